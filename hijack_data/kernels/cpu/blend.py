"""Pasting in memory: all layers of all stamps of a picture in one call, compiled by Numba.

A row of a layer is drawn in groups of 32 or 16 pixels, or pixel by pixel if it is narrower. A group
is three LLVM vectors of 32 or 16 bytes: one vector per channel if the channels of the picture are
planes, otherwise three vectors of interleaved pixels. The two cases differ only in how masks and
colours are shuffled into the vectors.

The last group of a row ends where the row ends; pixels that it shares with the group before are not
blended again.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

from ...types import UInt8Array

# Numba's cache notices changes of this file, but not of imported ones
from ..rows import FILL, INK, INKS, PAINT, PICTURE, StampRows
from . import jit

IrValue: TypeAlias = Any  # a value of LLVM, in the code that is being emitted

GROUPS = (32, 16, 1)  # pixels of a group: the largest that the row can fill is used
ABOVE_ALL = 2**62  # wider than any row

# Set by _kernel() once Numba is loaded, because Numba looks globals up when it compiles.
_packed: Any = None
_planar: Any = None
_strided: Any = None

_calls = 0  # calls that have succeeded


def paste(image: UInt8Array, rows: StampRows) -> None:
    """Draw rows into `image`, uint8 `[H, W, 3]` of any strides, in place.

    The rows are made by `rows_of` with `on_host`. Nothing is checked: they must lie inside the
    picture, and the arrays whose addresses they hold must be alive.

    Raises:
        MissingDependencyError: Numba is not installed.
    """
    global _calls
    _kernel()(image.ctypes.data, *image.strides, rows)
    _calls += 1


def has_run() -> bool:
    """Return whether the kernel has succeeded once, after which it cannot fail."""
    return _calls > 0


def _draw(picture: int, pitch: int, step: int, plane: int, rows: StampRows) -> None:
    """Draw rows into the picture at the memory address `picture`.

    `pitch`, `step` and `plane` are its strides in bytes; `rows` documents the columns.
    """
    for i in range(len(rows)):
        to = picture + rows[i, 0] * pitch + rows[i, 1] * step
        height = rows[i, 2]
        width = rows[i, 3]
        kind = rows[i, 4]
        a = rows[i, 5]
        b = rows[i, 7]
        b_pitch = rows[i, 8]
        if kind == PAINT:
            b_pitch = b_pitch * 2
        a_color = rows[i, 9]
        b_color = rows[i, 10]
        for _ in range(height):
            if step == 3 and plane == 1:
                _packed(kind, to, step, plane, a, b, a_color, b_color, width)
            elif step == 1:
                _planar(kind, to, step, plane, a, b, a_color, b_color, width)
            else:
                _strided(kind, to, step, plane, a, b, a_color, b_color, width)
            to += pitch
            a += rows[i, 6]
            b += b_pitch


@jit.lazy("the compiled paste")
def _kernel(numba: Any) -> Callable[..., None]:
    """Compile `_draw`, or load it from Numba's cache on disk."""
    global _packed, _planar, _strided
    intrinsic: Any = import_module("numba.extending").intrinsic
    _packed = intrinsic(_line(GROUPS, packed=True))
    _planar = intrinsic(_line(GROUPS, packed=False))
    _strided = intrinsic(_line(GROUPS[-1:], packed=False))
    t: Any = numba.types
    signature = t.void(t.intp, t.intp, t.intp, t.intp, t.int64[:, ::1])
    return jit.compile_now(numba.njit, _draw, signature)


