"""Triton kernels: stamp the layers of many pictures, resize many pictures, one launch each. `device` calls them.

A launch covers pictures of any size and layout: a table of *jobs*, int64, tells where each one lies. The arithmetic is
that of every other kernel: gather, multiply-add in int32, shift, clip.
"""
# pyright: basic, reportOperatorIssue=false
# (the bodies are Triton's language, compiled for the device; as Python they have no types)

import triton
import triton.language as tl

from ..resample import PRECISION_BITS
from . import rows as r

# A tile of a picture is the work of one program.
TILE = (16, 128)
ROWS_AT_ONCE = 64  # rows whose boxes are compared with the tile together

PASTE_JOB = 8  # address, height, width, strides of channel, row and pixel, first row, end of rows
RESIZE_JOB = (
    13  # address and strides of the source, then of the result, its height and width, address of first, taps, count
)

_COLUMNS, _PASTE_JOB, _RESIZE_JOB = tl.constexpr(r.COLUMNS), tl.constexpr(PASTE_JOB), tl.constexpr(RESIZE_JOB)
_FILL, _INKS, _PICTURE, _PAINT = (tl.constexpr(kind) for kind in (r.FILL, r.INKS, r.PICTURE, r.PAINT))
_BITS = tl.constexpr(PRECISION_BITS)
_HALF = tl.constexpr(1 << (PRECISION_BITS - 1))


@triton.jit
def paste(jobs, rows, GROUP: tl.constexpr, TALL: tl.constexpr, WIDE: tl.constexpr):
    """Stamp the rows of one picture into one tile of it, in order; a tile that no row meets is not read."""
    job = jobs + tl.program_id(1) * _PASTE_JOB
    height, width = tl.load(job + 1).to(tl.int32), tl.load(job + 2).to(tl.int32)
    first, end = tl.load(job + 6).to(tl.int32), tl.load(job + 7).to(tl.int32)
    across = tl.cdiv(width, WIDE)
    top, left = tl.program_id(0) // across * TALL, tl.program_id(0) % across * WIDE
    met = 0
    for start in range(first, end, GROUP):
        number = start + tl.arange(0, GROUP)
        row, known = rows + number * _COLUMNS, number < end
        y, x = tl.load(row, mask=known, other=0), tl.load(row + 1, mask=known, other=0)
        bottom, right = y + tl.load(row + 2, mask=known, other=0), x + tl.load(row + 3, mask=known, other=0)
        meets = known & (y < top + TALL) & (bottom > top) & (x < left + WIDE) & (right > left)
        met += tl.sum(meets.to(tl.int32), axis=0)
    if (met > 0) & (top < height):
        _paste_tile(job, rows, first, end, top, left, height, width, TALL, WIDE)


