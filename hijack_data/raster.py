"""The only file that draws. A recipe (JSON data) goes in, a sprite comes out.

Pillow draws with its BASIC text layout and a bundled DejaVu font, so that a recipe gives the same sprite on every
machine with the same FreeType. Each sprite has a fingerprint; a plan stores it, and replaying the plan where the
drawing would differ is an error instead of a silently different picture.

Recipes, by their `draw` key:

* `mark`:   `shape` star | circle | rectangle, `size` half side in px, `color`
* `text`:   `lines`, `font`, `size` px, `color`, `edge_color`, `edge` px, centred lines
* `window`: `size` [w, h], `edge` px, `panels` [{`box`, `fill`, `lines`, `font_size`}], `font`, `color`, `edge_color`
* `png`:    `data`, a base64 PNG with transparency, for plug-ins
* `asset`:  `id`, `sha256` (16 digits) of a picture of the asset pack, see `pack`; `crop` [x1, y1, x2, y2], if any
"""

import base64
import binascii
import hashlib
import io
import json
import math
import operator
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from threading import Lock
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from .cache import Cache as _Cache
from .errors import PlanError, suggest
from .pack import find_asset
from .params import rgb
from .text import line_height, line_width, load_font
from .types import Box, Point, UInt8Array

Color: TypeAlias = tuple[int, int, int]
CACHE_BYTES, LINE_CACHE_BYTES = 128 * 2**20, 8 * 2**20
MAX_PIXELS, MAX_FONT_SIZE = 2**28, 4096
MARGIN = 2  # pixels kept around a line's measured box, in case a letter leaves it


@dataclass(frozen=True, eq=False)
class Sprite:
    """A picture to stamp: premultiplied, with one opacity a pixel.

    A pixel `d` below it becomes `(t + (t >> 8)) >> 8` with `t = d * (255 - alpha) + paint + 128`: the exact rounding of
    the blend, in integers.

    Args:
        alpha: opacity, uint8 `[h, w]`.
        colors: the colours of a sprite that is opaque everywhere, uint8 `[h, w, 3]`; else `None`.
        mixed: colour * alpha (0..65025) of any other sprite, uint16 `[h, w, 3]`; else `None`.
        whole: the sprite that this one is a part of, if any.
        draw: draws an opaque sprite into pixels `[h, w, 3]` of any strides, without making `colors` first.
        scratch: where a backend keeps its own form of the sprite, such as tensors on a device.
    """

    alpha: UInt8Array
    colors: UInt8Array | None
    mixed: npt.NDArray[np.uint16] | None
    whole: "Sprite | None" = None
    draw: Callable[[UInt8Array], None] | None = None
    scratch: dict[Any, Any] = field(default_factory=dict[Any, Any], repr=False)

    @cached_property
    def fingerprint(self) -> str:
        """16 hexadecimal digits of the SHA-256 of the pixels, of the whole sprite for a part. Costs 1 ms for 1.5 MB."""
        if self.whole is not None:
            return self.whole.fingerprint
        return _fingerprint(self.rgb) if self.rgb is not None else _fingerprint(self.alpha, self.paint)

    @property
    def opaque(self) -> bool:
        """Whether every pixel is opaque, so that there are `rgb` colours."""
        return self.mixed is None

    @cached_property
    def rgb(self) -> UInt8Array | None:
        """The colours of a sprite that is opaque everywhere, uint8 `[h, w, 3]`; else `None`."""
        if self.draw is None:
            return self.colors
        pixels = np.empty((*self.size, 3), np.uint8)
        self.draw(pixels)
        pixels.setflags(write=False)
        return pixels

    @property
    def size(self) -> tuple[int, int]:
        """`(height, width)` in pixels."""
        return self.alpha.shape[0], self.alpha.shape[1]

    @property
    def nbytes(self) -> int:
        """Memory of the pixels; what backends keep is about as much again."""
        return self.alpha.size * (3 if self.opaque else 7)

    @cached_property
    def paint(self) -> npt.NDArray[np.uint16]:
        """Colour * alpha (0..65025), uint16 `[h, w, 3]`."""
        if self.rgb is not None:
            return self.rgb.astype(np.uint16) * 255
        assert self.mixed is not None
        return self.mixed

    @cached_property
    def pixels(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], UInt8Array, npt.NDArray[np.uint16]]:
        """The pixels that paint anything: `dy [n]`, `dx [n]`, `keep = 255 - alpha [n]`, `paint [n, 3]`."""
        dy, dx = np.nonzero(self.alpha)
        return dy.astype(np.int32), dx.astype(np.int32), 255 - self.alpha[dy, dx], self.paint[dy, dx]

    @cached_property
    def uniform(self) -> bool:
        """Whether all painted pixels are opaque and of one colour, so that overlapping stamps need no order."""
        _, _, keep, paint = self.pixels
        return bool((keep == 0).all() and (paint == paint[:1]).all())

    def crop(self, top: int, left: int, bottom: int, right: int) -> "Sprite":
        """Return the part of the sprite inside these bounds."""
        part = (slice(top, bottom), slice(left, right))
        rgb = None if self.rgb is None else self.rgb[part]
        mixed = None if self.mixed is None else self.mixed[part]
        return Sprite(self.alpha[part], rgb, mixed, self.whole or self)


