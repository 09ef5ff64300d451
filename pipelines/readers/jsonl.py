"""Our plain format: `trajectories.jsonl` with one step a line, and the screenshots beside it."""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.types import Step, Trajectory

from . import fields
from .base import FileReader, Rejected, files_below, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .plain_fields import LineProblems, identity, read_apps, read_step
from .safe_files import (
    Part,
    RecordLine,
    Source,
    inside,
    line_at,
    lines,
    parse,
    refuse_array,
    relative_name,
    source_root,
)

RECORDS = "trajectories.jsonl"
_KEYS = frozenset({"trajectory_id", "step"})


@dataclass
class _Index:
    """The places of each trajectory's lines: triples of step, offset and line number."""

    root: Path
    folder: Path
    places: "dict[str, array[int]]" = field(default_factory=dict)
    ids: set[str] = field(default_factory=set[str])

    def add(self, line: RecordLine) -> None:
        """Take in a line; one that is broken or repeats an id is a `FieldError`."""
        record = line.record()
        problems = LineProblems()
        name, step, row_id = identity(record, problems)
        if row_id and row_id in self.ids:
            problems.errors.append(FieldError("id", f"{row_id!r} was used by an earlier line"))
        if problems.errors or name is None or step is None:
            read_step(record, self.root, self.folder, problems=problems)
            return
        self.ids.add(row_id or "")
        self.places.setdefault(name, array("q")).extend((step, line.offset, line.number))

    def step_lines(self, name: str) -> list[tuple[int, int, int]]:
        """Return the triples of one trajectory in the order of its steps."""
        flat = self.places[name]
        steps = flat[0::3]
        return sorted(zip(steps, flat[1::3], flat[2::3], strict=True))


@register
class Jsonl(FileReader):
    """Reads our plain format, which docs/input_format.md describes.

    A source is a folder with `trajectories.jsonl`, there or anywhere below, or such a file. Each
    line is an object with `trajectory_id`, `step` (>= 0), `instruction`, `image` (path from the
    file's folder, inside the source), `action` {type, x, y, x2, y2, text, keys, amount} and, if
    known, `id`, `action_code`, `target_box` (x1, y1, x2, y2), `elements` (boxes), `domain`, `apps`
    and `platform` (see `hijack_data.types.Platform`). Lines of one trajectory may stand anywhere in
    the file; steps come out in order. Other fields are kept as `extra`, unless their name is a slip
    for one of these.

    Of two files that name a trajectory alike, the later one's gets the folder of its file before
    the name.

    Coordinates: pixels of the image, origin top-left. Points outside the image are rejected; boxes
    are clipped to it.
    """

    name = "jsonl"

    file_names = (RECORDS,)
    suffixes = ("",)
    keys = (_KEYS,)

    def recognizes(self, head: FileHead) -> bool:
        """Return whether the first lines are steps, and not the chat rows of an export."""
        return any(keys >= _KEYS and "messages" not in keys for keys in head.keys)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, in the order in which they begin."""
        root = source_root(path)
        used_ids: set[str] = set()
        yield from (item for item in files_below(path) if isinstance(item, Rejected))
        for file in _record_files(path):
            records = relative_name(file, root)
            try:
                inside(root, records, "")
                refuse_array(file)
                yield from _file(file, records, root, used_ids)
            except FieldError as error:
                yield Rejected(records, "", error.field, error.reason)
            except OSError as error:
                yield Rejected(records, "", "", f"cannot be read ({error.strerror or error})")


def _record_files(source: Source) -> list[Path]:
    """Return the files to read; of a folder without any, the one that it should have."""
    if isinstance(source, Part):
        return list(source.files)
    if source.is_file():
        return [source]
    record_files = [
        file for file in files_below(source) if isinstance(file, Path) and file.name == RECORDS
    ]
    return record_files or [source / RECORDS]


def _file(
    records: Path, file_name: str, root: Path, used_ids: set[str]
) -> Iterator[Trajectory | Rejected]:
    index = _Index(root, records.parent)
    yield from _index(records, file_name, index)
    with records.open("rb") as file:
        for name in index.places:
            yield from _trajectory(file, file_name, name, _free(name, file_name, used_ids), index)


def _free(name: str, records: str, used_ids: set[str]) -> str:
    """Return the id of a trajectory: its name, after the file's folder if the name is taken."""
    folder = Path(records).parent.as_posix()
    return fields.unique_id(name, Path(records).stem if folder == "." else folder, used_ids)


def _index(records: Path, file_name: str, index: _Index) -> Iterator[Rejected]:
    for line in lines(records):
        try:
            index.add(line)
        except FieldError as error:
            yield Rejected(file_name, f"line {line.number}", error.field, error.reason)


def _trajectory(
    file: Any, records: str, name: str, trajectory_id: str, index: _Index
) -> Iterator[Trajectory | Rejected]:
    steps: list[Step] = []
    about: dict[str, Any] = {}
    for _, offset, number in index.step_lines(name):
        try:
            record = fields.mapping(parse(line_at(file, offset)), "")
            step = read_step(record, index.root, index.folder)
            if steps and steps[-1].index == step.index:
                raise FieldError("step", f"step {step.index} of {name!r} was there before")
            _agree(about, record)
            steps.append(step)
        except FieldError as error:
            yield Rejected(records, f"line {number}", error.field, error.reason)
    if steps:
        yield Trajectory(source=Jsonl.name, id=trajectory_id, steps=tuple(steps), **about)


def _agree(about: dict[str, Any], record: JsonObject) -> None:
    # A step must agree with the first one about the whole trajectory.
    facts = {
        "instruction": fields.text(record, "instruction"),
        "domain": fields.text(record, "domain", default=""),
        "apps": read_apps(record),
        "platform": fields.platform(record.get("platform"), "platform"),
    }
    for key, value in facts.items():
        if about.setdefault(key, value) != value:
            first = short_repr(about[key])
            raise FieldError(key, f"differs from that of the trajectory's first step, {first}")
