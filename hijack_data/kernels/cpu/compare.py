"""Count the pixels in which two pictures in memory differ, with Numba or with NumPy.

The compiled kernel compares 64 bytes of a row at once, emitted as an LLVM vector, and gets a word
with one bit per byte. If the channels of a pixel are interleaved, three neighbouring bits are one
pixel, so a word has 21 pixels; if each channel is a plane of its own, the words of the three planes
together stand for 64 pixels.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

from ...types import BoxArray, UInt8Array, clip_boxes
from . import jit

Counter: TypeAlias = Callable[[UInt8Array, UInt8Array, BoxArray], int]

LANES = 64  # bytes compared at once
SAVES = 0.3  # milliseconds a picture
# rows to prefetch: no processor predicts accesses that far ahead in a small box
AHEAD = 2
EVERY = np.uint64(2**64 - 1)
PIXELS = np.uint64(sum(1 << bit for bit in range(0, LANES - 1, 3)))  # the first bit of each pixel
ONE = np.uint64(1)
TWO = np.uint64(2)
# NumPy compares bands of this many pixels, to stay in the cache. Areas up to the second number wide
# are compared pixel by pixel, wider ones as lines of bytes.
BAND = 1 << 15
NARROW = 128

# Set by _kernel() once Numba is loaded, because Numba looks globals up when it compiles.
_differ: Any = None
_population: Any = None
_separate: Any = None


def count(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    """Count the pixels inside given boxes in which two pictures of one size differ.

    The time grows with the square of the number of boxes: for more than some hundred, one box for
    the whole picture is quicker.

    Args:
        before: `[h, w, 3]`, of any strides.
        after: likewise.
        boxes: int32 `[n, 4]` (`xyxy`); they hold all pixels that can differ. They may overlap and
            stick out of the picture; each pixel counts once. Overlapping boxes are replaced by the
            box around them.
    """
    if not _readable(before, after) or not jit.worthwhile(SAVES):
        return _count_by_numpy(before, after, boxes)
    return jit.guarded(
        lambda: _kernel()(before, after, np.array(boxes, np.int32, order="C")),
        lambda: _count_by_numpy(before, after, boxes),
    )


def _readable(before: UInt8Array, after: UInt8Array) -> bool:
    """Return whether the compiled kernel can compare two pictures, by layout and width."""
    pixel = _pixel(before)
    return pixel > 0 and pixel == _pixel(after) and pixel * before.shape[1] >= LANES


def _pixel(image: UInt8Array) -> int:
    """Return the distance in bytes between neighbouring pixels: 3 or, for planes, 1.

    Returns 0 for a picture that the compiled kernel cannot read.
    """
    if image.dtype != np.uint8 or image.shape[2:] != (3,):
        return 0
    if image.strides[1] == 1:
        return 1
    return 3 if image.strides[1:] == (3, 1) else 0


def _count_by_numpy(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    inside = clip_boxes(boxes, before.shape[:2])
    holds_pixels = (inside[:, :2] < inside[:, 2:]).all(axis=1)
    apart = _disjoint(inside[holds_pixels])
    total = 0
    for x1, y1, x2, y2 in apart.tolist():
        total += _differing(before[y1:y2, x1:x2], after[y1:y2, x1:x2])
    return total


def _disjoint(boxes: BoxArray) -> BoxArray:
    """Replace overlapping boxes by the box around them until none overlap; no box may be empty."""
    while len(boxes) > 1:
        x1, y1, x2, y2 = boxes.T[:, :, None]
        touch = (x1 < x2.T) & (x2 > x1.T) & (y1 < y2.T) & (y2 > y1.T)
        # For each box, the first one that it overlaps, which may be itself.
        first = touch.argmax(axis=1)
        if (first == np.arange(len(boxes))).all():
            break
        low = boxes[:, :2].copy()
        high = boxes[:, 2:].copy()
        np.minimum.at(low, first, boxes[:, :2])
        np.maximum.at(high, first, boxes[:, 2:])
        boxes = np.concatenate([low, high], axis=1)[np.unique(first)]
    return boxes


def _differing(before: UInt8Array, after: UInt8Array) -> int:
    """Count the differing pixels of two `[h, w, 3]` areas, a band of rows at a time."""
    width = before.shape[1]
    band = max(1, BAND // width)
    packed = before.strides[1:] == after.strides[1:] == (3, 1)
    differ = _differ_in_lines if packed and width > NARROW else _differ_in_pixels
    total = 0
    for row in range(0, len(before), band):
        pixels = differ(before[row : row + band], after[row : row + band])
        total += int(np.count_nonzero(pixels))
    return total


def _differ_in_lines(before: UInt8Array, after: UInt8Array) -> Any:
    """Return which pixels differ, bool `[h, w]`, comparing whole lines of bytes.

    After the comparison, the result of each pixel is at its first byte.
    """
    differ = before.reshape(len(before), -1) != after.reshape(len(after), -1)
    pixels = differ[:, :-2] | differ[:, 1:-1]
    pixels |= differ[:, 2:]
    return pixels[:, ::3]


def _differ_in_pixels(before: UInt8Array, after: UInt8Array) -> Any:
    """Return which pixels differ, bool `[h, w]`."""
    differ = before != after
    pixels = differ[..., 0] | differ[..., 1]
    pixels |= differ[..., 2]
    return pixels


def _separate_in_place(boxes: BoxArray, height: int, width: int) -> int:
    """Clip boxes to the picture and make them disjoint as `_disjoint` does, in place.

    Returns the number of boxes that are left; they are at the beginning of the array.
    """
    kept = 0
    for i in range(len(boxes)):
        x1 = max(boxes[i, 0], 0)
        y1 = max(boxes[i, 1], 0)
        x2 = min(boxes[i, 2], width)
        y2 = min(boxes[i, 3], height)
        if x1 >= x2 or y1 >= y2:
            continue
        k = 0
        # the boxes kept so far are disjoint; those that overlap this box are merged into it
        while k < kept:
            across = x1 < boxes[k, 2] and x2 > boxes[k, 0]
            if across and y1 < boxes[k, 3] and y2 > boxes[k, 1]:
                x1 = min(x1, boxes[k, 0])
                y1 = min(y1, boxes[k, 1])
                x2 = max(x2, boxes[k, 2])
                y2 = max(y2, boxes[k, 3])
                kept -= 1
                for side in range(4):
                    boxes[k, side] = boxes[kept, side]
                k = 0
            else:
                k += 1
        boxes[kept, 0] = x1
        boxes[kept, 1] = y1
        boxes[kept, 2] = x2
        boxes[kept, 3] = y2
        kept += 1
    return kept


def _count(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    """Count as `count` does; the boxes are changed.

    The channels of the pictures are interleaved, or each is a plane.
    """
    height, width, _ = before.shape
    pixel = before.strides[1]
    line = width * pixel
    step = LANES // pixel * pixel
    one_ahead = AHEAD * before.strides[0]
    two_ahead = AHEAD * after.strides[0]
    total = 0
    for i in range(_separate(boxes, height, width)):
        left = boxes[i, 0] * pixel
        right = boxes[i, 2] * pixel
        for y in range(boxes[i, 1], boxes[i, 3]):
            one = before.ctypes.data + y * before.strides[0]
            two = after.ctypes.data + y * after.strides[0]
            for x in range(left, right, step):
                # at the end of a row the vector begins earlier, so as not to read beyond the row
                at = min(x, line - LANES)
                bits = _differ(one + at, two + at, one_ahead, two_ahead)
                if pixel == 1:
                    for channel in range(1, 3):
                        one_at = one + at + channel * before.strides[2]
                        two_at = two + at + channel * after.strides[2]
                        bits |= _differ(one_at, two_at, one_ahead, two_ahead)
                wanted = EVERY >> np.uint64(LANES - min(step, right - x))
                bits = bits >> np.uint64(x - at) & wanted
                if pixel == 3:
                    bits = (bits | bits >> ONE | bits >> TWO) & PIXELS
                total += _population(bits)
    return total


@jit.lazy("the compiled comparison")
def _kernel(numba: Any) -> Counter:
    """Compile `_count`, or load it from Numba's cache on disk."""
    global _differ, _population, _separate
    intrinsic: Any = import_module("numba.extending").intrinsic
    t: Any = numba.types
    picture = t.Array(t.uint8, 3, "A", readonly=True)
    boxes = t.int32[:, ::1]
    _differ = intrinsic(_emit_differ)
    _population = intrinsic(_emit_population)
    _separate = jit.compile_now(numba.njit, _separate_in_place, t.intp(boxes, t.intp, t.intp))
    return jit.compile_now(numba.njit, _count, t.int64(picture, picture, boxes))


