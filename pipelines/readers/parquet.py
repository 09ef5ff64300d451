"""Hugging Face data sets in Parquet or Arrow, found by their columns."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.types import Size, Trajectory

from ..choices import FRACTIONS, PIXELS, XYXY
from . import fields
from .arrow import SUFFIX as ARROW
from .base import FileReader, Rejected, files_below, register
from .box_forms import Form, detect_form
from .event_traces import TESS, TESS_OPTIONAL, TRACE, CuaBenchTrace, StepRows, TessEpisode
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .lerobot import in_lerobot
from .mind2web import COLUMNS as MIND2WEB
from .mind2web import mind2web
from .parquet_rows import ParquetRow, chat, grounding, trajectory
from .reader_options import NO_CHOICES, ReaderOptions
from .recorded_pictures import GroupRows, open_parquet
from .recording_facts import EPISODES, PICTURE_EPISODES, ROW_EPISODES
from .safe_files import Source, inside, relative_name, source_root

SUFFIXES = (".parquet", ARROW)
# What `save_to_disk` writes beside its files.
_COMPANION_FILES = ("state.json", "dataset_info.json", "dataset_dict.json")


@dataclass(frozen=True)
class _Shape:
    """One kind of table.

    Args:
        needs: columns that it must have.
        takes: other columns that are read.
        read: yields the trajectory of a row, and the errors in it; or makes the reader of the rows,
            one after the other, that have the value in `common`.
        common: the column whose value the rows of a trajectory have in common; `""` if a row is
            one.
    """

    needs: tuple[str, ...]
    takes: tuple[str, ...]
    read: Callable[[Any], Any]
    common: str = ""


CHAT_OPTIONAL = ("system", "metadata", "id", "width", "height")
SHAPES = (
    _Shape(("task_id", "instruction", "actions", "screenshots"), ("domain",), trajectory),
    *(
        _Shape((messages, images), (*CHAT_OPTIONAL, *EPISODES), chat)
        for messages in ("messages", "conversations")
        for images in ("images", "image")
    ),
    _Shape((*MIND2WEB,), ("website", "domain"), mind2web),
    _Shape(TRACE, (), CuaBenchTrace, "trajectory_id"),
    _Shape(TESS, TESS_OPTIONAL, TessEpisode, "episode_id"),
    _Shape(("image", "bbox", "instruction"), ("data_source", "file_name"), grounding),
)


@register
@dataclass(frozen=True)
class Parquet(FileReader):
    """Reads Hugging Face data sets in Parquet, and those that `save_to_disk` wrote, in Arrow.

    A source is a `.parquet` or `.arrow` file, or a folder with them anywhere below. Pictures are
    structs of `bytes` and `path`, or bytes; a `path` without bytes is a file beside the table. What
    a table holds is seen from its columns:

    - `task_id, instruction, actions, screenshots` (`markov-ai/computer-use`): a row is a
      trajectory. Actions are pyautogui code or `computer_13` JSON. The card does not say whether a
      screenshot is from before or after its action; it is taken to be from before, as the reply
      beside it was given on it.
    - `messages` or `conversations`, `images` or `image` (chat rows, cua-lite): a row is a
      trajectory; the messages are JSON text or a list. An image is shown by a part of type `image`
      (with its `index`, or the next one) or by `<image>` in the text. A reply with `tool_calls` is
      a step, its first action that does something; so is a reply in one of the languages of
      `model_replies`, and the last reply of a row with tool calls (`"done"`).
    - `image, bbox, instruction` (ScreenSpot): a row is a trajectory of one click at the middle of
      the box.
    - `annotation_id, action_uid, operation, pos_candidates, screenshot` (Multimodal-Mind2Web), see
      `mind2web`.
    - `event_name, data_json, data_images, trajectory_id` (traces of cua-bench), and `episode_id,
      step_idx, image, instruction, action_type, click_type` (TESS-AgentNet): rows of one trajectory
      follow each other, see `event_traces`.

    Rows are read one at a time. The id is `task_id`, or else the file and the row's number. The
    domain is `domain`, the `platform` in `metadata`, or `data_source`: `desktop`, `mobile`, `ios`,
    ..., with `web page` for the web ones.

    Coordinates: pixels of the screenshot in trajectories and in code; 0..1000 of the picture in
    `tool_calls`; text of Qwen-VL and UI-TARS needs the choice `coordinates`, unless the prompt
    states the resolution. What the numbers of a `bbox` are is decided for the whole table, see
    `box_forms`.
    """

    choices: ReaderOptions = NO_CHOICES
    name = "parquet"
    suffixes = SUFFIXES
    takes = ("coordinates", "boxes", "episode_key")
    episodes = (
        f"{ROW_EPISODES} (chat rows), {PICTURE_EPISODES} (grounding), an `annotation_id`"
        " (Multimodal-Mind2Web) or a row that holds a whole recording"
    )

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a table is not a part of a LeRobot data set."""
        return not in_lerobot(head.path)

    def beside(self, file: Path) -> bool:
        """Return whether `save_to_disk` wrote a file beside its tables."""
        return file.name in _COMPANION_FILES

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, rows in order."""
        root = source_root(path)
        ids = fields.RowIds()
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            elif file.suffix in SUFFIXES:
                try:
                    inside(root, relative_name(file, root), "")
                    yield from _table(ParquetRow(file, root, 0, 0, 0, choices=self.choices), ids)
                except FieldError as error:
                    yield Rejected(relative_name(file, root), "", error.field, error.reason)


def _table(first: ParquetRow, ids: fields.RowIds) -> Iterator[Trajectory | Rejected]:
    name = relative_name(first.file, first.root)
    ids.open(os.path.splitext(name)[0])
    table = open_parquet(first.file)
    try:
        shape, columns = _shape(table.schema_arrow.names, first.choices.episode_key)
        if shape.common:
            yield from _grouped(table, first, shape, columns, ids)
            return
        form = _form(table, first) if shape.read is grounding else first.form
        count = 0
        for group in range(table.num_row_groups):
            for number, record in enumerate(GroupRows(table, group, columns)):
                row = replace(first, group=group, number=number, count=count, form=form)
                for item in _row(record, row, shape, ids):
                    if isinstance(item, Trajectory):
                        yield item
                    else:
                        yield Rejected(name, f"row {count}", item.field, item.reason)
                count += 1
        if not count:
            yield Rejected(name, "", "", "holds no row")
    finally:
        table.close()


def _grouped(
    table: Any, first: ParquetRow, shape: _Shape, columns: list[str], ids: fields.RowIds
) -> Iterator[Trajectory | Rejected]:
    """Yield the trajectories of a table whose rows are steps, and everything rejected of it."""
    name = relative_name(first.file, first.root)
    episode: StepRows | None = None
    common: object = None

    def ended() -> Iterator[Trajectory | Rejected]:
        for item in ids.unique(episode.trajectory() if episode else ()):
            if isinstance(item, Trajectory):
                yield item
            else:
                yield Rejected(name, short_repr(common), item.field, item.reason)

    for count, (group, number, record) in enumerate(_rows(table, columns)):
        row = replace(first, group=group, number=number, count=count)
        try:
            if isinstance(record, FieldError):
                if episode is not None:
                    episode.skip()
                raise record
            if episode is None or record[shape.common] != common:
                yield from ended()
                episode = None
                common = record[shape.common]
                step_rows: StepRows = shape.read(common)
                episode = step_rows
            episode.add(row.holding(record))
        except FieldError as error:
            yield Rejected(name, f"row {count}", error.field, error.reason)
    yield from ended()


def _form(table: Any, first: ParquetRow) -> Form:
    """Return the form of the boxes of a table."""
    rows = list(_rows(table, ["bbox"]))
    boxes = [None if isinstance(record, FieldError) else record["bbox"] for _, _, record in rows]
    pictures = _rows(table, ["image"])
    # ScreenSpot as it is published in Parquet today has fractions, and names its files.
    published_forms = ((FRACTIONS, XYXY),) if "file_name" in table.schema_arrow.names else ()

    def size(index: int) -> Size | None:
        group, number, record = next(pictures)
        if isinstance(record, FieldError):
            return None
        row = replace(first, group=group, number=number, count=index).holding(record)
        try:
            return row.picture("image")[1]
        except FieldError:
            return None

    if not any(boxes):
        return PIXELS, XYXY
    return detect_form(boxes, size, first.choices, published_forms)


def _rows(table: Any, columns: list[str]) -> Iterator[tuple[int, int, Any]]:
    for group in range(table.num_row_groups):
        for number, record in enumerate(GroupRows(table, group, columns)):
            yield group, number, record


def _row(
    record: JsonObject | FieldError, row: ParquetRow, shape: _Shape, ids: fields.RowIds
) -> Iterator[Trajectory | FieldError]:
    if isinstance(record, FieldError):
        yield record
        return
    yield from ids.unique(shape.read(row.holding(record)))


def _shape(columns: list[str], episode_key: str | None) -> tuple[_Shape, list[str]]:
    chosen_key = () if episode_key is None else (episode_key,)
    for shape in SHAPES:
        if set(shape.needs) <= set(columns):
            used_columns = (name for name in (*shape.takes, *chosen_key) if name in columns)
            return shape, list(dict.fromkeys([*shape.needs, *used_columns]))
    alternatives = " or ".join(", ".join(shape.needs) for shape in SHAPES)
    raise FieldError("columns", f"has {short_repr(', '.join(columns))}; expected {alternatives}")
