"""Draw a recipe (JSON data) as a sprite. Nothing outside this package draws.

Pillow draws with its BASIC text layout and a bundled DejaVu font, so that a recipe gives the same
sprite on every machine with the same FreeType. Each sprite has a fingerprint; a plan stores it, and
replaying the plan where the drawing would differ is an error instead of a silently different
picture.

Recipes, by their `draw` key:

* `mark`:   `shape` star | circle | rectangle, `size` half side in px, `color`
* `text`:   `lines`, `font`, `size` px, `color`, `edge_color`, `edge` px, centred lines; `margin` px
  around them, if any
* `window`: `size` [w, h], `edge` px, `panels` [{`box`, `fill`, `lines`, `font_size`}], `font`,
  `color`, `edge_color`
* `png`:    `data`, a base64 PNG with transparency, for plug-ins
* `asset`:  `id`, `sha256` (16 digits) of a picture of the asset pack, see `pack`; `crop` [x1, y1,
  x2, y2], if any
"""

import base64
import binascii
import io
import json
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from ..cache import Cache as _Cache
from ..errors import ImageError, ImageTypeError, PlanError, short_repr, suggest
from ..limits import SPRITE_PIXELS
from ..pack import find_asset
from ..params import rgb
from ..types import Box, Point, Size, UInt8Array
from .canvas import canvas, check_area
from .line_masks import line_mask
from .sprite import Color, Layer, Sprite
from .text import line_height, line_width, load_font

CACHE_BYTES = 128 * 2**20
MAX_FONT_SIZE = MAX_EDGE = 4096
PNG_HEADER = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"

_cache = _Cache(CACHE_BYTES)


_recipe_key = json.JSONEncoder(sort_keys=True, separators=(",", ":")).encode


def render(recipe: Mapping[str, Any]) -> Sprite:
    """Draw a recipe, or return its sprite from the cache.

    Raises:
        PlanError: the recipe cannot be drawn.
    """
    try:
        key = _recipe_key(recipe)
    except (TypeError, ValueError, RecursionError) as error:
        raise PlanError(f"plan: the recipe of a sprite is not JSON data ({error})") from None
    sprite = _cache.get(key)
    if sprite is None:
        sprite = _draw(recipe)
        _cache.put(key, sprite, sprite.footprint)
    return sprite


# A recipe may hold any values; these are the errors of Python, NumPy and Pillow for bad ones.
_WRONG_VALUE = (
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    ArithmeticError,
    OSError,
    MemoryError,
    Image.DecompressionBombError,
)


def _draw(recipe: object) -> Sprite:
    if not isinstance(recipe, dict):
        raise PlanError(f"plan: the recipe of a sprite must be an object, got {short_repr(recipe)}")
    data = cast("dict[str, Any]", recipe)
    name = data.get("draw")
    if not isinstance(name, str) or name not in _DRAW:
        suggestion = suggest(name, _DRAW)
        raise PlanError(
            f"plan: sprite.draw = {short_repr(name)} is not a known drawing{suggestion}"
        )
    try:
        return _DRAW[name](data)
    except PlanError:
        raise
    except KeyError as error:
        missing = f"it has no field {error}"
        raise PlanError(f"plan: the {name!r} sprite cannot be drawn: {missing}") from None
    except _WRONG_VALUE as error:
        reason = str(error) or type(error).__name__
        raise PlanError(f"plan: the {name!r} sprite cannot be drawn: {reason}") from error


def _full_box(array: npt.NDArray[Any]) -> Box:
    return 0, 0, array.shape[1], array.shape[0]