def _emit_differ(context: Any, one: Any, two: Any, one_ahead: Any, two_ahead: Any) -> Any:
    """Emit the comparison of 64 bytes: bit `i` of a word is set if the bytes `i` differ.

    The cache lines `one_ahead` and `two_ahead` bytes ahead are prefetched, which is allowed even
    beyond the picture.
    """
    ir: Any = import_module("llvmlite.ir")
    t: Any = import_module("numba").types

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        i32 = ir.IntType(32)
        pointer = ir.PointerType()
        vector = ir.VectorType(ir.IntType(8), LANES)
        kind = ir.FunctionType(ir.VoidType(), [pointer, i32, i32, i32])
        prefetch = b.module.declare_intrinsic("llvm.prefetch", (pointer,), kind)
        for address, ahead in zip(args[:2], args[2:], strict=True):
            soon = b.inttoptr(b.add(address, ahead), pointer)
            b.call(prefetch, [soon, i32(0), i32(3), i32(1)])
        one = b.load(b.inttoptr(args[0], pointer), align=1, typ=vector)
        two = b.load(b.inttoptr(args[1], pointer), align=1, typ=vector)
        return b.bitcast(b.icmp_unsigned("!=", one, two), ir.IntType(LANES))

    return t.uint64(*[t.intp] * 4), emit


def _emit_population(context: Any, word: Any) -> Any:
    """Emit the count of the bits of a word that are set."""
    t: Any = import_module("numba").types

    def emit(_context: Any, b: Any, _signature: Any, args: Any) -> Any:
        return b.ctpop(args[0])

    return t.int64(t.uint64), emit
