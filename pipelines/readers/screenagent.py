"""Recorded sessions of ScreenAgent: a folder a session, a JSON file and a picture a step."""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.actions.dialects.field_checks import action_at, click_type, key_names, number, text
from hijack_data.actions.recorded_actions import SCREENAGENT
from hijack_data.errors import HijackError, short_repr
from hijack_data.platforms import find_platform
from hijack_data.types import Action, Size, Step, Trajectory, are_fractions

from . import fields
from .base import FileReader, Rejected, files_below, register
from .fields import FieldError, JsonObject
from .recorded_actions import RecordedStep, raw_action_text
from .recording_facts import RecordedTrajectory
from .safe_files import Source, image_size, inside, parse_file, relative_name, source_root

IMAGES = "images"
_BUTTONS = {"click": 1, "double_click": 2}
_PLAIN = {"move": "move", "down": "mouse_down", "up": "mouse_up"}
_SCROLLS = {"scroll_up": 1, "scroll_down": -1}
_ON_SCREEN = ("MouseAction", "KeyboardAction", "WaitAction")
_TEXT_ACTIONS = ("PlanAction", "EvaluateSubTaskAction")
_SYSTEM = re.compile(r"\b(\w+) operating system")


@register
class ScreenAgent(FileReader):
    """Reads ScreenAgent.

    A source is a folder with sessions anywhere below, or one JSON file. A step is a file:
    `session_id, task_prompt, saved_image_name` (in `images/` or beside it), `video_width,
    video_height, actions`. Steps are in the order of the file names, which are times, and numbered
    from 0. `task_prompt` is the instruction, in the language of the session.

    One file may hold several actions on one picture. The step's action is the first that does
    something on the screen (the picture is stale for the others); plans and evaluations alone are
    `"other"`. `action_code` keeps all of them. The platform is that which the English prompt names;
    the applications are not recorded.

    Coordinates: pixels of the picture; in `mouse_position`, `width` is x and `height` is y. A drag
    gives its end only.
    """

    name = "screenagent"
    adopts = True

    suffixes = (".json",)
    keys = (frozenset({"session_id", "saved_image_name", "actions"}),)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of their folders."""
        root = source_root(path)
        ids: set[str] = set()
        session = _Session(root, root)
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
                continue
            if file.suffix != ".json":
                continue
            if file.parent != session.folder:
                yield from session.trajectory(ids)
                session = _Session(root, file.parent)
            try:
                session.take(file)
            except FieldError as error:
                yield Rejected(relative_name(file, root), "", error.field, error.reason)
        yield from session.trajectory(ids)


@dataclass
class _Session:
    """One session, while it is read."""

    root: Path
    folder: Path
    steps: list[Step] = field(default_factory=list[Step])
    pictures: set[str] = field(default_factory=set[str])
    count: int = 0
    id: str = ""
    instruction: str = ""
    system: str = ""  # what the session's prompts say the machine runs

    def take(self, file: Path) -> None:
        """Take in a file.

        Raises:
            FieldError: it is broken, or of another session than the folder's first step.
        """
        number_of = self.count
        self.count += 1
        record = parse_file(inside(self.root, relative_name(file, self.root), ""))
        name = fields.text(record, "saved_image_name")
        session = fields.text(record, "session_id")
        if name in self.pictures:
            raise FieldError("saved_image_name", f"{name!r} was there before")
        self.pictures.add(name)
        if self.id and session != self.id:
            raise FieldError(
                "session_id", f"{session!r} is not that of the folder's first step, {self.id!r}"
            )
        step = self._step(record, name, number_of)
        self.id = session
        self.instruction = self.instruction or fields.text(record, "task_prompt")
        self.system = self.system or _system(record)
        self.steps.append(step)

    def trajectory(self, ids: set[str]) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory, if there is one."""
        if self.id in ids:
            yield Rejected(
                relative_name(self.folder, self.root),
                "",
                "session_id",
                f"{self.id!r} was there before",
            )
        elif self.steps:
            ids.add(self.id)
            yield RecordedTrajectory(
                self.id,
                ScreenAgent.name,
                self.instruction,
                tuple(self.steps),
                platform=find_platform(self.system),
                screen="desktop",
            )

    def _step(self, record: JsonObject, name: str, index: int) -> Step:
        folder = relative_name(self.folder, self.root)
        image_folder = IMAGES if (self.folder / IMAGES).is_dir() else ""
        image = inside(self.root, os.path.join(folder, image_folder, name), "saved_image_name")
        size = _checked_size(record, image_size(image, "saved_image_name"))
        listed = fields.items(record, "actions")
        entries = [fields.mapping(entry, f"actions[{i}]") for i, entry in enumerate(listed)]
        action = _action(entries, size)
        code = raw_action_text(entries, "actions")
        is_talk = all(entry.get("action_type") in _TEXT_ACTIONS for entry in entries)
        return RecordedStep(
            index=index,
            image=os.fspath(image),
            action=action,
            action_code=code,
            dialect=SCREENAGENT,
            acts=not is_talk,
        )


