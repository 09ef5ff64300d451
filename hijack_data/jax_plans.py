"""Plans as JAX pytrees: packed on the host, applied inside your own `jax.jit`.

    packer = Packer((1080, 1920))

    @partial(jax.jit, donate_argnums=1)
    def train_step(state, images, plans):  # uint8 [B, H, W, 3]
        images = apply_arrays(plans, images)
        ...

    state = train_step(state, images, packer.pack([aug.plan(scene, seed=1, sample=key) for key in
    keys]))

A new text, size or number of marks must not cause a new compilation, so the shape of every array is
a static bucket. The buckets of a packer only grow, to powers of two, so after a few batches nothing
is compiled any more. The bytes are those of `hijack_data.apply`. Outside `jax.jit` none of this is
needed: `hijack_data.apply` takes JAX arrays.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any, cast

import jax
import numpy as np
import numpy.typing as npt

from . import resample
from .backends import find_backend
from .errors import ImageError, ImageTypeError, ParameterError, ParameterTypeError, short_repr
from .kernels import plan_stamps
from .kernels.jax_ops import (
    MIN_BLOCK_SIDE,
    MIN_PADDED_PIXELS,
    blend_block,
    blend_pixels,
    padded_block,
    power_of_two,
    resize_pass,
    stamped_pixels,
)
from .limits import PICTURE_PIXELS
from .plan import Paste, Plan
from .resample import weights
from .types import Size, as_size, size_text

_jax, jnp = cast(Any, jax), cast(Any, jax.numpy)  # JAX leaves many types unknown
_Array = npt.NDArray[Any]
Pixels = tuple[_Array, _Array, _Array]  # flat positions [n], keep [n], paint [n, 3]


@_jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Pastes:
    """The paint between two resizes of a batch of `B` pictures: blocks, then layers of pixels.

    `top`, `left` int32 `[B, N]`, `colors` uint8 `[B, N, h, w, 3]`, `inside` int32 `[B, N, 4]`;
    `index` int32 `[B, L, P]` into the canvas (its size means none), `keep` uint8 `[B, L, P, 1]`,
    `paint` uint16 `[B, L, P, 3]`. `blocks` and `layers`, int32 `[B]`, are the numbers of them that
    each picture has, so that no time is spent on others.
    """

    top: Any
    left: Any
    colors: Any
    inside: Any
    index: Any
    keep: Any
    paint: Any
    blocks: Any
    layers: Any


@_jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Resizes:
    """One resize of each picture of a batch.

    `kind` int32 `[B]` is 0 for none, 1 for rows first, 2 for columns first. The tables of the axis
    `a` are int32 `[B, side, K]`: positions in the canvas and weights, 0 beyond the result.
    """

    kind: Any
    index_y: Any
    taps_y: Any
    index_x: Any
    taps_x: Any


@_jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PlanArrays:
    """Plans of a batch as a pytree; `pastes` has one entry more than `resizes`.

    `size`, the (height, width) of the pictures, and `canvas`, that of the working area, are static.
    """

    pastes: tuple[Pastes, ...]
    resizes: tuple[Resizes, ...]
    size: Size = field(metadata={"static": True})
    canvas: Size = field(metadata={"static": True})


@dataclass
class _Stage:
    """The paint of one plan between two resizes."""

    blocks: list[tuple[Any, int, int]] = field(default_factory=list[Any])  # sprite, y, x
    layers: list[list[Pixels]] = field(default_factory=list["list[Pixels]"])


@dataclass
class Packer:
    """Packs plans for pictures of one size, `(height, width)`, into arrays whose shapes only grow.

    Every plan must leave the size as it is (`Resolution(restore=True)`): a batch has one shape.
    """

    size: Size
    _marks: dict[str, int] = field(default_factory=dict[str, int], init=False, repr=False)

    def __post_init__(self) -> None:
        self.size = as_size(self.size)

    def pack(self, plans: Sequence[Plan]) -> PlanArrays:
        """Return the plans of a batch, with NumPy arrays inside.

        JAX sends them to the device when your program is called.

        Raises:
            ParameterTypeError: `plans` is not a list of plans.
            ParameterError: there are no plans, or a plan is for another size, changes the size, or
                paints too much.
            PlanError: a plan draws differently here than where it was made.
        """
        if not isinstance(cast(object, plans), list | tuple):
            raise ParameterTypeError(f"pack takes a list of plans, got {type(plans).__name__}")
        if not plans:
            raise ParameterError("pack got no plans; give one for each picture of the batch")
        for i, plan in enumerate(plans):
            self._check(plan, i)
        canvas = self._canvas(plans)
        staged = [_stages(plan, canvas[1]) for plan in plans]
        count = self._bucket(
            "resizes", max((len(sizes) for _, sizes in staged), default=0), exact=True
        )
        pastes = tuple(
            self._pastes(
                [stages[i] if i < len(stages) else _Stage() for stages, _ in staged], i, canvas
            )
            for i in range(count + 1)
        )
        resizes = tuple(
            self._resizes([sizes[i] if i < len(sizes) else None for _, sizes in staged], i, canvas)
            for i in range(count)
        )
        return PlanArrays(pastes, resizes, self.size, canvas)

    def _check(self, plan: Plan, i: int) -> None:
        if not isinstance(cast(object, plan), Plan):
            raise ParameterTypeError(
                f"pack takes a list of plans, but item {i} is {short_repr(plan)}"
            )
        if plan.size != self.size:
            raise ParameterError(
                f"plan {i} was made for {size_text(plan.size)}, not for {size_text(self.size)}"
            )
        if plan.out_size != plan.size:
            raise ParameterError(
                f"plan {i} ({plan.corruption}) gives {size_text(plan.out_size)}, but a batch has"
                " one shape; use Resolution(restore=True)"
            )

    def _bucket(self, name: str, required: int, least: int = 0, exact: bool = False) -> int:
        """Return the bucket `name`: the largest need so far, rounded up to a power of two."""
        bucket = required if exact or required == 0 else max(least, power_of_two(required))
        self._marks[name] = max(self._marks.get(name, 0), bucket)
        return self._marks[name]

    def _canvas(self, plans: Sequence[Plan]) -> Size:
        """Return the size of the working area: the screen's, or more if a plan enlarges it."""
        sizes = [op.size for plan in plans for op in plan.ops if not isinstance(op, Paste)]
        height, width = (
            (
                side
                if (largest := max((s[axis] for s in sizes), default=0)) <= side
                else power_of_two(largest)
            )
            for axis, side in enumerate(self.size)
        )
        return self._bucket("height", height, exact=True), self._bucket("width", width, exact=True)

    def _pastes(self, stages: list[_Stage], number: int, canvas: Size) -> Pastes:
        name = f"stage {number}: "
        count = len(stages)
        sizes = [sprite.size for stage in stages for sprite, _, _ in stage.blocks]
        blocks = self._bucket(f"{name}blocks", max(len(stage.blocks) for stage in stages))
        shape = [
            min(
                side,
                self._bucket(
                    f"{name}side {axis}", max((s[axis] for s in sizes), default=0), MIN_BLOCK_SIDE
                ),
            )
            for axis, side in enumerate(canvas)
        ]
        top = np.zeros((count, blocks), np.int32)
        left = np.zeros((count, blocks), np.int32)
        colors, inside = (
            np.zeros((count, blocks, *shape, 3), np.uint8),
            np.zeros((count, blocks, 4), np.int32),
        )
        for b, stage in enumerate(stages):
            for n, (sprite, y, x) in enumerate(stage.blocks):
                block = padded_block(sprite, y, x, canvas, (shape[0], shape[1]))
                top[b, n], left[b, n], colors[b, n], inside[b, n] = block
        counts = np.array([(len(stage.blocks), len(stage.layers)) for stage in stages], np.int32).T
        return Pastes(
            top, left, colors, inside, *self._layers(stages, name, canvas), counts[0], counts[1]
        )

    def _layers(self, stages: list[_Stage], name: str, canvas: Size) -> Pixels:
        layers = self._bucket(f"{name}layers", max(len(stage.layers) for stage in stages))
        longest = max(
            (sum(len(at) for at, _, _ in layer) for stage in stages for layer in stage.layers),
            default=0,
        )
        shape = len(stages), layers, self._bucket(f"{name}pixels", longest, MIN_PADDED_PIXELS)
        index = np.full(shape, canvas[0] * canvas[1], np.int32)
        keep = np.zeros((*shape, 1), np.uint8)
        paint = np.zeros((*shape, 3), np.uint16)
        for b, stage in enumerate(stages):
            for n, layer in enumerate(stage.layers):
                at, coverage, painted = (
                    np.concatenate(parts) for parts in zip(*layer, strict=True)
                )
                index[b, n, : len(at)], keep[b, n, : len(at), 0], paint[b, n, : len(at)] = (
                    at,
                    coverage,
                    painted,
                )
        return index, keep, paint

    def _resizes(self, sizes: list[tuple[Size, Size] | None], number: int, canvas: Size) -> Resizes:
        kind = np.array(
            [0 if pair is None else 1 + resample.columns_first(*pair) for pair in sizes], np.int32
        )
        tables: list[_Array] = []
        for axis, side in enumerate(canvas):
            weight_tables = [
                None if pair is None else weights(pair[0][axis], pair[1][axis]) for pair in sizes
            ]
            largest = max(
                (table.taps.shape[1] for table in weight_tables if table is not None), default=0
            )
            width = self._bucket(f"resize {number}: {axis}", largest)
            index, taps = (
                np.zeros((len(sizes), side, width), np.int32),
                np.zeros((len(sizes), side, width), np.int32),
            )
            for b, table in enumerate(weight_tables):
                if table is not None:
                    rows, n = table.taps.shape
                    index[b, :rows, :n], taps[b, :rows, :n] = table.index, table.taps
            tables += [index, taps]
        return Resizes(kind, *tables)