_cache = _Cache(CACHE_BYTES)
_lines = _Cache(LINE_CACHE_BYTES)


def _renew_locks() -> None:
    """In a forked child: a thread that held a lock when the parent forked is not there to release it."""
    for cache in (_cache, _lines):
        cache.lock = Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_locks)
_recipe_key = json.JSONEncoder(sort_keys=True, separators=(",", ":")).encode


def render(recipe: Mapping[str, Any]) -> Sprite:
    """Draw a recipe, or return it from the cache. Raises `PlanError` for a recipe that cannot be drawn."""
    try:
        key = _recipe_key(recipe)
        draw = _DRAW[recipe["draw"]]
    except KeyError:
        name = recipe.get("draw")
        raise PlanError(f"plan: sprite.draw = {name!r} is not a known drawing{suggest(name, _DRAW)}") from None
    sprite = _cache.get(key)
    if sprite is None:
        try:
            sprite = draw(recipe)
        except (KeyError, TypeError, IndexError, ValueError) as error:
            raise PlanError(f"plan: the {recipe['draw']!r} sprite cannot be drawn: {error}") from error
        _cache.put(key, sprite, 3 * sprite.nbytes)
    return sprite


def _canvas(mode: str, width: int, height: int) -> Image.Image:
    """Return an empty picture; a plan from elsewhere must not make this process ask for all memory."""
    _check_area(width, height)
    return Image.new(mode, (width, height))


def _check_area(width: int, height: int) -> None:
    if not (width > 0 and height > 0 and width * height <= MAX_PIXELS):
        raise PlanError(f"plan: a sprite of {width}x{height} pixels; it must hold 1 to {MAX_PIXELS}")


