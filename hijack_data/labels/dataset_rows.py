"""Rows of our own datasets: the value of each column after a plan on the row's screenshot.

A row is recognised by its columns, so transforms keep it consistent in `TorchDataset`, in Grain,
and in `datasets`. `pipelines` computes the same columns with the same functions when it builds a
dataset.
"""

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, cast

import numpy as np
from PIL import Image

from ..actions import (
    DICT_DIALECTS,
    FRACTIONS,
    RESIZED_DIALECTS,
    TEXT_PARSERS,
    Scaling,
    parse_actions,
)
from ..actions.dialects.pyautogui_code import calls_pyautogui
from ..actions.recorded_actions import SCREENAGENT, SIZELESS, map_recorded
from ..backends import to_numpy
from ..corruption import find_corruption
from ..errors import HijackError, LabelError
from ..picture_io import pixel_sha256
from ..plan import CLEAN, Plan
from ..safety import changed_pixels, target_visible
from ..smart_resize import smart_resize
from ..types import Action, Size
from .action_formats import own_action
from .base import Location, Move

_Row = Mapping[str, Any]
# A sample with these columns is a row of a dataset; the other columns may be missing.
ROW_MARKER_COLUMNS = ("trajectory_id", "step", "corruption")
BASE = "base_screenshot"
PROVENANCE = (
    "id",
    "corruption",
    "severity",
    "seed",
    "params",
    "plan",
    "plan_digest",
    "target_visible",
    "changed_pixels",
    "image_sha256",
)
# Columns of a row that hold no place on the screen, or describe the recorded screen and never
# change; those of `PROVENANCE` are computed anew.
COLUMNS = (
    *PROVENANCE,
    "trajectory_id",
    "source",
    "domain",
    "instruction",
    "fidelity",
    "inserted",
    "extra",
    "event",
    "reminder",
)
_PAIR = re.compile(r"(-?\d+(?:\.\d+)?)\s*,\s*(-?\d+(?:\.\d+)?)")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_COORDINATES = re.compile(
    _PAIR.pattern + r"|<point>\s*\d|\b(?:x|y|width|height)\d?[\"']?\s*[:=]\s*[\"'(\[]?-?\d"
)


def is_row(sample: _Row) -> bool:
    """Return whether a sample is a row of a dataset that `hijack build` made."""
    return all(key in sample for key in ROW_MARKER_COLUMNS)


def check_drawn(sample: _Row) -> None:
    """Raise for a lazy row that has not been drawn: its labels belong to another picture.

    Raises:
        LabelError: the sample is a lazy row that has not been drawn.
    """
    if BASE in sample:
        raise LabelError(
            f"the sample is a lazy row: {BASE!r} is the picture before its corruption; draw it"
            " first, with load_dataset(...).with_transform(pipelines.render), or read it by"
            " open_dataset or TorchDataset"
        )


def holds_coordinates(text: str) -> bool:
    """Return whether text seems to hold coordinates, in any dialect."""
    return _COORDINATES.search(text) is not None


def _holds_two_numbers(text: str) -> bool:
    return len(_NUMBER.findall(text)) > 1


# --- The columns that describe the corruption