def _stages(plan: Plan, width: int) -> tuple[list[_Stage], list[tuple[Size, Size]]]:
    """Split a plan at its resizes.

    Returns the paint before, between and after the resizes, and the sizes around each.
    """
    stages = [_Stage()]
    sizes = list[tuple[Size, Size]]()
    size = plan.size
    pixels = 0
    for number, op in enumerate(plan.ops):
        if not isinstance(op, Paste):
            sizes.append((size, op.size))
            stages.append(_Stage())
            size = op.size
            continue
        for stamp in plan_stamps(plan, number, size):
            if stamp.sprite.opaque:
                for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
                    _cover(stages[-1], stamp.sprite, y, x, width)
            else:
                pixels += len(stamp.ys) * len(stamp.sprite.pixels[0])
                _check_amount(pixels, plan)
                step = max(1, len(stamp.ys)) if stamp.sprite.uniform else 1
                for i in range(0, len(stamp.ys), step):
                    part = stamped_pixels(
                        stamp.sprite, stamp.ys[i : i + step], stamp.xs[i : i + step], width
                    )
                    _add(stages[-1].layers, part)
    for stage in stages:
        _check_amount(_block_pixels(stage), plan)
    return stages, sizes


def _check_amount(pixels: int, plan: Plan) -> None:
    if pixels > PICTURE_PIXELS:
        advice = "use fewer or smaller ones, or hijack_data.apply"
        raise ParameterError(f"{plan.corruption} paints too many pixels for a program; {advice}")


