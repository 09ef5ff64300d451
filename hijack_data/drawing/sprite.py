"""Sprites: `raster` draws them from recipes, and the kernels stamp them.

A sprite is a stack of layers; everything else is derived from them. Every kernel understands
layers: a box, and colours that are blended into it through masks. A window is a few filled boxes
    with lines of text, a mark is one mask with one colour, so neither has to be drawn as a picture
    before it is stamped.
"""

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from ..limits import PIXELS_AT_ONCE
from ..types import Box, UInt8Array

Color: TypeAlias = tuple[int, int, int]
UInt16Array: TypeAlias = npt.NDArray[np.uint16]
# Bytes per pixel. An opaque sprite has its colours in three layouts and a mask; any other sprite
# has its masks and its paint and, for each painted pixel, `pixels` and the cache of `kernels.cpu`.
OPAQUE_BYTES = 10
BYTES = 10
PAINTED_BYTES = 71


@dataclass(frozen=True, eq=False)
class Layer:
    """Colours blended into a box.

    A byte `d` of a channel becomes `(t + (t >> 8)) >> 8`, the exact rounding of a blend, with
    `t = d * (255 - sum of covers) + sum of cover * colour + 128`. A layer without a cover is
    opaque.

    Args:
        box: `(x1, y1, x2, y2)` in pixels of the sprite, not empty and inside it.
        covers: at most two masks uint8 `[h, w]`, rows contiguous, whose sum is at most 255.
        colors: one colour per cover, or the one of an opaque layer. Empty if `picture` is given.
        picture: uint8 `[h, w, 3]` colours of an opaque layer, or uint16 colours * cover of a layer
            with one cover; rows contiguous.
    """

    box: Box
    covers: tuple[UInt8Array, ...] = ()
    colors: tuple[Color, ...] = ()
    picture: UInt8Array | UInt16Array | None = None

    @property
    def size(self) -> tuple[int, int]:
        """`(height, width)` in pixels."""
        x1, y1, x2, y2 = self.box
        return y2 - y1, x2 - x1

    def part(self, box: Box) -> "Layer | None":
        """Return the part inside a box of the sprite as a view; the box's corner becomes (0, 0)."""
        left, top, right, bottom = self.box
        x1 = max(left, box[0])
        y1 = max(top, box[1])
        x2 = min(right, box[2])
        y2 = min(bottom, box[3])
        if x1 >= x2 or y1 >= y2:
            return None
        rows = slice(y1 - top, y2 - top)
        columns = slice(x1 - left, x2 - left)
        covers = tuple(cover[rows, columns] for cover in self.covers)
        picture = None if self.picture is None else self.picture[rows, columns]
        inside = (x1 - box[0], y1 - box[1], x2 - box[0], y2 - box[1])
        return Layer(inside, covers, self.colors, picture)

    @property
    def alpha(self) -> UInt8Array:
        """Opacity, uint8 `[h, w]`."""
        if not self.covers:
            return np.broadcast_to(np.uint8(255), self.size)
        if len(self.covers) == 1:
            return self.covers[0]
        first, second = self.covers
        return first + second

    @property
    def paint(self) -> UInt16Array:
        """Colour * opacity (0..65025), uint16 `[h, w, 3]`."""
        if self.picture is not None:
            if self.covers:
                return cast(UInt16Array, self.picture)
            return self.picture.astype(np.uint16) * 255
        covers = self.covers or (self.alpha,)
        parts: list[UInt16Array] = []
        for cover, rgb in zip(covers, self.colors, strict=True):
            color = np.array(rgb, np.uint16)
            parts.append(cover[..., None].astype(np.uint16) * color)
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]