def _fingerprint(*arrays: npt.NDArray[Any]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(cast(Any, np.ascontiguousarray(array)))
    return digest.hexdigest()[:16]


def _opaque(rgb: UInt8Array) -> Sprite:
    rgb.setflags(write=False)
    alpha = np.broadcast_to(np.uint8(255), rgb.shape[:2])
    return Sprite(alpha, rgb, None)


def _blended(alpha: UInt8Array, paint: npt.NDArray[np.uint16]) -> Sprite:
    if (alpha == 255).all():
        return _opaque((paint // 255).astype(np.uint8))
    alpha.setflags(write=False)
    paint.setflags(write=False)
    return Sprite(alpha, None, paint)


def _mark(recipe: Mapping[str, Any]) -> Sprite:
    size = int(recipe["size"])
    mask = _canvas("L", 2 * size, 2 * size)
    draw, last = ImageDraw.Draw(mask), 2 * size - 1
    match recipe["shape"]:
        case "circle":
            draw.ellipse((0, 0, last, last), fill=255)
        case "rectangle":
            draw.rectangle((0, 0, last, last), fill=255)
        case "star":
            draw.polygon(_star_points(size), fill=255)
        case other:
            raise PlanError(f"plan: unknown mark shape {other!r}{suggest(other, ('star', 'circle', 'rectangle'))}")
    alpha = np.array(mask)
    return _blended(alpha, alpha[..., None].astype(np.uint16) * np.array(rgb(recipe["color"]), np.uint16))


def _star_points(size: int) -> list[tuple[float, float]]:
    """Five points on a circle of radius `size`, joined through an inner circle of 0.4 of it."""
    centre = size - 0.5
    points: list[tuple[float, float]] = []
    for i in range(10):
        radius = centre * (0.4 if i % 2 else 1.0)
        angle = math.pi * (i / 5 - 0.5)
        points.append((centre + radius * math.cos(angle), centre + radius * math.sin(angle)))
    return points


def _font_size(value: Any) -> int:
    if not 0 < int(value) <= MAX_FONT_SIZE:
        raise PlanError(f"plan: font size {value!r} is not in 1..{MAX_FONT_SIZE}")
    return int(value)


def _masks(recipe: Mapping[str, Any]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return the fill and the outline coverage of centred lines, int32 `[h, w]`, 0..255."""
    font, edge = load_font(recipe["font"], _font_size(recipe["size"])), int(recipe.get("edge", 0))
    step = line_height(font) + 2 * edge
    widths = [math.ceil(font.getlength(line)) + 2 * edge for line in recipe["lines"]]
    box = max(1, *widths, 1), max(1, step * len(widths))
    masks: list[npt.NDArray[np.int32]] = []
    for stroke in (0, edge):
        image = _canvas("L", *box)
        draw = ImageDraw.Draw(image)
        for row, (line, width) in enumerate(zip(recipe["lines"], widths, strict=True)):
            at = ((box[0] - width) // 2 + edge, row * step + edge)
            draw.text(at, line, fill=255, font=font, stroke_width=stroke)
        masks.append(np.array(image).astype(np.int32))
    return masks[0], masks[1]


def _text(recipe: Mapping[str, Any]) -> Sprite:
    fill, outline = _masks(recipe)
    rest = (outline * (255 - fill) + 127) // 255
    color, edge = (np.array(rgb(recipe[key]), np.int32) for key in ("color", "edge_color"))
    paint = fill[..., None] * color + rest[..., None] * edge
    return _blended((fill + rest).astype(np.uint8), paint.astype(np.uint16))


def _window(recipe: Mapping[str, Any]) -> Sprite:
    width, height = (int(side) for side in recipe["size"])
    _check_area(width, height)
    _window_parts(recipe)  # a recipe that cannot be drawn is refused here, not when it is painted
    alpha = np.broadcast_to(np.uint8(255), (height, width))
    return Sprite(alpha, None, None, draw=partial(_draw_window, recipe))


def _draw_window(recipe: Mapping[str, Any], pixels: UInt8Array) -> None:
    """Draw a window over all of `pixels`, `[h, w, 3]` of any strides."""
    planes = _planes(pixels)
    for fill, (x1, y1, x2, y2), lines in _window_parts(recipe):
        for plane, channel, per in planes:
            if x2 > x1 and y2 > y1:
                part = plane[y1:y2, per * x1 : per * x2]
                part[:] = _row(fill, channel, part.shape[1] // per)
        for line, font, size, at in lines:
            _write(planes, line, font, size, at, rgb(recipe["color"]))


def _window_parts(recipe: Mapping[str, Any]) -> list[tuple[Color, Box, list[tuple[str, str, int, Point]]]]:
    """Return what a window is made of, in order: a colour, the box it fills, and lines of text with their places."""
    (width, height), edge = (int(side) for side in recipe["size"]), int(recipe["edge"])
    parts: list[tuple[Color, Box, list[tuple[str, str, int, Point]]]] = [
        (rgb(recipe["edge_color"]), (0, 0, width, height), [])
    ]
    for panel in recipe["panels"]:
        x1, y1, x2, y2 = (int(v) for v in panel["box"])
        size, lines = _font_size(panel["font_size"]), panel["lines"]
        font = load_font(recipe["font"], size)
        step = line_height(font)
        top = (y1 + y2 - step * len(lines)) // 2
        lefts = [(x1 + x2 - math.ceil(line_width(line, font))) // 2 for line in lines]
        places = [(left, top + row * step) for row, left in enumerate(lefts)]
        texts = [(line, str(recipe["font"]), size, at) for line, at in zip(lines, places, strict=True)]
        parts.append((rgb(panel["fill"]), _inner(x1, y1, x2, y2, edge), texts))
    rgb(recipe["color"])
    return parts


def _inner(x1: int, y1: int, x2: int, y2: int, edge: int) -> Box:
    """A box without its edge, cut off at the top and the left; empty when the edge is all of it."""
    if x2 - x1 <= 2 * edge or y2 - y1 <= 2 * edge:
        return 0, 0, 0, 0
    return max(0, x1 + edge), max(0, y1 + edge), max(0, x2 - edge), max(0, y2 - edge)


def _planes(pixels: UInt8Array) -> list[tuple[UInt8Array, slice, int]]:
    """Return flat pictures to draw on, the channels in each, and bytes a pixel: one of whole lines, or one a channel.

    Whole lines of bytes are drawn 20 times as fast as single pixels.
    """
    if pixels.strides[1:] == (3, 1):
        return [(pixels.reshape(len(pixels), -1), slice(0, 3), 3)]
    return [(pixels[..., c], slice(c, c + 1), 1) for c in range(3)]


def _row(color: Color, channel: slice, width: int) -> UInt8Array:
    return np.tile(np.array(color[channel], np.uint8), width)


def _write(planes: list[Any], line: str, font: str, size: int, at: Point, ink: Color) -> None:
    """Write a line over opaque pixels with its corner at `at`, as Pillow does; what sticks out is cut off."""
    mask, (left, top) = _line_mask(line, font, size)
    x, y = at[0] + left, at[1] + top
    for plane, channel, per in planes:
        rows, columns = plane.shape[0], plane.shape[1] // per
        part = mask[max(0, -y) : max(0, rows - y), 3 * max(0, -x) : 3 * max(0, columns - x) : 3 // per]
        below = plane[max(0, y) : max(0, y) + part.shape[0], per * max(0, x) : per * max(0, x) + part.shape[1]]
        total = np.multiply(below, 255 - part, dtype=np.uint16)
        total += np.multiply(part, _row(ink, channel, part.shape[1] // per), dtype=np.uint16)
        total += 128  # at most 65153, so that 16 bits hold every step
        total += total >> 8
        np.right_shift(total, 8, out=below, casting="unsafe")


def _line_mask(line: str, font: str, size: int) -> tuple[UInt8Array, Point]:
    """Return the coverage of one line, uint8 `[h, 3 * w]`, and where its corner lies from the line's own (x, y)."""
    key = (line, font, size)
    found = _lines.get(key)
    if found is None:
        loaded = load_font(font, size)
        x1, y1, x2, y2 = (int(v) for v in loaded.getbbox(line))
        image = _canvas("L", max(1, x2 - x1) + 2 * MARGIN, max(1, y2 - y1) + 2 * MARGIN)
        ImageDraw.Draw(image).text((MARGIN - x1, MARGIN - y1), line, fill=255, font=loaded)
        mask = np.repeat(np.array(image), 3, axis=1)
        mask.setflags(write=False)
        found = mask, (x1 - MARGIN, y1 - MARGIN)
        _lines.put(key, found, mask.nbytes)
    return found


def _png(recipe: Mapping[str, Any]) -> Sprite:
    try:
        image = Image.open(io.BytesIO(base64.b64decode(recipe["data"], validate=True)), formats=["PNG"])
        pixels = np.array(image.convert("RGBA"))
    except (OSError, binascii.Error) as error:
        raise PlanError(f"plan: the 'png' sprite does not hold a readable base64 PNG: {error}") from error
    return _rgba(pixels)


def _asset(recipe: Mapping[str, Any]) -> Sprite:
    pixels = find_asset(recipe["id"], recipe["sha256"]).pixels()
    if recipe.get("crop") is not None:
        x1, y1, x2, y2 = (operator.index(v) for v in recipe["crop"])
        if not (0 <= x1 < x2 <= pixels.shape[1] and 0 <= y1 < y2 <= pixels.shape[0]):
            raise PlanError(f"plan: crop {recipe['crop']} leaves {recipe['id']}, {pixels.shape[1]}x{pixels.shape[0]}")
        pixels = pixels[y1:y2, x1:x2]
    return _opaque(np.ascontiguousarray(pixels)) if pixels.shape[2] == 3 else _rgba(pixels)


def _rgba(pixels: UInt8Array) -> Sprite:
    alpha = pixels[..., 3].copy()
    return _blended(alpha, pixels[..., :3].astype(np.uint16) * alpha[..., None].astype(np.uint16))


def png_recipe(rgba: UInt8Array) -> dict[str, Any]:
    """Return the `png` recipe of an RGBA picture, uint8 `[h, w, 4]`: the way for a plug-in to stamp its own pixels."""
    buffer = io.BytesIO()
    Image.fromarray(rgba, "RGBA").save(buffer, "PNG")
    return {"draw": "png", "data": base64.b64encode(buffer.getvalue()).decode()}


_DRAW: dict[str, Callable[[Mapping[str, Any]], Sprite]] = {
    "mark": _mark,
    "text": _text,
    "window": _window,
    "png": _png,
    "asset": _asset,
}
