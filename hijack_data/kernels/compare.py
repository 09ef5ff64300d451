"""Counting the pixels in which two pictures on the CPU differ: compiled by Numba where it is there, else by NumPy.

The compiled way compares 64 bytes of a row at once, emitted as an LLVM vector, and gets a word with one bit a byte.
Where the channels of a pixel lie together, three neighbouring bits are one pixel, 21 pixels a word; where each channel
is a plane of its own, the words of the three planes are one word of 64 pixels.
"""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ..types import BoxArray, UInt8Array, clip_boxes
from . import jit

LANES = 64  # bytes compared at once
SAVES = 0.3  # milliseconds a picture
AHEAD = 2  # rows from which bytes are asked for before their turn: no processor guesses that far in a small box
EVERY, PIXELS = np.uint64(2**64 - 1), np.uint64(sum(1 << bit for bit in range(0, LANES - 1, 3)))
# NumPy compares bands of this many pixels, to stay in the cache: pixel by pixel areas up to so wide, wider ones as
# lines of bytes.
BAND, NARROW = 1 << 15, 128

# Bound by _kernel() once Numba is loaded: Numba looks globals up when it compiles.
_differ: Any = None
_population: Any = None
_separate: Any = None


def count(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    """Count the pixels in which two pictures of one size differ, looking at certain boxes only.

    `before` and `after` are `[h, w, 3]` of any strides, `boxes` int32 `[n, 4]` (`xyxy`) hold all pixels that can
    differ. They may overlap and stick out; a pixel counts once. Those that overlap are looked at as the box around
    them. The time grows with the square of `n`: for more than some hundred, one box for the whole picture is quicker.
    """
    pixel = _pixel(before)
    if pixel and pixel == _pixel(after) and pixel * before.shape[1] >= LANES and jit.worthwhile(SAVES):
        return _kernel()(before, after, np.array(boxes, np.int32, order="C"))
    return _count_by_numpy(before, after, boxes)


def _pixel(image: UInt8Array) -> int:
    """Return how many bytes lie from pixel to pixel: 3 or, for planes, 1; 0 for what the compiled way does not read."""
    if image.dtype != np.uint8 or image.shape[2:] != (3,):
        return 0
    return 1 if image.strides[1] == 1 else 3 * (image.strides[1:] == (3, 1))


def _count_by_numpy(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    inside = clip_boxes(boxes, before.shape[:2])
    apart = _disjoint(inside[(inside[:, :2] < inside[:, 2:]).all(axis=1)])
    return sum(_differing(before[y1:y2, x1:x2], after[y1:y2, x1:x2]) for x1, y1, x2, y2 in apart.tolist())


def _disjoint(boxes: BoxArray) -> BoxArray:
    """Replace boxes that overlap by the box around them until none do; no box may be empty."""
    while len(boxes) > 1:
        x1, y1, x2, y2 = boxes.T[:, :, None]
        touch = (x1 < x2.T) & (x2 > x1.T) & (y1 < y2.T) & (y2 > y1.T)
        first = touch.argmax(axis=1)  # the first box that each one overlaps, itself at the latest
        if (first == np.arange(len(boxes))).all():
            break
        low, high = boxes[:, :2].copy(), boxes[:, 2:].copy()
        np.minimum.at(low, first, boxes[:, :2])
        np.maximum.at(high, first, boxes[:, 2:])
        boxes = np.concatenate([low, high], axis=1)[np.unique(first)]
    return boxes


def _differing(before: UInt8Array, after: UInt8Array) -> int:
    """Count the differing pixels of two `[h, w, 3]` areas, a band of rows at a time."""
    total, band = 0, max(1, BAND // before.shape[1])
    lines = before.strides[1:] == after.strides[1:] == (3, 1) and before.shape[1] > NARROW
    for row in range(0, len(before), band):
        one, two = before[row : row + band], after[row : row + band]
        if lines:  # whole lines of bytes; of the bytes, every third one tells about all three of its pixel
            differ = one.reshape(len(one), -1) != two.reshape(len(two), -1)
            pixels = differ[:, :-2] | differ[:, 1:-1]
            pixels |= differ[:, 2:]
            pixels = pixels[:, ::3]
        else:
            differ = one != two
            pixels = differ[..., 0] | differ[..., 1]
            pixels |= differ[..., 2]
        total += int(np.count_nonzero(pixels))
    return total


def _separate_in_place(boxes: BoxArray, height: int, width: int) -> int:
    """Clip boxes to the picture and do what `_disjoint` does, in place; return how many are left, at the beginning."""
    kept = 0
    for i in range(len(boxes)):
        x1, y1 = max(boxes[i, 0], 0), max(boxes[i, 1], 0)
        x2, y2 = min(boxes[i, 2], width), min(boxes[i, 3], height)
        if x1 >= x2 or y1 >= y2:
            continue
        k = 0
        while k < kept:  # the boxes kept so far share no pixel; those that this one overlaps become part of it
            if x1 < boxes[k, 2] and x2 > boxes[k, 0] and y1 < boxes[k, 3] and y2 > boxes[k, 1]:
                x1, y1 = min(x1, boxes[k, 0]), min(y1, boxes[k, 1])
                x2, y2 = max(x2, boxes[k, 2]), max(y2, boxes[k, 3])
                kept -= 1
                for side in range(4):
                    boxes[k, side] = boxes[kept, side]
                k = 0
            else:
                k += 1
        boxes[kept, 0], boxes[kept, 1], boxes[kept, 2], boxes[kept, 3] = x1, y1, x2, y2
        kept += 1
    return kept


def _count(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    """Count as `count` does; the boxes are changed. A pixel's channels lie together, or each in a plane."""
    height, width, _ = before.shape
    pixel = before.strides[1]
    line, step = width * pixel, LANES // pixel * pixel
    ahead = AHEAD * before.strides[0], AHEAD * after.strides[0]
    total = 0
    for i in range(_separate(boxes, height, width)):
        left, right = boxes[i, 0] * pixel, boxes[i, 2] * pixel
        for y in range(boxes[i, 1], boxes[i, 3]):
            one, two = before.ctypes.data + y * before.strides[0], after.ctypes.data + y * after.strides[0]
            for x in range(left, right, step):
                at = min(x, line - LANES)  # at the end of a row the vector begins earlier, to read nothing beyond it
                bits = _differ(one + at, two + at, ahead[0], ahead[1])
                if pixel == 1:
                    for channel in range(1, 3):
                        plane = channel * before.strides[2], channel * after.strides[2]
                        bits |= _differ(one + at + plane[0], two + at + plane[1], ahead[0], ahead[1])
                bits = bits >> np.uint64(x - at) & EVERY >> np.uint64(LANES - min(step, right - x))
                if pixel == 3:
                    bits = (bits | bits >> np.uint64(1) | bits >> np.uint64(2)) & PIXELS
                total += _population(bits)
    return total


@cache
def _kernel() -> Callable[[UInt8Array, UInt8Array, BoxArray], int]:
    """Compile `_count`, or load it from Numba's cache on disk."""
    global _differ, _population, _separate
    numba: Any = importlib.import_module("numba")
    intrinsic: Any = importlib.import_module("numba.extending").intrinsic
    t: Any = numba.types
    picture, boxes = t.Array(t.uint8, 3, "A", readonly=True), t.int32[:, ::1]
    _differ, _population = intrinsic(_emit_differ), intrinsic(_emit_population)
    _separate = jit.compile_now(numba.njit, _separate_in_place, t.intp(boxes, t.intp, t.intp))
    return jit.compile_now(numba.njit, _count, t.int64(picture, picture, boxes))


def _emit_differ(context: Any, one: Any, two: Any, one_ahead: Any, two_ahead: Any) -> Any:
    """Emit the word whose bit `i` tells whether byte `i` after the address `one` differs from that after `two`.

    The cache lines so many bytes ahead are asked for, which is allowed beyond a picture, too.
    """
    ir: Any = importlib.import_module("llvmlite.ir")
    t: Any = importlib.import_module("numba").types

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        byte, vector, i32 = ir.IntType(8).as_pointer(), ir.VectorType(ir.IntType(8), LANES).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, i32, i32, i32])
        prefetch = b.module.declare_intrinsic("llvm.prefetch", (byte,), kind)
        for address, ahead in zip(args[:2], args[2:], strict=True):
            b.call(prefetch, [b.inttoptr(b.add(address, ahead), byte), i32(0), i32(3), i32(1)])
        one, two = (b.load(b.inttoptr(address, vector), align=1) for address in args[:2])
        return b.bitcast(b.icmp_unsigned("!=", one, two), ir.IntType(LANES))

    return t.uint64(*[t.intp] * 4), emit


def _emit_population(context: Any, word: Any) -> Any:
    """Emit how many bits of a word are set."""
    t: Any = importlib.import_module("numba").types

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        return b.ctpop(args[0])

    return t.int64(t.uint64), emit
