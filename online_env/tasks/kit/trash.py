"""The trash of the home folder, in the format of freedesktop.org that file managers share."""

from pathlib import PurePosixPath
from urllib.parse import quote, unquote

from ..machine import Machine

_FILES = ".local/share/Trash/files"
_INFO = ".local/share/Trash/info"
_DELETION_DATE = "2024-05-06T07:08:09"


def move_to_trash(machine: Machine, path: str, data: bytes) -> None:
    """Put a file into the trash that was at a path, relative to the home folder."""
    name = PurePosixPath(path).name
    info = f"[Trash Info]\nPath={quote(machine.path(path))}\nDeletionDate={_DELETION_DATE}\n"
    machine.write(f"{_INFO}/{name}.trashinfo", info)
    # What watches the trash reads it as soon as the file is there, and never again.
    machine.write(f"{_FILES}/{name}", data)


def trashed_files(machine: Machine) -> dict[str, bytes]:
    """Return the content of the trash by the former paths, relative to the home folder.

    A folder has no content, and is left out.
    """
    files: dict[str, bytes] = {}
    for name in machine.names(_INFO) or ():
        info = machine.text(f"{_INFO}/{name}") or ""
        data = machine.read(f"{_FILES}/{name.removesuffix('.trashinfo')}")
        if data is not None:
            files[_original_path(info).removeprefix(f"{machine.home}/")] = data
    return files


def take_out(machine: Machine, path: str) -> None:
    """Put a file of the trash back, whose name there is that of its path of old."""
    name = PurePosixPath(path).name
    machine.run("mv", f"{_FILES}/{name}", path)
    machine.run("rm", f"{_INFO}/{name}.trashinfo")


def _original_path(info: str) -> str:
    """Return the former path of a file in the trash, or "" if it is not recorded."""
    for line in info.splitlines():
        key, _, value = line.partition("=")
        if key == "Path":
            return unquote(value)
    return ""
