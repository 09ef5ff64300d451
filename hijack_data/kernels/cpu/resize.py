"""Pillow's bicubic resize compiled by Numba: the same bytes, about ten times as fast.

Both passes are one operation: the weighted sum of `n` vectors of bytes that lie a fixed stride
apart, rounded and clipped. Along columns the vectors are parts of rows. Along rows the picture is
transposed in blocks of `ROWS` rows, so that a vector holds one pixel column of the block, all three
channels of it.

Numba turns loops over these vectors into code that keeps the sums in memory and transposes byte by
byte. The two inner operations are therefore emitted as LLVM vectors, which LLVM fits to the machine
(AVX-512, AVX2, NEON). The sums are of integers, so their order cannot change a byte.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from ...errors import ImageError, ImageTypeError, ParameterError
from ...resample import PRECISION_BITS, Weights, columns_first, weights
from ...types import MAX_SIDE, Int32Array, Size, UInt8Array
from . import jit

ROWS = 16  # rows transposed at once: a 16x16 tile of bytes fits the registers of every vector unit
LANES = 3 * ROWS  # bytes summed at once: the three channels of one pixel column of a block

# Set by _kernel() once Numba is loaded, because Numba looks globals up when it compiles.
_weighted_sum: Any = None
_transpose: Any = None
_across: Any = None


def resample(image: UInt8Array, size: Size, threads: int = 1) -> UInt8Array:
    """Resize with Pillow's bicubic filter; the same bytes as `PIL.Image.resize((w, h), BICUBIC)`.

    A channels-first array viewed through `np.moveaxis(x, -3, -1)` gives a result with the same
    memory layout. Rows that are contiguous in memory are read in place, other layouts are copied
    first.

    Args:
        image: uint8 `[H, W, 3]` or a batch `[N, H, W, 3]`.
        size: `(h, w)` in pixels, 1 or more.
        threads: how many threads share the output rows, 1 or more.

    Returns:
        uint8 `[h, w, 3]` or `[N, h, w, 3]`.

    Raises:
        ImageTypeError: the picture is not uint8.
        ImageError: it has another shape or no pixels.
        ParameterError: `size` or `threads` is out of range.
        MissingDependencyError: Numba is not installed.
    """
    _check(image, size, threads)
    batch = image if image.ndim == 4 else image[None]
    count, height, width, _ = batch.shape
    channels_first = batch.strides[2] == 1 and batch.strides[3] != 1
    if channels_first:
        planes = np.moveaxis(batch, 3, 1)
    else:
        planes = batch.reshape(count, 1, height, width * 3)
    across = weights(width, size[1])
    down = weights(height, size[0])
    # a pass that keeps the size takes time but changes no byte; this is rare
    if columns_first((height, width), size):
        planes = _resize(planes, weights(width, width), down, threads)
        down = weights(size[0], size[0])
    resized = _resize(planes, across, down, threads)
    result = np.moveaxis(resized, 1, 3) if channels_first else resized.reshape(count, *size, 3)
    return result if image.ndim == 4 else result[0]


def _check(image: UInt8Array, size: Size, threads: int) -> None:
    if image.dtype != np.uint8:
        raise ImageTypeError(f"resample: the picture is {image.dtype}, not uint8; convert it first")
    if image.ndim not in (3, 4) or image.shape[-1] != 3 or 0 in image.shape:
        wanted = "give [H, W, 3] or [N, H, W, 3] with no side of 0"
        raise ImageError(f"resample: the shape is {image.shape}; {wanted}")
    if not all(1 <= side <= MAX_SIDE for side in size):
        wanted = f"give sides from 1 to {MAX_SIDE}"
        raise ParameterError(f"resample: the size (h, w) is {size}; {wanted}")
    if threads < 1:
        raise ParameterError(f"resample: threads is {threads}; give at least 1")


def _resize(batch: UInt8Array, across: Weights, down: Weights, threads: int) -> UInt8Array:
    """Resize `[N, planes, H, columns]` along rows, then columns.

    Three planes are channels, a single one holds all three.
    """
    band = _kernel()
    h = down.first.size
    columns = across.first.size * 3 // batch.shape[1]
    out = np.empty((*batch.shape[:2], h, max(columns, LANES)), np.uint8)

    def work(task: tuple[UInt8Array, UInt8Array, int, int]) -> None:
        source, to, top, bottom = task
        band(source, across.first, across.taps, down.first, down.taps, to, columns, top, bottom)

    parts = min(threads, h)
    edges = [h * i // parts for i in range(parts + 1)]
    tasks: list[tuple[UInt8Array, UInt8Array, int, int]] = []
    for planes, to in zip(batch, out, strict=True):
        source = _with_room(planes)
        tasks += [(source, to, top, bottom) for top, bottom in pairwise(edges)]
    if parts == 1:
        for task in tasks:
            work(task)
    else:  # a pool for each call, because threads do not survive a fork
        with ThreadPoolExecutor(parts) as pool:
            list(pool.map(work, tasks))
    return np.ascontiguousarray(out[..., :columns])


def _with_room(planes: UInt8Array) -> UInt8Array:
    """Return `[planes, H, columns]` with contiguous rows, padded to at least one tile.

    No weight reaches the padding.
    """
    count, height, columns = planes.shape
    if height >= ROWS and columns >= ROWS:
        return planes if planes.strides[2] == 1 else np.ascontiguousarray(planes)
    room = np.zeros((count, max(height, ROWS), max(columns, ROWS)), np.uint8)
    room[:, :height, :columns] = planes
    return room


def _block_across(
    source: UInt8Array,
    row: int,
    first: Int32Array,
    taps: Int32Array,
    block: UInt8Array,
    out: int,
    span: int,
    columns: int,
) -> None:
    """Resize `ROWS` rows of `source` from `row` on, along the rows.

    Plane `p` goes to the address `out + p * span`. `block` holds `[pixel, channel, ROWS]`, first of
    the input, then of the output. A column of a single plane is a channel of it, a column of one of
    three planes is a pixel: that is `step`.
    """
    planes, _, wide = source.shape
    plane, pitch, _ = source.strides
    step = planes * ROWS
    begin = block.ctypes.data
    for p in range(planes):
        for x in range(0, wide, ROWS):
            x = min(x, wide - ROWS)  # the last tile overlaps the one before
            corner = source.ctypes.data + p * plane + row * pitch + x
            _transpose(corner, pitch, begin + p * ROWS + x * step, step)
    n = taps.shape[1]
    result = begin + wide * step
    for x in range(first.size):
        weights_of_x = taps.ctypes.data + x * n * taps.itemsize
        _weighted_sum(begin + first[x] * LANES, LANES, weights_of_x, n, result + x * LANES)
    for p in range(planes):
        for x in range(0, columns, ROWS):
            _transpose(result + p * ROWS + x * step, step, out + p * span + x, planes * span)


def _band(
    source: UInt8Array,
    x_first: Int32Array,
    x_taps: Int32Array,
    y_first: Int32Array,
    y_taps: Int32Array,
    out: UInt8Array,
    columns: int,
    top: int,
    bottom: int,
) -> None:
    """Write rows `top` to `bottom` of `out` `[planes, h, >= columns]`.

    Rows resized along x are kept in a buffer that slides down the picture and stays in the
    processor's cache.
    """
    planes, height, wide = source.shape
    n = y_taps.shape[1]
    span = (columns + LANES + 7) // 8 * 8  # tiles and vectors may stick out to the right
    line = span * planes
    capacity = min(2 * n, height) + 2 * ROWS
    buffer = np.empty(capacity * line // 8, np.int64)
    lines = buffer.ctypes.data
    block = np.empty(((wide + columns) * planes + ROWS * 3) * ROWS, np.uint8)
    start = end = min(y_first[top], height - ROWS)  # the buffer holds input rows start to end
    for y in range(top, bottom):
        while end < y_first[y] + n:
            if end + ROWS - start > capacity:
                keep = min(y_first[y], height - ROWS)
                shift = (keep - start) * line // 8
                # a slice assignment would take seconds to compile
                for i in range((end - keep) * line // 8):
                    buffer[i] = buffer[i + shift]
                start = keep
            row = min(end, height - ROWS)  # the last block overlaps the one before
            to = lines + (row - start) * line
            _across(source, row, x_first, x_taps, block, to, span, columns)
            end = row + ROWS
        rows = lines + (y_first[y] - start) * line
        weights_of_y = y_taps.ctypes.data + y * n * y_taps.itemsize
        for p in range(planes):
            to = out.ctypes.data + p * out.strides[0] + y * out.strides[1]
            for x in range(0, columns, LANES):
                x = max(min(x, columns - LANES), 0)
                _weighted_sum(rows + p * span + x, line, weights_of_y, n, to + x)


@jit.compiled_on_first_use("the compiled resize")
def _kernel(numba: Any) -> Callable[..., None]:
    """Compile `_band`, or load it from Numba's cache on disk."""
    global _weighted_sum, _transpose, _across
    intrinsic: Any = import_module("numba.extending").intrinsic
    t: Any = numba.types
    source = t.Array(t.uint8, 3, "A", readonly=True)
    first = t.Array(t.int32, 1, "C", readonly=True)
    taps = t.Array(t.int32, 2, "C", readonly=True)
    out = t.Array(t.uint8, 3, "C")
    _weighted_sum = intrinsic(_emit_weighted_sum)
    _transpose = intrinsic(_emit_transpose)
    across = t.void(source, t.intp, first, taps, t.uint8[::1], t.intp, t.intp, t.intp)
    _across = jit.compile_now(numba.njit, _block_across, across)
    band = t.void(source, first, taps, first, taps, out, t.intp, t.intp, t.intp)
    return jit.compile_now(numba.njit, _band, band)