@dataclass(frozen=True, eq=False)
class Sprite:
    """A picture to stamp, with one opacity per pixel.

    Args:
        size: `(height, width)` in pixels.
        layers: the bottom layer first. A sprite that is not opaque everywhere has a single layer of
            its own size.
        opaque: whether every pixel is opaque.
        whole: the sprite of which this one is a part, if any.
        scratch: a cache for the backends' own forms of the sprite, such as tensors on a device.
    """

    size: tuple[int, int]
    layers: tuple[Layer, ...]
    opaque: bool
    whole: "Sprite | None" = None
    scratch: dict[Any, Any] = field(default_factory=dict[Any, Any], repr=False)

    @classmethod
    def from_layer(cls, layer: Layer) -> "Sprite":
        """Return a sprite with a single layer."""
        for array in (*layer.covers, layer.picture):
            if array is not None:
                array.setflags(write=False)
        opaque = bool((layer.alpha == 255).all())
        return cls(layer.size, (layer,), opaque)

    @cached_property
    def fingerprint(self) -> str:
        """16 hexadecimal digits of the SHA-256 of the pixels; a part has that of the whole sprite.

        It takes 1 ms for 1.5 MB.
        """
        if self.whole is not None:
            return self.whole.fingerprint
        if self.rgb is not None:
            return _fingerprint([self.rgb])
        (layer,) = self.layers
        return _fingerprint(chain([self.alpha], (band.paint for band in _bands(layer))))

    @property
    def footprint(self) -> int:
        """The most bytes that the sprite can take, with all caches for the CPU."""
        height, width = self.size
        area = height * width
        if self.opaque:
            return area * OPAQUE_BYTES
        painted = int(np.count_nonzero(self.alpha))
        return area * BYTES + painted * PAINTED_BYTES

    @cached_property
    def alpha(self) -> UInt8Array:
        """Opacity, uint8 `[h, w]`."""
        if self.opaque:
            return np.broadcast_to(np.uint8(255), self.size)
        return self.layers[0].alpha

    @cached_property
    def rgb(self) -> UInt8Array | None:
        """The colours of a sprite that is opaque everywhere, uint8 `[h, w, 3]`, or `None`."""
        if not self.opaque:
            return None
        pixels = np.zeros((*self.size, 3), np.uint8)
        draw(self.layers, pixels)
        pixels.setflags(write=False)
        return pixels

    @cached_property
    def paint(self) -> UInt16Array:
        """Colour * alpha (0..65025), uint16 `[h, w, 3]`."""
        if self.rgb is None:
            return self.layers[0].paint
        return self.rgb.astype(np.uint16) * 255

    @cached_property
    def pixels(
        self,
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], UInt8Array, UInt16Array]:
        """The pixels that are not fully transparent.

        They are given as `dy [n]`, `dx [n]`, `keep = 255 - alpha [n]` and `paint [n, 3]`.
        """
        dy, dx = np.nonzero(self.alpha)
        keep = 255 - self.alpha[dy, dx]
        paint = self.paint[dy, dx]
        return dy.astype(np.int32), dx.astype(np.int32), keep, paint

    @cached_property
    def uniform(self) -> bool:
        """Whether all painted pixels are opaque and of one colour, so stamps need no order."""
        if self.rgb is not None:
            return bool((self.rgb == self.rgb[:1, :1]).all())
        (layer,) = self.layers
        soft = (layer.alpha != 0) & (layer.alpha != 255)
        if soft.any():
            return False
        if layer.picture is None and len(layer.colors) == 1:
            return True
        paint = self.paint[self.alpha != 0]
        return bool((paint == paint[:1]).all())

    def crop(self, top: int, left: int, bottom: int, right: int) -> "Sprite":
        """Return the part of the sprite inside these bounds; its pixels are not copied."""
        parts = [layer.part((left, top, right, bottom)) for layer in self.layers]
        layers = tuple(layer for layer in parts if layer is not None)
        return Sprite((bottom - top, right - left), layers, self.opaque, self.whole or self)


def _fingerprint(arrays: Iterable[npt.NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(cast(Any, np.ascontiguousarray(array)))
    return digest.hexdigest()[:16]


def draw(layers: tuple[Layer, ...], pixels: UInt8Array) -> None:
    """Draw layers over `pixels`, uint8 `[h, w, 3]` of any strides, in place."""
    for plane, channels in _planes(pixels):
        per = channels.stop - channels.start
        for layer in layers:
            for band in _bands(layer):
                x1, y1, x2, y2 = band.box
                _blend(plane[y1:y2, per * x1 : per * x2], band, channels)


def _bands(layer: Layer) -> Iterator[Layer]:
    """Yield a layer in bands of rows, because blending takes many times a band's memory."""
    x1, y1, x2, y2 = layer.box
    rows = max(1, PIXELS_AT_ONCE // (x2 - x1))
    if y2 - y1 <= rows:
        yield layer
        return
    for top in range(y1, y2, rows):
        part = layer.part((0, top, x2, top + rows))
        if part is not None:
            box = x1, top, x2, top + part.size[0]
            yield Layer(box, part.covers, part.colors, part.picture)


def _planes(pixels: UInt8Array) -> list[tuple[UInt8Array, slice]]:
    """Return flat views of a picture to draw on, and the number of channels in each.

    There is one view of whole lines, or one view for each channel. Whole lines of bytes are drawn
    20 times as fast as single pixels.
    """
    if pixels.strides[1:] == (3, 1):
        return [(pixels.reshape(len(pixels), -1), slice(0, 3))]
    return [(pixels[..., c], slice(c, c + 1)) for c in range(3)]


def _blend(below: UInt8Array, layer: Layer, channels: slice) -> None:
    """Blend one layer into its box of a flat picture, `[h, w * channels]`."""
    height, width = layer.size
    per = channels.stop - channels.start
    picture = layer.picture
    if picture is not None:
        picture = picture[..., channels].reshape(height, width * per)
    colors = [np.tile(np.array(color[channels], np.uint8), width) for color in layer.colors]
    if not layer.covers:
        below[:] = colors[0] if picture is None else picture
        return
    total = np.multiply(below, _per_byte(255 - layer.alpha, per), dtype=np.uint16)
    if picture is not None:
        total += picture
    for cover, color in zip(layer.covers, colors, strict=False):
        total += np.multiply(_per_byte(cover, per), color, dtype=np.uint16)
    total += 128  # at most 65153, so every step fits into 16 bits
    total += total >> 8
    np.right_shift(total, 8, out=below, casting="unsafe")


def _per_byte(mask: UInt8Array, channels: int) -> UInt8Array:
    """Repeat each pixel of a mask `[h, w]` for the channels that lie beside each other."""
    return mask if channels == 1 else np.repeat(mask, channels, axis=1)
