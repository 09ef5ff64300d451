"""Recordings of phones: GUI-Odyssey's annotations, and AndroidControl converted to JSON."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.field_checks import action_at, number
from hijack_data.actions.dialects.ui_tars import WAIT_S
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import HijackError, quantity, short_repr
from hijack_data.types import Action, Size, Step, Trajectory

from . import fields
from .base import FileReader, Rejected, files_below, register
from .fields import FieldError, FieldTypeError, JsonObject
from .file_head import FileHead
from .json_rows import FOLDERS, picture_at
from .recorded_actions import PYAUTOGUI, RecordedStep, raw_action_text
from .recording_facts import RecordedTrajectory
from .safe_files import Source, inside, parse_file, relative_name, source_root

_FOLDERS = (*FOLDERS, "screenshots")
_KEYS = ("KEY_HOME", "KEY_BACK", "KEY_APPSELECT")
_DIRECTIONS = ("up", "down", "left", "right")
_FIVE_DIGITS = "[0-9]" * 5
_TFRECORDS = ("*.tfrecord", "*.tfrecords", f"*-{_FIVE_DIGITS}-of-{_FIVE_DIGITS}")
_WAY_OUT = (
    "a TFRecord file, which is not read: write a JSON an episode (episode_id, goal, actions,"
    ' screenshots) and its PNGs with tf.data.TFRecordDataset(files, compression_type="GZIP")'
)
_Entry = tuple[object, JsonObject]  # the picture named by a step, and its action


class _Phone(FileReader, ABC):
    """A format with one JSON file per episode."""

    name = ""
    suffixes = (".json",)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the files."""
        root = source_root(path)
        ids: set[str] = set()
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            elif file.suffix == ".json":
                yield from self._episode(file, root, ids)
            elif FileHead(file).is_named(_TFRECORDS):
                yield Rejected(relative_name(file, root), "", "", _WAY_OUT)

    def _episode(self, file: Path, root: Path, ids: set[str]) -> Iterator[Trajectory | Rejected]:
        name = relative_name(file, root)
        steps: list[Step] = []
        try:
            record = parse_file(inside(root, name, ""))
            episode, instruction, apps = self.about(record)
            if episode in ids:
                raise FieldError("episode_id", f"{episode!r} was there before")
            ids.add(episode)
            entries = self.entries(record)
            if not entries:
                raise FieldError("", "holds no step")
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
            return
        for index, (picture, entry) in enumerate(entries):
            try:
                image, size = picture_at(picture, file, root, "screenshot", _FOLDERS)
                steps.append(phone_step(index, image, size, entry, self.action))
            except FieldError as error:
                yield Rejected(name, f"step {index}", error.field, error.reason)
        if steps:
            yield RecordedTrajectory(
                id=episode,
                source=self.name,
                instruction=instruction,
                steps=tuple(steps),
                domain="android",
                apps=apps,
                screen="phone",
            )

    @abstractmethod
    def about(self, record: JsonObject) -> tuple[str, str, tuple[str, ...]]:
        """Return the id, the instruction and the apps; a broken one is a `FieldError`."""

    @abstractmethod
    def entries(self, record: JsonObject) -> list[_Entry]:
        """Return the steps in order; a broken list is a `FieldError`."""

    @abstractmethod
    def action(self, entry: JsonObject, size: Size) -> Action:
        """Return the action of a step in pixels of its picture; a broken one is a `HijackError`."""


def phone_step(
    index: int,
    image: str,
    size: Size,
    entry: JsonObject,
    read: Callable[[JsonObject, Size], Action],
) -> Step:
    """Return a step of a phone: code of a click, the entry itself without a point, or neither.

    Raises:
        FieldError: the action is broken, or outside the picture.
    """
    try:
        action = fields.check_on_screen(read(entry, size), size, "action")
    except FieldError:
        raise
    except HijackError as error:
        raise FieldError("action", str(error)) from None
    if action.point and action.type == "click":
        click = f"pyautogui.click({action.x}, {action.y})"
        return RecordedStep(index, image, action, click, dialect=PYAUTOGUI)
    code = "" if action.point else raw_action_text(dict(entry), "action")
    return RecordedStep(index, image, action, code, dialect=SIZELESS)


