"""Pictures that are broken get one clear line; files are written whole or not at all."""

import io
import os
import stat
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

import hijack_data as hj
from hijack_data.errors import AssetError, HijackError, ImageError, ParameterTypeError
from hijack_data.file_io import (
    check_versioned,
    read_regular,
    read_versioned_json,
    replace_atomic,
    write_atomic,
)
from hijack_data.picture_io import decode_image, encode_png, load_image
from pipelines.dataset.image_codec import decode


def png16(path):
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", 2, 2, 16, 2, 0, 0, 0)
    rows = zlib.compress((b"\x00" + bytes(12)) * 2)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def test_modes_are_converted_and_said(tmp_path):
    for mode in ("RGBA", "L", "P", "CMYK", "LA", "1"):
        path = tmp_path / f"{mode}.{'tiff' if mode == 'CMYK' else 'png'}"
        Image.new(mode, (4, 3)).save(path)
        image, notes = load_image(path)
        assert image.shape == (3, 4, 3)
        assert image.dtype == np.uint8
        assert f"{mode} was converted to RGB" in notes[0]
    Image.new("RGB", (4, 3)).save(tmp_path / "rgb.png")
    assert load_image(tmp_path / "rgb.png")[1] == ()


def test_broken_pictures(tmp_path, noise):
    (tmp_path / "empty.png").write_bytes(b"")
    whole_bytes = encode_png(noise)
    (tmp_path / "cut.png").write_bytes(whole_bytes[: len(whole_bytes) // 2])
    (tmp_path / "text.png").write_text("not a picture")
    (tmp_path / "flipped.png").write_bytes(
        whole_bytes[:300] + bytes([whole_bytes[300] ^ 255]) + whole_bytes[301:]
    )
    png16(tmp_path / "deep.png")
    Image.new("I;16", (4, 4)).save(tmp_path / "grey16.png")
    frames = [Image.new("RGB", (5, 5), c) for c in ("red", "blue")]
    frames[0].save(tmp_path / "moving.png", save_all=True, append_images=frames[1:])
    frames[0].save(tmp_path / "moving.gif", save_all=True, append_images=frames[1:])
    expected = {
        "empty.png": "0 bytes",
        "cut.png": "cut off",
        "text.png": "not a PNG/",
        "flipped.png": "damaged",
        "deep.png": "16 bits a channel",
        "grey16.png": "16 bits a channel",
        "moving.png": "animated, 2 frames",
        "moving.gif": "animated, 2 frames",
        "missing.png": "No such file",
        ".": "cannot be read",
    }
    for name, message in expected.items():
        with pytest.raises(ImageError, match=message) as caught:
            load_image(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_smallest_and_largest(tmp_path):
    Image.new("RGB", (1, 1)).save(tmp_path / "one.png")
    assert load_image(tmp_path / "one.png")[0].shape == (1, 1, 3)
    Image.new("L", (10000, 10000)).save(tmp_path / "large.png")
    assert load_image(tmp_path / "large.png")[0].shape == (10000, 10000, 3)
    Image.new("1", (20000, 20000)).save(tmp_path / "huge.png")
    with pytest.raises(ImageError, match="more than 268435456 pixels"):
        load_image(tmp_path / "huge.png")


ORIENTATIONS = range(1, 9)
FORMATS = ["JPEG", "PNG", "WEBP", "TIFF"]


def turned_file(kind: str, orientation: object) -> tuple[bytes, np.ndarray]:
    """A picture file with an EXIF orientation, and its pixels as they are stored."""
    stored = np.zeros((40, 24, 3), np.uint8)
    stored[:20, :12] = 255
    stored[:20, 12:, 1] = 200
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    options = {"JPEG": {"quality": 100, "subsampling": 0}, "WEBP": {"lossless": True}}
    buffer = io.BytesIO()
    Image.fromarray(stored).save(buffer, kind, exif=exif, **options.get(kind, {}))
    return buffer.getvalue(), stored


def turned(stored: np.ndarray, orientation: int) -> np.ndarray:
    """The pixels as EXIF says that they are to be shown: the meaning of its eight values."""
    turn = {
        1: stored,
        2: stored[:, ::-1],
        3: stored[::-1, ::-1],
        4: stored[::-1],
        5: stored.swapaxes(0, 1),
        6: stored[::-1].swapaxes(0, 1),
        7: stored[::-1, ::-1].swapaxes(0, 1),
        8: stored.swapaxes(0, 1)[::-1],
    }
    return turn[orientation]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_a_picture_that_exif_turns_is_loaded_as_it_is_shown(tmp_path, kind, orientation):
    data, stored = turned_file(kind, orientation)
    path = tmp_path / f"turned.{kind.lower()}"
    path.write_bytes(data)
    image, notes = load_image(path)
    expected = turned(stored, orientation)
    assert image.shape == expected.shape
    assert np.abs(image.astype(int) - expected).max() <= (6 if kind == "JPEG" else 0)
    assert any(f"turned upright (EXIF orientation {orientation})" in note for note in notes) == (
        orientation > 1
    )


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("decode", [decode_image, lambda data, name: (decode(data, name), ())])
def test_a_recorded_picture_that_exif_turns_is_refused(kind, orientation, decode):
    """Nothing says whether the coordinates beside it are of the picture as stored or as shown."""
    data, stored = turned_file(kind, orientation)
    if orientation == 1:
        assert decode(data, "step 3")[0].shape == stored.shape
        return
    with pytest.raises(ImageError, match=rf"step 3: its EXIF orientation {orientation} turns it"):
        decode(data, "step 3")


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_a_picture_of_pillow_that_exif_turns_is_refused(kind, orientation):
    """The result would not carry the note, so what shows it would turn it no more."""
    data, stored = turned_file(kind, orientation)
    image = Image.open(io.BytesIO(data))
    plan = hj.Marks(number=1, mark_size=5).plan(hj.Scene(stored.shape[:2]), seed=1)
    if orientation == 1:
        assert hj.apply(plan, image).size == image.size
        return
    with pytest.raises(ImageError, match=rf"EXIF orientation {orientation}.*exif_transpose"):
        hj.apply(plan, image)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("orientation", [0, 9, 400])
def test_an_orientation_that_does_not_exist_turns_nothing(kind, orientation):
    data, stored = turned_file(kind, orientation)
    assert decode_image(data, "x")[0].shape == stored.shape


@pytest.mark.parametrize("kind", [*FORMATS, "BMP", "GIF"])
def test_damaged_files_are_ours_to_refuse(kind):
    """Bytes changed anywhere: pixels come out, or one of our errors."""
    buffer = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)).save(
        buffer, kind
    )
    whole_bytes, rng = buffer.getvalue(), np.random.default_rng(1)
    names = set()
    for _ in range(400):
        data = bytearray(whole_bytes)
        for _ in range(rng.integers(1, 5)):
            data[rng.integers(0, min(len(data), 300))] = rng.integers(0, 256)
        cut = len(data) if rng.random() < 0.7 else int(rng.integers(0, len(data)))
        try:
            names.add(decode_image(bytes(data[:cut]), "x", upright=True)[0].shape[2:])
        except ImageError:
            names.add(None)
    assert None in names


@pytest.mark.parametrize("path", ["a\0b.png", "a\ud800.png", "x" * 5000])
def test_a_path_that_is_none(path):
    with pytest.raises(ImageError):
        load_image(path)


@pytest.mark.parametrize("path", [None, 5, b"x.png", ["x.png"]])
def test_a_path_of_the_wrong_type(path):
    with pytest.raises(ParameterTypeError, match="a picture is named by its path"):
        load_image(path)


def test_png_round_trip(tmp_path, noise):
    write_atomic(tmp_path / "a.png", encode_png(noise))
    assert np.array_equal(load_image(tmp_path / "a.png")[0], noise)


def test_a_failed_write_leaves_nothing(tmp_path):
    target = tmp_path / "kept.txt"
    write_atomic(target, "first")

    def fail(temporary):
        temporary.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(
        HijackError, match=r"kept.txt: cannot be written \(No space left on device\)"
    ):
        replace_atomic(target, fail)
    assert target.read_text() == "first"
    assert [p.name for p in tmp_path.iterdir()] == ["kept.txt"]
    with pytest.raises(HijackError, match="cannot be written"):
        write_atomic(tmp_path / "no" / "such.txt", "x")


def test_permissions_follow_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        write_atomic(tmp_path / "a", "x")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640


def test_the_umask_of_the_process_is_never_changed(tmp_path, monkeypatch):
    def refuse(mask):
        raise AssertionError(f"os.umask({mask:o})")

    monkeypatch.setattr(os, "umask", refuse)
    write_atomic(tmp_path / "a", "x")
    assert (tmp_path / "a").read_text() == "x"


@pytest.mark.parametrize("error", [ValueError("bad"), KeyboardInterrupt()])
def test_other_errors_of_a_writer_go_on_and_leave_nothing(tmp_path, error):
    def fail(temporary):
        temporary.write_text("half")
        raise error

    with pytest.raises(type(error)):
        replace_atomic(tmp_path / "a", fail)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a\0b", "a\ud800", "x" * 5000])
def test_a_name_that_no_file_can_have(tmp_path, name):
    with pytest.raises(HijackError, match="cannot be written"):
        write_atomic(tmp_path / name, "x")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [None, 5, ["a"]])