def _block_pixels(stage: _Stage) -> int:
    """Return how many pixels the blocks of a stage take: all are padded to the largest one."""
    sizes = [sprite.size for sprite, _, _ in stage.blocks]
    return len(sizes) * prod(
        max([MIN_BLOCK_SIDE, *(size[axis] for size in sizes)]) for axis in (0, 1)
    )


def _cover(stage: _Stage, sprite: Any, y: int, x: int, width: int) -> None:
    """Put an opaque block on top: pixels below it are removed, so blocks can be painted first."""
    h, w = sprite.size
    stage.blocks.append((sprite, y, x))
    for layer in stage.layers:
        for i, (at, keep, paint) in enumerate(layer):
            rows = at // width
            columns = at % width
            free = (rows < y) | (rows >= y + h) | (columns < x) | (columns >= x + w)
            layer[i] = at[free], keep[free], paint[free]


def _add(layers: list[list[Pixels]], part: Pixels) -> None:
    """Put pixels on top: into the last layer if they overlap none of its own, or into a new one."""
    if layers and not any(np.isin(part[0], at).any() for at, _, _ in layers[-1]):
        layers[-1].append(part)
    else:
        layers.append([part])


def apply_arrays(plans: PlanArrays, images: Any) -> Any:
    """Apply one packed plan to each of uint8 `[B, H, W, 3]`; a pure function, for use in `jax.jit`.

    Pictures are processed one after the other (`jax.lax.map`), so that only resized pictures cost
    the time of a resize. Donate `images` to your program if you don't need them any more. Raises
    `ImageTypeError` and `ImageError` for pictures whose dtype, size or number does not match the
    plans, and `ParameterTypeError` for plans that are not packed.
    """
    _check_images(plans, images)

    def apply_one(arrays: tuple[Any, Any, Any]) -> Any:
        pastes, resizes, image = arrays
        return _apply_one(pastes, resizes, image, plans.canvas)

    return _jax.lax.map(apply_one, (plans.pastes, plans.resizes, images))


