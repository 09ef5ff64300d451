"""The asset pack: pictures recorded from a real desktop.

The pack also holds, for each picture, what could be clicked in it and which action undid it. A pack
is a folder with `index.json` and lossless WebP pictures. One pack ships with the package;
`AGENTHIJACK_ASSETS` names another. A plan refers to a picture by id and hash, never by path, so it
means the same pixels wherever the pack is stored. `hijack desktop record --assets` makes packs.
"""

import hashlib
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from .errors import AssetError, ParameterTypeError, short_repr
from .file_io import read_versioned_json
from .picture_io import pixel_sha256
from .registry import find_registry
from .types import ACTION_TYPES, MAX_SIDE, Action, Box, Size, UInt8Array

FORMAT = "agenthijack-assets"
VERSION = 1
INDEX = "index.json"
VARIABLE = "AGENTHIJACK_ASSETS"
SHIPPED = Path(__file__).parent / "assets"
# Digits of the hash by which a plan names a picture, the same number as in a sprite's fingerprint.
DIGITS = 16


@dataclass(frozen=True)
class AssetTarget:
    """Something that could be clicked, from the accessibility tree.

    `box` is in pixels of the picture.
    """

    name: str
    role: str
    box: Box


@dataclass(frozen=True)
class RecordedAction:
    """An action that was carried out, and the box at which it aimed, in pixels of the picture."""

    action: Action
    target_box: Box | None = None

    def translate(self, dx: int, dy: int) -> "RecordedAction":
        """Return the action on a screen with the picture's corner at `(dx, dy)`."""
        old = self.action
        action = replace(
            old, x=_plus(old.x, dx), y=_plus(old.y, dy), x2=_plus(old.x2, dx), y2=_plus(old.y2, dy)
        )
        if self.target_box is None:
            return RecordedAction(action)
        left, top, right, bottom = self.target_box
        return RecordedAction(action, (left + dx, top + dy, right + dx, bottom + dy))


def _plus(value: int | None, by: int) -> int | None:
    return None if value is None else value + by


@dataclass(frozen=True, kw_only=True)
class Asset:
    """One picture of a pack.

    Args:
        id: the name of the picture, unique in the pack.
        path: the file.
        kind: one of `picture_kinds()`.
        app: the application that drew it, or `""`.
        screen: `(height, width)` of the desktop that showed it.
        box: the place of the picture on that desktop, `xyxy`.
        sha256: the hash of the decoded RGB or RGBA bytes.
        targets: what could be clicked.
        recover: the action that was observed to undo it, if any.
        opened_by: the click that opened it, if a click did; its point may be outside the picture.
        made_by: how the picture was obtained.
        look: themes and wallpaper of the desktop that showed it, `"golden"` for the ordinary ones.
    """

    id: str
    path: Path = field(repr=False)
    kind: str
    app: str
    screen: Size
    box: Box
    sha256: str
    targets: tuple[AssetTarget, ...] = ()
    recover: RecordedAction | None = None
    opened_by: RecordedAction | None = None
    made_by: str = ""
    look: str = "golden"

    @property
    def size(self) -> Size:
        """`(height, width)` of the picture."""
        return self.box[3] - self.box[1], self.box[2] - self.box[0]

    def recipe(self, crop: Box | None = None) -> dict[str, Any]:
        """Return the recipe that draws the picture, or its part `crop`; see `raster`."""
        recipe: dict[str, Any] = {"draw": "asset", "id": self.id, "sha256": self.sha256[:DIGITS]}
        return recipe if crop is None else {**recipe, "crop": list(crop)}

    def pixels(self) -> UInt8Array:
        """Decode the picture: uint8 `[h, w, 3]`, or `[h, w, 4]` if it has transparent corners.

        Raises:
            AssetError: the file is missing, damaged, or not the picture that the index describes.
        """
        try:
            data = io.BytesIO(self.path.read_bytes())
            with Image.open(data, formats=["WEBP", "PNG"]) as image:
                mode = "RGBA" if image.mode == "RGBA" else "RGB"
                pixels = np.array(image.convert(mode))
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise AssetError(
                f"{self.path}: cannot be read ({error}); install the pack again"
            ) from None
        if pixels.shape[:2] != self.size or pixel_sha256(pixels) != self.sha256:
            raise AssetError(
                f"{self.path}: is not the picture of {INDEX} (other size or hash); install the pack"
                " again"
            )
        return pixels