@register
class GuiOdyssey(_Phone):
    """Reads GUI-Odyssey: `annotations/<episode>.json` and `screenshots/`.

    A source is the folder of both, or an annotation with its pictures beside it. A step's
    screenshot is from before its action. `CLICK` and `LONG_PRESS` point, `SCROLL` is a drag, `TYPE`
    a text; keys such as HOME are `"other"`.

    Coordinates: 0..1000 of the screenshot.
    """

    name = "gui_odyssey"
    keys = (frozenset({"episode_id", "device_info", "steps"}),)

    def about(self, record: JsonObject) -> tuple[str, str, tuple[str, ...]]:
        """Return the id, the instruction and the apps.

        Raises:
            FieldError: the record is broken.
        """
        task = fields.mapping(record.get("task_info"), "task_info")
        key = "instruction" if task.get("instruction") else "task"
        name = fields.text(record, "episode_id")
        return name, fields.text(task, key), fields.strings(task.get("app"))

    def entries(self, record: JsonObject) -> list[_Entry]:
        """Return the steps in order.

        Raises:
            FieldError: the record is broken.
        """
        steps = fields.mappings(fields.items(record, "steps"), "steps")
        return [(step.get("screenshot"), step) for step in steps]

    def action(self, entry: JsonObject, size: Size) -> Action:
        """Return what was done, in pixels.

        Raises:
            FieldError: the action is not one of the format.
        """
        kind = fields.text(entry, "action")
        info = entry.get("info")
        scaling = Scaling.fractions(size, 1000)
        match kind:
            case "CLICK" if isinstance(info, str) and info in _KEYS:
                return Action("other")
            case "CLICK" | "LONG_PRESS":
                (coordinates,) = _points(info, 1)
                name = "click" if kind == "CLICK" else "other"
                return action_at(name, scaling.point(*coordinates))
            case "SCROLL":
                start, end = (scaling.point(*coordinates) for coordinates in _points(info, 2))
                return Action("drag", *start, *end)
            case "TYPE" | "TEXT":
                return Action("type", text=fields.text(entry, "info"))
            case "COMPLETE":
                return Action("done")
            case "IMPOSSIBLE" | "INCOMPLETE":
                return Action("fail")
            case "HOME" | "BACK" | "RECENT":
                return Action("other")
            case _:
                raise FieldError("action", f"{short_repr(kind)} is not an action of GUI-Odyssey")


@register
class AndroidControl(_Phone):
    """Reads AndroidControl, converted: a JSON file an episode, with the fields of its records.

    `episode_id`, `goal`, `actions` (objects with `action_type`), and `screenshots`: the paths of
    the pictures, one more than there are actions. The TFRecord files themselves hold pictures and
    protocol buffers; they are refused with the way out: one such JSON an episode and its PNGs,
    written with `tf.data.TFRecordDataset(files, compression_type="GZIP")`.

    A scroll says neither place nor distance: like `open_app` and the navigation keys it is
    `"other"`, with its direction in `action_code`. `type`, a click and a text, is `"other"` at its
    point.

    Coordinates: pixels of the screenshot.
    """

    name = "android_control"
    file_names = _TFRECORDS
    keys = (frozenset({"episode_id", "goal", "actions"}),)

    def about(self, record: JsonObject) -> tuple[str, str, tuple[str, ...]]:
        """Return the id, the instruction and the apps.

        Raises:
            FieldTypeError: the id is neither a number nor a name.
        """
        episode = record.get("episode_id")
        if isinstance(episode, bool) or not isinstance(episode, str | int) or not str(episode):
            raise FieldTypeError("episode_id", "a number or a name", episode)
        actions = fields.objects(fields.items(record, "actions"))
        app_names = [action.get("app_name") for action in actions]
        name = fields.storable(str(episode), "episode_id")
        return name, fields.text(record, "goal"), fields.strings(app_names)

    def entries(self, record: JsonObject) -> list[_Entry]:
        """Return the steps in order.

        Raises:
            FieldError: the numbers of pictures and of actions do not fit.
        """
        pictures = fields.items(record, "screenshots")
        actions = fields.items(record, "actions")
        if len(pictures) - len(actions) not in (0, 1):
            reason = f"are {len(pictures)}, but there are {len(actions)} actions"
            raise FieldError("screenshots", reason)
        return list(zip(pictures, fields.mappings(actions, "actions"), strict=False))

    def action(self, entry: JsonObject, size: Size) -> Action:
        """Return what was done, in pixels.

        Raises:
            FieldError: the action is not one of the format.
        """
        kind = fields.text(entry, "action_type")
        match kind:
            case "click" | "long_press" | "type":
                coordinates = [number(entry.get(side), side) for side in ("x", "y")]
                point = Scaling.pixels(None).point(*coordinates)
                text = fields.text(entry, "text") if kind == "type" else None
                name = "click" if kind == "click" else "other"
                return action_at(name, point, text=text)
            case "input_text":
                return Action("type", text=fields.text(entry, "text"))
            case "scroll":
                direction = fields.text(entry, "direction")
                if direction not in _DIRECTIONS:
                    reason = f"{short_repr(direction)} is not up, down, left or right"
                    raise FieldError("direction", reason)
                return Action("other")
            case "wait":
                return Action("wait", amount=WAIT_S)
            case "open_app" | "navigate_home" | "navigate_back":
                return Action("other")
            case _:
                reason = f"{short_repr(kind)} is not an action of AndroidControl"
                raise FieldError("action_type", reason)


def _points(value: object, count: int) -> list[tuple[float, float]]:
    """Return points given as a list of pairs.

    Raises:
        FieldError: the value is not a list of `count` pairs.
    """
    listed = cast("list[Any]", value) if isinstance(value, list) else []
    if len(listed) != count or not all(
        isinstance(pair, list) and len(pair) == 2 for pair in listed
    ):
        raise FieldError(
            "info", f"must be {quantity(count, 'point')} [x, y], got {short_repr(value)}"
        )
    return [(number(x, "info"), number(y, "info")) for x, y in listed]
