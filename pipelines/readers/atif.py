"""ATIF (Agent Trajectory Interchange Format, Harbor's RFC 0001): a JSON file an episode."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.actions import DIALECTS
from hijack_data.actions.dialects.field_checks import action_at, click_type, key_names, number
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import ActionError, short_repr
from hijack_data.types import Action, Box, Size, Step, Trajectory

from . import fields
from .base import DocumentReader, Rejected, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .recorded_actions import (
    ANTHROPIC,
    OPENAI,
    PYAUTOGUI,
    RecordedStep,
    first_action,
    raw_action_text,
)
from .safe_files import image_size, inside, parse_file, relative_name

PREFIX = "ATIF-v1."
# The tool of our own export, and the key of its metadata in `extra`.
TOOL = "desktop_action"
EXPORT_KEY = "agenthijack"
REPORT = "export.json"
COMPUTER = "computer"
HARBOR = "computer_action"
FINISHED = "mark_task_complete"
_LOOKING_TOOLS = ("screenshot", "cursor_position", "zoom")
_CROPPED = "zoom"
# The action types of Harbor's agent computer-1 that are one of ours.
_HARBOR = {
    "click": "click",
    "double_click": "double_click",
    "triple_click": "triple_click",
    "right_click": "right_click",
    "move": "move",
    "mouse_move": "move",
    "hover": "move",
    "drag": "drag",
}
_HARBOR_KEYS = ("key", "keypress", "hotkey")
_HARBOR_ENDS = ("done", "answer", "terminate")
# They name an address or a distance in a unit that nothing states.
_HARBOR_OTHERS = ("navigate", "scroll", "bash")
_NO_SCREEN = "no screenshot came before this action"
_STALE = "no screenshot was taken between this action and the one before"


@register
class Atif(DocumentReader):
    """Reads ATIF 1.x, whose pictures (since 1.6) are files beside the document.

    A source is such a `.json` file (`trajectory.json` in Harbor's folders), or a folder with any
    number of them. An agent step is a step if one of its tool calls acts on the screen: the first
    that does. ATIF shows a screen as the result of a step, so an action is taken on the last
    picture that a step before it shows, and each picture goes with one action. The instruction is
    the first text of the user. Steps copied from another document (`is_copied_context`) are left
    out.

    Tools are known by their names: `desktop_action` of our own export, `computer` with the
    arguments of Anthropic's or OpenAI's computer tool, and `computer_action` of Harbor's computer-1
    (its scrolling, addresses and shell commands are `"other"`). Any other tool is rejected, since
    ATIF does not say what its coordinates count. Of our own export, steps on a corrupted picture
    are rejected.

    Coordinates: pixels of the screenshot; a point outside is rejected.
    """

    name = "atif"
    keys = (frozenset({"schema_version"}),)

    def recognizes(self, head: FileHead) -> bool:
        """Return whether the document states a version of ATIF."""
        return any(str(record.get("schema_version")).startswith(PREFIX) for record in head.records)

    def beside(self, file: Path) -> bool:
        """Return whether a file is the report of our own export."""
        return file.name == REPORT

    def document(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one document, and everything rejected of it."""
        yield from _Document(file, root).read()


@dataclass
class _Document:
    """One file, while it is read."""

    file: Path
    root: Path
    instruction: str = ""
    image: str = ""
    size: Size = (0, 0)
    no_screen: str = _NO_SCREEN
    actions: int = 0
    pictures: int = 0
    steps: list[Step] = field(default_factory=list[Step])

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield what is broken, then the trajectory."""
        name = relative_name(self.file, self.root)
        try:
            record = parse_file(inside(self.root, name, ""))
            steps = fields.mappings(fields.items(record, "steps"), "steps")
            trajectory_id = (
                fields.text(record, "trajectory_id", default="") or os.path.splitext(name)[0]
            )
            domain = fields.text(_export_record(record), "domain", default="")
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
            return
        broken = [
            Rejected(name, f"step {index}", error.field, error.reason)
            for index, step in enumerate(steps, 1)
            for error in self._take(step, index)
        ]
        if not self.pictures:
            reason = "show no screenshot, as those of an agent in a terminal: nothing to corrupt"
            yield Rejected(name, "", "steps", reason)
            return
        yield from broken
        if not self.actions:
            yield Rejected(name, "", "tool_calls", "hold no action on the screen")
        elif not self.instruction:
            yield Rejected(name, "", "instruction", "no message of the user holds text")
        elif self.steps:
            yield Trajectory(trajectory_id, Atif.name, self.instruction, tuple(self.steps), domain)

    def _take(self, step: JsonObject, index: int) -> Iterator[FieldError]:
        if step.get("is_copied_context"):
            return
        calls = fields.objects(step.get("tool_calls"))
        message = step.get("message")
        try:
            if step.get("source") == "user":
                self._ask(message)
                self._look(message)
            for call in calls:
                if self._act(step, call, index):
                    break
        except FieldError as error:
            yield error
        if any(_kind(_arguments(call)) == _CROPPED for call in calls):
            return  # a part of the screen
        observation: Any = step.get("observation")
        results = observation.get("results") if isinstance(observation, dict) else None
        for result in fields.objects(results):
            try:
                self._look(result.get("content"))
            except FieldError as error:
                yield error

    def _ask(self, message: object) -> None:
        parts = fields.objects(message) if isinstance(message, list) else [{"text": message}]
        for part in parts:
            text: object = part.get("text")
            if isinstance(text, str) and text.strip() and not self.instruction:
                self.instruction = fields.storable(text.strip(), "message")

    def _look(self, content: object) -> None:
        """Take the last picture of a content as the screen.

        Raises:
            FieldError: the picture is on the web, or cannot be read.
        """
        for part in fields.objects(content):
            if part.get("type") != "image":
                continue
            self.pictures += 1
            self.image = ""
            self.no_screen = "the screenshot before this action cannot be read"
            source = fields.mapping(part.get("source"), "source")
            name = fields.text(source, "path", "source.path")
            if "://" in name:
                reason = "is on the web; only files in the folder are read"
                raise FieldError("source.path", reason)
            folder = relative_name(self.file.parent, self.root)
            path = inside(self.root, os.path.join(folder, name), "source.path")
            self.size = image_size(path, "source.path")
            self.image = os.fspath(path)

    def _act(self, step: JsonObject, call: JsonObject, index: int) -> bool:
        """Add the action of a call; return whether it is one, and not a look at the screen.

        Raises:
            FieldError: the tool is not known, or its screen is corrupted.
        """
        name = fields.text(call, "function_name", "tool_calls.function_name")
        arguments = _arguments(call)
        if name in (COMPUTER, HARBOR) and _kind(arguments) in _LOOKING_TOOLS:
            return False
        self.actions += 1
        image, no_screen = self.image, self.no_screen
        self.image, self.no_screen = "", _STALE
        if name not in _TOOLS:
            tools = ", ".join(_TOOLS)
            reason = f"{name!r} does not say what its coordinates count; known tools: {tools}"
            raise FieldError("tool_calls.function_name", reason)
        export = _export_record(step)
        if export.get("corruption", "clean") != "clean":
            reason = f"{short_repr(export['corruption'])}: the picture is corrupted, not clean"
            raise FieldError("extra.corruption", reason)
        if not image:
            raise FieldError("screenshot", no_screen)
        self.steps.append(_step(step, name, arguments, image, self.size, index))
        return True


def _step(
    step: JsonObject, name: str, arguments: JsonObject, image: str, size: Size, index: int
) -> Step:
    field = f"tool_calls.{name}"
    if name == TOOL:
        return _exported(step, arguments, image, size, index)
    if name == COMPUTER:
        dialect = ANTHROPIC if "action" in arguments else OPENAI
        action = first_action(arguments, dialect, size, field)
        return RecordedStep(
            index, image, action, raw_action_text(arguments, field), dialect=dialect
        )
    try:
        action = Action("done") if name == FINISHED else _harbor_action(arguments)
    except ActionError as error:
        raise FieldError(field, str(error)) from None
    fields.check_on_screen(action, size, field)
    if action.type != "other":
        return RecordedStep(index, image, action, write_pyautogui(action), dialect=PYAUTOGUI)
    code = "" if action.point else raw_action_text(arguments, field)
    return RecordedStep(index, image, action, code, dialect=SIZELESS)


def _exported(step: JsonObject, arguments: JsonObject, image: str, size: Size, index: int) -> Step:
    """Return a step of our own export, whose message is the action in its dialect."""
    export = _export_record(step)
    dialect = export.get("dialect")
    code = fields.text(step, "message", default="") if dialect in DIALECTS else ""
    target: Box | None = None
    if export.get("target_box") is not None:
        (target,) = fields.boxes([export["target_box"]], size, "target_box")
    return RecordedStep(
        index=fields.step_number(export, "step") if "step" in export else index,
        image=image,
        action=fields.action(arguments, size),
        action_code=code,
        target_box=target,
        dialect=str(dialect) if code else SIZELESS,
    )


def _harbor_action(arguments: JsonObject) -> Action:
    """Return an action of Harbor's computer-1.

    Raises:
        ActionError: the action is not known.
    """
    kind = arguments.get("type")
    point = None
    if arguments.get("x") is not None:
        point = round(number(arguments["x"], "x")), round(number(arguments.get("y"), "y"))
    if kind == "click":
        return action_at(click_type(arguments.get("button") or "left", 1), point)
    if kind == "drag":
        x2, y2 = (round(number(arguments.get(side), side)) for side in ("end_x", "end_y"))
        return action_at("drag", point, x2=x2, y2=y2)
    if kind in _HARBOR:
        return action_at(_HARBOR[kind], point)
    if kind == "type":
        return Action("type", text=fields.text(arguments, "text"))
    if kind in _HARBOR_KEYS:
        return Action("hotkey", keys=key_names(arguments.get("keys"), "keys", "+"))
    if kind == "wait":
        return Action("wait")
    if kind in _HARBOR_ENDS:
        return Action("done")
    if kind in _HARBOR_OTHERS:
        return action_at("other", point)
    raise ActionError(f"{short_repr(kind)} is not an action of {HARBOR}")


_TOOLS = (TOOL, COMPUTER, HARBOR, FINISHED)


def _arguments(call: JsonObject) -> JsonObject:
    value: Any = call.get("arguments")
    return value if isinstance(value, dict) else {}


def _kind(arguments: JsonObject) -> object:
    return arguments.get("action", arguments.get("type"))


def _export_record(record: JsonObject) -> JsonObject:
    """Return what our own export says in `extra`; nothing for any other document."""
    extra: Any = record.get("extra")
    export = extra.get(EXPORT_KEY) if isinstance(extra, dict) else None
    return export if isinstance(export, dict) else {}