@dataclass(frozen=True, eq=False)
class AssetPack:
    """The pictures of one folder. Use `AssetPack.load`."""

    folder: Path
    assets: tuple[Asset, ...]
    licence: str = ""
    desktop: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @classmethod
    def load(cls, folder: str | os.PathLike[str] | None = None) -> "AssetPack":
        """Read the index of a pack; pictures are decoded when they are drawn.

        From then on, this process can apply plans that refer to pictures of the pack.

        Args:
            folder: the pack; by default that of `AGENTHIJACK_ASSETS`, otherwise the one that ships
                with the package.

        Raises:
            ParameterTypeError: `folder` is not a path.
            AssetError: there is no pack, or its index is damaged, of a newer version or names files
                elsewhere.
        """
        if folder is None:
            folder = os.environ.get(VARIABLE) or SHIPPED
        try:
            pack_folder = Path(folder)
        except TypeError:
            index = short_repr(folder)
            raise ParameterTypeError(f"an asset pack is a folder's path, got {index}") from None
        try:
            state = (pack_folder / INDEX).stat()
        except (OSError, ValueError):
            raise AssetError(
                f"{pack_folder}: no asset pack there ({INDEX} is missing); record one with "
                f"`hijack desktop record --assets DIR`, or name one with {VARIABLE}"
            ) from None
        pack = _read(os.path.abspath(pack_folder), state.st_mtime_ns, state.st_size)
        _asset_cache.update({(asset.id, asset.sha256[:DIGITS]): asset for asset in pack.assets})
        return pack

    @cached_property
    def digest(self) -> str:
        """64 hexadecimal digits that identify the pack, independent of its folder.

        They are the SHA-256 of the index entries of all pictures.
        """
        lines = [
            repr(
                (a.id, a.kind, a.app, a.screen, a.sha256, a.targets, a.recover, a.opened_by, a.box)
            )
            for a in self.assets
        ]
        text = "\n".join(sorted(lines))
        return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()

    def pictures(
        self, kind: str, app: str | None = None, screen: Size | None = None
    ) -> list[Asset]:
        """Return the pictures of a kind in the order of their ids.

        Args:
            kind: such as `"window"`.
            app: only those of this application.
            screen: only those of screens of this size, (height, width).
        """
        matching = [asset for asset in self.assets if asset.kind == kind]
        if app is not None:
            matching = [asset for asset in matching if asset.app == app]
        if screen is not None:
            matching = [asset for asset in matching if asset.screen == screen]
        return matching

    def get(self, name: str) -> Asset:
        """Return the picture with an id.

        Raises:
            AssetError: the pack has no picture with this id.
        """
        for asset in self.assets:
            if asset.id == name:
                return asset
        raise AssetError(f"{self.folder}: holds no picture {name!r}")


def picture_kinds() -> list[str]:
    """Return the kinds of pictures that show corruptions: built-in kinds, then those of plug-ins.

    Each corruption declares its own (`Corruption.pictures`).
    """
    corruptions = find_registry("corruptions")
    listed = [kind for name in corruptions.names() for kind in corruptions.get(name).pictures]
    return list(dict.fromkeys(listed))


def _registered_kinds() -> set[str]:
    """Return the kinds of the corruptions registered so far, without loading plug-ins."""
    corruptions = find_registry("corruptions")
    corruptions.load_ours()
    return {kind for cls in corruptions.entries.values() for kind in cls.pictures}


_asset_cache: dict[tuple[str, str], Asset] = {}


