"""What an agent leaves damaged is a wrong result: judges say so, and never fail over it."""

import io
import random
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("openpyxl", reason=needs.ONLINE)
pytest.importorskip("docx", reason=needs.ONLINE)
pytest.importorskip("pptx", reason=needs.ONLINE)

from online_env.errors import DesktopError
from online_env.tasks import Task, get
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import chromium, recordings, vlc
from online_env.tasks.kit.archives import make_zip, unpack
from online_env.tasks.kit.office import dump
from online_env.tasks.machine import Machine

BOOK, TEXT, SLIDES = "sum_column", "style_heading", "add_slide"


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(FolderDesktop(tmp_path))


def parts(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def without(name: str) -> Callable[[bytes], bytes]:
    """Return what takes a part out of an office file."""
    return lambda data: make_zip({key: part for key, part in parts(data).items() if key != name})


def with_part(name: str, old: bytes, new: bytes) -> Callable[[bytes], bytes]:
    """Return what changes a part of an office file."""

    def change(data: bytes) -> bytes:
        result = parts(data)
        assert old in result[name]
        return make_zip({**result, name: result[name].replace(old, new, 1)})

    return change


def overwritten(data: bytes) -> bytes:
    """Return an office file with other bytes in the middle of each compressed part."""
    damaged = bytearray(data)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for entry in archive.infolist():
            start = entry.header_offset + 30 + len(entry.filename) + entry.compress_size // 2
            if entry.compress_size > 60:
                damaged[start : start + 20] = b"\xff" * 20
    return bytes(damaged)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        (BOOK, overwritten),
        (TEXT, overwritten),
        (SLIDES, overwritten),
        (BOOK, without("xl/styles.xml")),
        (BOOK, with_part("xl/worksheets/sheet1.xml", b"<sheetView ", b"<sheetView wrong='1' ")),
        (TEXT, without("word/styles.xml")),
        (SLIDES, with_part("ppt/_rels/presentation.xml.rels", b' Id="rId1"', b"")),
        (
            BOOK,
            lambda data: dump(get(TEXT).initial_document()),
        ),  # another kind of document, saved over it
        (TEXT, lambda data: dump(get(SLIDES).initial_document())),
        (SLIDES, lambda data: dump(get(BOOK).initial_document())),
    ],
)
def test_a_damaged_document_is_a_wrong_result(
    machine: Machine, name: str, damage: Callable[[bytes], bytes]
) -> None:
    task: Task = get(name)
    task.prepare(machine)
    machine.remember()
    path = task.values.path
    machine.write(path, damage(machine.read(path) or b""))
    verdict = task.validate(machine)
    assert verdict.score == 0
    assert verdict.reason.startswith(f"{path} is gone, or in another format than its name says")


def packed(mode: str, files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as archive:  # type: ignore[call-overload]
        for name, data in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
    return buffer.getvalue()


NOISE = {str(n): random.Random(n).randbytes(20_000) for n in range(6)}


@pytest.mark.parametrize("kind", ["gz", "bz2", "xz"])
def test_an_archive_with_other_bytes_in_its_middle_is_none(kind: str) -> None:
    whole_bytes = packed(f"w:{kind}", NOISE)
    assert unpack(whole_bytes) == NOISE
    middle = len(whole_bytes) // 2
    assert unpack(whole_bytes[:middle] + b"\xff" * 40 + whole_bytes[middle + 40 :]) is None
    assert unpack(whole_bytes[:middle]) is None


@pytest.mark.parametrize(
    "method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
)
def test_a_zip_file_with_other_bytes_in_its_middle_is_none(method: int) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr("a.txt", NOISE["0"])
    data = buffer.getvalue()
    assert unpack(data) == {"a.txt": NOISE["0"]}
    middle = len(data) // 2
    assert unpack(data[:middle] + b"\xff" * 40 + data[middle + 40 :]) is None


def test_a_tar_file_whose_last_file_is_a_zip_file_is_not_taken_for_that() -> None:
    files = {"notes.txt": b"one", "inner.zip": make_zip({"inside.txt": b"two"})}
    assert unpack(packed("w:", files)) == files


def test_a_link_in_an_archive_is_no_file() -> None:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        link = tarfile.TarInfo("b.txt")
        link.type, link.linkname = tarfile.SYMTYPE, "a.txt"
        archive.addfile(link)
        folder = tarfile.TarInfo("folder")
        folder.type = tarfile.DIRTYPE
        archive.addfile(folder)
    assert unpack(buffer.getvalue()) == {}


RATE, CHUNK = slice(24, 28), slice(16, 20)  # bytes of a WAV file's header


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (RATE, 0),
        (CHUNK, 2**32 - 1),
        (slice(22, 24), 0),  # channels
        (slice(34, 36), 24),  # bits a sample
        (slice(20, 22), 3),  # fractions instead of whole numbers
    ],
)
def test_a_sound_with_an_impossible_header_is_none(
    machine: Machine, field: slice, value: int
) -> None:
    data = bytearray(recordings.wav_file([220.0]))
    data[field] = value.to_bytes(field.stop - field.start, "little")
    machine.write("a.wav", bytes(data))
    assert recordings.sound(machine, "a.wav") is None


def test_silence_and_the_octave_are_no_melody(machine: Machine) -> None:
    tune = [220.0, 330.0]
    machine.write("a.wav", recordings.wav_file([440.0, 330.0]))
    octave = recordings.sound(machine, "a.wav")
    assert octave is not None
    assert list(recordings.melody_problems(octave, tune)) == ["note 1 has 440 Hz, not 220 Hz"]
    silence = recordings.Sound(1, octave.rate, octave.samples * 0)
    assert list(recordings.melody_problems(silence, tune)) == ["note 1 has 0 Hz, not 220 Hz"]


@pytest.mark.parametrize(
    ("cents", "is_same"),
    [(-30, True), (30, True), (-100, False), (100, False)],  # a hundred are a semitone
)
def test_a_note_may_be_a_little_off(machine: Machine, cents: int, is_same: bool) -> None:
    machine.write("a.wav", recordings.wav_file([220 * 2 ** (cents / 1200)]))
    messages = recordings.sound(machine, "a.wav")
    assert messages is not None
    assert (list(recordings.melody_problems(messages, [220.0])) == []) == is_same


def test_what_is_no_address_in_a_playlist_is_a_name(machine: Machine) -> None:
    machine.write("Music/a.m3u", "http://[live\n//[x\nIntro: slow.wav\n../Videos/b.avi\n")
    home = machine.home
    assert vlc.playlist(machine, "Music/a.m3u") == [
        "http://[live",
        "//[x",
        f"{home}/Music/Intro: slow.wav",
        f"{home}/Videos/b.avi",
    ]
    location = "<location>http://[live</location>"
    xspf = f'<playlist xmlns="http://xspf.org/ns/0/"><track>{location}</track></playlist>'
    machine.write("Music/a.xspf", xspf)
    assert vlc.playlist(machine, "Music/a.xspf") == ["http://[live"]


@pytest.mark.parametrize("stored", ["[]", "null", '"text"', "12"])
def test_a_profile_that_holds_no_object_is_an_error_with_its_path(
    machine: Machine, stored: str
) -> None:
    machine.write(chromium.BOOKMARKS, stored)
    machine.write(chromium.PREFERENCES, stored)
    with pytest.raises(DesktopError, match=rf"^{chromium.BOOKMARKS} holds \w+ and no object$"):
        chromium.bookmarks(machine)
    with pytest.raises(DesktopError, match=rf"^{chromium.PREFERENCES} holds \w+ and no object$"):
        chromium.setting(machine, "a.b")
