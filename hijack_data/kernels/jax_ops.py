"""Paste and resample as JAX programs: uint8 `[H, W, 3]`, every call returns a new array.

They are used on devices other than the CPU and in traced code; the conformance suite also runs them
on the CPU.

Shapes that vary from plan to plan (the number of painted pixels, the sides of a block) are padded
to powers of two, so that a new text or size does not cause a new compilation: for a picture of
1920x1080 there are at most 25 block sizes and a dozen pixel counts. The first operation on a
picture copies it; later ones write into that copy (donation).
"""

from typing import Any, TypeAlias, cast

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt

from ..drawing.sprite import Sprite
from ..resample import PRECISION_BITS, columns_first, weights
from ..types import Int32Array, Size
from .stamps import Stamp, at_once

# flat positions [n], keep [n], paint [n, 3]
StampedPixels: TypeAlias = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]

# the smallest side of a padded block, the smallest padded number of pixels
MIN_BLOCK_SIDE = 128
MIN_PADDED_PIXELS = 4096
_jax: Any = jax  # JAX leaves many types unknown


def compilations() -> int:
    """Return how many programs were compiled for pasting and resizing in this process."""
    programs = (_paste_block, _paste_block_into, _paste_pixels, _paste_pixels_into, _resize_pass)
    return sum(int(program._cache_size()) for program in programs)


def paste(image: Any, stamps: list[Stamp]) -> Any:
    """Stamp sprites, in order; return a new array."""
    ours = False  # whether `image` is our own copy, which may be donated
    for stamp in stamps:
        if not len(stamp.ys):
            continue
        if stamp.sprite.opaque:
            image = _paste_opaque(image, stamp, ours)
        else:
            image = _paste_soft(image, stamp, ours)
        ours = True
    return image


def _paste_opaque(image: Any, stamp: Stamp, ours: bool) -> Any:
    for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
        run = _paste_block_into if ours else _paste_block
        image = run(
            image, *padded_block(stamp.sprite, y, x, image.shape, (MIN_BLOCK_SIDE, MIN_BLOCK_SIDE))
        )
        ours = True
    return image


def _paste_soft(image: Any, stamp: Stamp, ours: bool) -> Any:
    step = at_once(stamp.sprite)
    for i in range(0, len(stamp.ys), step):
        ys = stamp.ys[i : i + step]
        xs = stamp.xs[i : i + step]
        run = _paste_pixels_into if ours else _paste_pixels
        image = run(image, *_padded_pixels(stamp.sprite, ys, xs, image.shape))
        ours = True
    return image


def power_of_two(n: int) -> int:
    """Return the least power of two that is at least `n`."""
    return 1 << (n - 1).bit_length()


def padded_block(
    sprite: Sprite, y: int, x: int, shape: tuple[int, ...], least: Size
) -> tuple[Any, ...]:
    """Return an opaque sprite in a window of padded size inside a picture of `shape`.

    The result is top, left, colours uint8 `[h, w, 3]`, and the box of the sprite in the window,
    `(y1, x1, y2, x2)` int32 `[4]`. `least` is the smallest (height, width) of the window.
    """
    h, w = sprite.size
    height = min(shape[0], max(least[0], power_of_two(h)))
    width = min(shape[1], max(least[1], power_of_two(w)))
    top = min(y, shape[0] - height)
    left = min(x, shape[1] - width)
    y1 = y - top
    x1 = x - left
    colors = np.zeros((height, width, 3), np.uint8)
    colors[y1 : y1 + h, x1 : x1 + w] = cast(Any, sprite.rgb)
    inside = np.array((y1, x1, y1 + h, x1 + w), np.int32)
    return np.int32(top), np.int32(left), colors, inside


def blend_block(image: Any, top: Any, left: Any, colors: Any, inside: Any) -> Any:
    """Return the picture with the colours inside `(y1, x1, y2, x2)` of a window at `top, left`."""
    window = (*colors.shape[:2], 1)
    y = _jax.lax.broadcasted_iota(jnp.int32, window, 0)
    x = _jax.lax.broadcasted_iota(jnp.int32, window, 1)
    mask = (y >= inside[0]) & (x >= inside[1]) & (y < inside[2]) & (x < inside[3])
    below = jax.lax.dynamic_slice(image, (top, left, 0), colors.shape)
    return jax.lax.dynamic_update_slice(image, jnp.where(mask, colors, below), (top, left, 0))


def stamped_pixels(sprite: Sprite, ys: Int32Array, xs: Int32Array, width: int) -> StampedPixels:
    """Return all pixels that a sprite paints at some places in a picture of that width.

    They are given as flat positions `[n]`, keep `[n]` and paint `[n, 3]`.
    """
    dy, dx, keep, paint = sprite.pixels
    rows = ys[:, None] + dy
    columns = xs[:, None] + dx
    at = (rows * width + columns).reshape(-1)
    return at, np.tile(keep, len(ys)), np.tile(paint, (len(ys), 1))


def _padded_pixels(
    sprite: Sprite, ys: Int32Array, xs: Int32Array, shape: tuple[int, ...]
) -> StampedPixels:
    """Return positions, keep and paint, padded with positions beyond the picture."""
    at, keep, paint = stamped_pixels(sprite, ys, xs, shape[1])
    count = len(at)
    bucket = max(MIN_PADDED_PIXELS, power_of_two(count))
    index = np.full(bucket, shape[0] * shape[1], np.int32)
    keeps = np.zeros((bucket, 1), np.uint8)
    paints = np.zeros((bucket, 3), np.uint16)
    index[:count] = at
    keeps[:count, 0] = keep
    paints[:count] = paint
    return index, keeps, paints


def blend_pixels(image: Any, index: Any, keep: Any, paint: Any) -> Any:
    """Blend single pixels, each at most once; positions beyond the picture are left out."""
    flat = image.reshape(-1, 3)
    below = flat.at[index].get(mode="fill", fill_value=0).astype(jnp.int32)
    total = below * keep.astype(jnp.int32) + paint.astype(jnp.int32) + 128
    value = ((total + (total >> 8)) >> 8).astype(jnp.uint8)
    return flat.at[index].set(value, mode="drop").reshape(image.shape)


_paste_block = _jax.jit(blend_block)
_paste_block_into = _jax.jit(blend_block, donate_argnums=0)
_paste_pixels = _jax.jit(blend_pixels)
_paste_pixels_into = _jax.jit(blend_pixels, donate_argnums=0)


def resample(image: Any, size: Size) -> Any:
    """Resize to `size`, (height, width)."""
    height, width = image.shape[:2]
    axes = (0, 1) if columns_first((height, width), size) else (1, 0)
    for axis in axes:
        if image.shape[axis] != size[axis]:
            table = weights(image.shape[axis], size[axis])
            image = _resize_pass(image, table.index, table.taps, axis=axis)
    return image


def resize_pass(image: Any, index: Any, taps: Any, axis: int) -> Any:
    """Make one pass along `axis`: multiply-add in int32, shift, clip."""
    shape = (1, -1, 1) if axis == 1 else (-1, 1, 1)
    total = jnp.int32(1 << (PRECISION_BITS - 1))
    for k in range(taps.shape[1]):
        values = jnp.take(image, index[:, k], axis=axis).astype(jnp.int32)
        total = total + values * taps[:, k].reshape(shape)
    return jnp.clip(total >> PRECISION_BITS, 0, 255).astype(jnp.uint8)


_resize_pass = _jax.jit(resize_pass, static_argnames="axis")
