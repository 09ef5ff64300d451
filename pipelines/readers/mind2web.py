"""Multimodal-Mind2Web: one row of a Parquet table is one action on a page."""

from collections.abc import Iterator
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.types import Action, Box, Size, Trajectory

from ..choices import PIXELS, XYWH
from . import fields
from .box_forms import box_center, box_in
from .fields import FieldError, JsonObject
from .parquet_rows import SOURCE, ParquetRow
from .recorded_actions import PYAUTOGUI, RecordedStep, first_action
from .recording_facts import RecordedTrajectory, stated_episode
from .safe_files import parse_embedded

COLUMNS = (
    "annotation_id",
    "action_uid",
    "confirmed_task",
    "operation",
    "pos_candidates",
    "screenshot",
)
_OPERATIONS = ("CLICK", "TYPE", "SELECT")
_NOWHERE = "-1,-1,-1,-1"


def mind2web(row: ParquetRow) -> Iterator[Trajectory | FieldError]:
    """Read a row: the operation at the middle of its target.

    `bounding_box_rect` is x, y, width, height in pixels. `TYPE` is a click and the text; `SELECT`
    has no code, since the list that it opens does not show.

    Raises:
        FieldError: the row is broken.
    """
    record = row.record
    annotation = fields.text(record, "annotation_id")
    name = f"{annotation}/{fields.text(record, 'action_uid')}"
    image, size = row.picture("screenshot")
    operation = _object(record.get("operation"), "operation")
    kind = fields.text(operation, "op", "operation.op")
    if kind not in _OPERATIONS:
        operations = ", ".join(_OPERATIONS)
        raise FieldError("operation.op", f"{short_repr(kind)} is not one of {operations}")
    box = _target(fields.items(record, "pos_candidates"), size)
    x, y = box_center(box)
    value = fields.text(operation, "value", "operation.value", default="")
    code = _code(kind, x, y, value)
    action = Action("other", x, y)
    if code:
        action = first_action(code, PYAUTOGUI, size, "operation")
    step = RecordedStep(0, image, action, code, box)
    task = fields.text(record, "confirmed_task")
    site = fields.text(record, "website", default="")
    key = row.choices.episode_key
    yield RecordedTrajectory(
        name,
        SOURCE,
        task,
        (step,),
        domain=site or "web page",
        platform="web",
        episode=stated_episode(record, key) if key else annotation,
    )


def _code(kind: str, x: int, y: int, value: str) -> str:
    if kind == "SELECT":
        return ""
    click = f"pyautogui.click({x}, {y})"
    if kind == "TYPE":
        return f"{click}\npyautogui.write({value!r})"
    return click


def _target(candidates: list[Any], size: Size) -> Box:
    """Return the box of the original target, or else of another element that would do.

    Raises:
        FieldError: no element has a box.
    """
    elements = [_object(candidate, "pos_candidates") for candidate in candidates]
    for candidate in sorted(elements, key=_is_other):
        attributes = _object(candidate.get("attributes"), "pos_candidates.attributes")
        rect = attributes.get("bounding_box_rect")
        if isinstance(rect, str) and rect != _NOWHERE:
            return box_in((PIXELS, XYWH), _numbers(rect), size, "pos_candidates")
    raise FieldError("pos_candidates", "name no element with a place on the page")


def _is_other(candidate: JsonObject) -> bool:
    return not candidate.get("is_original_target")


def _numbers(rect: str) -> list[float]:
    try:
        return [float(part) for part in rect.split(",")]
    except ValueError:
        reason = f"{short_repr(rect)} is not x,y,width,height"
        raise FieldError("pos_candidates", reason) from None


def _object(value: object, field: str) -> JsonObject:
    return fields.mapping(parse_embedded(value, field), field)
