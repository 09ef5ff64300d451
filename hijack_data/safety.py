"""Label safety: does the target of a step still show, what is covered, did the picture change.

A corrupted sample whose target is hidden must not become a training label by accident.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .backends import backend_of, to_numpy
from .errors import ParameterError
from .kernels import lower
from .plan import Paste, Plan, Resample
from .raster import Sprite
from .types import Box, BoxArray, BoxesLike, Scene, Size, UInt8Array, as_boxes, as_target, clip_boxes

# A pixel hides what is below it from half opacity on; an element is covered when less than half of it shows.
OPAQUE = 128
COVERED_BELOW = 0.5
AVOID_TRIES = 16
# Pictures are compared in bands of this many pixels; areas up to so wide are compared pixel by pixel, wider ones as
# lines of bytes; beyond so many stamps the whole picture is compared.
BAND, NARROW, MANY = 1 << 15, 128, 512


class Planner(Protocol):
    """Anything that plans: a corruption, `OneOf`, `Sequence`, `Schedule`."""

    @property
    def needs_elements(self) -> bool:
        """Whether the plan depends on where the interactive elements are."""
        ...

    def plan(self, scene: Scene, *, seed: int, sample: int | str = 0, step: int | None = None, epoch: int = 0) -> Plan:
        """Return the plan for one screen."""
        ...


@dataclass(frozen=True)
class Safety:
    """What a corruption did to the labels of one step.

    Args:
        target_visible: share of the target that still shows, 0..1; `None` without a target.
        covered: indices of the boxes of which less than half shows.
        changed_pixels: pixels whose colour differs; all of them when the size changed.
    """

    target_visible: float | None
    covered: tuple[int, ...]
    changed_pixels: int


def hidden(plan: Plan) -> npt.NDArray[np.bool_]:
    """Return which pixels of the corrupted picture are painted over, bool `[h, w]` of `plan.out_size`."""
    mask = np.zeros(plan.size, bool)
    for op in plan.ops:
        if isinstance(op, Paste):
            _paint(mask, op)
        else:
            mask = _nearest(mask, op.size)
    return mask


def _paint(mask: npt.NDArray[np.bool_], op: Paste) -> None:
    height, width = mask.shape
    for stamp in lower(op, (height, width)):
        opaque = stamp.sprite.alpha >= OPAQUE
        h, w = opaque.shape
        for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
            mask[y : y + h, x : x + w] |= opaque


def _nearest(mask: npt.NDArray[np.bool_], size: Size) -> npt.NDArray[np.bool_]:
    rows = (2 * np.arange(size[0]) + 1) * mask.shape[0] // (2 * size[0])
    columns = (2 * np.arange(size[1]) + 1) * mask.shape[1] // (2 * size[1])
    return mask[rows[:, None], columns]


@dataclass(frozen=True, eq=False)
class _Painted:
    """The stamps that lie on the corrupted picture as they were pasted: sprites, and their boxes `[n, 4]`, `xyxy`."""

    sprites: list[Sprite]
    boxes: BoxArray

    def hidden_in(self, boxes: BoxArray) -> list[int]:
        """Return how many pixels of each box inside the picture are painted over."""
        counts = [0] * len(boxes)
        x1, y1, x2, y2 = boxes.T[:, :, None]
        left, top, right, bottom = self.boxes.T
        over = (left < x2) & (right > x1) & (top < y2) & (bottom > y1)
        for i in np.flatnonzero(over.any(axis=1)).tolist():
            counts[i] = self._hidden(boxes[i].tolist(), np.flatnonzero(over[i]).tolist())
        return counts

    def _hidden(self, box: list[int], over: list[int]) -> int:
        left, top, right, bottom = box
        mask = np.zeros((bottom - top, right - left), bool)
        for k in over:
            x, y, x_end, y_end = self.boxes[k].tolist()
            rows, columns = (max(y, top), min(y_end, bottom)), (max(x, left), min(x_end, right))
            part = _opaque(self.sprites[k])[rows[0] - y : rows[1] - y, columns[0] - x : columns[1] - x]
            mask[rows[0] - top : rows[1] - top, columns[0] - left : columns[1] - left] |= part
        return int(np.count_nonzero(mask))


def _painted(plan: Plan) -> _Painted | None:
    """Return what is painted on the corrupted picture, or `None` when a paste was resized afterwards."""
    sprites: list[Sprite] = []
    size, boxes = plan.size, [as_boxes(None)]
    for op in plan.ops:
        if isinstance(op, Resample):
            if sprites:
                return None
            size = op.size
            continue
        for stamp in lower(op, size):
            (h, w), xs, ys = stamp.sprite.size, stamp.xs, stamp.ys
            sprites += [stamp.sprite] * len(ys)
            boxes.append(np.stack([xs, ys, xs + w, ys + h], axis=1))
    return _Painted(sprites, np.concatenate(boxes))


def _opaque(sprite: Sprite) -> npt.NDArray[np.bool_]:
    """Return which pixels of a sprite hide what is below, bool `[h, w]`."""
    if "opaque" not in sprite.scratch:
        opaque = np.broadcast_to(True, sprite.size) if sprite.opaque else sprite.alpha >= OPAQUE
        sprite.scratch["opaque"] = opaque
    return sprite.scratch["opaque"]


def visible_share(plan: Plan, boxes: BoxesLike) -> list[float]:
    """Return, for each box on the screen (`xyxy`), the share of it that shows after the corruption, 0..1.

    A box that is empty or off the screen shows nothing.
    """
    inside = clip_boxes(as_boxes(boxes), plan.size)
    return _shares(plan, _painted(plan), inside) if len(inside) else []


def _shares(plan: Plan, painted: _Painted | None, inside: BoxArray) -> list[float]:
    """`visible_share` of boxes that were clipped to the screen; `painted` is that of the plan."""
    moved = plan.coords.boxes_to_observation(inside)
    if painted is not None:
        lost = painted.hidden_in(moved)
    else:
        mask = hidden(plan)
        lost = [int(np.count_nonzero(mask[y1:y2, x1:x2])) for x1, y1, x2, y2 in moved.tolist()]
    shown = ((inside[:, 2:] > inside[:, :2]) & (moved[:, 2:] > moved[:, :2])).all(axis=1)
    areas = np.maximum((moved[:, 2:] - moved[:, :2]).astype(np.int64).prod(axis=1), 1)
    return np.where(shown, 1.0 - np.array(lost, np.int64) / areas, 0.0).tolist()


def target_visible(plan: Plan, target: object, end: object = None) -> float | None:
    """Return the share of the target (a point or a box on the screen) that shows, or `None` without a target.

    `end` is where a drag that starts at the target ends: the lesser share counts.
    """
    boxes = [box for box in (as_target(target), as_target(end)) if box is not None]
    return min(visible_share(plan, boxes), default=None)


def covered(plan: Plan, boxes: BoxesLike) -> tuple[int, ...]:
    """Return the indices of the boxes of which less than half shows."""
    return tuple(i for i, share in enumerate(visible_share(plan, boxes)) if share < COVERED_BELOW)


def changed_pixels(before: Any, after: Any, plan: Plan | None = None) -> int:
    """Count the pixels that differ between two pictures of any framework; all of `after` when the sizes differ.

    With the plan that made `after` from `before`, only the pixels that it can have changed are looked at.
    """
    return _changed(before, after, None if plan is None else _painted_areas(plan, _painted(plan)))


def _changed(before: Any, after: Any, areas: BoxArray | None) -> int:
    height, width = backend_of(after).size(after)
    if backend_of(before).size(before) != (height, width):
        return height * width
    boxes = [[0, 0, width, height]] if areas is None else areas.tolist()
    if not boxes:
        return 0
    if _device(after) != "cpu":  # reading a whole picture there costs less than moving it here
        return count_on_device(before, after)
    one, two = to_numpy(before), to_numpy(after)
    return sum(_differing(one[y1:y2, x1:x2], two[y1:y2, x1:x2]) for x1, y1, x2, y2 in boxes)


def _device(image: Any) -> str:
    device = getattr(image, "device", None)
    return str(getattr(device, "type", getattr(device, "platform", "cpu")))


def count_on_device(before: Any, after: Any) -> int:
    """Count the differing pixels of two torch or JAX pictures where they are; only the number comes back."""
    return int((before != after).any(backend_of(after).channels).sum())


def _differing(before: UInt8Array, after: UInt8Array) -> int:
    """Count the differing pixels of two `[h, w, 3]` pictures, a band of rows at a time to stay in the cache."""
    count, band = 0, max(1, BAND // before.shape[1])
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
        count += int(np.count_nonzero(pixels))
    return count


def _painted_areas(plan: Plan, painted: _Painted | None) -> BoxArray | None:
    """Return boxes that share no pixel and hold all that a plan can have changed; `None` for the whole picture."""
    if painted is None or len(painted.boxes) > MANY or any(isinstance(op, Resample) for op in plan.ops):
        return None
    return _disjoint(painted.boxes)


def _disjoint(boxes: BoxArray) -> BoxArray:
    """Replace boxes that overlap by the box around them until none do."""
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


def judge(plan: Plan, before: Any, after: Any, *, target: object = None, boxes: BoxesLike = None) -> Safety:
    """Return the label safety of one corrupted picture; `target` and `boxes` are in screen coordinates."""
    box: Box | None = as_target(target)
    every = as_boxes(boxes)
    painted = _painted(plan)
    rows = np.concatenate([every, as_boxes([box])]) if box else every
    shares = _shares(plan, painted, clip_boxes(rows, plan.size)) if len(rows) else []
    seen = shares.pop() if box else None
    hits = tuple(i for i, share in enumerate(shares) if share < COVERED_BELOW)
    return Safety(seen, hits, _changed(before, after, _painted_areas(plan, painted)))


def plan_avoiding(
    planner: Planner,
    scene: Scene,
    *,
    seed: int,
    sample: int | str = 0,
    step: int | None = None,
    epoch: int = 0,
    at_least: float = 1.0,
    end: object = None,
) -> Plan | None:
    """Plan again, up to `AVOID_TRIES` times, until `at_least` of the target shows; `None` when it never does.

    Each try has a stream of its own, so the result depends on the arguments alone. Try 0 is the ordinary plan. `end` is
    where a drag from the target ends, which then has to show as well.
    """
    if not 0 <= at_least <= 1:
        raise ParameterError(f"at_least must be in 0..1, got {at_least}")
    for attempt in range(AVOID_TRIES):
        key = sample if attempt == 0 else f"{sample}~{attempt}"
        plan = planner.plan(scene, seed=seed, sample=key, step=step, epoch=epoch)
        seen = target_visible(plan, scene.target, end)
        if seen is None or seen >= at_least:
            return plan
    return None
