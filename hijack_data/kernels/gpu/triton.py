"""Triton kernels: stamp the layers of many pictures, resize many pictures, one launch each.

`device` calls them. A launch covers pictures of any size and layout: a table of *jobs*, int64, has
the place of each one in memory. The arithmetic is that of every other kernel: gather, multiply-add
in int32, shift, clip.
"""

# pyright: basic, reportOperatorIssue=false
# (the bodies are in Triton's language, compiled for the device, and have no Python types)

import triton
import triton.language as tl

from ...resample import PRECISION_BITS
from .. import stamp_rows as r

# Size (height, width) of the tile of one program.
RESIZE_TILE = (8, 128)

# Columns of a job. Address, height, width, strides of channel, row and pixel, first row, end of
# rows.
PASTE_JOB = 8
# Address and strides of the source, then of the result, its height and width, addresses of first
# and taps, taps each.
RESIZE_JOB = 13

_COLUMNS, _PASTE_JOB, _RESIZE_JOB = (
    tl.constexpr(r.COLUMNS),
    tl.constexpr(PASTE_JOB),
    tl.constexpr(RESIZE_JOB),
)
_FILL, _INK, _INKS, _PICTURE = (tl.constexpr(kind) for kind in (r.FILL, r.INK, r.INKS, r.PICTURE))
_BITS = tl.constexpr(PRECISION_BITS)
_HALF = tl.constexpr(1 << (PRECISION_BITS - 1))


@triton.jit
def paste(jobs, rows, tiles, TALL: tl.constexpr, WIDE: tl.constexpr):
    """Stamp the rows of a picture into one tile of it, in order.

    `tiles` is int32 `[n, 3]`: picture, row and column of the tile.
    """
    tile = tiles + tl.program_id(0) * 3
    job = jobs + tl.load(tile) * _PASTE_JOB
    height = tl.load(job + 1).to(tl.int32)
    width = tl.load(job + 2).to(tl.int32)
    first = tl.load(job + 6).to(tl.int32)
    end = tl.load(job + 7).to(tl.int32)
    top = tl.load(tile + 1) * TALL
    left = tl.load(tile + 2) * WIDE
    ys = top + tl.arange(0, TALL)[:, None]
    xs = left + tl.arange(0, WIDE)[None, :]
    image = tl.load(job).to(tl.pointer_type(tl.uint8))
    channel = tl.load(job + 3)
    at = image + ys * tl.load(job + 4) + xs * tl.load(job + 5)
    inside = (ys < height) & (xs < width)
    red = tl.load(at, mask=inside, other=0).to(tl.int32)
    green = tl.load(at + channel, mask=inside, other=0).to(tl.int32)
    blue = tl.load(at + 2 * channel, mask=inside, other=0).to(tl.int32)
    for number in range(first, end):
        row = rows + number * _COLUMNS
        y0 = tl.load(row).to(tl.int32)
        x0 = tl.load(row + 1).to(tl.int32)
        tall = tl.load(row + 2).to(tl.int32)
        wide = tl.load(row + 3).to(tl.int32)
        if (y0 < top + TALL) & (y0 + tall > top) & (x0 < left + WIDE) & (x0 + wide > left):
            y = ys - y0
            x = xs - x0
            covered = inside & (y >= 0) & (y < tall) & (x >= 0) & (x < wide)
            a_color = tl.load(row + 9).to(tl.int32)
            b_color = tl.load(row + 10).to(tl.int32)
            kind = tl.load(row + 4)
            b_pitch = tl.load(row + 8).to(tl.int32)
            a = (
                tl.load(row + 5).to(tl.pointer_type(tl.uint8))
                + y * tl.load(row + 6).to(tl.int32)
                + x
            )
            if kind == _FILL:
                red = tl.where(covered, (a_color >> 16) & 255, red)
                green = tl.where(covered, (a_color >> 8) & 255, green)
                blue = tl.where(covered, a_color & 255, blue)
            elif kind == _INK:
                alpha = tl.load(a, mask=covered, other=0).to(tl.int32)
                red = _blend(red, 255 - alpha, alpha * ((a_color >> 16) & 255))
                green = _blend(green, 255 - alpha, alpha * ((a_color >> 8) & 255))
                blue = _blend(blue, 255 - alpha, alpha * (a_color & 255))
            elif kind == _INKS:
                b = tl.load(row + 7).to(tl.pointer_type(tl.uint8)) + y * b_pitch + x
                alpha = tl.load(a, mask=covered, other=0).to(tl.int32)
                b_alpha = tl.load(b, mask=covered, other=0).to(tl.int32)
                keep = 255 - alpha - b_alpha
                red = _blend(
                    red, keep, alpha * ((a_color >> 16) & 255) + b_alpha * ((b_color >> 16) & 255)
                )
                green = _blend(
                    green, keep, alpha * ((a_color >> 8) & 255) + b_alpha * ((b_color >> 8) & 255)
                )
                blue = _blend(blue, keep, alpha * (a_color & 255) + b_alpha * (b_color & 255))
            elif kind == _PICTURE:
                color = tl.load(row + 7).to(tl.pointer_type(tl.uint8)) + y * b_pitch + 3 * x
                red = tl.where(covered, tl.load(color, mask=covered, other=0).to(tl.int32), red)
                green = tl.where(
                    covered, tl.load(color + 1, mask=covered, other=0).to(tl.int32), green
                )
                blue = tl.where(
                    covered, tl.load(color + 2, mask=covered, other=0).to(tl.int32), blue
                )
            else:
                paint = tl.load(row + 7).to(tl.pointer_type(tl.uint16)) + y * b_pitch + 3 * x
                keep = 255 - tl.load(a, mask=covered, other=0).to(tl.int32)
                red = _blend(red, keep, tl.load(paint, mask=covered, other=0).to(tl.int32))
                green = _blend(green, keep, tl.load(paint + 1, mask=covered, other=0).to(tl.int32))
                blue = _blend(blue, keep, tl.load(paint + 2, mask=covered, other=0).to(tl.int32))
    tl.store(at, red.to(tl.uint8), mask=inside)
    tl.store(at + channel, green.to(tl.uint8), mask=inside)
    tl.store(at + 2 * channel, blue.to(tl.uint8), mask=inside)