def test_a_target_of_the_wrong_type(path):
    with pytest.raises(ParameterTypeError, match="a file is named by its path"):
        write_atomic(path, "x")


def versioned(path):
    return read_versioned_json(
        path, format="f", version=2, description="the index of a pack", error=AssetError
    )


def test_a_versioned_file_is_read(tmp_path):
    path = tmp_path / "index.json"
    for version in (1, 2):
        write_atomic(path, f'{{"format": "f", "version": {version}, "more": [1]}}')
        assert versioned(path) == {"format": "f", "version": version, "more": [1]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"index.json: is not JSON"),
        ("[" * 100_000, r"index.json: is not JSON"),
        ("[]", r"index.json: not the index of a pack \(field 'format' must be 'f'\)"),
        ('{"format": "g", "version": 1}', r"field 'format' must be 'f'"),
        ('{"format": "f", "version": 3}', r"version 3 is newer than this library reads \(2\)"),
        ('{"format": "f"}', r"version None is not a version; it must be an integer, 1 to 2"),
        ('{"format": "f", "version": true}', r"version True is not a version"),
        ('{"format": "f", "version": 0}', r"version 0 is not a version"),
        ('{"format": "f", "version": "1"}', r"version '1' is not a version"),
    ],
)
def test_a_versioned_file_that_cannot_be_used(tmp_path, text, message):
    path = tmp_path / "index.json"
    path.write_text(text)
    with pytest.raises(AssetError, match=message):
        versioned(path)


