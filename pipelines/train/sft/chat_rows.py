"""Examples for supervised fine-tuning: the folders that `hijack export` writes, as chats.

Reads `--to chat` and `--to onlooker` (all three of its tables, or one). Pictures are opened when an
example is read. Needs pyarrow and Pillow, neither torch nor TRL.
"""

import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from PIL import Image, UnidentifiedImageError

from ...dataset.columns import pyarrow
from ...errors import DatasetError
from ...exports.chat import ROWS
from ...exports.example import IMAGE
from ...exports.onlooker.tables import TABLES
from ..split import SIDES, check_split, members

# Columns of pictures, by table of an onlooker export.
PICTURES = {
    "reminders": ("screenshot",),
    "summaries": ("before", "after"),
    "recovery": ("screenshot",),
}
_UUID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_SEED = re.compile(r"-\d+$")
_MAX_SHOWN_CHARS = 60  # characters of a text in a message


@dataclass(frozen=True, kw_only=True)
class ChatRow:
    """One example, its pictures still in their files.

    Args:
        question: the message of the user, without the places of pictures.
        answer: the answer to learn.
        pictures: files, or (Parquet file, row, column).
        trajectory: the recording that it is from.
        location: its place in the files, for messages.
    """

    question: str
    answer: str
    pictures: tuple[Path | tuple[Path, int, str], ...]
    trajectory: str
    location: str

    def open_images(self) -> list[Image.Image]:
        """Return the pictures, in RGB.

        Raises:
            DatasetError: one is missing or damaged.
        """
        return [_open_image(picture, self.location) for picture in self.pictures]

    def example(self) -> dict[str, Any]:
        """Return the row as `SFTTrainer` takes it: `prompt`, `completion` and `images`."""
        return {
            "prompt": [{"role": "user", "content": self.question}],
            "completion": [{"role": "assistant", "content": self.answer}],
            "images": self.open_images(),
        }


def read_rows(folder: Path) -> list[ChatRow]:
    """Return the examples of an export.

    Args:
        folder: of `hijack export --to chat` or `--to onlooker`, or one table of the latter.

    Raises:
        DatasetError: the folder is not such an export, or a row is damaged.
    """
    if (folder / ROWS).is_file():
        return _chat_rows(folder)
    if folder.name in TABLES and list(folder.glob("*.parquet")):
        return _table_rows(folder)
    tables = [folder / name for name in TABLES if (folder / name).is_dir()]
    if tables:
        return [row for table in tables for row in _table_rows(table)]
    raise DatasetError(
        f"{folder}: no examples to train on: neither {ROWS} nor {', '.join(TABLES)} is there;"
        f" make them with: hijack export DATASET --to chat --out {folder}"
    )


def check_rows(
    rows: Sequence[ChatRow],
    evaluation: Sequence[str] = (),
    *,
    source: str,
    osworld_split: str = "osworld",
) -> None:
    """Refuse rows of tasks that are held out or reported.

    Args:
        rows: the rows.
        evaluation: names of the tasks that are reported.
        source: their folder, for the message.
        osworld_split: as in `check_split`.

    Raises:
        LeakError: there are such rows; the message names the tasks.
    """
    task_names = _split_tasks() | set(evaluation)
    names: dict[str, None] = {}
    for trajectory in dict.fromkeys(row.trajectory for row in rows):
        names.update(dict.fromkeys(named_tasks(trajectory, task_names)))
    check_split(names, evaluation, source=source, osworld_split=osworld_split)


def named_tasks(trajectory: str, task_names: set[str] | None = None) -> list[str]:
    """Return the tasks that the id of a trajectory names.

    A build from a run has episodes as trajectories (`compare_ferries-3__marks__s0__agent`), one
    from OSWorld's results folders that end in the task's id.

    Args:
        trajectory: the column `trajectory_id`.
        task_names: the names that count; those of the splits of suite, OSWorld and toy if omitted.
    """
    names = _split_tasks() if task_names is None else task_names
    candidates = _UUID.findall(trajectory)
    for part in re.split(r"/|__", trajectory):
        candidates += [part, _SEED.sub("", part)]
    return [name for name in dict.fromkeys(candidates) if name in names]


