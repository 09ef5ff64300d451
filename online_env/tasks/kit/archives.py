"""Archives: made for a task, and read for its judgement."""

import io
import lzma
import tarfile
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import PurePosixPath

from hijack_data.rng import Stream

_DATE = (2024, 5, 6, 7, 8, 10)
_ENCRYPTED = 1  # bit 0 of a ZIP entry's flags
_HEADERS = {b"PK\x03\x04": 6, b"PK\x01\x02": 8}  # where the flags are, by the header's start
_DAMAGED = (
    zipfile.BadZipFile,
    tarfile.TarError,
    zlib.error,
    lzma.LZMAError,
    ValueError,  # places that cannot be, names that are no text
    RuntimeError,  # a password, or a way of compression that Python lacks
    OSError,
    EOFError,
)
_SIZES = {b"PK\x03\x04": 22, b"PK\x01\x02": 24}  # where the uncompressed size is


def make_zip(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive of files, by path, and of their folders, as `zip -r` makes it."""
    folders = {f"{parent}/" for path in files for parent in PurePosixPath(path).parents}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for folder in sorted(folders - {"./"}):
            entry = zipfile.ZipInfo(folder, _DATE)
            entry.external_attr = 0o40755 << 16
            archive.writestr(entry, b"")
        for path, data in files.items():
            entry = zipfile.ZipInfo(path, _DATE)
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, data)
    return buffer.getvalue()


def make_locked_zip(names: Mapping[str, int], stream: Stream) -> bytes:
    """Return a ZIP archive that asks for a password, and that no password opens.

    What should be encrypted is random: nobody can find out a password that there never was.

    Args:
        names: The sizes of its files, in bytes, by path.
        stream: The random draws.
    """
    header = 12  # bytes that traditional encryption puts before the data
    data = {
        name: bytes(stream.integer(0, 255) for _ in range(size + header))
        for name, size in names.items()
    }
    archive = bytearray(make_zip(data))
    for start in _HEADERS:
        position = archive.find(start)
        while position >= 0:
            archive[position + _HEADERS[start]] |= _ENCRYPTED
            at = position + _SIZES[start]
            size = int.from_bytes(archive[at : at + 4], "little") - header
            archive[at : at + 4] = size.to_bytes(4, "little")
            position = archive.find(start, position + 4)
    return bytes(archive)


def unpack(data: bytes | None) -> dict[str, bytes] | None:
    """Return the files of a ZIP or TAR archive by path, or `None` if it is none.

    Folders have no content, and are left out; a leading `./` as well.
    """
    if data is None:
        return None
    try:
        if _is_zip(data):
            return _from_zip(data)
        return _from_tar(data)
    except _DAMAGED:
        return None


def _is_zip(data: bytes) -> bool:
    """Return whether an archive is a ZIP one, and not a TAR one that ends with a ZIP file."""
    stream = io.BytesIO(data)
    if not zipfile.is_zipfile(stream):
        return False
    return data.startswith(b"PK") or not tarfile.is_tarfile(io.BytesIO(data))


def _from_zip(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = [entry for entry in archive.infolist() if not entry.is_dir()]
        return {entry.filename.removeprefix("./"): archive.read(entry) for entry in files}


def _from_tar(data: bytes) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        for entry in archive:
            file = archive.extractfile(entry) if entry.isfile() else None
            if file is not None:
                files[entry.name.removeprefix("./")] = file.read()
    return files
