"""Our reader of PNG files gives Pillow's pixels, or leaves the file to Pillow."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from isal import isal_zlib
from PIL import ExifTags, Image

from hijack_data.errors import ImageError
from hijack_data.kernels.cpu import jit
from hijack_data.picture_io import decode_image
from pipelines.dataset import png_decoder
from pipelines.dataset.image_codec import decode, encode


@pytest.fixture(autouse=True)
def compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit._state, "forgone", jit.NUMBA_LOADING_MS)


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_file(
    width: int,
    height: int,
    raw: bytes,
    colour: int = 2,
    extra: bytes = b"",
    depth: int = 8,
    lace: int = 0,
) -> bytes:
    header = struct.pack(">II5B", width, height, depth, colour, 0, 0, lace)
    packed = zlib.compress(raw)
    parts = (packed[:5], packed[5:])
    body = b"".join(chunk(b"IDAT", part) for part in parts)
    return png_decoder.SIGNATURE + chunk(b"IHDR", header) + extra + body + chunk(b"IEND", b"")


def filtered(width: int, height: int, channels: int, seed: int, kinds: list[int]) -> bytes:
    """Random bytes behind chosen filters: whatever they are, they are some picture."""
    raw = np.random.default_rng(seed).integers(
        0, 256, (height, 1 + channels * width), dtype=np.uint8
    )
    raw[:, 0] = [kinds[y % len(kinds)] for y in range(height)]
    return raw.tobytes()


def pillow(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


@settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)  # the first example waits for the compiler
@given(
    st.integers(1, 12),
    st.integers(1, 9),
    st.sampled_from([2, 6]),
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(0, 4), min_size=1, max_size=5),
)
def test_every_filter_is_undone_as_pillow_does(
    width: int, height: int, colour: int, seed: int, kinds: list[int]
) -> None:
    pytest.importorskip("numba")
    data = png_file(
        width, height, filtered(width, height, png_decoder.CHANNELS[colour], seed, kinds), colour
    )
    png = png_decoder.decode_png(data, isal_zlib)
    assert png is not None
    assert np.array_equal(png, pillow(data))
    assert png.flags.writeable


def test_the_kernel_is_the_function_that_was_compiled() -> None:
    raw = np.frombuffer(filtered(5, 6, 4, 1, [4, 3, 2, 1, 0]), np.uint8).reshape(6, 21)
    out = np.empty((6, 5, 3), np.uint8)
    with np.errstate(over="ignore"):
        png_decoder._unfilter(raw, out)
    assert np.array_equal(out, pillow(png_file(5, 6, raw.tobytes(), 6)))


def test_the_first_pictures_are_left_to_pillow_until_numba_has_paid_for_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("numba")
    data = png_file(30, 20, filtered(30, 20, 3, 0, [4, 1]))
    monkeypatch.setattr(
        jit._state, "forgone", jit.NUMBA_LOADING_MS - 2.5 * png_decoder.SAVED_MS_PER_PIXEL * 30 * 20
    )
    values = [png_decoder.decode_png(data, isal_zlib) is not None for _ in range(5)]
    assert values == [False, False, False, True, True]
    assert np.array_equal(decode(data, "x"), pillow(data))


def test_what_needs_no_compiled_reader_waits_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit._state, "forgone", 0.0)
    data = png_file(30, 20, filtered(30, 20, 3, 0, [2]))
    png = png_decoder.decode_png(data, isal_zlib)
    assert png is not None
    assert np.array_equal(png, pillow(data))


def test_real_screenshots(shared_data: Path) -> None:
    read = 0
    for file in sorted((shared_data / "screenshots").glob("*.png"))[::7]:
        data = file.read_bytes()
        png = png_decoder.decode_png(data, isal_zlib)
        assert np.array_equal(decode(data, "x"), decode_image(data, "x")[0]), file.name
        read += png is not None
    assert read >= 8


GOOD = png_file(3, 2, filtered(3, 2, 3, 0, [4, 1]))


@pytest.mark.parametrize(
    "data",
    [
        png_file(3, 2, filtered(3, 2, 3, 0, [5])),  # no such filter
        png_file(3, 2, filtered(3, 2, 3, 0, [2])[:-1]),
        png_file(3, 2, filtered(3, 2, 3, 0, [2]) + b"more"),
        png_file(3, 2, filtered(3, 2, 1, 0, [2]), colour=0),
        png_file(3, 2, filtered(3, 2, 3, 0, [2]), lace=1),
        png_file(3, 2, filtered(3, 2, 6, 0, [2]), depth=16),
        png_file(3, 2, filtered(3, 2, 3, 0, [2]), extra=chunk(b"acTL", struct.pack(">II", 2, 0))),
        png_file(0, 2, b""),
        png_file(2**31 - 1, 2**31 - 1, b""),
        b"",
        b"rubbish",
        png_decoder.SIGNATURE,
        *(GOOD[:end] for end in (20, 40, 60, len(GOOD) - 12, len(GOOD) - 1)),
    ],
)
def test_what_is_not_for_this_reader(data: bytes) -> None:
    assert png_decoder.decode_png(data, isal_zlib) is None


@given(st.integers(0, len(GOOD) - 1), st.integers(1, 255))
def test_a_changed_byte_never_gives_another_picture(at: int, change: int) -> None:
    damaged = bytearray(GOOD)
    damaged[at] ^= change
    png = png_decoder.decode_png(bytes(damaged), isal_zlib)
    assert png is None or np.array_equal(png, pillow(GOOD))


def orientation_chunks() -> dict[str, bytes]:
    """Every way in which a PNG file says that it is to be turned by a quarter."""
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    data = exif.tobytes()
    raw = f"\nexif\n{len(data):8}\n{data.hex()}\n".encode()
    xmp = b'<x xmlns:tiff="t" tiff:Orientation="6"/>'
    return {
        "eXIf": chunk(b"eXIf", data.removeprefix(b"Exif\0\0")),
        "zTXt": chunk(b"zTXt", b"Raw profile type exif\0\0" + zlib.compress(raw)),
        "tEXt": chunk(b"tEXt", b"Raw profile type exif\0" + raw),
        "iTXt": chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + xmp),
    }


@pytest.mark.parametrize("name", list(orientation_chunks()))
def test_a_picture_that_is_to_be_turned_is_left_to_pillow_and_refused(name: str) -> None:
    data = png_file(3, 2, filtered(3, 2, 3, 0, [2]), extra=orientation_chunks()[name])
    assert png_decoder.decode_png(data, isal_zlib) is None
    with pytest.raises(ImageError, match="its EXIF orientation 6 turns it"):
        decode(data, "x")


def test_other_texts_are_passed_over() -> None:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 1
    texts = (
        chunk(b"tEXt", b"Software\0gnome-screenshot"),
        chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0<x>Screenshot</x>"),
        chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0")),
    )
    for extra in (*texts, b"".join(texts)):
        data = png_file(3, 2, filtered(3, 2, 3, 0, [2]), extra=extra)
        assert np.array_equal(png_decoder.decode_png(data, isal_zlib), pillow(data))
        assert np.array_equal(decode(data, "x"), pillow(data))


@pytest.mark.parametrize(
    "exif", [b"", b"MM", b"MM\0*\xff\xff\xff\xff", b"II*\0\x08\0\0\0\x09\0", b"nothing"]
)
def test_exif_that_is_damaged_is_what_it_is_to_pillow(exif: bytes) -> None:
    data = png_file(3, 2, filtered(3, 2, 3, 0, [2]), extra=chunk(b"eXIf", exif))
    try:
        expected = decode_image(data, "x")[0]
    except ImageError:
        with pytest.raises(ImageError):
            decode(data, "x")
        return
    assert np.array_equal(decode(data, "x"), expected)


def test_a_wrong_sum_of_the_pixels_is_found() -> None:
    raw = filtered(3, 2, 3, 0, [2])
    packed = bytearray(zlib.compress(raw))
    packed[-1] ^= 1
    header = struct.pack(">II5B", 3, 2, 8, 2, 0, 0, 0)
    data = (
        png_decoder.SIGNATURE
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", bytes(packed))
        + chunk(b"IEND", b"")
    )
    assert png_decoder.decode_png(data, isal_zlib) is None


def test_without_numba_pillow_reads_what_our_own_writer_did_not_make(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jit, "available", lambda: False)
    assert png_decoder.decode_png(GOOD, isal_zlib) is None
    assert np.array_equal(decode(GOOD, "x"), pillow(GOOD))
    ours = encode(pillow(GOOD))
    assert np.array_equal(png_decoder.decode_png(ours, isal_zlib), pillow(GOOD))  # type: ignore[arg-type]
    with pytest.raises(ImageError, match="x: damaged or cut off"):
        decode(GOOD[:50], "x")