def _line(groups: tuple[int, ...], packed: bool) -> Callable[..., Any]:
    """Make the Numba intrinsic that draws a line, which is one row of pixels of a layer.

    The line is drawn in the first group size in `groups` that is not wider than it. `to`, `a` and
    `b` are the addresses of its first pixel, of its mask, and of its second mask or its colours.
    """

    def line(
        context: Any,
        kind: Any,
        to: Any,
        step: Any,
        plane: Any,
        a: Any,
        b: Any,
        a_color: Any,
        b_color: Any,
        width: Any,
    ) -> Any:
        t: Any = import_module("numba").types

        def emit(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            above = ABOVE_ALL
            for lanes in groups:
                _Line(builder, args, lanes, packed).emit(above)
                above = lanes
            return context.get_dummy_value()

        return t.void(*[t.intp] * 9), emit

    return line


class _Line:
    """Emits the drawing of a line in groups of `lanes` pixels.

    `at` is where a group begins, in pixels of the line.
    """

    def __init__(self, builder: Any, args: Any, lanes: int, packed: bool) -> None:
        ir: Any = import_module("llvmlite.ir")
        self.i32 = ir.IntType(32)
        self.i64 = ir.IntType(64)
        self.bits = ir.IntType(lanes)
        self.vector = ir.VectorType
        self.bytes = ir.VectorType(ir.IntType(8), lanes)
        self.words = ir.VectorType(ir.IntType(16), lanes)
        self.pointer = ir.PointerType()
        self.builder = builder
        self.lanes = lanes
        self.packed = packed
        self.kind, self.to, self.step, self.plane, self.a, self.b, a_color, b_color, width = args
        self.width = width
        self._order()
        self.a_color = self.color(a_color)
        self.b_color = self.color(b_color)

    def _order(self) -> None:
        """Compute which pixel and which channel each byte of the three vectors belongs to."""
        lanes = self.lanes
        if self.packed:
            numbers = [range(k * lanes, (k + 1) * lanes) for k in range(3)]
            self.pixel_of = [[i // 3 for i in part] for part in numbers]
            self.channel_of = [[i % 3 for i in part] for part in numbers]
        else:
            self.pixel_of = [list(range(lanes)) for _ in range(3)]
            self.channel_of = [[k] * lanes for k in range(3)]

    def emit(self, above: int) -> None:
        """Emit a loop over the groups for each kind of layer.

        The code handles lines of at least one group and less than `above` pixels.
        """
        cgutils: Any = import_module("numba.core.cgutils")
        b = self.builder
        lanes = self.i64(self.lanes)
        enough = b.icmp_signed(">=", self.width, lanes)
        not_more = b.icmp_signed("<", self.width, self.i64(above))
        kinds = {
            FILL: self.fill,
            INK: self.ink,
            INKS: self.inks,
            PICTURE: self.copy,
            PAINT: self.paint,
        }
        with b.if_then(b.and_(enough, not_more)):
            for kind, group in kinds.items():
                is_kind = b.icmp_signed("==", self.kind, self.i64(kind))
                groups = cgutils.for_range_slice(b, self.i64(0), self.width, lanes)
                with b.if_then(is_kind), groups as (start, _):
                    last = b.sub(self.width, lanes)
                    at = b.select(b.icmp_signed("<", start, last), start, last)
                    group(at, b.sub(start, at))

    def fill(self, at: IrValue, _done: IrValue) -> None:
        """Emit one group of a `FILL`."""
        self.store(at, [self.builder.trunc(color, self.bytes) for color in self.a_color])

    def copy(self, at: IrValue, _done: IrValue) -> None:
        """Emit one group of a `PICTURE`."""
        self.store(at, self.colors(self.bytes, at))

    def ink(self, at: IrValue, done: IrValue) -> None:
        """Emit one group of an `INK`.

        Opaque groups, such as most of a mark, are stored without blending.
        """
        b = self.builder
        mask = self.mask(self.a, at, done)
        with b.if_then(self.differs(mask, 0)):
            not_opaque = self.differs(mask, 255)
            with b.if_else(not_opaque) as (mixed, opaque):
                with mixed:
                    cover = self.spread(mask)
                    self.blend(at, cover, self.times(cover, self.a_color))
                with opaque:
                    self.fill(at, done)

    def inks(self, at: IrValue, done: IrValue) -> None:
        """Emit one group of an `INKS`."""
        b = self.builder
        first = self.mask(self.a, at, done)
        second = self.mask(self.b, at, done)
        both = b.add(first, second)
        with b.if_then(self.differs(both, 0)):
            ones = self.times(self.spread(first), self.a_color)
            others = self.times(self.spread(second), self.b_color)
            added = [b.add(one, other) for one, other in zip(ones, others, strict=True)]
            self.blend(at, self.spread(both), added)

    def paint(self, at: IrValue, done: IrValue) -> None:
        """Emit one group of a `PAINT`."""
        b = self.builder
        none = self.words([0] * self.lanes)
        mask = self.mask(self.a, at, done)
        with b.if_then(self.differs(mask, 0)):
            cover = self.spread(mask)
            colors = self.colors(self.words, at)
            added: list[IrValue] = []
            for covered, color in zip(cover, colors, strict=True):
                uncovered = b.icmp_unsigned("==", covered, none)
                added.append(b.select(uncovered, none, color))
            self.blend(at, cover, added)

    def times(self, cover: list[IrValue], color: list[IrValue]) -> list[IrValue]:
        """Emit the products of vectors."""
        return [self.builder.mul(one, other) for one, other in zip(cover, color, strict=True)]

    def blend(self, at: IrValue, cover: list[IrValue], added: list[IrValue]) -> None:
        """Emit the blending of the three vectors of a group.

        It computes `d = (t + (t >> 8)) >> 8` with `t = d * (255 - cover) + added + 128` in 16 bits.
        """
        b = self.builder
        full = self.words([255] * self.lanes)
        half = self.words([128] * self.lanes)
        bits = self.words([8] * self.lanes)
        out: list[IrValue] = []
        for k in range(3):
            below = b.load(self.pixels(at, k), align=1, typ=self.bytes)
            kept = b.mul(b.zext(below, self.words), b.sub(full, cover[k]))
            total = b.add(b.add(kept, added[k]), half)
            rounded = b.lshr(b.add(total, b.lshr(total, bits)), bits)
            out.append(b.trunc(rounded, self.bytes))
        self.store(at, out)

    def mask(self, base: IrValue, at: IrValue, done: IrValue) -> IrValue:
        """Emit the loading of one group of a mask.

        The first `done` pixels, which are drawn already, become 0.
        """
        b = self.builder
        zeros = self.bytes([0] * self.lanes)
        count = b.trunc(done, self.bytes.element)
        counts = b.insert_element(zeros, count, self.i32(0))
        counts = b.shuffle_vector(counts, zeros, self.indices([0] * self.lanes))
        drawn = b.icmp_unsigned("<", self.bytes(list(range(self.lanes))), counts)
        return b.select(drawn, zeros, self.load(self.bytes, base, at))

    def store(self, at: IrValue, vectors: list[IrValue]) -> None:
        """Emit the writing of a group."""
        for k, vector in enumerate(vectors):
            self.builder.store(vector, self.pixels(at, k), align=1)

    def pixels(self, at: IrValue, k: int) -> IrValue:
        """Emit the address of vector `k` of a group in the picture."""
        b = self.builder
        offset = self.i64(k * self.lanes) if self.packed else b.mul(self.plane, self.i64(k))
        first = b.add(self.to, b.mul(at, self.step))
        return b.inttoptr(b.add(first, offset), self.pointer)

    def load(self, kind: Any, base: IrValue, offset: IrValue) -> IrValue:
        """Emit the reading of a vector."""
        b = self.builder
        address = b.inttoptr(b.add(base, offset), self.pointer)
        return b.load(address, align=1, typ=kind)

    def differs(self, mask: IrValue, value: int) -> IrValue:
        """Emit whether any byte of a mask differs from a value."""
        b = self.builder
        wanted = self.bytes([value] * self.lanes)
        bits = b.bitcast(b.icmp_unsigned("!=", mask, wanted), self.bits)
        return b.icmp_unsigned("!=", bits, self.bits(0))

    def spread(self, mask: IrValue) -> list[IrValue]:
        """Emit a mask in the pixel order of the three vectors, in 16 bits."""
        b = self.builder
        shuffled = [b.shuffle_vector(mask, mask, self.indices(part)) for part in self.pixel_of]
        return [b.zext(part, self.words) for part in shuffled]

    def color(self, value: IrValue) -> list[IrValue]:
        """Emit a colour 0xRRGGBB in the channel order of the three vectors, in 16 bits."""
        b = self.builder
        word = self.words.element
        channels = self.vector(word, 4)([0] * 4)
        for k in range(3):
            shifted = b.lshr(value, self.i64(16 - 8 * k))
            channel = b.trunc(b.and_(shifted, self.i64(255)), word)
            channels = b.insert_element(channels, channel, self.i32(k))
        orders = [self.indices(part) for part in self.channel_of]
        return [b.shuffle_vector(channels, channels, order) for order in orders]

    def colors(self, kind: Any, at: IrValue) -> list[IrValue]:
        """Emit the colours `b` of a group in the order of the three vectors."""
        b = self.builder
        size = kind.element.width // 8
        start = b.mul(at, self.i64(3 * size))
        found: list[IrValue] = []
        for k in range(3):
            offset = b.add(start, self.i64(k * self.lanes * size))
            found.append(self.load(kind, self.b, offset))
        if self.packed:
            return found
        return [self.plane_of(found, k) for k in range(3)]

    def plane_of(self, found: list[IrValue], k: int) -> IrValue:
        """Emit every third element from `k` on: of the first two vectors, then of the third."""
        b = self.builder
        n = self.lanes
        wanted = range(k, 3 * n, 3)
        from_two = [i % (2 * n) for i in wanted]
        from_third = [lane if i < 2 * n else i - n for lane, i in enumerate(wanted)]
        two = b.shuffle_vector(found[0], found[1], self.indices(from_two))
        return b.shuffle_vector(two, found[2], self.indices(from_third))

    def indices(self, lanes: list[int]) -> IrValue:
        """Return the constant that names the elements which `shuffle_vector` takes."""
        return self.vector(self.i32, len(lanes))(lanes)
