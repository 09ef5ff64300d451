"""Label safety: whether the target of a step is still visible, what is covered, what changed.

A corrupted sample whose target is hidden must not become a training label by accident.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from .backends import find_backend, to_numpy
from .drawing.sprite import Sprite
from .errors import ParameterError, ParameterTypeError, short_repr
from .geometry import intersection
from .kernels import lower
from .kernels.cpu import compare
from .plan import Paste, Plan, Resample
from .planner import Planner, as_planner
from .rng import branch
from .types import Box, BoxArray, BoxesLike, Scene, Size, as_boxes, as_target, clip_boxes

# A pixel counts as hidden below paint of at least half opacity; an element counts as covered if
# less than half of it is visible.
OPAQUE = 128
COVERED_BELOW = 0.5
AVOID_TRIES = 16
MAX_COMPARED_STAMPS = 512  # with more stamps than this the whole picture is compared


@dataclass(frozen=True)
class Safety:
    """What a corruption did to the labels of one step.

    Args:
        target_visible: share of the target that is still visible, 0..1; for a drag, the lesser
            share of its two ends; `None` without a target.
        covered: indices of the boxes of which less than half is visible.
        changed_pixels: number of pixels whose colour differs; all of them if the size changed.
    """

    target_visible: float | None
    covered: tuple[int, ...]
    changed_pixels: int


def hidden(plan: Plan) -> npt.NDArray[np.bool_]:
    """Return a mask of the pixels of the corrupted picture that are painted over.

    The mask is bool `[h, w]` of `plan.out_size`.
    """
    mask = np.zeros(plan.size, bool)
    for op in plan.ops:
        if isinstance(op, Paste):
            _paint(mask, op)
        else:
            mask = resized_mask(mask, op.size)
    return mask


def _paint(mask: npt.NDArray[np.bool_], op: Paste) -> None:
    height, width = mask.shape
    for stamp in lower(op, (height, width)):
        opaque = _opaque(stamp.sprite)
        h, w = stamp.sprite.size
        for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
            mask[y : y + h, x : x + w] |= opaque


def resized_mask(mask: npt.NDArray[Any], size: Size) -> npt.NDArray[Any]:
    """Return a mask at another size: each pixel takes the value under its centre.

    Args:
        mask: `[..., H, W]` of any type.
        size: (height, width) of the result.
    """
    old_rows, old_columns = mask.shape[-2:]
    rows = _nearest(old_rows, size[0])
    columns = _nearest(old_columns, size[1])
    return mask[..., rows[:, None], columns]


def _nearest(old: int, new: int) -> npt.NDArray[np.int64]:
    """Return, for each of `new` pixels of a side, the one of `old` pixels under its centre."""
    centres = 2 * np.arange(new) + 1
    return centres * old // (2 * new)


@dataclass(frozen=True, eq=False)
class _Painted:
    """The stamps on the corrupted picture, none of which was resized after it was pasted.

    Args:
        sprites: one sprite per stamp.
        boxes: their places, int32 `[n, 4]`, `xyxy`.
    """

    sprites: list[Sprite]
    boxes: BoxArray

    def hidden_in(self, boxes: BoxArray) -> list[int] | None:
        """Return how many pixels of each box inside the picture are painted over.

        Returns `None` if there are so many stamps and boxes that a mask of the whole picture is
        faster.
        """
        counts = [0] * len(boxes)
        x1, y1, x2, y2 = boxes.T[:, :, None]
        left, top, right, bottom = self.boxes.T
        across = (left < x2) & (right > x1)
        down = (top < y2) & (bottom > y1)
        pairs = np.argwhere(across & down)
        if len(pairs) > len(boxes) + len(self.boxes):
            return None
        for i, over in groupby(pairs.tolist(), key=itemgetter(0)):
            counts[i] = self._hidden(boxes[i].tolist(), [k for _, k in over])
        return counts

    def _hidden(self, box: list[int], over: list[int]) -> int:
        """Return how many pixels of a box are painted over by stamps that all overlap it."""
        left, top, right, bottom = box
        if len(over) == 1 and self.sprites[over[0]].opaque:
            x1, y1, x2, y2 = intersection(self.boxes[over[0]].tolist(), box)
            return (x2 - x1) * (y2 - y1)
        mask = np.zeros((bottom - top, right - left), bool)
        for k in over:
            stamp = self.boxes[k].tolist()
            x1, y1, x2, y2 = intersection(stamp, box)
            opaque = _opaque(self.sprites[k])
            x = stamp[0]
            y = stamp[1]
            part = opaque[y1 - y : y2 - y, x1 - x : x2 - x]
            mask[y1 - top : y2 - top, x1 - left : x2 - left] |= part
        return int(np.count_nonzero(mask))


def _painted(plan: Plan) -> _Painted | None:
    """Return the stamps on the corrupted picture; `None` if a paste was resized later."""
    sprites: list[Sprite] = []
    boxes = [as_boxes(None)]
    size = plan.size
    for op in plan.ops:
        if isinstance(op, Resample):
            if sprites:
                return None
            size = op.size
            continue
        for stamp in lower(op, size):
            h, w = stamp.sprite.size
            xs = stamp.xs
            ys = stamp.ys
            sprites += [stamp.sprite] * len(ys)
            corners = np.array([xs, ys, xs + w, ys + h], np.int32)
            boxes.append(corners.T)
    return _Painted(sprites, np.concatenate(boxes))


def _opaque(sprite: Sprite) -> npt.NDArray[np.bool_]:
    """Return which pixels of a sprite hide the pixels below, bool `[h, w]`."""
    if "opaque" not in sprite.scratch:
        if sprite.opaque:
            opaque = np.broadcast_to(True, sprite.size)
        else:
            opaque = sprite.alpha >= OPAQUE
        sprite.scratch["opaque"] = opaque
    return sprite.scratch["opaque"]


def visible_share(plan: Plan, boxes: BoxesLike) -> list[float]:
    """Return the share of each box that is visible after the corruption, float `[N]` in 0..1.

    The share of a box that is empty or off the screen is 0.

    Args:
        plan: the corruption.
        boxes: `[N, 4]`, `xyxy` in pixels of the screen.
    """
    rows = as_boxes(boxes)
    return _shares(plan, _painted(plan), rows) if len(rows) else []


def _shares(plan: Plan, painted: _Painted | None, boxes: BoxArray) -> list[float]:
    """Return `visible_share` of boxes; `painted` holds the stamps of the plan."""
    mapped_boxes = _on_picture(plan, boxes)
    rows = mapped_boxes.tolist()
    hidden_pixels = None if painted is None else painted.hidden_in(mapped_boxes)
    if hidden_pixels is None:
        mask = hidden(plan)
        hidden_pixels = [int(np.count_nonzero(mask[y1:y2, x1:x2])) for x1, y1, x2, y2 in rows]
    areas = [max(x2 - x1, 0) * max(y2 - y1, 0) for x1, y1, x2, y2 in rows]
    return [
        _share(covered_pixels, area)
        for covered_pixels, area in zip(hidden_pixels, areas, strict=True)
    ]


def _on_picture(plan: Plan, boxes: BoxArray) -> BoxArray:
    """Map boxes on the screen to the corrupted picture; empty boxes stay empty."""
    inside = clip_boxes(boxes, plan.size)
    if plan.out_size == plan.size:
        return inside
    mapped_boxes = plan.coords.boxes_to_observation(inside)
    is_empty = (inside[:, :2] >= inside[:, 2:]).any(axis=1)
    mapped_boxes[is_empty] = 0
    return mapped_boxes


def _share(covered_pixels: int, area: int) -> float:
    """Return the share of an area that is left; 0 for an empty area."""
    return 1.0 - covered_pixels / area if area else 0.0


def target_visible(plan: Plan, target: object, end: object = None) -> float | None:
    """Return the visible share of the target, 0..1; `None` without a target.

    Args:
        plan: the corruption.
        target: a point or a box on the screen.
        end: where a drag that starts at the target ends; the lesser share of both counts.
    """
    return min(visible_share(plan, _ends(target, end)), default=None)


def _ends(target: object, end: object) -> list[Box]:
    """Return the boxes that must be visible: the target, and the end of a drag from it."""
    return [box for box in (as_target(target), as_target(end)) if box is not None]


def covered(plan: Plan, boxes: BoxesLike) -> tuple[int, ...]:
    """Return the indices of the boxes of which less than half is visible."""
    return tuple(i for i, share in enumerate(visible_share(plan, boxes)) if share < COVERED_BELOW)


def changed_pixels(before: Any, after: Any, plan: Plan | None = None) -> int:
    """Count the pixels that differ between two pictures of any framework.

    Args:
        before: uint8 RGB, `[H, W, 3]` or torch `[3, H, W]`.
        after: likewise; if its size differs, all its pixels count.
        plan: the plan that made `after` from `before`, if known: then only the areas that it can
            have changed are compared.
    """
    areas = None
    if plan is not None:
        areas = _painted_areas(plan, _painted(plan))
    return int(_count_changes(before, after, areas))


def _count_changes(before: Any, after: Any, areas: BoxArray | None) -> Any:
    """Return how many pixels differ, as an integer or as a scalar that a device still computes."""
    height, width = find_backend(after).size(after)
    if find_backend(before).size(before) != (height, width):
        return height * width
    boxes = np.array([[0, 0, width, height]], np.int32) if areas is None else areas
    if not len(boxes):
        return 0
    # Comparing whole pictures on the device takes less time than copying them to the host.
    if _device(after) != "cpu":
        return count_on_device(before, after)
    return compare.count(to_numpy(before), to_numpy(after), boxes)


def _device(image: Any) -> str:
    device = getattr(image, "device", None)
    return str(getattr(device, "type", getattr(device, "platform", "cpu")))


def count_on_device(before: Any, after: Any) -> Any:
    """Start counting the differing pixels of two torch or JAX pictures on their device."""
    return (before != after).any(find_backend(after).channels).sum()


def _painted_areas(plan: Plan, painted: _Painted | None) -> BoxArray | None:
    """Return boxes around everything that a plan can have changed; `None` is the whole picture."""
    if painted is None or len(painted.boxes) > MAX_COMPARED_STAMPS:
        return None
    if any(isinstance(op, Resample) for op in plan.ops):
        return None
    return painted.boxes


def judge(
    plan: Plan,
    before: Any,
    after: Any,
    *,
    target: object = None,
    end: object = None,
    boxes: BoxesLike = None,
) -> Safety:
    """Return the label safety of one corrupted picture.

    Args:
        plan: what made the picture.
        before: the clean picture, uint8 RGB, `[H, W, 3]` or torch `[3, H, W]`.
        after: the corrupted one.
        target: the point or box on the screen that the label aims at.
        end: where a drag that starts at the target ends.
        boxes: of the elements, `[N, 4]`, `xyxy` in pixels of the screen.

    Raises:
        ParameterTypeError: `plan` is not a plan.
    """
    if not isinstance(cast(object, plan), Plan):
        raise ParameterTypeError(
            f"judge needs the Plan that made the picture, got {short_repr(plan)}"
        )
    return judge_all([plan], [before], [after], targets=[target], ends=[end], boxes=[boxes])[0]


def judge_all(
    plans: Sequence[Plan],
    before: Sequence[Any],
    after: Sequence[Any],
    *,
    targets: Sequence[object],
    ends: Sequence[object],
    boxes: Sequence[BoxesLike],
) -> list[Safety]:
    """Judge all pictures of a batch as `judge` does, one result each.

    A device starts counting for all pictures before the first result is awaited.
    """
    painted = [_painted(plan) for plan in plans]
    counts = [
        _count_changes(old, new, _painted_areas(plan, stamps))
        for plan, stamps, old, new in zip(plans, painted, before, after, strict=True)
    ]
    rows = zip(plans, painted, counts, targets, ends, boxes, strict=True)
    return [
        _verdict(plan, stamps, int(count), _ends(target, end), picture_boxes)
        for plan, stamps, count, target, end, picture_boxes in rows
    ]


def _verdict(
    plan: Plan, painted: _Painted | None, changed_count: int, must_show: list[Box], boxes: BoxesLike
) -> Safety:
    ends = as_boxes(must_show)
    element_boxes = as_boxes(boxes)
    rows = np.concatenate([ends, element_boxes])
    shares = _shares(plan, painted, rows) if len(rows) else []
    target_shares = shares[: len(ends)]
    element_shares = shares[len(ends) :]
    hits = tuple(i for i, share in enumerate(element_shares) if share < COVERED_BELOW)
    visible = min(target_shares, default=None)
    return Safety(visible, hits, changed_count)


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
    """Plan again until enough of the target is visible; return `None` if it never is.

    Each of the `AVOID_TRIES` tries has its own stream, so the result depends only on the arguments.
    Try 0 is the ordinary plan.

    Args:
        planner: the planner.
        scene: the screen, with the target.
        seed: 0 to 2**64 - 1.
        sample: id of the sample or trajectory.
        step: step in the trajectory.
        epoch: training epoch.
        at_least: the share of the target that must be visible, 0..1.
        end: where a drag from the target ends, which must be visible as well.

    Raises:
        ParameterTypeError: `planner` is not a planner, or `scene` is not a `Scene`.
        ParameterError: `at_least` is out of range.
    """
    as_planner(planner, "a planner is a corruption or a combinator")
    if not isinstance(cast(object, scene), Scene):
        raise ParameterTypeError(f"scene must be a hijack_data.Scene, got {short_repr(scene)}")
    if not 0 <= at_least <= 1:
        raise ParameterError(f"at_least must be in 0..1, got {at_least}")
    for attempt in range(AVOID_TRIES):
        key = sample if attempt == 0 else branch(sample, f"try {attempt}")
        plan = planner.plan(scene, seed=seed, sample=key, step=step, epoch=epoch)
        share = target_visible(plan, scene.target, end)
        if share is None or share >= at_least:
            return plan
    return None
