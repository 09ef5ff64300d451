"""Tables whose rows are the steps of a trajectory: traces of cua-bench, and TESS-AgentNet."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.field_checks import action_at, key_names, number
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import ActionError, HijackError, short_repr
from hijack_data.platforms import find_platform
from hijack_data.types import Action, Platform, Size, Step, Trajectory

from . import fields
from .fields import FieldError, JsonObject
from .parquet_rows import SOURCE, ParquetRow
from .recorded_actions import OPENAI, PYAUTOGUI, RecordedStep, first_action, raw_action_text
from .recording_facts import RecordedTrajectory
from .safe_files import parse_embedded

TRACE = ("event_name", "data_json", "data_images", "trajectory_id")
TESS = ("episode_id", "step_idx", "image", "instruction", "action_type", "click_type")
TESS_OPTIONAL = ("mouse_x", "mouse_y", "keyboard_text", "os_type")
_POINTER_ACTIONS = {
    "ClickAction": "click",
    "RightClickAction": "right_click",
    "DoubleClickAction": "double_click",
    "MiddleClickAction": "middle_click",
    "MoveToAction": "move",
}
# By the card of the set. Scrolling says no distance.
_CLICKS = ("move", "click", "right_click", "double_click", "middle_click")
_CLICKS_TESS = (*_CLICKS, "other", "other", "mouse_down", "mouse_up")
_MOUSE, _KEYBOARD = 0, 1
_FRAME_BEFORE = "step:before"
_AGENT = "agent_step"


class StepRows(ABC):
    """One trajectory, while its rows are read in order.

    Args:
        name: the value of the column that its rows have in common.
    """

    def __init__(self, name: object) -> None:
        self.name = fields.text({"id": name}, "id")
        self.steps: list[Step] = []
        self.instruction = ""
        self.platform: Platform | None = None
        self.screen: tuple[str, Size] | None = None

    @abstractmethod
    def add(self, row: ParquetRow) -> None:
        """Take in a row.

        Raises:
            FieldError: the row is broken.
        """

    def skip(self) -> None:
        """Forget the screen: a row that cannot be read may hold an action that changed it."""
        self.screen = None

    def trajectory(self) -> Iterator[Trajectory | FieldError]:
        """Yield the trajectory, after a missing instruction; nothing if all of it is broken."""
        if self.steps and not self.instruction:
            yield FieldError("instruction", "not recorded, left empty")
        if self.steps:
            about = (self.name, SOURCE, self.instruction, tuple(self.steps))
            # Files of a set may end within an episode, whose other part then has another id.
            yield RecordedTrajectory(*about, platform=self.platform, episode=self.name)

    def _append(self, index: int, image: str, size: Size, action: Action, code_text: str) -> None:
        """Add a step whose code is made of its action, or else is `code_text`."""
        fields.check_on_screen(action, size, "action")
        dialect = PYAUTOGUI
        try:
            code = write_pyautogui(action)
        except ActionError:
            dialect = SIZELESS
            code = "" if action.point else code_text
        self.steps.append(RecordedStep(index, image, action, code, dialect=dialect))


class CuaBenchTrace(StepRows):
    """A trace of cua-bench: rows of events, of which these are read.

    - `reset`: the task's description, the operating system, and the first screen;
    - `step:before`: the screen and the action on it, as Python writes it (`ClickAction(x=1, y=2)`);
    - `agent_step`: in `output`, the first `computer_call` that does more than look, on the screen
      of the event before; the screen after it.

    Scrolling has no unit and is `"other"`. Coordinates: pixels of the screenshot.
    """

    def __init__(self, name: object) -> None:
        super().__init__(name)
        self.actions = 0
        self.stepped = False

    def add(self, row: ParquetRow) -> None:
        """Take in an event.

        Raises:
            FieldError: the event is broken.
        """
        before = self.screen
        self.screen = None
        count = len(fields.listed(row.record.get("data_images")))
        if count:
            self.screen = row.picture("data_images", count - 1)
        event = fields.text(row.record, "event_name")
        data = fields.mapping(parse_embedded(row.record.get("data_json"), "data_json"), "data_json")
        if not count and event not in (_FRAME_BEFORE, _AGENT):
            self.screen = before
        if event == "reset":
            self.instruction = self.instruction or _description(data.get("task"))
            setup: Any = data.get("setup_config")
            system = setup.get("os_type") if isinstance(setup, dict) else None
            self.platform = find_platform(system)
        elif event == _FRAME_BEFORE:
            self.stepped = True
            image, size = self._count_action(self.screen)
            self._append(self.actions, image, size, *_python_action(data.get("action")))
        elif event == _AGENT and not self.stepped:
            self._call(before, data)

    def _call(self, screen: tuple[str, Size] | None, data: JsonObject) -> None:
        for item in fields.objects(data.get("output")):
            action: Any = item.get("action")
            if item.get("type") == "function_call":
                reason = f"{item.get('name')!r:.60} does not say what its coordinates count"
                raise FieldError("data_json.output", reason)
            if item.get("type") != "computer_call" or not isinstance(action, dict):
                continue
            if action.get("type") == "screenshot":
                continue
            image, size = self._count_action(screen)
            parsed_action = first_action(action, OPENAI, size, "data_json.output")
            code = raw_action_text(action, "data_json.output")
            self.steps.append(
                RecordedStep(self.actions, image, parsed_action, code, dialect=OPENAI)
            )
            return

    def _count_action(self, screen: tuple[str, Size] | None) -> tuple[str, Size]:
        """Count an action, and return the screen that it was taken on.

        Raises:
            FieldError: no screenshot came before the action.
        """
        self.actions += 1
        if screen is None:
            raise FieldError("data_images", "no screenshot came before this action")
        return screen


class TessEpisode(StepRows):
    """An episode of TESS-AgentNet: a row a step, with its screen before the action.

    Text of the keyboard that holds special tokens, which the card does not list, is `"other"`, and
    so is scrolling. Coordinates: fractions 0..1 of the screenshot.
    """

    def add(self, row: ParquetRow) -> None:
        """Take in a step.

        Raises:
            FieldError: the row is broken.
        """
        record = row.record
        image, size = row.picture("image")
        index = fields.step_number(record, "step_idx")
        self.instruction = self.instruction or fields.text(record, "instruction")
        self.platform = "linux" if record.get("os_type") == "ubuntu" else None
        try:
            action = _tess_action(record, size)
        except HijackError as error:
            raise FieldError("action_type", str(error)) from None
        self._append(index, image, size, action, fields.text(record, "keyboard_text", default=""))


def _tess_action(record: JsonObject, size: Size) -> Action:
    """Return the action of a row.

    Raises:
        ActionError: the card of the set does not describe the action.
    """
    kind, click = record.get("action_type"), record.get("click_type")
    if kind == _KEYBOARD:
        text = fields.text(record, "keyboard_text")
        return Action("other") if "<" in text else Action("type", text=text)
    if kind != _MOUSE or not isinstance(click, int) or not 0 <= click < len(_CLICKS_TESS):
        raise ActionError(f"{kind!r} with click_type {click!r} is not described by the set's card")
    fractions = [number(record.get(side), side) for side in ("mouse_x", "mouse_y")]
    return action_at(_CLICKS_TESS[click], Scaling.fractions(size).point(*fractions))


def _python_call(value: object) -> tuple[str, dict[str, Any]]:
    """Return the name and the keywords of a Python call with literal values.

    Raises:
        ValueError: the text is anything else.
    """
    if not isinstance(value, str):
        raise ValueError(value)
    try:
        call = ast.parse(value.strip(), mode="eval").body
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and not call.args:
            arguments = {
                str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords
            }
            return call.func.id, arguments
    except (SyntaxError, MemoryError, RecursionError, TypeError):
        pass
    raise ValueError(value)


def _description(task: object) -> str:
    """Return the description of a task, as Python writes the object; `""` if it has none."""
    try:
        description = _python_call(task)[1].get("description")
    except ValueError:
        return ""
    if not isinstance(description, str):
        return ""
    return fields.storable(description.strip(), "data_json.task")


def _python_action(value: object) -> tuple[Action, str]:
    """Return an action, as Python writes the object, and that text.

    Raises:
        FieldError: the value is not an action.
    """
    try:
        name, arguments = _python_call(value)
        return _action(name, arguments), fields.storable(str(value), "data_json.action")
    except FieldError:
        raise
    except (HijackError, ValueError) as error:
        reason = f"{short_repr(value)} is not an action of cua-bench"
        detail = str(error) if isinstance(error, ActionError) else reason
        raise FieldError("data_json.action", detail) from None


def _action(name: str, arguments: dict[str, Any]) -> Action:
    def point(x: str, y: str) -> tuple[int, int]:
        coordinates = [number(arguments.get(side), side) for side in (x, y)]
        return Scaling.pixels(None).point(*coordinates)

    if name in _POINTER_ACTIONS:
        return action_at(_POINTER_ACTIONS[name], point("x", "y"))
    match name:
        case "DragAction":
            x2, y2 = point("to_x", "to_y")
            return action_at("drag", point("from_x", "from_y"), x2=x2, y2=y2)
        case "TypeAction":
            return Action("type", text=fields.text(arguments, "text", default=""))
        case "KeyAction":
            return Action("hotkey", keys=key_names(arguments.get("key"), "key"))
        case "HotkeyAction":
            return Action("hotkey", keys=key_names(arguments.get("keys"), "keys"))
        case "WaitAction":
            return Action("wait", amount=number(arguments.get("seconds", 1.0), "seconds"))
        case "DoneAction":
            return Action("done")
        case "ScrollAction":
            return Action("other")
        case _:
            raise ActionError(f"{name} is not an action of cua-bench")
