"""NumPy kernels: uint8 `[H, W, 3]`, any strides; contiguous pictures in either channel order are fast."""

from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt
from PIL import Image

from ..resample import columns_first
from ..sprite import Sprite, draw
from ..types import Size, UInt8Array
from . import Stamp, compiled

# Masking a sprite's whole box beats addressing single bytes when the box is large and many of its pixels are opaque.
DENSE_SHARE, DENSE_AREA = 0.12, 128 * 128
LINE = 64  # bytes of a cache line


@dataclass(frozen=True, eq=False)
class _Form:
    """A sprite made ready for pictures of certain strides. Offsets are in bytes from the top-left corner."""

    solid_at: npt.NDArray[np.intp]
    solid: UInt8Array
    soft_at: npt.NDArray[np.intp]
    keep: npt.NDArray[np.uint32]
    paint: npt.NDArray[np.uint32]
    dense: tuple[UInt8Array, UInt8Array] | None


def empty_like(image: UInt8Array) -> UInt8Array:
    """A new array of the same shape and memory layout, not filled. It begins on a cache line, for JAX to take over."""
    if not image.flags.c_contiguous:
        return np.empty_like(image, subok=False)
    memory = np.empty(image.size + LINE, np.uint8)
    start = -memory.ctypes.data % LINE
    return memory[start : start + image.size].reshape(image.shape)


def paste(image: UInt8Array, stamps: list[Stamp]) -> UInt8Array:
    """Stamp sprites into `image`, in order, in place; return it."""
    flat = _flat(image)
    for stamp in stamps:
        sprite, (h, w) = stamp.sprite, stamp.sprite.size
        places = zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True)
        if sprite.opaque:
            for y, x in places:
                _paste_opaque(image[y : y + h, x : x + w], sprite)
        elif flat is None:
            for y, x in places:
                _paste_anywhere(image, sprite, y, x)
        else:
            form = _form(sprite, image.strides)
            for y, x in places:
                _paste_flat(image, flat, form, y, x)
    return image


def _flat(image: UInt8Array) -> UInt8Array | None:
    """Return the bytes of the picture as one writable line, or `None` when it is not one block of memory."""
    for axes in ((0, 1, 2), (2, 0, 1)):
        view = image.transpose(axes)
        if view.flags.c_contiguous:
            return view.reshape(-1)
    return None


def _ordered(array: UInt8Array, strides: tuple[int, ...]) -> UInt8Array:
    """Return the same array `[h, w, 3]`, laid out in memory in the channel order of a picture with these strides."""
    if strides[2] < strides[1]:
        return np.ascontiguousarray(array)
    return np.ascontiguousarray(array.transpose(2, 0, 1)).transpose(1, 2, 0)


def _paste_opaque(part: UInt8Array, sprite: Sprite) -> None:
    """Fill `part`, `[h, w, 3]`. A window is drawn right there the first time: most are never needed again."""
    if len(sprite.layers) > 1 and "drawn" not in sprite.scratch:
        sprite.scratch["drawn"] = True
        draw(sprite.layers, part)
    else:
        part[...] = _block(sprite, part.strides)


def _block(sprite: Sprite, strides: tuple[int, ...]) -> UInt8Array:
    key = "block-hwc" if strides[2] < strides[1] else "block-chw"
    if key not in sprite.scratch:
        sprite.scratch[key] = _ordered(cast(UInt8Array, sprite.rgb), strides)
    return sprite.scratch[key]


def _form(sprite: Sprite, strides: tuple[int, ...]) -> _Form:
    form = sprite.scratch.get(strides)
    if form is None:
        form = sprite.scratch[strides] = _make_form(sprite, strides)
    return form


def _make_form(sprite: Sprite, strides: tuple[int, ...]) -> _Form:
    dy, dx, keep, paint = sprite.pixels
    pixel = dy.astype(np.intp) * strides[0] + dx.astype(np.intp) * strides[1]
    at = pixel[:, None] + np.arange(3, dtype=np.intp) * strides[2]
    solid = keep == 0
    soft = ~solid
    dense = None
    if sprite.alpha.size >= DENSE_AREA and solid.sum() > DENSE_SHARE * sprite.alpha.size:
        dense = _dense(sprite, strides)
        solid = np.zeros_like(solid)
    return _Form(
        at[solid].reshape(-1),
        (paint[solid] // 255).astype(np.uint8).reshape(-1),
        at[soft].reshape(-1),
        np.repeat(keep[soft], 3).astype(np.uint32),
        paint[soft].astype(np.uint32).reshape(-1) + 128,
        dense,
    )


def _dense(sprite: Sprite, strides: tuple[int, ...]) -> tuple[UInt8Array, UInt8Array]:
    """Return masks `[h, w, 3]` in the picture's channel order: what survives below, and what opaque pixels add."""
    opaque = sprite.alpha == 255
    keep = np.broadcast_to(np.where(opaque, 0, 255).astype(np.uint8)[..., None], sprite.paint.shape)
    add = np.where(opaque[..., None], sprite.paint // 255, 0).astype(np.uint8)
    return _ordered(keep, strides), _ordered(add, strides)


def _paste_flat(image: UInt8Array, flat: UInt8Array, form: _Form, y: int, x: int) -> None:
    part = flat[y * image.strides[0] + x * image.strides[1] :]
    if form.dense is not None:
        keep, add = form.dense
        below = image[y : y + keep.shape[0], x : x + keep.shape[1]]
        np.bitwise_and(below, keep, out=below)
        np.bitwise_or(below, add, out=below)
    else:
        part[form.solid_at] = form.solid
    if form.soft_at.size:
        total = part[form.soft_at] * form.keep
        total += form.paint
        total += total >> 8
        part[form.soft_at] = (total >> 8).astype(np.uint8)


def _paste_anywhere(image: UInt8Array, sprite: Sprite, y: int, x: int) -> None:
    dy, dx, keep, paint = sprite.pixels
    total = image[dy + y, dx + x] * keep[:, None].astype(np.uint32) + paint + 128
    image[dy + y, dx + x] = ((total + (total >> 8)) >> 8).astype(np.uint8)


def resample(image: UInt8Array, size: Size) -> UInt8Array:
    """Resize to `size` (height, width); a new array in the same channel order."""
    if compiled.available():
        return compiled.resample(image, size)
    height, width = image.shape[:2]
    picture = Image.fromarray(np.ascontiguousarray(image))
    between = (width, size[0]) if columns_first((height, width), size) else (size[1], height)
    for step in (between, (size[1], size[0])):  # one pass a call, so that the order is ours and not Pillow's
        picture = picture.resize(step, Image.Resampling.BICUBIC)
    return np.array(picture)