def _draw_mark(recipe: Mapping[str, Any]) -> Sprite:
    size = int(recipe["size"])
    mask = canvas("L", 2 * size, 2 * size)
    draw = ImageDraw.Draw(mask)
    last = 2 * size - 1
    match recipe["shape"]:
        case "circle":
            draw.ellipse((0, 0, last, last), fill=255)
        case "rectangle":
            draw.rectangle((0, 0, last, last), fill=255)
        case "star":
            draw.polygon(_star_points(size), fill=255)
        case shape:
            suggestion = suggest(shape, ("star", "circle", "rectangle"))
            raise PlanError(f"plan: unknown mark shape {shape!r}{suggestion}")
    alpha = np.array(mask)
    color = rgb(recipe["color"])
    return Sprite.from_layer(Layer(_full_box(alpha), (alpha,), (color,)))


def _star_points(size: int) -> list[tuple[float, float]]:
    """Return a star: five points at radius `size`, and five at 0.4 `size` between them."""
    centre = size - 0.5
    points: list[tuple[float, float]] = []
    for i in range(10):
        radius = centre * (0.4 if i % 2 else 1.0)
        angle = math.pi * (i / 5 - 0.5)
        x = centre + radius * math.cos(angle)
        y = centre + radius * math.sin(angle)
        points.append((x, y))
    return points


def _font_size(value: Any) -> int:
    if not 0 < int(value) <= MAX_FONT_SIZE:
        raise PlanError(f"plan: font size {value!r} is not in 1..{MAX_FONT_SIZE}")
    return int(value)


def _edge(recipe: Mapping[str, Any], key: str = "edge") -> int:
    edge = int(recipe.get(key, 0))
    if not 0 <= edge <= MAX_EDGE:
        raise PlanError(f"plan: {key} {edge} of a sprite is not in 0..{MAX_EDGE}")
    return edge


def _texts(lines: object) -> list[str]:
    texts = cast("list[Any]", lines)
    if not isinstance(lines, list) or not all(isinstance(text, str) for text in texts):
        raise PlanError(f"plan: the lines of a sprite must be strings, got {short_repr(texts)}")
    return texts


def _text_masks(recipe: Mapping[str, Any]) -> list[UInt8Array]:
    """Return the coverage of centred lines, uint8 `[h, w]`: the fill's, and any outline's."""
    font = load_font(recipe["font"], _font_size(recipe["size"]))
    edge = _edge(recipe)
    lines = _texts(recipe["lines"])
    margin = _edge(recipe, "margin")
    step = line_height(font) + 2 * edge
    # `font.getlength` gives the same, but overflows for lines of tens of millions of pixels.
    widths = [math.ceil(line_width(line, font)) + 2 * edge for line in lines]
    wide = max(1, *widths, 1)
    tall = max(1, step * len(widths))
    masks: list[UInt8Array] = []
    for stroke in (0, edge) if edge else (0,):
        image = canvas("L", wide + 2 * margin, tall + 2 * margin)
        draw = ImageDraw.Draw(image)
        y = edge + margin
        for line, width in zip(lines, widths, strict=True):
            x = (wide - width) // 2 + edge + margin
            draw.text((x, y), line, fill=255, font=font, stroke_width=stroke)
            y += step
        masks.append(np.array(image))
    return masks


def _draw_text(recipe: Mapping[str, Any]) -> Sprite:
    fill, *outline = _text_masks(recipe)
    color = rgb(recipe["color"])
    edge_color = rgb(recipe["edge_color"])
    box = _full_box(fill)
    if not outline:
        return Sprite.from_layer(Layer(box, (fill,), (color,)))
    edge_cover = np.multiply(outline[0], 255 - fill, dtype=np.uint16)
    edge_cover += 127
    edge_cover //= 255
    covers = (fill, edge_cover.astype(np.uint8))
    return Sprite.from_layer(Layer(box, covers, (color, edge_color)))