def _check_images(plans: PlanArrays, images: Any) -> None:
    if not isinstance(cast(object, plans), PlanArrays):
        shape = type(plans).__name__
        raise ParameterTypeError(f"apply_arrays takes what Packer.pack returned, got {shape}")
    backend = find_backend(images)
    if backend.name == "torch":
        raise ImageTypeError("apply_arrays takes JAX arrays, got a tensor; use hijack_data.apply")
    backend.check(images)
    count = plans.pastes[0].blocks.shape[0]
    expected = (count, *plans.size, 3)
    if tuple(images.shape) != expected:
        packed_shape = (
            f"the plans are for {count} pictures of {size_text(plans.size)}, {list(expected)}"
        )
        shape = f"but images has the shape {list(images.shape)}"
        raise ImageError(
            f"{packed_shape}, {shape}; pack a plan for each, with a Packer of their size"
        )


def _apply_one(
    pastes: tuple[Pastes, ...], resizes: tuple[Resizes, ...], image: Any, canvas: Size
) -> Any:
    height, width = image.shape[:2]
    if canvas != (height, width):
        image = jnp.pad(image, ((0, canvas[0] - height), (0, canvas[1] - width), (0, 0)))
    for number, stage in enumerate(pastes):
        if number:
            image = _resize(resizes[number - 1], image)
        for n in range(stage.top.shape[0]):
            block = stage.top[n], stage.left[n], stage.colors[n], stage.inside[n]
            image = _jax.lax.cond(n < stage.blocks, blend_block, _unchanged, image, *block)
        for n in range(stage.index.shape[0]):
            pixels = stage.index[n], stage.keep[n], stage.paint[n]
            image = _jax.lax.cond(n < stage.layers, blend_pixels, _unchanged, image, *pixels)
    return image[:height, :width]


def _unchanged(image: Any, *_: Any) -> Any:
    return image


def _resize(table: Resizes, image: Any) -> Any:
    def rows_first(image: Any) -> Any:
        return resize_pass(
            resize_pass(image, table.index_x, table.taps_x, 1), table.index_y, table.taps_y, 0
        )

    def columns_first(image: Any) -> Any:
        return resize_pass(
            resize_pass(image, table.index_y, table.taps_y, 0), table.index_x, table.taps_x, 1
        )

    return _jax.lax.switch(table.kind, [_unchanged, rows_first, columns_first], image)