@triton.jit
def _paste_tile(job, rows, first, end, top, left, height, width, TALL: tl.constexpr, WIDE: tl.constexpr):
    ys, xs = top + tl.arange(0, TALL)[:, None], left + tl.arange(0, WIDE)[None, :]
    image = tl.load(job).to(tl.pointer_type(tl.uint8))
    channel = tl.load(job + 3)
    at = image + ys * tl.load(job + 4) + xs * tl.load(job + 5)
    inside = (ys < height) & (xs < width)
    red = tl.load(at, mask=inside, other=0).to(tl.int32)
    green = tl.load(at + channel, mask=inside, other=0).to(tl.int32)
    blue = tl.load(at + 2 * channel, mask=inside, other=0).to(tl.int32)
    for number in range(first, end):
        row = rows + number * _COLUMNS
        y, x = ys - tl.load(row).to(tl.int32), xs - tl.load(row + 1).to(tl.int32)
        here = inside & (y >= 0) & (y < tl.load(row + 2)) & (x >= 0) & (x < tl.load(row + 3))
        kind = tl.broadcast_to(tl.load(row + 4), (1, WIDE))  # a mask is a tensor
        a_color, b_color = tl.load(row + 9).to(tl.int32), tl.load(row + 10).to(tl.int32)
        a = tl.load(row + 5).to(tl.pointer_type(tl.uint8)) + y * tl.load(row + 6) + x
        b = y * tl.load(row + 8)
        second = tl.load(row + 7).to(tl.pointer_type(tl.uint8))
        deep = tl.load(row + 7).to(tl.pointer_type(tl.uint16)) + b + 3 * x
        alpha = tl.load(a, mask=here & (kind != _FILL) & (kind != _PICTURE), other=255).to(tl.int32)
        other = tl.load(second + b + x, mask=here & (kind == _INKS), other=0).to(tl.int32)
        keep, shown, painted = 255 - alpha - other, here & (kind == _PICTURE), here & (kind == _PAINT)
        color = second + b + 3 * x
        red = _blend(red, keep, alpha, other, a_color >> 16, b_color >> 16, color, deep, shown, painted, here)
        green = _blend(green, keep, alpha, other, a_color >> 8, b_color >> 8, color + 1, deep + 1, shown, painted, here)
        blue = _blend(blue, keep, alpha, other, a_color, b_color, color + 2, deep + 2, shown, painted, here)
    tl.store(at, red.to(tl.uint8), mask=inside)
    tl.store(at + channel, green.to(tl.uint8), mask=inside)
    tl.store(at + 2 * channel, blue.to(tl.uint8), mask=inside)


@triton.jit
def _blend(below, keep, alpha, other, a_color, b_color, color, deep, shown, painted, here):
    """Blend one channel; exactly one of inks, picture and paint adds anything."""
    total = below * keep + alpha * (a_color & 255) + other * (b_color & 255) + 128
    total += tl.load(color, mask=shown, other=0).to(tl.int32) * 255
    total += tl.load(deep, mask=painted, other=0).to(tl.int32)
    return tl.where(here, (total + (total >> 8)) >> 8, below)


@triton.jit
def resize(jobs, ALONG_ROWS: tl.constexpr, TALL: tl.constexpr, WIDE: tl.constexpr):
    """One pass of a resize for one tile of one channel of one result: along its rows, or else along its columns."""
    job, plane = jobs + tl.program_id(1) * _RESIZE_JOB, tl.program_id(2).to(tl.int64)
    height, width = tl.load(job + 8).to(tl.int32), tl.load(job + 9).to(tl.int32)
    across = tl.cdiv(width, WIDE)
    top, left = tl.program_id(0) // across * TALL, tl.program_id(0) % across * WIDE
    if top < height:
        rows, columns = top + tl.arange(0, TALL), left + tl.arange(0, WIDE)
        ys, xs = rows[:, None], columns[None, :]
        inside = (ys < height) & (xs < width)
        first = tl.load(job + 10).to(tl.pointer_type(tl.int32))
        taps = tl.load(job + 11).to(tl.pointer_type(tl.int32))
        count, step_y, step_x = tl.load(job + 12).to(tl.int32), tl.load(job + 2), tl.load(job + 3)
        source = tl.load(job).to(tl.pointer_type(tl.uint8)) + plane * tl.load(job + 1)
        if ALONG_ROWS:
            along, known, step = columns, columns < width, step_x
            source += ys * step_y + (tl.load(first + along, mask=known, other=0) * step)[None, :]
        else:
            along, known, step = rows, rows < height, step_y
            source += xs * step_x + (tl.load(first + along, mask=known, other=0) * step)[:, None]
        total = tl.full((TALL, WIDE), _HALF, tl.int32)
        for k in range(count):
            weight = tl.load(taps + along * count + k, mask=known, other=0)
            weight = weight[None, :] if ALONG_ROWS else weight[:, None]
            total += tl.load(source + k * step, mask=inside, other=0).to(tl.int32) * weight
        value = tl.minimum(tl.maximum(total >> _BITS, 0), 255).to(tl.uint8)
        result = tl.load(job + 4).to(tl.pointer_type(tl.uint8)) + plane * tl.load(job + 5)
        tl.store(result + ys * tl.load(job + 6) + xs * tl.load(job + 7), value, mask=inside)
