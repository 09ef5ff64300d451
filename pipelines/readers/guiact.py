"""GUIAct (of GUICourse): questions about pages and phones, with the actions that answer them."""

import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.computer_tools import PIXELS_PER_NOTCH
from hijack_data.actions.dialects.field_checks import action_at, number
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import ActionError, HijackError, short_repr
from hijack_data.types import Action, Box, Size, Step, Trajectory

from ..choices import FRACTIONS, XYXY
from . import fields
from .base import FileReader, Rejected, register
from .box_forms import box_center, box_in
from .fields import FieldError, JsonObject
from .json_rows import FOLDERS, JsonRow, json_rows, picture_at, read_tables
from .recorded_actions import PYAUTOGUI, RecordedStep, raw_action_text
from .recording_facts import RecordedTrajectory
from .safe_files import Source, relative_name, source_root

_UID = re.compile(r"uid_(record|episode)_(\d+)_step_(\d+)")
_NUMBERS = re.compile(r"<(?:box|point)>([^<>]*)</(?:box|point)>")
_SUFFIXES = (".png", ".jpg", ".jpeg")
_SETS = ("web-single", "web-multi", "smartphone")
_FOLDERS = (*FOLDERS, *_SETS, *(f"images/{name}" for name in _SETS))
_TABLE = (
    "the pictures are in the set's *_images.parquet: write them as images/<image_id>.png, for"
    " example with data_preprocess/convert_parquet_to_png.py of GUICourse"
)
_POINTER_ACTIONS = {"click": "click", "tap": "click", "hover": "move", "select": "other"}
_ENDS = {"task_complete": "done", "task_impossible": "fail"}
# What the smartphone part calls an answer is only these two.
_VERDICTS = {"task complete": "done", "task impossible": "fail"}
_KEYS = {"enter": ("enter",), "copy": ("ctrl", "c"), "copy_text": ("ctrl", "c")}
_ROUNDED = 0.002  # `related` has three decimals


