"""AITZ (Android in the Zoo), and the sets that are laid out as it is: CAGUI, guievalkit."""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.field_checks import action_at, number
from hijack_data.errors import short_repr
from hijack_data.types import Action, Size, Step, Trajectory

from . import fields
from .base import FileReader, Rejected, register
from .fields import FieldError, JsonObject
from .json_rows import FOLDERS, JsonRow, json_rows, picture_at, read_tables
from .mobile import phone_step
from .recording_facts import RecordedTrajectory
from .safe_files import Source, parse_embedded, relative_name, source_root

# A gesture that is longer, in fractions of the screen, is a swipe; AITW's own threshold.
_TAP = 0.04
# Android in the Wild's numbers; the first two are CAGUI's.
_LONG_PRESS, _NO_ACTION, _TYPE, _GESTURE = 0, 1, 3, 4
_BACK, _HOME, _ENTER, _COMPLETE, _IMPOSSIBLE = 5, 6, 7, 10, 11
_EXTRA_FIELDS = ("result_action_type", "result_action_text", "result_touch_yx", "result_lift_yx")


@register
class Aitz(FileReader):
    """Reads AITZ, CAGUI and the steps of guievalkit.

    A source is a JSON file with the steps of episodes, one after the other, or a folder with any
    number of them. A step has `episode_id`, `step_id`, `instruction`, `result_action_type` (the
    numbers of Android in the Wild), `result_touch_yx`, `result_lift_yx`, `result_action_text`, and
    `image_path`, seen from the file or the source; a picture of that name may also lie beside the
    file. The picture is from before the action. A gesture that moves by at most 0.04 of the screen
    is a click where it was lifted, as the sets' own scripts have it; a longer one is a drag. Keys
    and long presses are `"other"`. Boxes of elements are not read: their unit differs between the
    sets.

    Coordinates: fractions 0..1 of the screenshot, y before x.
    """

    name = "aitz"
    keys = (frozenset({"episode_id", "step_id", "result_action_type", "image_path"}),)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, episodes in order."""
        root = source_root(path)
        ids: set[str] = set()
        yield from read_tables(path, lambda file: _episodes(file, root, ids))


def _episodes(file: Path, root: Path, ids: set[str]) -> Iterator[Trajectory | Rejected]:
    name = relative_name(file, root)
    for episode, rows in itertools.groupby(json_rows(file), _episode_id):
        steps: list[Step] = []
        instruction = ""
        for row in rows:
            try:
                if episode in ids:
                    raise FieldError("episode_id", f"{episode!r} was there before")
                instruction = instruction or fields.text(row.record, "instruction")
                steps.append(_step(row.record, file, root))
            except FieldError as error:
                yield Rejected(name, row.location, error.field, error.reason)
        ids.add(episode)
        if steps:
            yield RecordedTrajectory(
                id=episode,
                source=Aitz.name,
                instruction=instruction,
                steps=tuple(steps),
                domain="android",
                platform="android",
                screen="phone",
            )


def _episode_id(row: JsonRow) -> str:
    """Return the id of a row's episode; `""` for a row that is broken or names none."""
    values = row.values if not isinstance(row.values, FieldError) else {}
    episode = values.get("episode_id")
    return episode if isinstance(episode, str) else ""


def _step(record: JsonObject, file: Path, root: Path) -> Step:
    fields.text(record, "episode_id")
    index = fields.step_number(record, "step_id")
    value = fields.text(record, "image_path")
    try:
        image, size = picture_at(value, file, root, "image_path", FOLDERS)
    except FieldError as error:
        try:
            image, size = picture_at(Path(value).name, file, root, "image_path", ("",))
        except FieldError:
            raise error from None
    entry = {key: record[key] for key in _EXTRA_FIELDS if key in record}
    return phone_step(index, image, size, entry, lambda _, size: _action(record, size))


def _action(record: JsonObject, size: Size) -> Action:
    """Return the action of a step, in pixels.

    Raises:
        FieldError: the step is no action of AITZ.
    """
    kind = record.get("result_action_type")
    if kind in (_LONG_PRESS, _GESTURE):
        touch, lift = (_point(record, f"result_{end}_yx") for end in ("touch", "lift"))
        start, end = (Scaling.fractions(size).point(*point) for point in (touch, lift))
        if kind == _LONG_PRESS:
            return action_at("other", end)
        if math.dist(touch, lift) <= _TAP:
            return action_at("click", end)
        return Action("drag", *start, *end)
    if kind == _TYPE:
        return Action("type", text=fields.text(record, "result_action_text", default=""))
    if kind == _NO_ACTION:
        wait = record.get("duration")
        return Action("wait", amount=None if wait is None else number(wait, "duration") / 1000)
    if kind in (_BACK, _HOME, _ENTER):
        return Action("other")
    if kind in (_COMPLETE, _IMPOSSIBLE):
        return Action("done" if kind == _COMPLETE else "fail")
    reason = f"{short_repr(kind)} is not an action of Android in the Wild"
    raise FieldError("result_action_type", reason)


def _point(record: JsonObject, key: str) -> tuple[float, float]:
    """Return x and y of a point that is recorded as y, x, in JSON text or as a list.

    Raises:
        FieldError: the value is not two numbers.
    """
    value = fields.items({key: parse_embedded(record.get(key), key)}, key)
    if len(value) != 2:
        raise FieldError(key, f"must be y and x, got {short_repr(value)}")
    return number(value[1], key), number(value[0], key)
