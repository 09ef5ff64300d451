"""Write the asset pack: lossless pictures, and `index.json` last.

A recording that breaks off leaves no valid pack.
"""

import io
import json
import re
from collections.abc import Container
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hijack_data.errors import HijackError
from hijack_data.file_io import write_atomic
from hijack_data.pack import FORMAT, INDEX, VERSION, picture_kinds
from hijack_data.picture_io import pixel_sha256
from hijack_data.types import Size, UInt8Array

from ..errors import DesktopError
from ..recording.captured_picture import Picture
from .desktop_looks import GOLDEN

LICENCE = (
    "Apache-2.0. Recorded by `hijack desktop record --assets` on AgentHijack's own desktop, with"
    " its own wallpaper, web sites and documents; themes, icons, fonts and what applications draw"
    " belong to their projects."
)


_NAMED = re.compile(r".+-[0-9]+x[0-9]+-[0-9]+\.webp", re.DOTALL)


class AssetPackWriter:
    """A pack that is being recorded; nothing of the folder changes before `finish`.

    Entries of the folder that are not recorded anew are kept.

    Args:
        folder: The pack's folder.
        kinds: The kinds that are recorded anew.
        screens: The screens on which they are, as (height, width).
        looks: The looks in which they are.

    Raises:
        HijackError: The folder cannot be written, or holds something that is no pack.
    """

    def __init__(
        self,
        folder: Path,
        kinds: Container[str],
        screens: Container[Size],
        looks: Container[str] = (GOLDEN,),
    ) -> None:
        def is_kept(entry: dict[str, Any]) -> bool:
            width, height = entry["screen"]
            if entry["kind"] not in kinds or (height, width) not in screens:
                return True
            return entry.get("look", GOLDEN) not in looks

        self.folder = folder
        self.entries = [entry for entry in _present(folder) if is_kept(entry)]
        self._data: dict[str, bytes] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"cannot write to {folder}: {error.strerror}"
            raise HijackError(f"{problem}; give another folder") from None

    def add(self, picture: Picture, screen: Size, look: str = GOLDEN) -> dict[str, Any] | None:
        """Add a picture.

        Args:
            picture: The picture.
            screen: (height, width) of the screen it was made on.
            look: The look of the desktop.

        Returns:
            Its entry, or `None` if the pack has the same pixels of that kind already.
        """
        digest = pixel_sha256(picture.pixels)
        for entry in self.entries:
            if entry["sha256"] == digest and entry["kind"] == picture.kind:
                return None
        name = self._name(picture)
        self._data[f"{name}.webp"] = _encoded(picture.pixels, name)
        height, width = screen
        entry = {
            "id": name,
            "file": f"{name}.webp",
            **picture.entry(),
            "screen": [width, height],
            "sha256": digest,
        }
        if look != GOLDEN:
            entry["look"] = look
        self.entries.append(entry)
        return entry

    def finish(self, desktop: dict[str, Any]) -> int:
        """Write the pictures, then the index, then remove pictures of ours that it does not name.

        Args:
            desktop: What the pictures show, for the index.

        Returns:
            The pack's size in bytes.
        """
        for file, data in self._data.items():
            write_atomic(self.folder / file, data)
        entries = sorted(self.entries, key=lambda entry: entry["id"])
        write_atomic(self.folder / INDEX, _index(entries, desktop))
        files = {entry["file"] for entry in entries}
        total = (self.folder / INDEX).stat().st_size
        for path in self.folder.glob("*.webp"):
            if path.name in files:
                total += path.stat().st_size
            elif _is_ours(path):
                path.unlink()
        return total

    def _name(self, picture: Picture) -> str:
        x1, y1, x2, y2 = picture.box
        parts = (picture.kind, picture.app, f"{x2 - x1}x{y2 - y1}")
        stem = "-".join(part for part in parts if part)
        ids = {entry["id"] for entry in self.entries}
        number = 1
        while f"{stem}-{number}" in ids:
            number += 1
        return f"{stem}-{number}"


def _index(entries: list[dict[str, Any]], desktop: dict[str, Any]) -> str:
    """Return the index as JSON, an entry a line, for people."""
    about = {"format": FORMAT, "version": VERSION, "desktop": desktop, "licence": LICENCE}
    head = json.dumps(about)
    lines = ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in entries)
    return f'{head[:-1]}, "pictures": [\n{lines}\n]}}\n'


def _encoded(pixels: UInt8Array, name: str) -> bytes:
    """Return RGB or RGBA pixels as lossless WebP, which is decoded again as a check.

    Raises:
        DesktopError: The decoded pixels differ.
    """
    image = Image.fromarray(pixels)
    buffer = io.BytesIO()
    image.save(buffer, "WEBP", lossless=True, quality=100, method=6, exact=True)
    with Image.open(io.BytesIO(buffer.getvalue()), formats=("WEBP",)) as again:
        if again.mode != image.mode or not np.array_equal(np.asarray(again), pixels):
            raise DesktopError(
                f"{name}: WebP did not keep the pixels; is this Pillow's own build of libwebp?"
            )
    return buffer.getvalue()


def _present(folder: Path) -> list[dict[str, Any]]:
    """Return the entries of the folder's index; none if there is no index.

    Raises:
        HijackError: The folder holds no pack, or a damaged one.
    """
    path = folder / INDEX
    if not path.exists():
        _check_no_other_files(folder)
        return []
    try:
        index = json.loads(path.read_text(encoding="utf-8"))
        form = index["format"]
        version = index["version"]
        if form != FORMAT or version != VERSION:
            raise HijackError(f"{path} is of format {form} {version}, not {FORMAT} {VERSION}")
        entries = [dict(entry) for entry in index["pictures"]]
        for entry in entries:
            _, _ = entry["screen"]
            _ = [entry[name] for name in ("id", "file", "kind", "sha256")]
        return entries
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise HijackError(
            f"{path} cannot be read ({type(error).__name__}: {error}); remove it or mend it"
        ) from None


def _check_no_other_files(folder: Path) -> None:
    """Check that a folder without an index holds at most what a recording left that broke off.

    Raises:
        HijackError: It holds something else.
    """
    foreign_files = sorted(path.name for path in folder.glob("*") if not _is_ours(path))
    if foreign_files:
        raise HijackError(
            f"{folder} holds {foreign_files[0]!r}, but no {INDEX}: it is no asset pack; give"
            " another folder"
        )


def _is_ours(path: Path) -> bool:
    """Return whether a file has a name that `AssetPackWriter` gives to pictures."""
    kind = path.name.partition("-")[0]
    return kind in picture_kinds() and _NAMED.fullmatch(path.name) is not None