def _emit_weighted_sum(context: Any, source: Any, stride: Any, taps: Any, n: Any, out: Any) -> Any:
    """Emit one weighted sum.

    It computes `out[i] = clip((half + sum_k taps[k] * source[k * stride + i]) >> PRECISION_BITS)`
    for `i < LANES`.
    """
    ir: Any = import_module("llvmlite.ir")
    cgutils: Any = import_module("numba.core.cgutils")
    t: Any = import_module("numba").types
    i32 = ir.IntType(32)
    i64 = ir.IntType(64)
    pointer = ir.PointerType()
    # LLVM is slow with vectors whose length is not a power of two
    pixels = ir.VectorType(ir.IntType(8), ROWS)
    sums = ir.VectorType(i32, ROWS)
    parts = [i64(i) for i in range(0, LANES, ROWS)]
    half = sums([1 << PRECISION_BITS - 1] * ROWS)
    bits = sums([PRECISION_BITS] * ROWS)
    zero = sums([0] * ROWS)
    top = sums([255] * ROWS)

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        source, stride, taps, n, out = args

        def at(base: Any, offset: Any) -> Any:
            return b.inttoptr(b.add(base, offset), pointer)

        totals = [cgutils.alloca_once_value(b, half) for _ in parts]  # LLVM moves them to registers
        with cgutils.for_range(b, n) as tap:
            weight = b.load(at(taps, b.mul(tap.index, i64(4))), align=4, typ=i32)
            weight = b.shuffle_vector(b.insert_element(zero, weight, i32(0)), zero, zero)
            line = b.add(source, b.mul(tap.index, stride))
            for total, part in zip(totals, parts, strict=True):
                values = b.zext(b.load(at(line, part), align=1, typ=pixels), sums)
                sum_so_far = b.load(total, typ=sums)
                b.store(b.add(sum_so_far, b.mul(values, weight)), total)
        for total, part in zip(totals, parts, strict=True):
            value = b.ashr(b.load(total, typ=sums), bits)
            value = b.select(b.icmp_signed(">", value, zero), value, zero)
            value = b.select(b.icmp_signed("<", value, top), value, top)
            b.store(b.trunc(value, pixels), at(out, part), align=1)
        return _context.get_dummy_value()

    return t.void(*[t.intp] * 5), emit


