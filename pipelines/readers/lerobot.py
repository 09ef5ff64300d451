"""LeRobot v3 data sets whose actions are pyautogui code."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hijack_data.types import Step, Trajectory

from . import fields
from .base import Rejected, files_below, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .folder_reader import FolderReader, folder_id
from .parquet_rows import ParquetRow
from .recorded_actions import PYAUTOGUI, RecordedStep, first_action, raw_action_text
from .recorded_pictures import GroupRows, open_parquet
from .safe_files import inside, parse_file, relative_name

INFO = "info.json"
META = "meta"
ACTION = "action"
_VERSION = "v3."
_TASKS = "tasks.parquet"
# `tasks.parquet` is a data frame whose index is the text.
_TASK_COLUMNS = ("task", "__index_level_0__")


def in_lerobot(file: Path) -> bool:
    """Return whether a file is part of a LeRobot data set."""
    return any((folder / META / INFO).is_file() for folder in list(file.parents)[:4])


@register
class LeRobot(FolderReader):
    """Reads LeRobot v3: `meta/info.json`, `meta/tasks.parquet`, `data/**/*.parquet`.

    A source is the folder of a set, or one above. LeRobot describes robots: a frame has a picture
    and an `action`, a vector of numbers whose meaning is the set's own. Read are sets in which
    `action` is text, pyautogui code for the frame's picture, and the one picture feature is stored
    in the tables (`dtype` `image`); each episode is a trajectory, whose task is its instruction.
    Other sets are refused, with what is missing.

    Coordinates: pixels of the frame; fractions, and a point outside, are rejected.
    """

    name = "lerobot"
    records = INFO
    suffixes = (INFO,)
    keys = (frozenset({"codebase_version", "features"}),)

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a file is the description of a set."""
        return head.path.name == INFO and head.path.parent.name == META

    def beside(self, file: Path) -> bool:
        """Return whether a file is part of a set."""
        return in_lerobot(file)

    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectories of one set, and everything rejected of it."""
        name = relative_name(file, root)
        try:
            info = parse_file(inside(root, name, ""))
            column = _picture_column(info)
            home = file.parent.parent
            tasks = _tasks(home / META / _TASKS)
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
            return
        yield from _Set(home, root, column, tasks).read()


class _Set:
    """One data set, while it is read."""

    def __init__(self, home: Path, root: Path, column: str, tasks: dict[object, str]) -> None:
        self.home = home
        self.root = root
        self.column = column
        self.tasks = tasks
        self.episode = -1
        self.steps: list[Step] = []
        self.instruction = ""

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield the episodes; their frames follow each other, if need be from file to file."""
        for file in files_below(self.home / "data"):
            if isinstance(file, Path) and file.suffix == ".parquet":
                yield from self._table(file)
        yield from self._ended()

    def _table(self, file: Path) -> Iterator[Trajectory | Rejected]:
        name = relative_name(file, self.root)
        columns = [self.column, ACTION, "episode_index", "frame_index", "task_index"]
        count = 0
        try:
            table = open_parquet(file)
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
            return
        missing = [column for column in columns if column not in table.schema_arrow.names]
        if missing:
            yield Rejected(name, "", "columns", f"lack {', '.join(missing)}")
            return
        for group in range(table.num_row_groups):
            for number, record in enumerate(GroupRows(table, group, columns)):
                row = ParquetRow(file, self.root, group, number, count)
                try:
                    if isinstance(record, FieldError):
                        raise record
                    episode = fields.step_number(record, "episode_index")
                    if episode != self.episode:
                        yield from self._ended()
                        self.episode = episode
                    self._frame(row.holding(record))
                except FieldError as error:
                    yield Rejected(name, f"row {count}", error.field, error.reason)
                count += 1
        table.close()

    def _frame(self, row: ParquetRow) -> None:
        record = row.record
        self.instruction = self.instruction or self.tasks.get(record["task_index"], "")
        code = fields.text(record, ACTION)
        image, size = row.picture(self.column)
        action = first_action(code, PYAUTOGUI, size, ACTION)
        index = fields.step_number(record, "frame_index")
        self.steps.append(RecordedStep(index, image, action, raw_action_text(code, ACTION)))

    def _ended(self) -> Iterator[Trajectory | Rejected]:
        steps, instruction = tuple(self.steps), self.instruction
        self.steps, self.instruction = [], ""
        if not steps:
            return
        name = f"{folder_id(self.home, self.root)}/{self.episode:06d}"
        if not instruction:
            location = f"episode {self.episode}"
            yield Rejected(f"{META}/{_TASKS}", location, "task", "not recorded, left empty")
        yield Trajectory(name, LeRobot.name, instruction, steps)


def _picture_column(info: JsonObject) -> str:
    """Return the column of the pictures.

    Raises:
        FieldError: the set is of another version, or holds no actions on a screen.
    """
    version = fields.text(info, "codebase_version")
    if not version.startswith(_VERSION):
        reason = f"is {version!r:.20}: convert the set to v3.0 with lerobot's own script"
        raise FieldError("codebase_version", reason)
    features = fields.mapping(info.get("features"), "features")
    action = fields.mapping(features.get(ACTION), f"features.{ACTION}")
    if action.get("dtype") != "string":
        kind = f"{action.get('dtype')} {action.get('shape')}"
        reason = (
            f"is {kind:.60}: nothing says which number is a place on the screen, a button or a key;"
            " write the plain format (docs/input_format.md), or pyautogui code as text"
        )
        raise FieldError(f"features.{ACTION}", reason)
    kinds: dict[str, Any] = {
        name: feature.get("dtype")
        for name, feature in features.items()
        if isinstance(feature, dict)
    }
    pictures = [name for name, kind in kinds.items() if kind in ("image", "video")]
    if len(pictures) != 1:
        names = ", ".join(pictures) or "no picture"
        raise FieldError("features", f"has {names:.80}; exactly one must be the screen")
    if kinds[pictures[0]] == "video":
        reason = (
            "is a video, whose frames are not the recorded pixels: record with use_videos=False, or"
            " write the frames as pictures with the plain format (docs/input_format.md)"
        )
        raise FieldError(f"features.{pictures[0]}", reason)
    return pictures[0]


def _tasks(file: Path) -> dict[object, str]:
    """Return the texts of the tasks by their index."""
    if not file.is_file():
        return {}
    table = open_parquet(file)
    names = table.schema_arrow.names
    text = next((name for name in _TASK_COLUMNS if name in names), None)
    tasks: dict[object, str] = {}
    if text is None or "task_index" not in names:
        return tasks
    for group in range(table.num_row_groups):
        for record in GroupRows(table, group, ["task_index", text]):
            if not isinstance(record, FieldError):
                tasks[record["task_index"]] = fields.text(record, text, "task", default="")
    table.close()
    return tasks
