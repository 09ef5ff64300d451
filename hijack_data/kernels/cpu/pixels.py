"""Paste and resample for pictures in memory: uint8 `[H, W, 3]`, any strides.

Contiguous pictures in either channel order are fast. With Numba, the compiled kernel resizes as
soon as that pays off (`jit.worthwhile`); until then, and without Numba, `resample_plain` does.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from ...drawing.sprite import Sprite, draw
from ...limits import PIXELS_AT_ONCE
from ...resample import columns_first
from ...types import Int32Array, Size, UInt8Array
from ..stamps import Stamp
from . import jit, resize

LINE = 64  # bytes of a cache line
RESAMPLE_SAVED_MS_PER_BYTE = 3e-6  # milliseconds that the compiled kernel saves a byte


@dataclass(frozen=True, eq=False, kw_only=True)
class _Form:
    """The painted pixels of a sprite, the opaque ones (`solid`) and the others (`soft`).

    Places are rows and columns from the top-left corner, int32 `[n, 2]`; values have the three
    channels of each pixel in succession, `[3 n]`.
    """

    solid_at: Int32Array
    solid: UInt8Array
    soft_at: Int32Array
    keep: npt.NDArray[np.uint32]
    paint: npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Offsets:
    """The offsets of a form's bytes from its corner, `[3 n]`, in pictures of certain strides."""

    strides: tuple[int, ...]
    solid: npt.NDArray[np.intp]
    soft: npt.NDArray[np.intp]


def empty_like(image: UInt8Array) -> UInt8Array:
    """Return a new array of the same shape and memory layout, not filled.

    It begins on a cache line, so that JAX can take over the memory.
    """
    if not image.flags.c_contiguous:
        return np.empty_like(image, subok=False)
    memory = np.empty(image.size + LINE, np.uint8)
    start = -memory.ctypes.data % LINE
    return memory[start : start + image.size].reshape(image.shape)


def paste(image: UInt8Array, stamps: list[Stamp]) -> UInt8Array:
    """Stamp sprites into `image`, in order, in place; return it.

    What is opaque is copied as slices; only what is not opaque is blended.
    """
    flat = _flat(image)
    for stamp in stamps:
        h, w = stamp.sprite.size
        if stamp.sprite.opaque:
            block = _block(stamp.sprite, image.strides)
            for area in _areas(image, stamp):
                area[:] = block
        elif flat is None or h * w > PIXELS_AT_ONCE:
            for area in _areas(image, stamp):
                draw(stamp.sprite.layers, area)
        else:
            _paste_soft(flat, image.strides, stamp)
    return image


def _areas(image: UInt8Array, stamp: Stamp) -> Iterator[UInt8Array]:
    """Yield the areas of a picture that a stamp covers, as views."""
    h, w = stamp.sprite.size
    for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
        yield image[y : y + h, x : x + w]


def _paste_soft(flat: UInt8Array, strides: tuple[int, ...], stamp: Stamp) -> None:
    """Blend the pixels of a sprite into the bytes of a picture with these strides."""
    form = _form(stamp.sprite)
    at = _offsets(stamp.sprite, strides)
    for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
        corner = y * strides[0] + x * strides[1]
        _blend(flat[corner:], form, at)


def _flat(image: UInt8Array) -> UInt8Array | None:
    """Return the bytes of the picture as a flat writable view.

    Returns `None` if the picture is not one block of memory.
    """
    for axes in ((0, 1, 2), (2, 0, 1)):
        view = image.transpose(axes)
        if view.flags.c_contiguous:
            return view.reshape(-1)
    return None


def _block(sprite: Sprite, strides: tuple[int, ...]) -> UInt8Array:
    """Return the colours of an opaque sprite in the channel order of a picture with these strides.

    The sprite caches them.
    """
    planar = strides[1] < strides[2]
    block = sprite.scratch.get(("block", planar))
    if block is None:
        h, w = sprite.size
        if planar:
            block = np.empty((3, h, w), np.uint8).transpose(1, 2, 0)
        else:
            block = np.empty((h, w, 3), np.uint8)
        draw(sprite.layers, block)
        sprite.scratch["block", planar] = block
    return block


def _form(sprite: Sprite) -> _Form:
    """Return the form of a sprite, which caches it."""
    form = sprite.scratch.get("form")
    if form is None:
        form = _make_form(sprite)
        sprite.scratch["form"] = form
    return form


def _make_form(sprite: Sprite) -> _Form:
    dy, dx, keep, paint = sprite.pixels
    at = np.stack([dy, dx], axis=1)
    solid = keep == 0
    soft = keep != 0
    # Colours of opaque pixels are rounded, because a pixel on an edge may mix two colours.
    colors = ((paint[solid] + 127) // 255).astype(np.uint8)
    return _Form(
        solid_at=at[solid],
        solid=colors.reshape(-1),
        soft_at=at[soft],
        keep=np.repeat(keep[soft], 3).astype(np.uint32),
        paint=paint[soft].astype(np.uint32).reshape(-1) + 128,
    )


def _offsets(sprite: Sprite, strides: tuple[int, ...]) -> _Offsets:
    """Return where the form of a sprite lies in a picture with these strides.

    The sprite caches the last ones only, because the widths of pictures may vary without limit.
    """
    found = sprite.scratch.get("offsets")
    if found is None or found.strides != strides:
        form = _form(sprite)
        solid = _in_bytes(form.solid_at, strides)
        soft = _in_bytes(form.soft_at, strides)
        found = _Offsets(strides=strides, solid=solid, soft=soft)
        sprite.scratch["offsets"] = found
    return found


def _in_bytes(at: Int32Array, strides: tuple[int, ...]) -> npt.NDArray[np.intp]:
    pixels = at[:, 0].astype(np.intp) * strides[0]
    pixels += at[:, 1].astype(np.intp) * strides[1]
    channels = np.arange(3, dtype=np.intp) * strides[2]
    return (pixels[:, None] + channels).reshape(-1)


def _blend(below: UInt8Array, form: _Form, at: _Offsets) -> None:
    below[at.solid] = form.solid
    if at.soft.size:
        total = below[at.soft] * form.keep
        total += form.paint
        total += total >> 8
        below[at.soft] = (total >> 8).astype(np.uint8)


def resample(image: UInt8Array, size: Size) -> UInt8Array:
    """Resize to `size` (height, width); a new array in the same channel order."""
    if not jit.worthwhile(RESAMPLE_SAVED_MS_PER_BYTE * image.size):
        return resample_plain(image, size)
    return jit.call_with_fallback(
        lambda: resize.resample(image, size), lambda: resample_plain(image, size)
    )


def resample_plain(image: UInt8Array, size: Size) -> UInt8Array:
    """Resize as `resample` does, with Pillow instead of Numba."""
    height, width = image.shape[:2]
    picture = Image.fromarray(np.ascontiguousarray(image))
    between = (width, size[0]) if columns_first((height, width), size) else (size[1], height)
    # one pass per call, so that we decide the order and not Pillow
    for step in (between, (size[1], size[0])):
        picture = picture.resize(step, Image.Resampling.BICUBIC)
    return np.array(picture)