@register
class GuiAct(FileReader):
    """Reads GUIAct: `web-single`, `web-multi` and `smartphone`.

    A source is a JSON file with a list of steps (`uid, image_id, question, actions_label`), or a
    folder with such files. `image_id` names a picture `<image_id>.png` (or `.jpg`) beside the file,
    in `images/`, or in a folder named after the part; the set itself holds its pictures as base64
    in Parquet files. Steps that follow each other with the episode of their `uid` and one question
    are a trajectory; other rows are one each. The step's action is the first of `actions_label`:
    a click goes to its `point`, or to the middle of its `element`, which is then the target. Typing
    into an element is a click there, as in Multimodal-Mind2Web; `select` opens a list that does not
    show and is `"other"`. Scrolling is turned into notches of 100 pixels.

    Coordinates: `related`, fractions 0..1 of the picture. If `absolute`, in pixels of `image_size`,
    names another place, the step is rejected.
    """

    name = "guiact"
    keys = (frozenset({"uid", "image_id", "question", "actions_label"}),)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, steps in order."""
        root = source_root(path)
        yield from read_tables(path, lambda file: _episodes(file, root))


def _episodes(file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
    name = relative_name(file, root)
    ids: set[str] = set()
    for (episode, _), rows in itertools.groupby(json_rows(file), _episode):
        steps: list[Step] = []
        question = ""
        for row in rows:
            try:
                question = question or fields.text(row.record, "question")
                steps.append(_step(row, file, root))
            except FieldError as error:
                yield Rejected(name, row.location, error.field, error.reason)
        if not steps:
            continue
        while episode in ids:  # the set uses some numbers for two tasks
            episode += "~2"
        ids.add(episode)
        is_phone = episode.startswith("uid_episode")
        yield RecordedTrajectory(
            id=episode,
            source=GuiAct.name,
            instruction=question,
            steps=tuple(steps),
            domain="android" if is_phone else "web page",
            platform="android" if is_phone else "web",
            screen="phone" if is_phone else "web page",
        )


def _episode(row: JsonRow) -> tuple[str, object]:
    """Return what the rows of an episode have in common: its id and the question."""
    values: Any = row.values if not isinstance(row.values, FieldError) else {}
    uid = values.get("uid")
    if not isinstance(uid, str):
        return row.location, None
    match = _UID.fullmatch(uid)
    name = uid if match is None else f"uid_{match[1]}_{match[2]}"
    question = values.get("question")
    return name, question if isinstance(question, str) else None


def _step(row: JsonRow, file: Path, root: Path) -> Step:
    record = row.record
    match = _UID.fullmatch(fields.text(record, "uid"))
    image, size = _picture(fields.text(record, "image_id"), file, root)
    label: Any = record.get("actions_label")
    labels = [label] if isinstance(label, dict) else fields.items(record, "actions_label")
    actions = fields.mappings(labels, "actions_label")
    if not actions:
        raise FieldError("actions_label", "is empty")
    first = actions[0]
    try:
        box = _box(first.get("element"), record, size)
        action = fields.check_on_screen(_action(first, record, size, box), size, "actions_label")
    except FieldError:
        raise
    except HijackError as error:
        raise FieldError("actions_label", str(error)) from None
    target = box if action.point else None
    index = int(match[3]) if match else 0
    label_text = "" if action.point else raw_action_text(label, "actions_label")
    try:
        code = write_pyautogui(action)
    except ActionError:
        return RecordedStep(index, image, action, label_text, target, dialect=SIZELESS)
    if action.type == "click" and first.get("text") is not None:
        code += f"\npyautogui.write({fields.text(first, 'text', default='')!r})"
    return RecordedStep(index, image, action, code, target, dialect=PYAUTOGUI)


def _picture(name: str, file: Path, root: Path) -> tuple[str, Size]:
    for suffix in _SUFFIXES:
        try:
            return picture_at(name + suffix, file, root, "image_id", _FOLDERS)
        except FieldError as error:
            if "is not in the source folder" not in error.reason:
                raise
    raise FieldError("image_id", f"there is no picture {name}{_SUFFIXES[0]}; {_TABLE}")


def _action(first: JsonObject, record: JsonObject, size: Size, box: Box | None) -> Action:
    """Return an action in pixels.

    Raises:
        FieldError: the name is not an action of GUIAct.
    """
    name = fields.text(first, "name").lower()
    text = fields.text(first, "text", default="")
    has_place = box is not None or first.get("point") is not None
    if name in _POINTER_ACTIONS or (name == "input" and has_place):
        return action_at(
            _POINTER_ACTIONS.get(name, "click"), _pointer_target(first, record, size, box)
        )
    match name:
        case "input":
            return Action("type", text=text)
        case "swipe" | "select_text":
            pair = fields.mapping(first.get("dual_point"), "dual_point")
            ends = [_point(_end(pair, end), record, size) for end in ("from", "to")]
            return Action("drag", *ends[0], *ends[1])
        case "scroll":
            return _scroll(first, size)
        case "answer" if text.strip().lower() in _VERDICTS:
            return Action(_VERDICTS[text.strip().lower()])
        case "answer":
            return Action("done", text=text)
        case "go_back" | "go_home":
            return Action("other")
        case _ if name in _KEYS:
            return Action("hotkey", keys=_KEYS[name])
        case _ if name in _ENDS:
            return Action(_ENDS[name])
        case _:
            raise FieldError("actions_label.name", f"{name!r:.60} is not an action of GUIAct")


def _scroll(first: JsonObject, size: Size) -> Action:
    scroll = fields.mapping(first.get("scroll"), "scroll")
    related = fields.mapping(scroll.get("related"), "scroll.related")
    down = _decimal(related.get("down"), "scroll.related.down")
    notches = round(down * size[0] / PIXELS_PER_NOTCH)
    return Action("scroll", amount=-notches) if notches else Action("other")


def _end(pair: JsonObject, end: str) -> JsonObject:
    """Return one end of a gesture in both spaces."""
    ends: dict[str, object] = {}
    for space in ("related", "absolute"):
        if pair.get(space) is not None:
            ends[space] = fields.mapping(pair[space], f"dual_point.{space}").get(end)
    return ends


def _pointer_target(
    first: JsonObject, record: JsonObject, size: Size, box: Box | None
) -> tuple[int, int]:
    if first.get("point") is not None:
        return _point(fields.mapping(first["point"], "point"), record, size)
    if box is None:
        raise FieldError("actions_label.element", "is missing")
    return box_center(box)


def _point(spaces: JsonObject, record: JsonObject, size: Size) -> tuple[int, int]:
    x, y = _related(spaces, record, 2, "point")
    return Scaling.fractions(size).point(x, y)


def _box(element: object, record: JsonObject, size: Size) -> Box | None:
    if element is None:
        return None
    numbers = _related(fields.mapping(element, "element"), record, 4, "element")
    return box_in((FRACTIONS, XYXY), numbers, size, "element.related")


def _related(spaces: JsonObject, record: JsonObject, count: int, field: str) -> list[float]:
    """Return the fractions of a place, after comparing them with its pixels, if it has any.

    Raises:
        FieldError: fractions and pixels are two places.
    """
    related = _numbers(spaces.get("related"), count, f"{field}.related")
    sides: Any = record.get("image_size")
    if spaces.get("absolute") is None or not isinstance(sides, dict):
        return related
    absolute = _numbers(spaces["absolute"], count, f"{field}.absolute")
    size = [number(sides.get(side), f"image_size.{side}") for side in ("width", "height")]
    for fraction, pixel, side in zip(related, absolute, size * (count // 2), strict=True):
        if abs(fraction * side - pixel) > _ROUNDED * side + 1:
            raise FieldError(field, f"related {related} and absolute {absolute} are two places")
    return related


def _numbers(value: object, count: int, field: str) -> list[float]:
    match = _NUMBERS.fullmatch(value.strip()) if isinstance(value, str) else None
    parts: Sequence[str] = match[1].split(",") if match else ()
    if len(parts) != count:
        raise FieldError(field, f"must hold {count} numbers, got {short_repr(value)}")
    return [_decimal(part, field) for part in parts]


def _decimal(value: object, field: str) -> float:
    try:
        return number(float(value) if isinstance(value, str) else value, field)
    except (ValueError, ActionError):
        raise FieldError(field, f"must be a number, got {short_repr(value)}") from None
