"""The fields of the plain format; all mistakes of a line are reported at once."""

import json
import os
from collections.abc import Callable
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from hijack_data.actions import calls_pyautogui, parse_pyautogui, write_pyautogui
from hijack_data.errors import HijackError, short_repr
from hijack_data.types import Action, Point, Size, Step

from . import fields
from .fields import ACTION_FIELDS, FieldError, FieldTypeError, JsonObject
from .safe_files import image_size, inside, relative_name

FIELDS = (
    "trajectory_id",
    "step",
    "instruction",
    "image",
    "action",
    "id",
    "action_code",
    "target_box",
    "elements",
    "domain",
    "apps",
    "platform",
)
# Other names of these fields that are too different to be recognised as typing errors.
OTHER_NAMES = {
    "bbox": "target_box",
    "box": "target_box",
    "target": "target_box",
    "boxes": "elements",
    "bboxes": "elements",
    "task": "instruction",
    "goal": "instruction",
    "prompt": "instruction",
    "screenshot": "image",
    "image_path": "image",
    "file_name": "image",
    "code": "action_code",
    "app": "apps",
    "applications": "apps",
    "os": "platform",
    "system": "platform",
    "episode_id": "trajectory_id",
    "episode": "trajectory_id",
    "step_id": "step",
    "step_num": "step",
}
# Kinds of actions that count as equal: a text may be typed key by key, and a key is a text of one
# letter.
KEYBOARD = "keyboard"
KEYBOARD_TYPES = ("type", "hotkey", "key_down", "key_up")
# What stands for a wrong value while the other fields of an action are checked.
_HARMLESS: dict[str, Any] = {"text": "x", "keys": ["a"], "amount": 0}
SCHEMA = Path(__file__).with_name("trajectories.schema.json")
# The size against which points are checked if the picture cannot be read.
ANY_SIZE = (fields.MAX_PIXEL, fields.MAX_PIXEL)
T = TypeVar("T")


class LineProblems:
    """Collects the mistakes in one line, so that they can be reported at once."""

    def __init__(self) -> None:
        self.errors: list[FieldError] = []

    def of(self, read: Callable[[], T]) -> T | None:
        """Return the result of `read`; if it fails, note the error and return `None`."""
        try:
            return read()
        except FieldError as error:
            self.errors.append(error)
            return None

    def check(self) -> None:
        """Report all noted mistakes.

        Raises:
            FieldError: there are some; the message names them all.
        """
        if not self.errors:
            return
        first, *further = self.errors
        suffix = "".join(f"; {error}" for error in further)
        raise FieldError(first.field, f"{first.reason}{suffix}")


def check_names(
    record: JsonObject, problems: LineProblems, field_names: tuple[str, ...] = FIELDS
) -> None:
    """Note each unknown name that is similar to a known name missing in the record."""
    for name in record:
        suggestion = _suggest_field(name, field_names)
        if name not in field_names and suggestion and record.get(suggestion) is None:
            problems.errors.append(
                FieldError(name, f"is not a field; did you mean {suggestion!r}?")
            )


def extra_json(record: JsonObject, field_names: tuple[str, ...] = FIELDS) -> str:
    """Return the fields of a record that are not known, as JSON; `""` if there are none.

    Raises:
        FieldError: a dataset cannot store them.
    """
    unknown = {name: value for name, value in record.items() if name not in field_names}
    if not unknown:
        return ""
    first = next(iter(unknown))
    try:
        text = json.dumps(unknown, ensure_ascii=False, allow_nan=False)
    except (ValueError, RecursionError) as error:
        raise FieldError(first, f"cannot be kept as JSON ({error})") from None
    return fields.storable(text, first)


def identity(
    record: JsonObject, problems: LineProblems
) -> tuple[str | None, int | None, str | None]:
    """Return the trajectory, the step and the id of a line; `None` for each that is wrong."""
    trajectory = problems.of(lambda: fields.text(record, "trajectory_id"))
    step = problems.of(lambda: fields.step_number(record, "step"))
    row_id = problems.of(lambda: fields.text(record, "id", default=""))
    return trajectory, step, row_id


def read_step(
    record: JsonObject, root: Path, folder: Path, *, problems: LineProblems | None = None
) -> Step:
    """Return the step of a line; mistakes in it are one `FieldError` that names them all.

    Args:
        record: the line.
        root: the folder of the source, which pictures must not leave.
        folder: the folder from which pictures are named.
        problems: the mistakes found so far.
    """
    problems = problems or LineProblems()
    check_names(record, problems)
    if not any(error.field == "step" for error in problems.errors):
        problems.of(lambda: fields.step_number(record, "step"))
    problems.of(lambda: fields.text(record, "instruction"))
    problems.of(lambda: read_apps(record))
    problems.of(lambda: fields.platform(record.get("platform"), "platform"))
    picture = problems.of(lambda: find_image(record, root, folder))
    image, size = picture or ("", None)
    if size:
        problems.of(lambda: fields.check_stated_size(record, size))
    action = read_action(record.get("action"), size or ANY_SIZE, problems)
    code = problems.of(lambda: fields.text(record, "action_code", default=""))
    if action and code and size:
        problems.of(lambda: check_agreement(action, code, size))
    target, elements = read_boxes(record, size, problems)
    extra = problems.of(lambda: extra_json(record))
    row_id = problems.of(lambda: fields.text(record, "id", default=""))
    problems.check()
    return Step(
        index=record["step"],
        image=image,
        action=cast("Action", action),
        action_code=code or "",
        target_box=target,
        elements=elements,
        id=row_id or None,
        extra=extra or "",
    )


