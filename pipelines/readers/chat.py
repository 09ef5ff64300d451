"""Training sets of chat rows in JSON: `messages` or `conversations`, and their pictures."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import short_repr
from hijack_data.types import Size, Trajectory

from . import fields
from .base import FileReader, Rejected, register
from .chat_turns import ChatTurns, messages_in
from .fields import FieldError, JsonObject
from .file_head import one_of_each
from .json_rows import JsonRow, json_rows, picture_at, picture_inside, read_tables
from .parquet_rows import screen_domain
from .reader_options import NO_CHOICES, ReaderOptions
from .recording_facts import ROW_EPISODES, RecordedTrajectory, stated_episode
from .safe_files import Source, relative_name, source_root

CLEAN = "clean"
# A row has one of each.
_MESSAGES = ("messages", "conversations")
_PICTURES = ("images", "image")
# A row of our own export has these; its picture may be corrupted.
_EXPORT_COLUMNS = ("corruption", "plan_digest", "image_sha256")
_COMPANION_FILES = ("dataset_info.json", "export.json")


@register
@dataclass(frozen=True)
class Chat(FileReader):
    """Reads training sets of chat rows for vision models.

    Known sets are those of LLaMA-Factory, ScaleCUA, Aguvis, OS-Atlas, UI-TARS and our own. A source
    is a `.jsonl` file with a row a line, a `.json` file with a list of rows, or a folder with them
    anywhere below. A row has `messages` (`role`, `content`) or `conversations` (`from`, `value`),
    and `images` or `image`: paths seen from the file or the source, or from `images/` in either, or
    base64. A row is a trajectory, whose id is its `id`, or else the file and its number; an id that
    an earlier file has comes after the name of its file. Its episode is its `trajectory_id` or
    `episode_id`, or the field of the choice `episode_key`. A picture is shown by `<image>` in the
    text of the user; each reply that is an action (see `model_replies`) is a step on the picture
    shown last. The instruction is the first text of the user, or what the
    prompts of the recipes call the task.

    Rows of our own export come back with their target; those with a corrupted picture are rejected,
    as they are no clean screens.

    Coordinates: see `model_replies`; what cannot be told needs the choice `coordinates`.
    """

    choices: ReaderOptions = NO_CHOICES
    name = "chat"
    keys = one_of_each(_MESSAGES, _PICTURES)
    takes = ("coordinates", "episode_key")
    episodes = ROW_EPISODES

    def beside(self, file: Path) -> bool:
        """Return whether a file describes the rows of LLaMA-Factory or of our own export."""
        return file.name in _COMPANION_FILES

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, rows in order."""
        root = source_root(path)
        ids = fields.RowIds()
        yield from read_tables(path, lambda file: self._file(file, root, ids), _COMPANION_FILES)

    def _file(self, file: Path, root: Path, ids: fields.RowIds) -> Iterator[Trajectory | Rejected]:
        name = relative_name(file, root)
        ids.open(os.path.splitext(name)[0])
        is_empty = True
        for row in json_rows(file):
            is_empty = False
            chat_row = _Row(file, root, self.choices, row)
            for item in ids.unique(chat_row.trajectory()):
                if isinstance(item, Trajectory):
                    yield item
                else:
                    yield Rejected(name, row.location, item.field, item.reason)
        if is_empty:
            yield Rejected(name, "", "", "holds no row")


@dataclass(frozen=True)
class _Row:
    """One row of a file."""

    file: Path
    root: Path
    choices: ReaderOptions
    row: JsonRow

    def picture(self, pictures: list[Any], column: str, index: int) -> tuple[str, Size]:
        """Return the path or reference of a picture, and its (height, width).

        Raises:
            FieldError: the row has no such picture.
        """
        field = f"{column}[{index}]"
        if index >= len(pictures):
            raise FieldError(field, f"is not there: the row has {len(pictures)}")
        value = pictures[index]
        if isinstance(value, str) and value.startswith("data:"):
            is_list = isinstance(self.row.record.get(column), list)
            pointer = (column, index) if is_list else (column,)
            return picture_inside(value, self.file, self.row, pointer, field)
        return picture_at(value, self.file, self.root, field)

    def trajectory(self) -> Iterator[Trajectory | FieldError]:
        """Yield what is broken, and the trajectory.

        Raises:
            FieldError: the row names no picture, or its picture is corrupted.
        """
        record = self.row.record
        _check_clean(record)
        key = "messages" if "messages" in record else "conversations"
        messages = messages_in(record.get(key), key)
        column = "images" if "images" in record else "image"
        column_value: object = record.get(column)
        pictures = (
            cast("list[Any]", column_value) if isinstance(column_value, list) else [column_value]
        )
        if not pictures or column_value is None:
            raise FieldError(column, "names no picture")
        turns = ChatTurns(
            lambda index: self.picture(pictures, column, index),
            pictures,
            self.choices.coordinates,
            record,
        )
        turns.add_prompt(fields.text(record, "system", default=""), "system")
        yield from turns.read(messages, key)
        if turns.steps:
            yield self._make_trajectory(turns, record)

    def _make_trajectory(self, turns: ChatTurns, record: JsonObject) -> Trajectory:
        row_id = record.get("id")
        stem = os.path.splitext(relative_name(self.file, self.root))[0]
        name = (
            str(row_id)
            if isinstance(row_id, str | int) and str(row_id)
            else f"{stem}/{self.row.number:06d}"
        )
        steps = list(turns.steps)
        target: object = record.get("target_box")
        if target is not None and all(key in record for key in _EXPORT_COLUMNS):
            size = (fields.step_number(record, "height"), fields.step_number(record, "width"))
            box = fields.boxes([target], size, "target_box")[0]
            steps = [replace(step, target_box=box) for step in steps]
        domain = record.get("domain") or record.get("platform")
        return RecordedTrajectory(
            fields.storable(name, "id"),
            Chat.name,
            turns.instruction,
            tuple(steps),
            screen_domain(domain),
            episode=stated_episode(record, self.choices.episode_key),
        )


def _check_clean(record: JsonObject) -> None:
    """Refuse a row of our own export whose picture is corrupted.

    Raises:
        FieldError: the picture is corrupted.
    """
    if all(key in record for key in _EXPORT_COLUMNS) and record["corruption"] != CLEAN:
        raise FieldError(
            "corruption",
            f"{short_repr(record['corruption'])} is in the picture already: only the clean rows"
            " of an export are screens",
        )