def _emit_transpose(context: Any, source: Any, pitch: Any, out: Any, out_pitch: Any) -> Any:
    """Emit the transposition of a tile of `ROWS x ROWS` bytes."""
    ir: Any = import_module("llvmlite.ir")
    t: Any = import_module("numba").types
    i64 = ir.IntType(64)
    pointer = ir.PointerType()
    half = ROWS // 2
    pixels = ir.VectorType(ir.IntType(8), ROWS)
    lanes = ir.VectorType(ir.IntType(32), ROWS)
    orders = [[start + i // 2 + ROWS * (i % 2) for i in range(ROWS)] for start in (0, half)]
    zips = [lanes(order) for order in orders]

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        source, pitch, out, out_pitch = args

        def at(base: Any, stride: Any, i: int) -> Any:
            return b.inttoptr(b.add(base, b.mul(stride, i64(i))), pointer)

        lines = [b.load(at(source, pitch, i), align=1, typ=pixels) for i in range(ROWS)]
        # zipping the upper and the lower half log2(ROWS) times transposes
        for _ in range(ROWS.bit_length() - 1):
            zipped: list[Any] = []
            for i in range(ROWS):
                pair = lines[i // 2], lines[i // 2 + half]
                zipped.append(b.shuffle_vector(*pair, zips[i % 2]))
            lines = zipped
        for i, line in enumerate(lines):
            b.store(line, at(out, out_pitch, i), align=1)
        return _context.get_dummy_value()

    return t.void(*[t.intp] * 4), emit