def find_asset(name: str, sha256: str) -> Asset:
    """Return the picture that a plan refers to, from a loaded pack or from the default one.

    Raises:
        AssetError: no pack has the picture, or a pack has a different picture with that name.
    """
    if (name, sha256) not in _asset_cache:
        pack = AssetPack.load()
        if (name, sha256) not in _asset_cache:
            has_name = any(asset.id == name for asset in pack.assets)
            state = "holds another picture of that name" if has_name else "does not hold it"
            raise AssetError(
                f"the recorded picture {name!r} ({sha256}): {pack.folder} {state}; set {VARIABLE}"
                " to the pack that the plan was made with"
            )
    return _asset_cache[name, sha256]


@lru_cache(maxsize=8)
def _read(folder: str, mtime: int, size: int) -> AssetPack:
    path = Path(folder) / INDEX
    index = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        description="the index of an asset pack",
        error=AssetError,
    )
    try:
        assets = sorted(
            (_asset(Path(folder), entry) for entry in index["pictures"]), key=lambda asset: asset.id
        )
        licence = str(index.get("licence", ""))
        desktop = dict(index.get("desktop") or {})
    except AssetError:
        raise
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise AssetError(
            f"{path}: damaged ({type(error).__name__}: {error}); install the pack again"
        ) from None
    twice = next((a.id for a, b in pairwise(assets) if a.id == b.id), None)
    if twice is not None:
        raise AssetError(f"{path}: two pictures are named {twice!r}")
    return AssetPack(Path(folder), tuple(assets), licence, desktop)


def _asset(folder: Path, entry: Mapping[str, Any]) -> Asset:
    name = str(entry["id"])
    file = str(entry["file"])
    kind = str(entry["kind"])
    if os.path.basename(file) != file or file in ("", ".", ".."):
        raise ValueError(f"picture {name!r}: file {file!r} is not a plain name")
    if kind not in _registered_kinds() and kind not in picture_kinds():
        asset = ", ".join(picture_kinds())
        raise ValueError(f"picture {name!r}: kind {kind!r} is not one of {asset}")
    width, height = _numbers(entry["screen"], 2)
    box = _box(entry["box"])
    digest = str(entry["sha256"])
    is_empty = box[0] >= box[2] or box[1] >= box[3]
    if is_empty or len(digest) != 64:
        raise ValueError(f"picture {name!r}: box {list(box)} is empty, or sha256 is not one")
    targets = tuple(
        AssetTarget(str(t["name"]), str(t["role"]), _box(t["box"])) for t in entry["targets"]
    )
    return Asset(
        id=name,
        path=folder / file,
        kind=kind,
        app=str(entry["app"]),
        screen=(height, width),
        box=box,
        sha256=digest,
        targets=targets,
        recover=_recorded_action(entry.get("recover"), f"picture {name!r}: recover"),
        opened_by=_recorded_action(entry.get("opened_by"), f"picture {name!r}: opened_by"),
        made_by=str(entry.get("made_by", "")),
        look=str(entry.get("look", "golden")),
    )


def _recorded_action(data: Mapping[str, Any] | None, location: str) -> RecordedAction | None:
    if data is None:
        return None
    if data["type"] not in ACTION_TYPES:
        raise ValueError(f"{location}: type {data['type']!r} is not known")
    x: int | None = None
    y: int | None = None
    if data.get("x") is not None:
        x, y = _numbers([data["x"], data["y"]], 2)
    keys = tuple(str(key) for key in data["keys"]) if data.get("keys") else None
    text = None if data.get("text") is None else str(data["text"])
    box = data.get("target_box")
    action = Action(data["type"], x, y, text=text, keys=keys)
    return RecordedAction(action, None if box is None else _box(box))


def _box(value: Sequence[object]) -> Box:
    x1, y1, x2, y2 = _numbers(value, 4)
    return x1, y1, x2, y2


def _numbers(values: Sequence[object], count: int) -> Iterator[int]:
    integers = [v for v in values if isinstance(v, int) and not isinstance(v, bool)]
    in_range = [v for v in integers if abs(v) <= MAX_SIDE]
    if len(in_range) != count or len(values) != count:
        raise ValueError(f"{values!r} must be {count} integers")
    return iter(in_range)