@lru_cache(maxsize=1)
def _split_tasks() -> set[str]:
    families = ("toy", "suite", "osworld")
    return {name for family in families for side in SIDES for name in members(f"{family}/{side}")}


def _chat_rows(folder: Path) -> list[ChatRow]:
    path = folder / ROWS
    rows: list[ChatRow] = []
    with path.open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            location = f"{path}:{number}"
            try:
                row = json.loads(line)
            except ValueError as error:
                raise DatasetError(f"{location}: no JSON ({error})") from None
            names = row.get("images") if isinstance(row, dict) else None
            if not isinstance(names, list):
                raise DatasetError(f"{location}: field 'images' must be a list of file names")
            pictures = tuple(folder / str(name) for name in names)
            rows.append(_row(row, pictures, location))
    return rows


def _table_rows(folder: Path) -> list[ChatRow]:
    columns = PICTURES[folder.name]
    rows: list[ChatRow] = []
    for path in sorted(folder.glob("*.parquet")):
        try:
            table = pyarrow().parquet.read_table(path, columns=["messages", "trajectory_id"])
        except (OSError, ValueError, KeyError) as error:
            raise DatasetError(f"{path}: cannot be read ({error})") from None
        for number, row in enumerate(table.to_pylist()):
            pictures = tuple((path, number, column) for column in columns)
            rows.append(_row(row, pictures, f"{path}, row {number}"))
    return rows


def _row(
    row: Mapping[str, Any], pictures: tuple[Path | tuple[Path, int, str], ...], location: str
) -> ChatRow:
    messages = row.get("messages")
    roles = [message.get("role") for message in messages] if isinstance(messages, list) else None
    if not isinstance(messages, list) or roles != ["user", "assistant"]:
        raise DatasetError(f"{location}: 'messages' must be a question and an answer, got {roles}")
    question, answer = (str(message.get("content")) for message in messages)
    start = f"{IMAGE}\n" * len(pictures)
    text = question.removeprefix(start)
    if not question.startswith(start) or IMAGE in text or IMAGE in answer:
        raise DatasetError(
            f"{location}: the question must begin with {IMAGE} for each of {len(pictures)}"
            f" pictures, and have it nowhere else, got {question[:_MAX_SHOWN_CHARS]!r}"
        )
    return ChatRow(
        question=text,
        answer=answer,
        pictures=pictures,
        trajectory=str(row.get("trajectory_id") or ""),
        location=location,
    )


def _open_image(picture: Path | tuple[Path, int, str], location: str) -> Image.Image:
    try:
        source = picture if isinstance(picture, Path) else io.BytesIO(_read_image_bytes(*picture))
        with Image.open(source) as image:
            return image.convert("RGB")
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise DatasetError(f"{location}: a picture cannot be read ({error})") from None


def _read_image_bytes(path: Path, number: int, column: str) -> bytes:
    """Return the bytes of a picture; only its group of rows is read.

    Raises:
        ValueError: the file has no such row.
    """
    first = 0
    for group, length in enumerate(_groups(path)):
        if number < first + length:
            return _pictures(path, group, column)[number - first]
        first += length
    raise ValueError(f"there is no row {number}")


@lru_cache(maxsize=256)
def _groups(path: Path) -> tuple[int, ...]:
    """Return the number of rows in each group of a file."""
    about = pyarrow().parquet.ParquetFile(path).metadata
    return tuple(about.row_group(i).num_rows for i in range(about.num_row_groups))


@lru_cache(maxsize=8)
def _pictures(path: Path, group: int, column: str) -> tuple[bytes, ...]:
    table = pyarrow().parquet.ParquetFile(path).read_row_group(group, columns=[column])
    return tuple(row[column]["bytes"] for row in table.to_pylist())
