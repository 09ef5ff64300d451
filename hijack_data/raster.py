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
import io
import itertools
import json
import math
import operator
import os
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from .cache import Cache as _Cache
from .errors import PlanError, suggest
from .pack import find_asset
from .params import rgb
from .sprite import Color, Layer, Sprite
from .text import advances, line_height, line_width, load_font
from .types import Box, Point, Size, UInt8Array

CACHE_BYTES, LINE_CACHE_BYTES = 128 * 2**20, 8 * 2**20
MAX_PIXELS, MAX_FONT_SIZE = 2**28, 4096
MARGIN = 2  # pixels kept around a line's measured box, in case a letter leaves it


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


def _whole(array: npt.NDArray[Any]) -> Box:
    return 0, 0, array.shape[1], array.shape[0]


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
    return Sprite.of_layer(Layer(_whole(alpha), (alpha,), (rgb(recipe["color"]),)))


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


def _masks(recipe: Mapping[str, Any]) -> tuple[UInt8Array, UInt8Array]:
    """Return the fill and the outline coverage of centred lines, uint8 `[h, w]`."""
    font, edge = load_font(recipe["font"], _font_size(recipe["size"])), int(recipe.get("edge", 0))
    step = line_height(font) + 2 * edge
    widths = [math.ceil(font.getlength(line)) + 2 * edge for line in recipe["lines"]]
    box = max(1, *widths, 1), max(1, step * len(widths))
    masks: list[UInt8Array] = []
    for stroke in (0, edge):
        image = _canvas("L", *box)
        draw = ImageDraw.Draw(image)
        for row, (line, width) in enumerate(zip(recipe["lines"], widths, strict=True)):
            at = ((box[0] - width) // 2 + edge, row * step + edge)
            draw.text(at, line, fill=255, font=font, stroke_width=stroke)
        masks.append(np.array(image))
    return masks[0], masks[1]


def _text(recipe: Mapping[str, Any]) -> Sprite:
    fill, outline = _masks(recipe)
    rest = ((np.multiply(outline, 255 - fill, dtype=np.uint16) + 127) // 255).astype(np.uint8)
    colors = rgb(recipe["color"]), rgb(recipe["edge_color"])
    return Sprite.of_layer(Layer(_whole(fill), (fill, rest), colors))


def _window(recipe: Mapping[str, Any]) -> Sprite:
    """A window: its edge, then panel after panel a filled box and lines of text."""
    (width, height), edge = (int(side) for side in recipe["size"]), int(recipe["edge"])
    _check_area(width, height)
    ink, around = rgb(recipe["color"]), rgb(recipe["edge_color"])
    holes, layers = list[Box](), list[Layer]()
    for panel in recipe["panels"]:
        x1, y1, x2, y2 = (int(v) for v in panel["box"])
        size, lines = _font_size(panel["font_size"]), panel["lines"]
        font = load_font(recipe["font"], size)
        step = line_height(font)
        top = (y1 + y2 - step * len(lines)) // 2
        box = _inner(x1, y1, x2, y2, edge)
        inside = box[0], box[1], min(box[2], width), min(box[3], height)
        fill = rgb(panel["fill"])
        if inside[0] < inside[2] and inside[1] < inside[3]:
            layers.append(Layer(inside, colors=(fill,)))
            holes.append(inside)
        for row, line in enumerate(lines):
            left = (x1 + x2 - math.ceil(line_width(line, font))) // 2
            layers += _line((line, str(recipe["font"]), size), (left, top + row * step), ink, (height, width))
    edges = [Layer(box, colors=(around,)) for box in _without((0, 0, width, height), holes)]
    return Sprite((height, width), (*edges, *layers), opaque=True)


def _without(whole: Box, holes: list[Box]) -> list[Box]:
    """Return boxes that cover all of `whole` except the holes: what is painted over need not be filled first."""
    left = [whole]
    for x1, y1, x2, y2 in holes:
        parts: list[Box] = []
        for a1, b1, a2, b2 in left:
            top, bottom = min(max(y1, b1), b2), max(min(y2, b2), b1)
            if x1 >= a2 or x2 <= a1 or top >= bottom:
                parts.append((a1, b1, a2, b2))
                continue
            parts += [
                (a1, b1, a2, top),
                (a1, bottom, a2, b2),
                (a1, top, max(a1, x1), bottom),
                (min(x2, a2), top, a2, bottom),
            ]
        left = [box for box in parts if box[0] < box[2] and box[1] < box[3]]
    return left


def _line(text: tuple[str, str, int], at: Point, ink: Color, size: Size) -> list[Layer]:
    """Return the layer of a line with its corner at `at`; what sticks out of the sprite is cut off."""
    mask, (left, top) = _line_mask(*text)
    x, y = at[0] + left, at[1] + top
    mask = mask[max(0, -y) : max(0, size[0] - y), max(0, -x) : max(0, size[1] - x)]
    x, y, (h, w) = max(0, x), max(0, y), mask.shape
    return [Layer((x, y, x + w, y + h), (mask,), (ink,))] if mask.size else []


def _inner(x1: int, y1: int, x2: int, y2: int, edge: int) -> Box:
    """A box without its edge, cut off at the top and the left; empty when the edge is all of it."""
    if x2 - x1 <= 2 * edge or y2 - y1 <= 2 * edge:
        return 0, 0, 0, 0
    return max(0, x1 + edge), max(0, y1 + edge), max(0, x2 - edge), max(0, y2 - edge)


def _line_mask(line: str, font: str, size: int) -> tuple[UInt8Array, Point]:
    """Return the coverage of one line, uint8 `[h, w]`, and where its corner lies from the line's own (x, y)."""
    key = (line, font, size)
    found = _lines.get(key)
    if found is None:
        found = (_set_letters(line, font, size) if len(line) > 1 else None) or _drawn_line(line, load_font(font, size))
        found[0].setflags(write=False)
        _lines.put(key, found, found[0].nbytes)
    return found


def _drawn_line(line: str, font: ImageFont.FreeTypeFont) -> tuple[UInt8Array, Point]:
    """Let Pillow draw a line."""
    x1, y1, x2, y2 = (int(v) for v in font.getbbox(line))
    image = _canvas("L", max(1, x2 - x1) + 2 * MARGIN, max(1, y2 - y1) + 2 * MARGIN)
    ImageDraw.Draw(image).text((MARGIN - x1, MARGIN - y1), line, fill=255, font=font)
    left, top, right, bottom = image.getbbox() or (0, 0, 0, 0)
    return np.array(image)[top:bottom, left:right], (x1 - MARGIN + left, y1 - MARGIN + top)


def _set_letters(line: str, font: str, size: int) -> tuple[UInt8Array, Point] | None:
    """Make a line of remembered letters, as Pillow does; `None` where one would stand between two pixels."""
    if "\n" in line:  # Pillow begins a new line
        return None
    starts = [0.0, *itertools.accumulate(advances(line, load_font(font, size)))][:-1]
    if not all(start.is_integer() for start in starts):
        return None
    known = {letter: _line_mask(letter, font, size) for letter in set(line)}
    places = [
        (int(start) + left, y, mask)
        for start, (mask, (left, y)) in zip(starts, map(known.__getitem__, line), strict=True)
        if mask.size
    ]
    if not places:
        return np.zeros((0, 0), np.uint8), (0, 0)
    first, top = min(left for left, _, _ in places), min(y for _, y, _ in places)
    right = max(left + mask.shape[1] for left, _, mask in places)
    bottom = max(y + len(mask) for _, y, mask in places)
    _check_area(right - first, bottom - top)
    out, end = np.zeros((bottom - top, right - first), np.uint8), first
    for left, y, mask in places:
        below = out[y - top : y - top + len(mask), left - first : left - first + mask.shape[1]]
        below[:] = mask if left >= end else _over(mask, below)
        end = max(end, left + mask.shape[1])
    return out, (first, top)


def _over(mask: UInt8Array, below: UInt8Array) -> UInt8Array:
    """Blend the coverage of a letter over that of the ones before."""
    total = np.multiply(mask, np.uint16(255), dtype=np.uint16) + np.multiply(below, 255 - mask, dtype=np.uint16) + 128
    return ((total + (total >> 8)) >> 8).astype(np.uint8)


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
    if pixels.shape[2] == 4:
        return _rgba(pixels)
    return Sprite.of_layer(Layer(_whole(pixels), picture=np.ascontiguousarray(pixels)))


def _rgba(pixels: UInt8Array) -> Sprite:
    alpha, colors = pixels[..., 3].copy(), pixels[..., :3]
    if (alpha == 255).all():
        return Sprite.of_layer(Layer(_whole(alpha), picture=np.ascontiguousarray(colors)))
    paint = colors.astype(np.uint16) * alpha[..., None].astype(np.uint16)
    return Sprite.of_layer(Layer(_whole(alpha), (alpha,), picture=paint))


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