def _draw_window(recipe: Mapping[str, Any]) -> Sprite:
    """Draw a window: its edge, then for each panel a filled box and lines of text.

    Raises:
        PlanError: the size is out of range, or the lines of text hold too many pixels.
    """
    width, height = (int(side) for side in recipe["size"])
    edge = _edge(recipe)
    check_area(width, height)
    ink = rgb(recipe["color"])
    around = rgb(recipe["edge_color"])
    size = (height, width)
    holes: list[Box] = []
    layers: list[Layer] = []
    text = 0
    for panel in recipe["panels"]:
        lines = _panel_lines(panel, str(recipe["font"]), ink, size)
        inside = _panel_inside(panel, edge, size)
        fill = rgb(panel["fill"])
        if _has_pixels(inside):
            layers.append(Layer(inside, colors=(fill,)))
            holes.append(inside)
        for line in lines:
            text += _memory_bytes(line.covers[0])
            if text > SPRITE_PIXELS:
                raise PlanError(f"plan: a window's text has over {SPRITE_PIXELS} pixels")
            layers.append(line)
    edges = [Layer(box, colors=(around,)) for box in _subtract_boxes((0, 0, width, height), holes)]
    return Sprite(size, (*edges, *layers), opaque=True)


def _panel_inside(panel: Mapping[str, Any], edge: int, size: Size) -> Box:
    """Return the box of a panel without its edge, clipped to a window of `size`."""
    x1, y1, x2, y2 = (int(v) for v in panel["box"])
    left, top, right, bottom = _inset(x1, y1, x2, y2, edge)
    height, width = size
    return left, top, min(right, width), min(bottom, height)


def _panel_lines(panel: Mapping[str, Any], name: str, ink: Color, size: Size) -> Iterator[Layer]:
    """Yield the lines of a panel, centred in its box."""
    x1, y1, x2, y2 = (int(v) for v in panel["box"])
    font_size = _font_size(panel["font_size"])
    lines = _texts(panel["lines"])
    font = load_font(name, font_size)
    step = line_height(font)
    y = (y1 + y2 - step * len(lines)) // 2
    for line in lines:
        x = (x1 + x2 - math.ceil(line_width(line, font))) // 2
        layer = _line_layer((line, name, font_size), (x, y), ink, size)
        if layer is not None:
            yield layer
        y += step


def _has_pixels(box: Box) -> bool:
    x1, y1, x2, y2 = box
    return x1 < x2 and y1 < y2


def _subtract_boxes(area: Box, holes: list[Box]) -> list[Box]:
    """Return boxes that cover `area` except for the holes, which are painted over anyway."""
    remaining = [area]
    for hole in holes:
        parts = [part for box in remaining for part in _subtract_box(box, hole)]
        remaining = [box for box in parts if _has_pixels(box)]
    return remaining


def _subtract_box(box: Box, hole: Box) -> tuple[Box, ...]:
    """Return boxes, some of them empty, that cover `box` except for the hole."""
    x1, y1, x2, y2 = hole
    left, upper, right, lower = box
    top = min(max(y1, upper), lower)
    bottom = max(min(y2, lower), upper)
    if x1 >= right or x2 <= left or top >= bottom:
        return (box,)
    return (
        (left, upper, right, top),
        (left, bottom, right, lower),
        (left, top, max(left, x1), bottom),
        (min(x2, right), top, right, bottom),
    )


def _line_layer(text: tuple[str, str, int], at: Point, ink: Color, size: Size) -> Layer | None:
    """Return the layer of a line with its corner at `at`.

    Parts outside the sprite are cut off. Returns `None` for a line without pixels inside.
    """
    mask, (left, top) = line_mask(*text)
    height, width = size
    x = at[0] + left
    y = at[1] + top
    rows = slice(max(0, -y), max(0, height - y))
    columns = slice(max(0, -x), max(0, width - x))
    mask = mask[rows, columns]
    if not mask.size:
        return None
    x = max(0, x)
    y = max(0, y)
    h, w = mask.shape
    return Layer((x, y, x + w, y + h), (mask,), (ink,))


def _memory_bytes(mask: UInt8Array) -> int:
    """Return how many bytes a mask keeps in memory; it may be a view of a larger array."""
    return mask.nbytes if mask.base is None else cast(UInt8Array, mask.base).nbytes


