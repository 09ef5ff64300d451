"""Files that tasks put in place, and whether they were moved and copied as asked."""

import io
import time
from collections.abc import Iterable, Iterator
from pathlib import PurePosixPath
from typing import TypeAlias
from zlib import crc32

from ..machine import Machine

Pairs: TypeAlias = Iterable[tuple[str, str]]
_PICTURES = {".png": "PNG", ".jpg": "JPEG", ".pdf": "PDF"}
_DATE = time.gmtime(1_700_000_000)  # Pillow dates a PDF


def sample_file(name: str, text: str = "") -> bytes:
    """Return the content of a file whose kind its suffix tells: a picture, a PDF or text.

    Args:
        name: The file's name.
        text: What it says; by default, its first name. A picture only gets a colour from it.
    """
    said = text or f"This file was first called {name}."
    kind = _PICTURES.get(PurePosixPath(name).suffix.lower())
    return f"{said}\n".encode() if kind is None else _picture(kind, said)


def _picture(kind: str, text: str) -> bytes:
    from PIL import Image, ImageDraw

    red, green, blue, _ = crc32(text.encode()).to_bytes(4, "little")
    picture = Image.new("RGB", (480, 320), (red, green, blue))
    readable = text.encode("ascii", "replace").decode()  # what Pillow's own font has
    ImageDraw.Draw(picture).text((20, 150), readable, "white")
    buffer = io.BytesIO()
    dates = {"creationDate": _DATE, "modDate": _DATE} if kind == "PDF" else {}
    picture.save(buffer, kind, **dates)
    return buffer.getvalue()


def rearranged(
    machine: Machine, moved: Pairs = (), copied: Pairs = (), folders: Iterable[str] = ()
) -> Iterator[str]:
    """Yield what is wrong if files should have been moved and copied, and nothing else done.

    Modes of what was moved, copied or made do not matter.

    Args:
        machine: The machine; all paths are relative to the home folder.
        moved: Old and new paths of files.
        copied: Paths of files, and of their copies.
        folders: Folders that should be there.
    """
    moves = list(moved)
    copies = list(copied)
    wanted = list(folders)
    sources = [old for old, _ in moves]
    targets = [new for _, new in (*moves, *copies)]
    yield from machine.unexpected_changes(*sources, *targets, *wanted)
    was = machine.before.files
    now = machine.snapshot().files
    for old, new in (*moves, *copies):
        if new not in now:
            yield f"there is no {new}"
        elif content(now[new]) != content(was.get(old, "")):
            yield f"{new} is not the file that was {old}"
    for old in sources:
        if old in now and old not in targets:
            yield f"{old} is still there"
    for name in wanted:
        if not now.get(name, "").startswith("d"):
            yield f"there is no folder {name}"


def move_files(machine: Machine, pairs: Pairs, command: str = "mv") -> None:
    """Move files, or copy them with `cp`, behind the screen; the folders are made.

    Args:
        machine: The machine.
        pairs: Old and new paths.
        command: The command for two paths.
    """
    for old, new in pairs:
        machine.run("mkdir", "-p", str(PurePosixPath(new).parent))
        machine.run(command, old, new)


def below(machine: Machine, folder: str) -> list[str]:
    """Return the paths of the files that were below a folder at first, relative to it."""
    start = f"{folder}/"
    found: list[str] = []
    for path, look in machine.before.files.items():
        if path.startswith(start) and look.startswith("f"):
            found.append(path.removeprefix(start))
    return found


def content(look: str) -> tuple[str, str]:
    """Return kind and digest of a file of a snapshot."""
    kind, _, rest = look.partition(" ")
    return kind, rest.partition(" ")[2]


def mode(look: str) -> int:
    """Return the mode of a file of a snapshot."""
    return int(look.split(" ")[1], 8)
