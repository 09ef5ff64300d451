"""An image as one file: a tar, compressed with Zstandard.

Manifest and list of files come first, so that a file that does not fit here is refused at once, and
each file is compared with the list while it is unpacked. Owners are not in it.
"""

import hashlib
import io
import os
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from hijack_data.file_io import replace_atomic, unwritable, write_atomic

from ...errors import DesktopImageError
from . import file_entries, manifest
from .file_entries import Entry
from .manifest import Manifest

LEVEL = 6
SUFFIX = ".tar.zst"
# Nobody's manifest is larger; a damaged file must not fill the memory.
_MOST = {manifest.NAME: 16 << 20, manifest.FILES: 256 << 20}
_BLOCK = 1 << 20
_REMEDY = "fetch or export it again"


def write(folder: Path, path: Path) -> None:
    """Pack the image in `folder` into the file `path`, whole or not at all.

    Raises:
        DesktopImageError: A file of the image is not as its manifest says.
        StorageError: The disk is full.
        MissingDependencyError: The package `zstandard` is missing.
    """
    zstandard = _zstandard()
    entries = file_entries.parse((folder / manifest.FILES).read_text(encoding="utf-8"), str(folder))
    compressor = zstandard.ZstdCompressor(level=LEVEL, threads=os.cpu_count() or 1)

    def pack(temporary: Path) -> None:
        with (
            open(temporary, "wb") as raw,
            compressor.stream_writer(raw) as stream,
            tarfile.open(fileobj=stream, mode="w|", format=tarfile.PAX_FORMAT) as tar,
        ):
            for name in (manifest.NAME, manifest.FILES):
                _add_bytes(tar, name, (folder / name).read_bytes())
            for entry in entries:
                _add(tar, folder, entry)

    replace_atomic(path, pack)


def _add_bytes(tar: tarfile.TarFile, name: str, data: bytes) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(data)
    info.mode = 0o644
    tar.addfile(info, io.BytesIO(data))


def _add(tar: tarfile.TarFile, folder: Path, entry: Entry) -> None:
    info = tarfile.TarInfo(entry.path)
    info.mode = entry.mode
    info.mtime = entry.time or file_entries.EPOCH
    if entry.kind == "link":
        info.type = tarfile.SYMTYPE
        info.linkname = entry.content
        tar.addfile(info)
        return
    if entry.kind == "folder":
        info.type = tarfile.DIRTYPE
        tar.addfile(info)
        return
    data = (folder / entry.path).read_bytes()
    if hashlib.sha256(data).hexdigest() != entry.content:
        raise DesktopImageError(
            f"{folder / entry.path}: is not as the image's manifest says; build or import it again"
        )
    info.size = len(data)
    tar.addfile(info, io.BytesIO(data))


@contextmanager
def _open_tar(path: Path) -> Iterator[tarfile.TarFile]:
    """Yield the tar in a file; what is wrong with it becomes an error that names it.

    Raises:
        DesktopImageError: The file is cut off or damaged.
    """
    zstandard = _zstandard()
    try:
        with open(path, "rb") as raw:
            stream = zstandard.ZstdDecompressor().stream_reader(raw)
            with tarfile.open(fileobj=stream, mode="r|") as tar:
                yield tar
    except (zstandard.ZstdError, tarfile.TarError, EOFError) as error:
        raise DesktopImageError(f"{path}: is cut off or damaged ({error}); {_REMEDY}") from None


def read_manifest(path: Path) -> Manifest:
    """Return the manifest of an image in a file.

    Raises:
        DesktopImageError: The file is missing, or holds no image.
    """
    try:
        with _open_tar(path) as tar:
            return manifest.parse(_head(tar, path, manifest.NAME), f"{path}:{manifest.NAME}")
    except OSError as error:
        raise DesktopImageError(f"{path}: cannot be read ({error.strerror or error})") from None


def _head(tar: tarfile.TarFile, path: Path, name: str) -> bytes:
    info = tar.next()
    if info is None or info.name != name or not 0 <= info.size <= _MOST[name]:
        raise DesktopImageError(f"{path}: is no image of a desktop: its {name} is missing")
    return _content(tar, info).read()


def _content(tar: tarfile.TarFile, info: tarfile.TarInfo) -> IO[bytes]:
    content = tar.extractfile(info)
    if content is None:
        raise tarfile.ReadError(f"{info.name} is not a file")
    return content


def unpack(path: Path, folder: Path) -> Manifest:
    """Unpack the image in the file `path` into `folder`, which is empty.

    Raises:
        DesktopImageError: A file is cut off, or not as the manifest says.
        StorageError: The disk is full.
    """
    with _open_tar(path) as tar:
        text = _head(tar, path, manifest.NAME)
        image = manifest.parse(text, f"{path}:{manifest.NAME}")
        listed = _head(tar, path, manifest.FILES)
        if hashlib.sha256(listed).hexdigest() != image.files_sha256:
            raise DesktopImageError(f"{path}:{manifest.FILES}: is not the one of the manifest")
        write_atomic(folder / manifest.NAME, text)
        write_atomic(folder / manifest.FILES, listed)
        entries = file_entries.parse(listed.decode(), f"{path}:{manifest.FILES}")
        folders = {""}
        for entry in entries:
            _extract(tar, path, folder, entry, folders)
            if entry.kind == "folder":
                folders.add(entry.path)
        if tar.next() is not None:
            raise DesktopImageError(f"{path}: holds more than its manifest says; {_REMEDY}")
    _set_folders(folder, entries)
    return image


def _extract(
    tar: tarfile.TarFile, path: Path, folder: Path, entry: Entry, folders: set[str]
) -> None:
    """Write the next file, which must be `entry`, below a folder that was made before.

    So no link can lead out of `folder`.

    Raises:
        DesktopImageError: The tar has another entry, or is cut off.
        HijackError: The entry cannot be written.
    """
    info = tar.next()
    if info is None:
        raise DesktopImageError(f"{path}: is cut off before {entry.path}; {_REMEDY}")
    if info.name != entry.path or entry.path.rpartition("/")[0] not in folders:
        raise DesktopImageError(f"{path}: has {info.name!r} in the place of {entry.path!r}")
    target = folder / entry.path
    try:
        if entry.kind == "folder":
            target.mkdir()
        elif entry.kind == "link":
            target.symlink_to(entry.content)
        else:
            _write(_content(tar, info), target, entry, path)
    except OSError as error:
        problem = unwritable(target, error)
        raise problem from None


def _write(content: IO[bytes], target: Path, entry: Entry, path: Path) -> None:
    hasher = hashlib.sha256()
    with open(target, "xb") as out:
        while block := content.read(_BLOCK):
            hasher.update(block)
            out.write(block)
    if hasher.hexdigest() != entry.content:
        raise DesktopImageError(f"{path}: {entry.path} is not as its manifest says; {_REMEDY}")
    target.chmod(entry.mode)
    os.utime(target, (entry.time, entry.time))


def _set_folders(folder: Path, entries: list[Entry]) -> None:
    """Give the folders their permissions and times, when nothing is written into them any more."""
    for entry in reversed(entries):
        if entry.kind == "folder":
            (folder / entry.path).chmod(entry.mode)
            os.utime(folder / entry.path, (file_entries.EPOCH, file_entries.EPOCH))


def _zstandard() -> Any:
    from ... import extra

    extra.require("an image as a file", ("zstandard",))
    import zstandard

    return zstandard