def _inset(x1: int, y1: int, x2: int, y2: int, edge: int) -> Box:
    """Return a box without its edge, clipped at 0; empty if the edge fills it."""
    if x2 - x1 <= 2 * edge or y2 - y1 <= 2 * edge:
        return 0, 0, 0, 0
    return max(0, x1 + edge), max(0, y1 + edge), max(0, x2 - edge), max(0, y2 - edge)


def _draw_png(recipe: Mapping[str, Any]) -> Sprite:
    try:
        data = base64.b64decode(recipe["data"], validate=True)
    except binascii.Error as error:
        raise PlanError(f"plan: the 'png' sprite does not hold base64: {error}") from None
    check_area(*_png_size(data))
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            pixels = np.array(image.convert("RGBA"))
    except Exception as error:  # Pillow may raise any exception for damaged bytes
        raise PlanError(f"plan: the 'png' sprite does not hold a readable PNG: {error}") from error
    return _rgba_sprite(pixels)


def _png_size(data: bytes) -> tuple[int, int]:
    """Return the width and height from the first chunk of a PNG, without decoding it.

    Raises:
        PlanError: the data is not a PNG file, or is cut off.
    """
    if len(data) < 24 or not data.startswith(PNG_HEADER):
        raise PlanError("plan: the 'png' sprite is not a PNG file, or is cut off")
    return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])


def _draw_asset(recipe: Mapping[str, Any]) -> Sprite:
    pixels = find_asset(recipe["id"], recipe["sha256"]).pixels()
    crop = recipe.get("crop")
    if crop is not None:
        x1, y1, x2, y2 = (operator.index(v) for v in crop)
        height, width = pixels.shape[:2]
        if not (0 <= x1 < x2 <= width and 0 <= y1 < y2 <= height):
            raise PlanError(f"plan: crop {crop} leaves {recipe['id']}, {width}x{height}")
        pixels = pixels[y1:y2, x1:x2]
    if pixels.shape[2] == 4:
        return _rgba_sprite(pixels)
    return Sprite.from_layer(Layer(_full_box(pixels), picture=np.ascontiguousarray(pixels)))


def _rgba_sprite(pixels: UInt8Array) -> Sprite:
    alpha = pixels[..., 3].copy()
    colors = pixels[..., :3]
    if (alpha == 255).all():
        return Sprite.from_layer(Layer(_full_box(alpha), picture=np.ascontiguousarray(colors)))
    paint = colors.astype(np.uint16) * alpha[..., None].astype(np.uint16)
    return Sprite.from_layer(Layer(_full_box(alpha), (alpha,), picture=paint))


def png_recipe(rgba: UInt8Array) -> dict[str, Any]:
    """Return the `png` recipe of an RGBA picture, uint8 `[h, w, 4]`: for a plug-in's own pixels.

    Raises:
        ImageTypeError: the array is not uint8.
        ImageError: the array has another shape, or more than `limits.SPRITE_PIXELS` pixels.
    """
    if not isinstance(cast(object, rgba), np.ndarray) or rgba.dtype != np.uint8:
        kind = str(getattr(rgba, "dtype", type(rgba).__name__))
        raise ImageTypeError(f"png_recipe takes a uint8 array, got {kind}")
    if rgba.ndim != 3 or rgba.shape[2] != 4 or not 0 < rgba.size <= 4 * SPRITE_PIXELS:
        expected = f"[h, w, 4] of 1 to {SPRITE_PIXELS} pixels"
        raise ImageError(f"png_recipe takes RGBA, {expected}, got the shape {list(rgba.shape)}")
    buffer = io.BytesIO()
    Image.fromarray(rgba, "RGBA").save(buffer, "PNG")
    return {"draw": "png", "data": base64.b64encode(buffer.getvalue()).decode()}


_DRAW: dict[str, Callable[[Mapping[str, Any]], Sprite]] = {
    "mark": _draw_mark,
    "text": _draw_text,
    "window": _draw_window,
    "png": _draw_png,
    "asset": _draw_asset,
}