def params_json(plan: Plan) -> str:
    """Return the parameters of a plan as the column `params` holds them."""
    return json.dumps(dict(plan.params), sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def find_severity(plan: Plan) -> int | None:
    """Return the level of the corruption that made a plan, or `None`.

    The parameters must be exactly those of the level.
    """
    return _severity(plan.corruption, json.dumps(dict(plan.params), sort_keys=True))


@lru_cache(maxsize=256)
def _severity(corruption: str, params: str) -> int | None:
    try:
        cls = find_corruption(corruption)
        levels = range(1, 6) if cls.severities else ()
        return next(
            (level for level in levels if cls.at(level).params() == json.loads(params)), None
        )
    except HijackError:  # the plan is clean, or joins several corruptions
        return None


def plan_columns(plan: Plan, seed: int) -> dict[str, Any]:
    """Return the columns that say how a picture was made."""
    return {
        "severity": find_severity(plan),
        "seed": seed,
        "params": params_json(plan),
        "plan": plan.to_json(),
        "plan_digest": plan.digest(),
    }


def corruption_label(plan: Plan) -> str:
    """Return the value of the column `corruption` for a plan without a label of its own."""
    return "+".join(part.rpartition("-v")[0] or part for part in plan.corruption.split("+"))


def corrupted_row(
    row: _Row, plan: Plan, before: Any, after: Any, location: Location | None, seed: int | None
) -> dict[str, Any]:
    """Return the columns of a row, other than its labels, that a transform must change.

    Args:
        row: the row before; columns that it does not have are not made.
        plan: what was done to its screenshot.
        before: the screenshot before, an array or a PIL image.
        after: the screenshot after, likewise.
        location: where the action of the row points, in pixels of `before`.
        seed: the seed of the plan; `None` leaves the column unchanged.

    Raises:
        LabelError: the row has columns of its plan without the plan.
    """
    if not plan.ops:
        return {}
    before, after = (np.asarray(p) if isinstance(p, Image.Image) else p for p in (before, after))
    earlier = read_row_plan(row, plan.size)
    combined_plan = None if earlier is None else earlier.then(plan)
    was_clean = row["corruption"] == CLEAN
    label = corruption_label(plan) if was_clean else f"{row['corruption']}+{corruption_label(plan)}"
    columns = {"corruption": label, "id": _renamed(row, label)}
    if combined_plan is not None:
        columns |= plan_columns(combined_plan, row.get("seed", 0) if seed is None else seed)
    elif any(key in row for key in ("params", "plan_digest", "severity")):
        raise LabelError(
            "the row has no column 'plan', so its 'params' and 'plan_digest' would be wrong;"
            " keep it"
        )
    if "target_visible" in row:
        columns["target_visible"] = (
            None if location is None else visible_after(earlier, plan, location)
        )
    if "changed_pixels" in row:
        columns["changed_pixels"] = _count_changed_pixels(row, earlier, plan, before, after)
    if "image_sha256" in row:
        columns["image_sha256"] = pixel_sha256(to_numpy(after))
    return {key: value for key, value in columns.items() if key in row}


def read_row_plan(row: _Row, size: Size) -> Plan | None:
    """Return the plan by which the screenshot of a row was made from a clean one."""
    if row["corruption"] == CLEAN:
        return Plan.clean(size)
    stored = row.get("plan")
    if isinstance(stored, Plan):
        return stored
    return None if stored is None else Plan.from_json(cast(str, stored))


def _renamed(row: _Row, label: str) -> Any:
    """Return the id of a row under another label, and the event of an inserted step.

    An id is `trajectory/step/label`.
    """
    name = row.get("id")
    start = f"{row['trajectory_id']}/{int(row['step']):04d}/"
    if not isinstance(name, str) or not name.startswith(start + row["corruption"]):
        return name
    return f"{start}{label}{name[len(start) + len(row['corruption']) :]}"


def visible_after(earlier: Plan | None, plan: Plan, location: Location) -> float | None:
    """Return the share of the target that shows after both plans."""
    if earlier is None or not earlier.ops:
        return target_visible(plan, location.target, location.end)
    coords = earlier.coords
    if coords.is_identity:
        return target_visible(earlier.then(plan), location.target, location.end)
    ends = [_on_screen(earlier, end) for end in (location.target, location.end)]
    return target_visible(earlier.then(plan), *ends)


def _on_screen(plan: Plan, point_or_box: tuple[float, ...] | None) -> Any:
    """Return a point or box of a corrupted picture on the screen from which it was made."""
    if point_or_box is None:
        return None
    if len(point_or_box) == 2:
        return plan.coords.to_screen(point_or_box)
    return plan.coords.boxes_to_screen([point_or_box])[0].tolist()


def _count_changed_pixels(
    row: _Row, earlier: Plan | None, plan: Plan, before: Any, after: Any
) -> int | None:
    """Return how many pixels differ from the clean screenshot; `None` without a clean one."""
    if earlier is not None and plan.out_size != earlier.size:
        return plan.out_size[0] * plan.out_size[1]
    if row["corruption"] != CLEAN:
        return None
    return changed_pixels(before, after, plan)


# --- The text of the action


def map_action_code(code: str, action: Any, move: Move) -> str:
    """Return the text of an action after a move, in the dialect in which it was recorded.

    `action` is the same action, as an `Action` or as its dictionary. If it is `None`, only
    pyautogui code is understood.

    Raises:
        ActionError: the code cannot be mapped.
        LabelError: the dialect cannot be determined.
    """
    if action is None:
        if _holds_two_numbers(code) and not calls_pyautogui(code):
            problem = _unclear(code)
            raise problem
        return map_recorded(code, "pyautogui", move.scaling, move.scaling)
    dialect = detect_dialect(code, own_action(action), move.before, move.after)
    between_models = move.scaling
    if dialect in RESIZED_DIALECTS:
        between_models = _between_models(move.before, move.after)
    # As in a build: if the action itself is on the screen, other points in its text are clamped to
    # the edge.
    return map_recorded(code, dialect, Scaling(move.before, move.after), between_models)


def detect_dialect(code: str, action: Action, size: Size, after: Size | None = None) -> str:
    """Return the dialect of the code of a row, whose action is known.

    Rows do not name the dialect, so each dialect is tried; the right one is the one in which the
    code means that action.

    Args:
        code: the text of the action.
        action: the action, in pixels of the picture.
        size: `(height, width)` of the picture.
        after: the size to which the picture is resized; twice its size if it is not known.

    Raises:
        LabelError: the code holds coordinates, and means the action in no dialect; or it means the
            action both in pixels of the smart-resized picture and in fractions, and would become
            another text in each.
    """
    is_pointing = action.point is not None and _holds_two_numbers(code)
    if not is_pointing and not holds_coordinates(code):
        return SIZELESS
    if calls_pyautogui(code):
        return "pyautogui"
    try:
        data: Any = json.loads(code)
    except ValueError:
        data = None
    entries = cast("list[Any]", data) if isinstance(data, list) else [data]
    if any(isinstance(entry, dict) and "mouse_position" in entry for entry in entries):
        return SCREENAGENT
    candidates = (*RESIZED_DIALECTS, *FRACTIONS)
    if data is not None:
        candidates = (*DICT_DIALECTS, *candidates)
    fitting = [
        dialect
        for dialect in candidates
        if _means_action(entries[0] if dialect in DICT_DIALECTS else code, dialect, action, size)
    ]
    resized = next((dialect for dialect in fitting if dialect in RESIZED_DIALECTS), None)
    unresized = next((dialect for dialect in fitting if dialect not in RESIZED_DIALECTS), None)
    if resized and unresized in FRACTIONS:
        between = _between_models(size, after or (2 * size[0], 2 * size[1]))
        if map_recorded(code, resized, between, between) != code:
            problem = _unclear(code)
            raise problem
    if fitting:
        return fitting[0]
    if _in_thousandths(code, action, size):
        return SIZELESS
    problem = _unclear(code)
    raise problem


def _between_models(before: Size, after: Size) -> Scaling:
    return Scaling(smart_resize(*before), smart_resize(*after))


def _unclear(code: str) -> LabelError:
    return LabelError(
        f"the sample's entry 'action_code', {code!r:.80}, holds coordinates, and nothing says in"
        " which dialect; declare it, such as labels={'action_code': 'ui_tars_1.5'}, or 'leave'"
        " if it must not change"
    )


def _means_action(raw: Any, dialect: str, action: Action, size: Size) -> bool:
    """Return whether an action of a dialect is `action`, on a picture of `size`."""
    try:
        if dialect in RESIZED_DIALECTS:
            model_scaling = Scaling(smart_resize(*size), size, bounded=True)
            parsed = TEXT_PARSERS[dialect](raw, model_scaling)[0]
        else:
            parsed = parse_actions(raw, dialect, size)[0]
    except HijackError:
        return False
    return (parsed.point, parsed.end) == (action.point, action.end)


def _in_thousandths(code: str, action: Action, size: Size) -> bool:
    """Return whether the first pair of numbers in the code is the action's point in 0..1000."""
    pair = _PAIR.search(code)
    point = action.point or action.end
    if pair is None or point is None:
        return False
    sides = size[::-1]
    return all(
        abs(float(n) * side / 1000 - v) <= 1.5
        for n, side, v in zip(pair.groups(), sides, point, strict=True)
    )
