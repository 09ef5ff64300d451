"""Paste and resample as JAX programs: uint8 `[H, W, 3]`, every call returns a new array.

They are used on devices other than the CPU and in traced code; the conformance suite also runs them
on the CPU.

Shapes that vary from plan to plan (the number of painted pixels, the sides of a block) are padded
to powers of two, so that a new text or size does not cause a new compilation: for a picture of
1920x1080 there are at most 25 block sizes and a dozen pixel counts. The first operation on a
picture copies it; later ones write into that copy (donation).
"""

from collections.abc import Callable
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
RESIZE_BLOCK_ROWS = 64
_jax: Any = jax  # JAX leaves many types unknown


def compilations() -> int:
    """Return how many programs were compiled for pasting and resizing in this process."""
    programs = (_paste_block, _paste_block_into, _paste_pixels, _paste_pixels_into, _resize_pass)
    return sum(int(program._cache_size()) for program in programs)


def paste(image: Any, stamps: list[Stamp]) -> Any:
    """Stamp sprites, in order; return a new array."""
    donatable = False  # whether `image` is our own copy, which may be donated
    for stamp in stamps:
        if not len(stamp.ys):
            continue
        if stamp.sprite.opaque:
            image = _paste_opaque(image, stamp, donatable)
        else:
            image = _paste_soft(image, stamp, donatable)
        donatable = True
    return image


def _paste_opaque(image: Any, stamp: Stamp, donatable: bool) -> Any:
    for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
        run = _paste_block_into if donatable else _paste_block
        image = run(
            image, *padded_block(stamp.sprite, y, x, image.shape, (MIN_BLOCK_SIDE, MIN_BLOCK_SIDE))
        )
        donatable = True
    return image


def _paste_soft(image: Any, stamp: Stamp, donatable: bool) -> Any:
    step = at_once(stamp.sprite)
    for i in range(0, len(stamp.ys), step):
        ys = stamp.ys[i : i + step]
        xs = stamp.xs[i : i + step]
        run = _paste_pixels_into if donatable else _paste_pixels
        image = run(image, *_padded_pixels(stamp.sprite, ys, xs, image.shape))
        donatable = True
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


def blend_block(batch: Any, b: Any, top: Any, left: Any, colors: Any, inside: Any) -> Any:
    """Return a batch, in whose picture `b` a window at `top, left` has new colours.

    They are those inside `(y1, x1, y2, x2)` of the window.
    """
    window = (1, *colors.shape[:2], 1)
    y = _jax.lax.broadcasted_iota(jnp.int32, window, 1)
    x = _jax.lax.broadcasted_iota(jnp.int32, window, 2)
    mask = (y >= inside[0]) & (x >= inside[1]) & (y < inside[2]) & (x < inside[3])
    place = (b, top, left, 0)
    below = jax.lax.dynamic_slice(batch, place, (1, *colors.shape))
    return jax.lax.dynamic_update_slice(batch, jnp.where(mask, colors[None], below), place)


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


def blend_pixels(batch: Any, b: Any, index: Any, keep: Any, paint: Any) -> Any:
    """Blend single pixels of picture `b`, each at most once; positions beyond it are left out."""
    flat = batch.reshape(len(batch), -1, 3)
    below = flat.at[b, index].get(mode="fill", fill_value=0).astype(jnp.int32)
    total = below * keep.astype(jnp.int32) + paint.astype(jnp.int32) + 128
    value = ((total + (total >> 8)) >> 8).astype(jnp.uint8)
    return flat.at[b, index].set(value, mode="drop").reshape(batch.shape)


def _on_one(blend: Callable[..., Any], **options: Any) -> Any:
    """Compile a function of a batch for one picture."""

    def blend_one(image: Any, *arrays: Any) -> Any:
        return blend(image[None], 0, *arrays)[0]

    return _jax.jit(blend_one, **options)


_paste_block = _on_one(blend_block)
_paste_block_into = _on_one(blend_block, donate_argnums=0)
_paste_pixels = _on_one(blend_pixels)
_paste_pixels_into = _on_one(blend_pixels, donate_argnums=0)


def resample(image: Any, size: Size) -> Any:
    """Resize to `size`, (height, width)."""
    height, width = image.shape[:2]
    axes = (0, 1) if columns_first((height, width), size) else (1, 0)
    for axis in axes:
        if image.shape[axis] != size[axis]:
            table = weights(image.shape[axis], size[axis])
            image = _resize_pass(image, table.index, table.taps, np.int32(size[axis]), axis=axis)
    return image


def resize_pass(image: Any, index: Any, taps: Any, rows: Any, axis: int) -> Any:
    """Make one pass along `axis`: multiply-add in int32, shift, clip.

    The result has as many lines as the tables, of which the first `rows` (int32) are computed, in
    blocks. Two things are for XLA's CPU code: the lines that are added up are contiguous, because
    single pixels are not picked in vectors, and the loop keeps XLA from computing the pass before
    anew for every tap.
    """
    if axis == 1:
        return resize_pass(image.swapaxes(0, 1), index, taps, rows, 0).swapaxes(0, 1)
    lines = image.reshape(len(image), -1)
    side, count = taps.shape
    height = min(side, RESIZE_BLOCK_ROWS)

    def block(n: Any, out: Any) -> Any:
        top = jnp.minimum(n * height, side - height)  # the last block overlaps the one before
        at = _jax.lax.dynamic_slice_in_dim(index, top, height)
        weight = _jax.lax.dynamic_slice_in_dim(taps, top, height)
        total = jnp.int32(1 << (PRECISION_BITS - 1))
        for k in range(count):
            values = jnp.take(lines, at[:, k], axis=0, mode="clip").astype(jnp.int32)
            total = total + values * weight[:, k, None]
        result = jnp.clip(total >> PRECISION_BITS, 0, 255).astype(jnp.uint8)
        return _jax.lax.dynamic_update_slice_in_dim(out, result, top, 0)

    out: Any = jnp.zeros((side, lines.shape[1]), jnp.uint8)  # pyright: ignore[reportUnknownMemberType]
    blocks = (rows + height - 1) // height
    return _jax.lax.fori_loop(0, blocks, block, out).reshape(side, *image.shape[1:])


_resize_pass = _jax.jit(resize_pass, static_argnames="axis")
