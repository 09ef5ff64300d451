"""Histories of browser-use: `AgentHistoryList.save_to_file`, a JSON file a run."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hijack_data.actions.dialects.field_checks import key_names, number
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import ActionError, HijackError
from hijack_data.types import Action, Size, Step, Trajectory

from . import fields
from .base import DocumentReader, Rejected, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .recorded_actions import PYAUTOGUI, RecordedStep, raw_action_text
from .recorded_pictures import decode_base64, in_json
from .safe_files import image_size, inside, parse_file, relative_name

TASK = "task.json"
_SCREENSHOTS = ("", "screenshots")
_PLACEHOLDER = (4, 4)  # what browser-use stores for an empty page
_TYPING_ACTIONS = ("input", "input_text")


@register
class BrowserUse(DocumentReader):
    """Reads histories of browser-use.

    A source is such a JSON file (`history`, a list of `model_output`, `result`, `state`), or a
    folder with any number of them; each is a trajectory. A step is an entry with an action: the
    first of its `model_output`, on the page that its `state` shows (`screenshot` as base64, or the
    file that `screenshot_path` names, in the folder or in its `screenshots/`). The numbers of the
    elements are painted on the pictures. The file does not hold the task: it is read from a
    `task.json` beside it with `instruction`; without one it is empty, and reported once a file.

    Coordinates: none. Elements are named by an index, their places are in the page and not on the
    screenshot, and how many of its pixels a pixel of the page is, is not recorded. A click is
    therefore `"other"`, and so are typing (with its text), scrolling and navigation; keys, waiting
    and the end are what they are.
    """

    name = "browser_use"

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a file is a history with model outputs and states."""
        entries = (e for record in head.records for e in fields.objects(record.get("history")))
        return any({"model_output", "state"} <= entry.keys() for entry in entries)

    def beside(self, file: Path) -> bool:
        """Return whether a file states the task."""
        return file.name == TASK

    def document(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one document, and everything rejected of it."""
        yield from _history(file, root)


def _history(file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
    name = relative_name(file, root)
    steps: list[Step] = []
    try:
        record = parse_file(inside(root, name, ""))
        entries = fields.mappings(fields.items(record, "history"), "history")
        instruction = _instruction(file, root)
    except FieldError as error:
        yield Rejected(name, "", error.field, error.reason)
        return
    actions = 0
    for index, entry in enumerate(entries):
        try:
            action = _first_action(entry)
            if action:
                actions += 1
                steps.append(_step(index, *action, *_screen(entry, index, file, root)))
        except FieldError as error:
            actions += 1
            yield Rejected(name, f"history {index}", error.field, error.reason)
    if not actions:
        yield Rejected(name, "", "history", "holds no action")
    if steps and not instruction:
        reason = f"not recorded, left empty; put it into {TASK} beside the file"
        yield Rejected(name, "", "instruction", reason)
    if steps:
        yield Trajectory(
            id=os.path.splitext(name)[0],
            source=BrowserUse.name,
            instruction=instruction,
            steps=tuple(steps),
            apps=("browser",),
            platform="web",
        )


def _instruction(file: Path, root: Path) -> str:
    task = file.with_name(TASK)
    if not task.is_file():
        return ""
    return fields.text(parse_file(inside(root, relative_name(task, root), "")), "instruction")


def _first_action(entry: JsonObject) -> tuple[str, JsonObject, object] | None:
    """Return the name and the parameters of an entry's first action, and all of them."""
    if entry.get("model_output") is None:
        return None  # the model's reply could not be read
    output = fields.mapping(entry["model_output"], "model_output")
    actions = fields.mappings(fields.items(output, "action"), "model_output.action")
    for action in actions:
        for name, given in action.items():
            if isinstance(given, dict):
                return name, given, actions
    return None


def _screen(entry: JsonObject, index: int, file: Path, root: Path) -> tuple[str, Size]:
    """Return the picture of an entry, and its (height, width)."""
    state = fields.mapping(entry.get("state"), "state")
    if state.get("screenshot"):
        image = in_json(file, None, ("history", index, "state", "screenshot"))
        size = image_size(decode_base64(state["screenshot"]), "state.screenshot")
    else:
        path = _file(fields.text(state, "screenshot_path", "state.screenshot_path"), file, root)
        image, size = os.fspath(path), image_size(path, "state.screenshot_path")
    if size == _PLACEHOLDER:
        raise FieldError("state.screenshot", "is a placeholder: no page was open")
    return image, size


def _file(value: str, file: Path, root: Path) -> Path:
    """Return a screenshot by its name, since its path is that of the machine that recorded it."""
    name = value.replace("\\", "/").rpartition("/")[2]
    here = relative_name(file.parent, root)
    for folder in _SCREENSHOTS:
        candidate = os.path.normpath(os.path.join(here, folder, name))
        if name and (root / candidate).is_file():
            return inside(root, candidate, "state.screenshot_path")
    reason = f"{name!r} is neither beside the history nor in screenshots/: copy it there"
    raise FieldError("state.screenshot_path", reason)


def _step(index: int, name: str, given: JsonObject, raw: object, image: str, size: Size) -> Step:
    try:
        action = fields.check_on_screen(_action(name, given), size, name)
    except FieldError:
        raise
    except HijackError as error:
        raise FieldError("model_output.action", f"{name}: {error}") from None
    try:
        return RecordedStep(index, image, action, write_pyautogui(action), dialect=PYAUTOGUI)
    except ActionError:
        code = raw_action_text(raw, "model_output.action")
        return RecordedStep(index, image, action, code, dialect=SIZELESS)


def _action(name: str, given: JsonObject) -> Action:
    """Return an action; one that is not known, such as one of the user's own, is `"other"`."""
    match name:
        case "done":
            text = fields.text(given, "text", default="")
            return Action("fail" if given.get("success") is False else "done", text=text or None)
        case "wait":
            seconds: Any = given.get("seconds")
            return Action("wait", amount=None if seconds is None else number(seconds, "seconds"))
        case "send_keys":
            return Action("hotkey", keys=key_names(given.get("keys"), "keys", "+"))
        case _ if name in _TYPING_ACTIONS:
            return Action("other", text=fields.text(given, "text", default=""))
        case _:
            return Action("other")