def _system(record: JsonObject) -> str:
    """Return the operating system in a prompt ("familiar with the Linux operating system")."""
    prompt: object = record.get("send_prompt_en")
    match = _SYSTEM.search(prompt) if isinstance(prompt, str) else None
    return match[1] if match else ""


def _checked_size(record: JsonObject, size: Size) -> Size:
    for key, side in (("video_width", size[1]), ("video_height", size[0])):
        if record.get(key, side) != side:
            raise FieldError(
                key, f"is {short_repr(record[key])}, but the picture is {size[1]}x{size[0]}"
            )
    return size


def _action(entries: list[JsonObject], size: Size) -> Action:
    if not entries:
        raise FieldError("actions", "is empty")
    for index, entry in enumerate(entries):
        kind = entry.get("action_type")
        if kind in _ON_SCREEN:
            field = f"actions[{index}]"
            try:
                return fields.check_on_screen(_read(entry, str(kind)), size, field)
            except FieldError:
                raise
            except HijackError as error:
                raise FieldError(field, str(error)) from None
        if kind not in _TEXT_ACTIONS:
            raise FieldError(
                f"actions[{index}].action_type",
                f"{short_repr(kind)} is not an action of ScreenAgent",
            )
    return Action("other")


def _read(entry: JsonObject, kind: str) -> Action:
    if kind == "WaitAction":
        return Action("wait", amount=number(entry.get("wait_time"), "wait_time"))
    if kind == "MouseAction":
        return _mouse(entry)
    name = entry.get("keyboard_action_type")
    if name == "text":
        return Action("type", text=text(entry.get("keyboard_text"), "keyboard_text"))
    if name == "press":
        return Action("hotkey", keys=key_names(entry.get("keyboard_key"), "keyboard_key", "+"))
    raise FieldError("actions.keyboard_action_type", f"{short_repr(name)} is not text or press")


def _mouse(entry: JsonObject) -> Action:
    name = str(entry.get("mouse_action_type"))
    point = _point(entry.get("mouse_position"))
    if name in _BUTTONS:
        return action_at(click_type(entry.get("mouse_button", "left"), _BUTTONS[name]), point)
    if name in _SCROLLS:
        notches = number(entry.get("scroll_repeat", 1), "scroll_repeat")
        return action_at("scroll", point, amount=_SCROLLS[name] * notches)
    if name in _PLAIN:
        return action_at(_PLAIN[name], point)
    if name == "drag" and point is not None:
        return Action("drag", x2=point[0], y2=point[1])
    reason = f"{short_repr(name)} is not an action of the mouse"
    raise FieldError("actions.mouse_action_type", reason)


def _point(value: object) -> tuple[int, int] | None:
    if value is None:
        return None
    coordinates = cast("dict[str, Any]", value) if isinstance(value, dict) else {}
    x, y = (number(coordinates.get(key), f"mouse_position.{key}") for key in ("width", "height"))
    if max(abs(x), abs(y)) > fields.MAX_PIXEL:
        raise FieldError("actions.mouse_position", f"{short_repr(value)} is beyond any screen")
    if are_fractions((x, y)):
        raise FieldError("actions.mouse_position", f"{short_repr(value)} are fractions, not pixels")
    return math.floor(x + 0.5), math.floor(y + 0.5)
