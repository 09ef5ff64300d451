"""One row of a Parquet table as a trajectory, a chat, or a box on a picture."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

from hijack_data.surrogates import has_half
from hijack_data.types import Action, Size, Step, Trajectory

from ..choices import PIXELS, XYXY
from . import fields
from .box_forms import Form, box_center, box_in
from .chat_turns import ChatTurns, TurnImage, messages_in
from .fields import FieldError, JsonObject
from .reader_options import NO_CHOICES, ReaderOptions
from .recorded_actions import COMPUTER_13, PYAUTOGUI, RecordedStep, read_recorded
from .recorded_pictures import as_bytes, in_parquet
from .recording_facts import RecordedTrajectory, stated_episode
from .safe_files import image_size, inside, parse, parse_embedded, relative_name

SOURCE = "parquet"
# The names of pages without a browser around them, in cua-lite (`platform`) and ScreenSpot
# (`data_source`, by site).
WEB = ("web", "gitlab", "shop", "forum", "tool")


@dataclass(frozen=True)
class ParquetRow:
    """One row of a table, and its place.

    Args:
        file: the table.
        root: the folder of the source.
        group: index of the row group.
        number: index of the row in its group.
        count: index of the row in the file.
        values: values by column.
        choices: the choices of the user.
        form: the form of the boxes of the table.
    """

    file: Path
    root: Path
    group: int
    number: int
    count: int
    values: JsonObject | None = None
    choices: ReaderOptions = NO_CHOICES
    form: Form = (PIXELS, XYXY)

    def holding(self, values: JsonObject) -> "ParquetRow":
        """Return the same row with its values."""
        return replace(self, values=values)

    @property
    def record(self) -> JsonObject:
        """The values."""
        return self.values or {}

    @property
    def name(self) -> str:
        """An id for rows that have none: the file without its suffix, and the row."""
        stem, _ = os.path.splitext(relative_name(self.file, self.root))
        return f"{stem}/{self.count:06d}"

    def picture(self, column: str, item: int | None = None) -> tuple[str, Size]:
        """Return the path or reference of a picture in the row, and its (height, width).

        Args:
            column: the column of the picture.
            item: its index, if the column is a list.

        Raises:
            FieldError: there is no such picture, or it cannot be read.
        """
        field = column if item is None else f"{column}[{item}]"
        value: Any = self.record.get(column)
        if item is not None:
            try:
                value = value[item]
            except (IndexError, TypeError):
                raise FieldError(field, "is not there") from None
        entry = cast("dict[str, Any]", value) if isinstance(value, dict) else {"path": value}
        path = entry.get("path")
        if not entry.get("bytes") and isinstance(path, str):
            folder = relative_name(self.file.parent, self.root)
            image = inside(self.root, os.path.join(folder, path), field)
            return os.fspath(image), image_size(image, field)
        try:
            size = image_size(as_bytes(value), field)
        except FieldError as error:
            raise FieldError(field, error.reason) from None
        return in_parquet(self.file, self.group, self.number, column, item), size

    def picture_key(self, column: str) -> str:
        """Return a text that two rows share if they show the same picture file."""
        value: Any = self.record.get(column)
        entry = cast("dict[str, Any]", value) if isinstance(value, dict) else {"path": value}
        if not entry.get("bytes") and isinstance(entry.get("path"), str):
            return entry["path"]
        return sha256(as_bytes(value)).hexdigest()


def trajectory(row: ParquetRow) -> Iterator[Trajectory | FieldError]:
    """Read a row of parallel lists `actions` and `screenshots`.

    Raises:
        FieldError: the row as a whole is broken; broken steps are yielded.
    """
    record = row.record
    name = fields.text(record, "task_id")
    instruction = fields.text(record, "instruction")
    actions = fields.items(record, "actions")
    pictures = fields.items(record, "screenshots")
    if len(actions) != len(pictures):
        reason = f"are {len(pictures)}, but there are {len(actions)} actions"
        raise FieldError("screenshots", reason)
    if not actions:
        raise FieldError("actions", "is empty")
    steps: list[Step] = []
    for index, action in enumerate(actions):
        field = f"actions[{index}]"
        try:
            steps.append(_step(row, index, action, field))
        except FieldError as error:
            yield FieldError(error.field or field, error.reason)
    if steps:
        domain = fields.text(record, "domain", default="")
        key = row.choices.episode_key
        episode = stated_episode(record, key) if key else None
        yield RecordedTrajectory(name, SOURCE, instruction, tuple(steps), domain, episode=episode)


def _step(row: ParquetRow, index: int, action: object, field: str) -> Step:
    image, size = row.picture("screenshots", index)
    text = fields.text({"action": action}, "action", field)
    raw: object = text
    dialect = PYAUTOGUI
    if text.lstrip().startswith("{"):
        raw = parse(text.encode())
        dialect = COMPUTER_13
    recorded_action = read_recorded(raw, dialect, size, field, row.choices.coordinates, PIXELS)
    code = recorded_action.code
    if recorded_action.dialect == dialect == COMPUTER_13:
        code = text
    return RecordedStep(index, image, recorded_action.action, code, dialect=recorded_action.dialect)


def grounding(row: ParquetRow) -> Iterator[Trajectory | FieldError]:
    """Read a row with a box on a picture: one click at its middle."""
    record = row.record
    image, size = row.picture("image")
    box = box_in(row.form, record.get("bbox"), size, "bbox")
    x, y = box_center(box)
    step = Step(0, image, Action("click", x, y), target_box=box)
    domain = screen_domain(record.get("data_source"))
    instruction = fields.text(record, "instruction")
    key = row.choices.episode_key
    episode = stated_episode(record, key) if key else row.picture_key("image")
    yield RecordedTrajectory(row.name, SOURCE, instruction, (step,), domain, episode=episode)


def chat(row: ParquetRow) -> Iterator[Trajectory | FieldError]:
    """Read a row of chat messages and the images that they show."""
    record = row.record
    key = "messages" if "messages" in record else "conversations"
    messages = messages_in(record.get(key), key)
    has_several = "images" in record
    pictures = fields.items(record, "images") if has_several else [record.get("image")]

    def picture(index: int) -> TurnImage:
        if has_several:
            return row.picture("images", index)
        if index:
            reason = f"there is one picture, but the messages show {index + 1}"
            raise FieldError("image", reason)
        return row.picture("image")

    turns = ChatTurns(picture, pictures, row.choices.coordinates, record)
    turns.add_prompt(fields.text(record, "system", default=""), "system")
    yield from turns.read(messages, key)
    name = fields.text(record, "id", default="") or row.name
    platform = screen_domain(_metadata(record.get("metadata")).get("platform"))
    if turns.steps:
        yield RecordedTrajectory(
            name,
            SOURCE,
            turns.instruction,
            tuple(turns.steps),
            platform,
            episode=stated_episode(record, row.choices.episode_key),
        )


def _metadata(value: object) -> JsonObject:
    """Return the metadata of a chat row, JSON text or a struct; nothing if it is neither."""
    try:
        return fields.mapping(parse_embedded(value, "metadata"), "metadata")
    except FieldError:
        return {}


def screen_domain(value: object) -> str:
    """Return the domain of a platform's name: `web page`, or the name itself; `""` without one."""
    if not isinstance(value, str) or has_half(value):
        return ""
    word = value.strip().lower()
    return "web page" if word in WEB else word