def test_a_versioned_file_that_is_missing(tmp_path):
    with pytest.raises(AssetError, match="cannot be read"):
        versioned(tmp_path)
    with pytest.raises(AssetError, match=r"none.json: cannot be read \(No such file"):
        versioned(tmp_path / "none.json")
    with pytest.raises(HijackError, match=r"^record one first$"):
        read_versioned_json(
            tmp_path / "none", format="f", version=1, description="x", missing="record one first"
        )


def test_data_in_memory_are_checked_alike():
    data = {"format": "f", "version": 1}
    assert check_versioned(data, format="f", version=1, source="plan", description="a plan") is data
    with pytest.raises(HijackError, match=r"^plan: not a plan "):
        check_versioned(None, format="f", version=1, source="plan", description="a plan")


def test_what_is_written_is_on_the_disk_before_its_name_is(tmp_path, monkeypatch):
    items, fsync, replace = [], os.fsync, Path.replace

    def note_sync(handle):
        items.append(
            "folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else os.pread(handle, 9, 0).decode()
        )
        fsync(handle)

    def note_name(self, target):
        items.append("name")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(Path, "replace", note_name)
    write_atomic(tmp_path / "a", "content")
    assert items == ["content", "name", "folder"]


def test_a_folder_that_cannot_be_synced_is_no_error(tmp_path, monkeypatch):
    def refuse(handle):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "fsync", refuse)
    write_atomic(tmp_path / "a", "content")
    assert (tmp_path / "a").read_text() == "content"


# Devices


def test_a_pipe_is_written_to_and_never_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_atomic(pipe, "whole")
        assert os.read(reader, 100) == b"whole"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode), "as root, a rename would replace /dev/null"
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_name_of_an_open_file_is_not_replaced(tmp_path):
    with (tmp_path / "open").open("w") as file, pytest.raises(HijackError) as error:
        write_atomic(f"/proc/self/fd/{file.fileno()}", "x")
    assert "is another name for a file that is open; name the file" in str(error.value)
    assert (tmp_path / "open").read_bytes() == b""


def test_only_a_regular_file_of_somebody_else_is_read(tmp_path):
    write_atomic(tmp_path / "file", "content")
    (tmp_path / "link").symlink_to("file")
    assert read_regular(tmp_path / "link") == b"content"
    (tmp_path / "endless").symlink_to("/dev/null")  # as /dev/zero, which old code would read on
    os.mkfifo(tmp_path / "pipe")
    for name in ("endless", "pipe"):
        with pytest.raises(OSError, match="is not a regular file, and reading it might never end"):
            read_regular(tmp_path / name)
    with pytest.raises(IsADirectoryError):
        read_regular(tmp_path)