@triton.jit
def _blend(below, keep, paint):
    """Blend with exact rounding; a byte stays unchanged if all of it is kept and nothing added."""
    total = below * keep + paint + 128
    return (total + (total >> 8)) >> 8


@triton.jit
def resize(jobs, ALONG_ROWS: tl.constexpr, TALL: tl.constexpr, WIDE: tl.constexpr):
    """Make one pass of a resize, along rows or along columns, for one tile of one channel."""
    job = jobs + tl.program_id(1) * _RESIZE_JOB
    plane = tl.program_id(2).to(tl.int64)
    height = tl.load(job + 8).to(tl.int32)
    width = tl.load(job + 9).to(tl.int32)
    across = tl.cdiv(width, WIDE)
    top = tl.program_id(0) // across * TALL
    left = tl.program_id(0) % across * WIDE
    if top < height:
        rows = top + tl.arange(0, TALL)
        columns = left + tl.arange(0, WIDE)
        ys = rows[:, None]
        xs = columns[None, :]
        inside = (ys < height) & (xs < width)
        first = tl.load(job + 10).to(tl.pointer_type(tl.int32))
        taps = tl.load(job + 11).to(tl.pointer_type(tl.int32))
        count = tl.load(job + 12).to(tl.int32)
        step_y = tl.load(job + 2)
        step_x = tl.load(job + 3)
        source = tl.load(job).to(tl.pointer_type(tl.uint8)) + plane * tl.load(job + 1)
        if ALONG_ROWS:
            along = columns
            valid = columns < width
            step = step_x
            source += ys * step_y + (tl.load(first + along, mask=valid, other=0) * step)[None, :]
        else:
            along = rows
            valid = rows < height
            step = step_y
            source += xs * step_x + (tl.load(first + along, mask=valid, other=0) * step)[:, None]
        total = tl.full((TALL, WIDE), _HALF, tl.int32)
        for k in range(count):
            weight = tl.load(taps + along * count + k, mask=valid, other=0)
            weight = weight[None, :] if ALONG_ROWS else weight[:, None]
            total += tl.load(source + k * step, mask=inside, other=0).to(tl.int32) * weight
        value = tl.minimum(tl.maximum(total >> _BITS, 0), 255).to(tl.uint8)
        result = tl.load(job + 4).to(tl.pointer_type(tl.uint8)) + plane * tl.load(job + 5)
        tl.store(result + ys * tl.load(job + 6) + xs * tl.load(job + 7), value, mask=inside)
