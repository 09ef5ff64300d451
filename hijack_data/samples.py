"""Samples of a training set: which key a sample has, what it says about its screen, and what follows the pixels.

A sample is a dictionary. These entries are read, all but the id optional:

* `id`: names the sample; with the seed and the epoch it alone decides what happens to it,
* `step`, `epoch`: the step of its trajectory and the training epoch, 0 by default,
* `target`: the point `(x, y)` or box `(x1, y1, x2, y2)` that the label aims at; by default the point of `action`,
* `elements`: `[N, 4]` boxes of interactive elements,
* `action` (an `Action`), `action_code` (pyautogui code): like target and elements, they follow the pixels. Where the
  action is a drag, its end must show like the target, at which it starts: the lesser share of the two counts.

This file knows no framework; `transforms` (torchvision) and `grain` build on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from .actions import parse_pyautogui
from .compose import check_ids
from .errors import ActionError, ParameterError, ParameterTypeError
from .plan import Plan
from .safety import Planner, plan_avoiding, target_visible
from .types import Action, Point, Scene, Size, as_boxes

LABEL_POLICIES = ("keep", "avoid")
DRAGGING = ("drag", "mouseUp")  # pyautogui code without any of these drags nothing


@dataclass(frozen=True)
class SamplePlanner:
    """A planner with the settings that every sample shares.

    Args:
        planner: a corruption, `OneOf`, `Sequence` or `Schedule`.
        seed: 0 to 2**64 - 1.
        label_policy: `keep` what was drawn, or `avoid`: draw again until the target shows, and with it the end of a
            drag, else leave the sample clean.
        id_key: name of the entry that holds the id.
    """

    planner: Planner
    seed: int = 0
    label_policy: str = "keep"
    id_key: str = "id"

    def __post_init__(self) -> None:
        if not hasattr(self.planner, "plan") or isinstance(self.planner, type):
            raise ParameterTypeError(f"expected a corruption such as Marks(), got {self.planner!r}")
        if self.label_policy not in LABEL_POLICIES:
            raise ParameterError(f"label_policy must be keep or avoid, got {self.label_policy!r}")

    def plan(self, size: Size, sample: Mapping[str, Any], key: int | str, epoch: int = 0) -> Plan:
        """Return the plan for a sample whose picture has this size; `key` is its id, `epoch` counts if it has none."""
        scene = Scene(size, as_boxes(to_rows(sample.get("elements"))), target=target_of(sample))
        step, epoch = scalar(sample.get("step"), "step", 0), scalar(sample.get("epoch"), "epoch", epoch)
        if self.label_policy == "keep":
            return self.planner.plan(scene, seed=self.seed, sample=key, step=step, epoch=epoch)
        end = end_of(sample, size)
        plan = plan_avoiding(self.planner, scene, seed=self.seed, sample=key, step=step, epoch=epoch, end=end)
        return Plan.clean(size) if plan is None else plan

    def key(self, sample: Mapping[str, Any], *, batch: int | None = None) -> list[int | str]:
        """Return the sample's id in a list, or the ids of a batch of `batch` pictures. Raises `ParameterError`."""
        if sample.get(self.id_key) is None:
            raise ParameterError(
                f"the sample has no {self.id_key!r} entry (it has: {', '.join(map(str, sample)) or 'nothing'}); the id "
                "decides which corruption a sample gets, so give each sample one of its own, such as its row number; "
                "for pictures alone, id_from='content' derives it from the pixels"
            )
        ids = sample[self.id_key]
        if batch is None:
            return [_id(ids)]
        if not is_many(ids):
            raise ParameterError(f"{self.id_key} is {ids!r}, but there are {batch} pictures: give a list of ids")
        keys = [_id(i) for i in ids]
        check_ids(keys, batch)
        return keys


def is_many(value: Any) -> bool:
    """Tell whether an id entry holds several ids."""
    return isinstance(value, list | tuple) or bool(getattr(value, "ndim", 0))


def _id(value: Any) -> int | str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, str):
        return str(value)
    if isinstance(value, bool) or is_many(value) or not hasattr(value, "__index__"):
        raise ParameterTypeError(f"the id of a sample must be a string or an integer, got {value!r}")
    return int(value.__index__())


def scalar(value: Any, what: str, default: int) -> int:
    """Return an integer entry, or `default` where there is none."""
    if value is None:
        return default
    try:
        return int(value.__index__())
    except (AttributeError, TypeError):
        raise ParameterTypeError(f"{what} must be an integer, got {value!r}") from None


def target_of(sample: Mapping[str, Any]) -> Any:
    """Return the target of a sample, a point or a box, or `None`; one row of boxes counts as the box.

    Where there is no `target`, it is the point of the `action`, as it is when a dataset is built.
    """
    target = to_rows(sample.get("target"))
    if target is None and isinstance(action := sample.get("action"), Action):
        return action.point
    rows = None if target is None else np.asarray(target)
    return rows[0] if rows is not None and rows.ndim == 2 and len(rows) == 1 else target


def end_of(sample: Mapping[str, Any], size: Size) -> Point | None:
    """Return where the drag from the target of a sample ends, or `None` where there is no target or no drag.

    `action` says so, else `action_code`, written for a screen of `size` (height, width); code that cannot be read says
    nothing. Only code that may hold a drag is parsed, which takes 0.2 ms.
    """
    if target_of(sample) is None:
        return None
    if isinstance(action := sample.get("action"), Action):
        return action.end
    code = sample.get("action_code")
    if not isinstance(code, str) or not any(word in code for word in DRAGGING):
        return None
    try:
        return parse_pyautogui(code, size).end
    except ActionError:
        return None


def visible_in(plan: Plan, sample: Mapping[str, Any]) -> float | None:
    """Return the share of the target of a sample that shows after `plan`, or of the end of its drag if that is less."""
    return target_visible(plan, target_of(sample), end_of(sample, plan.size))


def to_rows(value: Any) -> Any:
    """Return coordinates of any kind (tensor, array, lists) as NumPy or lists."""
    detach = getattr(value, "detach", None)
    return detach().cpu().numpy() if detach is not None else value


def follow(plan: Plan, sample: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a sample that must follow the pixels, in the coordinates of the corrupted picture."""
    if plan.coords.is_identity:
        return {}
    moved: dict[str, Any] = {}
    if isinstance(action := sample.get("action"), Action):
        moved["action"] = plan.coords.action_to_observation(action)
    if isinstance(code := sample.get("action_code"), str):
        moved["action_code"] = plan.coords.code_to_observation(code)
    for key in ("target", "elements"):
        if sample.get(key) is not None:
            moved[key] = _like(sample[key], _moved(plan, np.asarray(to_rows(sample[key]), np.float64)))
    return moved


def _moved(plan: Plan, numbers: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    if numbers.shape == (2,):
        return plan.coords.to_observation(numbers)
    boxes = plan.coords.boxes_to_observation(numbers.reshape(-1, 4))
    return boxes.reshape(numbers.shape) if numbers.size else numbers


def _like(original: Any, numbers: Any) -> Any:
    """Return coordinates as what they came in: a list, a tuple, an array, or a tensor of its dtype and device."""
    if hasattr(original, "new_tensor"):
        return original.new_tensor(numbers)
    if isinstance(original, np.ndarray):
        return numbers.astype(cast(Any, original).dtype)
    rows: Any = numbers.tolist()
    return tuple(cast("list[Any]", rows)) if isinstance(original, tuple) else rows