def find_image(record: JsonObject, root: Path, folder: Path) -> tuple[str, Size]:
    """Return the path of the picture of a line, and its (height, width)."""
    name = fields.text(record, "image")
    below = "" if folder == root else relative_name(folder, root)
    image = inside(root, os.path.join(below, name))
    return os.fspath(image), image_size(image)


def check_agreement(action: Action, code: str, size: Size) -> None:
    """Check that the code of a step does not contradict its action.

    Only certain cases count: code that does not call pyautogui, or that holds several actions,
    proves nothing.

    Args:
        action: the action, in pixels.
        code: its text.
        size: (height, width) of the picture.

    Raises:
        FieldError: the code is another kind of action, points elsewhere, or counts in fractions.
    """
    if _is_our_code(action, code) or not calls_pyautogui(code, or_computer=True):
        return
    try:
        coded = parse_pyautogui(code, size)  # on a screen, the pointer stops at the edge
    except HijackError:
        _check_pixels(code, size)
        return
    if _contradict(action, coded):
        raise FieldError(
            "action_code",
            f"says {_in_words(coded)}, but action is {_in_words(action)}; keep the one that was"
            " done, or leave action_code out",
        )


def _is_our_code(action: Action, code: str) -> bool:
    """Return whether code is what we write for an action; parsing takes 100 times as long."""
    try:
        return write_pyautogui(action) == code
    except HijackError:
        return False


def _check_pixels(code: str, size: Size) -> None:
    try:
        point = parse_pyautogui(code, size, normalized=True).point
    except HijackError:
        return  # the code cannot be understood without running it
    if point is not None:
        reason = f"{short_repr(code)} counts in fractions of the picture; write pixels"
        raise FieldError("action_code", reason)


def _contradict(action: Action, coded: Action) -> bool:
    kinds = {_kind(action), _kind(coded)}
    if "other" in kinds:
        return False
    if len(kinds) > 1:
        return True
    if (action.amount or 0) * (coded.amount or 0) < 0 and action.type == "scroll":
        return True  # up and down
    pairs = [(action.point, coded.point), (action.end, coded.end)]
    return any(
        _are_different_points(first, second)
        for first, second in pairs
        if first is not None and second is not None
    )


def _kind(action: Action) -> str:
    return KEYBOARD if action.type in KEYBOARD_TYPES else action.type


def _are_different_points(first: Point, second: Point) -> bool:
    return max(abs(first[0] - second[0]), abs(first[1] - second[1])) > 1


def _in_words(action: Action) -> str:
    start = "" if action.point is None else f" at {action.point}"
    end = "" if action.end is None else f" to {action.end}"
    amount = f" by {action.amount:g}" if action.type == "scroll" and action.amount else ""
    return f"{action.type}{start}{end}{amount}"


def read_boxes(
    record: JsonObject, size: Size | None, problems: LineProblems
) -> tuple[Any, tuple[Any, ...]]:
    """Return the target and the elements; empty if the size of the picture is unknown."""
    if size is None:
        return None, ()
    target = None
    label = record.get("target_box")
    if label is not None:
        targets = problems.of(lambda: fields.boxes([label], size, "target_box"))
        target = targets[0] if targets else None
    labels = record.get("elements") or []
    elements = problems.of(lambda: fields.boxes(labels, size, "elements"))
    return target, elements or ()


def read_action(value: object, size: Size, problems: LineProblems) -> Action | None:
    """Return the action of a line; all mistakes in it are noted."""
    if value is None:
        problems.errors.append(FieldError("action", "is missing"))
        return None
    if not isinstance(value, dict):
        problems.of(lambda: fields.mapping(value, "action"))
        return None
    remaining = dict(cast("dict[str, Any]", value))
    before = len(problems.errors)
    for _ in range(len(remaining) + len(ACTION_FIELDS)):
        action = problems.of(lambda: fields.action(remaining, size))
        if action is not None:
            if len(problems.errors) == before:
                problems.of(lambda: fields.check_action_fields(remaining))
            return action if len(problems.errors) == before else None
        if not _without(remaining, problems.errors[-1].field):
            return None
    return None


def _without(action: dict[str, Any], field: str) -> bool:
    """Remove the wrong field, so that the next mistake is found; return whether it was there."""
    name = field.partition(".")[2]
    if name == "type":
        repeated = action.get("type") == "other"
        action["type"] = "other"
        return not repeated
    pairs = {"x": "y", "y": "x", "x2": "y2", "y2": "x2"}
    was_there = name in action or pairs.get(name) in action
    action.pop(name, None)
    if was_there and name in _HARMLESS:
        action[name] = _HARMLESS[name]
    # The other coordinate of the point is checked on its own, with the wrong one replaced.
    if name in pairs and action.get(pairs[name]) is not None:
        action[name] = 2  # 0 or 1 might be a fraction beside it
    return was_there


def read_apps(record: JsonObject) -> tuple[str, ...]:
    """Return the applications of a line.

    Raises:
        FieldTypeError: they are not a list of strings.
    """
    value: object = record.get("apps")
    if value is None:
        return ()
    names = [name for name in fields.listed(value) if isinstance(name, str)]
    if not isinstance(value, list) or len(names) != len(fields.listed(value)):
        raise FieldTypeError("apps", "a list of strings", value)
    return tuple(fields.storable(name, "apps") for name in names)


@lru_cache(1024)  # the lines of a file have the same names
def _suggest_field(name: str, field_names: tuple[str, ...]) -> str | None:
    synonym = OTHER_NAMES.get(name.lower())
    if synonym in field_names:
        return synonym
    close = get_close_matches(name.lower(), field_names, n=1, cutoff=0.75)
    return close[0] if close else None
