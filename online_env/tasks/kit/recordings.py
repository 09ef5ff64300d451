"""Recordings that tasks put in place: melodies as WAV files, and silent films as AVI files."""

import io
import struct
import wave
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hijack_data.rng import Stream

from ..machine import Machine
from . import gimp

NOTE = 2.0  # seconds of one note
CD = (2, 44100)  # channels and samples a second of a CD
FILM_SIZE = (640, 360)
SCENE = 10  # seconds of one scene of a film
_RATE = 8000  # samples a second of a recording
_LOUDNESS = 6000
_NOTES = 8  # of a melody
_PITCHES = tuple(round(220 * 2 ** (step / 12), 1) for step in range(0, 25, 2))  # whole tones
_PITCH_SLACK = 0.03  # a quarter of a whole tone
_FRAMES_PER_SECOND = 5
_IS_KEY = 0x10  # a picture of an AVI file that can be shown without others
_HAS_INDEX = 0x10


@dataclass(frozen=True)
class Sound:
    """What a WAV file holds.

    Args:
        channels: How many.
        rate: Samples a second.
        samples: The first channel.
    """

    channels: int
    rate: int
    samples: NDArray[np.int16]


def melody(stream: Stream) -> list[float]:
    """Return the pitches of a melody, in Hz; a note never follows itself."""
    pitches: list[float] = []
    while len(pitches) < _NOTES:
        pitch = stream.choice(_PITCHES)
        if pitch not in pitches[-1:]:
            pitches.append(pitch)
    return pitches


def wav_file(pitches: Sequence[float], channels: int = 1, rate: int = _RATE) -> bytes:
    """Return a WAV file of a melody, 16 bits a sample.

    Args:
        pitches: Of its notes, in Hz.
        channels: How many; all of them are the same.
        rate: Samples a second.
    """
    times = np.arange(int(rate * NOTE)) / rate
    swell = np.minimum(1.0, np.minimum(times, NOTE - times) * 20)  # no clicks between notes
    notes = [np.sin(2 * np.pi * pitch * times) * swell * _LOUDNESS for pitch in pitches]
    samples = np.repeat(np.concatenate(notes).astype("<i2"), channels)
    buffer = io.BytesIO()
    with wave.open(buffer, "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(samples.tobytes())
    return buffer.getvalue()


def sound(machine: Machine, path: str) -> Sound | None:
    """Return what is in a WAV file of 16 bits a sample; `None` if there is no such file."""
    data = machine.read(path)
    if data is None:
        return None
    try:
        with wave.open(io.BytesIO(data)) as file:
            if file.getsampwidth() != 2 or not file.getframerate():
                return None
            frames = file.readframes(file.getnframes())
            length = (
                len(frames) - len(frames) % 2
            )  # a file that was cut off may end within a sample
            samples = np.frombuffer(frames[:length], "<i2")[:: file.getnchannels()]
            return Sound(file.getnchannels(), file.getframerate(), samples)
    except (wave.Error, EOFError, RuntimeError):  # the last for chunks with impossible lengths
        return None


def melody_problems(recording: Sound, pitches: Sequence[float]) -> Iterator[str]:
    """Yield how a sound differs from the melody of some pitches, in Hz."""
    length = len(recording.samples) / recording.rate
    if abs(length - NOTE * len(pitches)) > NOTE / 4:
        yield f"it is {length:.1f} s long, not {NOTE * len(pitches):g} s"
        return
    for index, pitch in enumerate(pitches):
        start = int((index + 0.25) * NOTE * recording.rate)
        heard_pitch = _pitch(
            recording.samples[start : start + int(NOTE / 2 * recording.rate)], recording.rate
        )
        if abs(heard_pitch / pitch - 1) > _PITCH_SLACK:
            yield f"note {index + 1} has {heard_pitch:.0f} Hz, not {pitch:g} Hz"
            return


def _pitch(samples: NDArray[np.int16], rate: int) -> float:
    """Return the loudest frequency, in Hz; 0 for silence."""
    strengths = np.abs(np.fft.rfft(samples.astype(np.float64)))
    return float(np.argmax(strengths) * rate / len(samples))


def scene(stream: Stream, title: str) -> Image.Image:
    """Return the picture of a scene, with its title on it."""
    picture = gimp.drawing(stream, *FILM_SIZE)
    pen = ImageDraw.Draw(picture)
    pen.rectangle((0, 0, FILM_SIZE[0], 64), fill="black")
    pen.text((20, 10), title, "white", ImageFont.load_default(36))
    return picture


def film(scenes: Sequence[Image.Image]) -> bytes:
    """Return an AVI file (motion JPEG, silent) that shows each picture for `SCENE` seconds."""
    jpegs = [gimp.encode(picture, "JPEG", 90) for picture in scenes]
    frames = [data for data in jpegs for _ in range(SCENE * _FRAMES_PER_SECOND)]
    chunks, index, offset = [], [], 4
    for data in frames:
        chunk = _chunk(b"00dc", data)
        chunks.append(chunk)
        index.append(struct.pack("<4s3I", b"00dc", _IS_KEY, offset, len(data)))
        offset += len(chunk)
    headers = _headers(len(frames), max(map(len, frames)))
    moving = _chunk(b"LIST", b"movi" + b"".join(chunks))
    body = headers + moving + _chunk(b"idx1", b"".join(index))
    return _chunk(b"RIFF", b"AVI " + body)


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a RIFF file; its length is even."""
    return kind + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def _headers(frames: int, largest: int) -> bytes:
    """Return the headers of an AVI file with one stream of pictures.

    The fields are those of AVIMAINHEADER, AVISTREAMHEADER and BITMAPINFOHEADER, in their order.
    """
    width, height = FILM_SIZE
    a_second = largest * _FRAMES_PER_SECOND
    main = (1_000_000 // _FRAMES_PER_SECOND, a_second, 0, _HAS_INDEX, frames, 0, 1, largest)
    stream = (0, 0, 0, 1, _FRAMES_PER_SECOND, 0, frames, largest, 0, 0)
    format_ = struct.pack(
        "<3i2H4s5I", 40, width, height, 1, 24, b"MJPG", width * height * 3, *[0] * 4
    )
    header = struct.pack("<4s4s10I4H", b"vids", b"MJPG", *stream, 0, 0, width, height)
    streams = b"strl" + _chunk(b"strh", header) + _chunk(b"strf", format_)
    main_header = _chunk(b"avih", struct.pack("<14I", *main, width, height, *[0] * 4))
    return _chunk(b"LIST", b"hdrl" + main_header + _chunk(b"LIST", streams))
