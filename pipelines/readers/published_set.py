"""The base of the readers of published grounding sets.

The reader `grounding` detects the form of any table; these readers are for one set each, refuse
everything else, and also read fields that only their set has. They are selected by name: `--format
screenspot_v2`.
"""

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.types import Action, Box, Size, Step, Trajectory

from ..errors import SourceError
from . import fields
from .base import FileReader, Rejected, files_below
from .box_forms import Form, box_center, box_in
from .fields import FieldError, JsonObject
from .grounding import program_and_platform
from .json_rows import JsonRow, json_rows, picture_at
from .parquet_rows import screen_domain
from .recording_facts import PICTURE_EPISODES, RecordedTrajectory
from .safe_files import Source, inside, relative_name, source_root


@dataclass(frozen=True, kw_only=True)
class GroundingTarget:
    """The target of a row.

    Args:
        action: the action, in pixels of the picture.
        box: the target box; `None` if there is none.
        extra: further data on the target, for the column `extra`.
    """

    action: Action
    box: Box | None = None
    extra: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class _Target:
    """A row and its picture."""

    row: JsonRow
    image: str
    size: Size
    target: GroundingTarget


class PublishedSet(FileReader, ABC):
    """Base of the readers of one published set, which is selected by name (`--format`).

    Its files are not recognized: detection leaves them to `grounding`.

    A subclass sets `name`; `layout`, how its folder looks, for errors; `picture`, the field that
    names the picture; `folder`, where pictures lie; `size_field`, the field with the size of the
    picture, if there is one; and `extra_fields`, those that go into `extra`.
    """

    name: str = ""
    layout: str = ""
    picture: str = ""
    folder: str = ""
    size_field: str = ""
    extra_fields: tuple[str, ...] = ()
    suffixes = ()
    episodes: str = PICTURE_EPISODES

    @abstractmethod
    def is_table(self, file: Path) -> bool:
        """Return whether a file is a table of the set, by its name."""

    @abstractmethod
    def target(self, record: JsonObject, size: Size) -> GroundingTarget:
        """Return what a row asks for.

        Args:
            record: the row.
            size: `(height, width)` of its picture.

        Raises:
            FieldError: the row does not have the form of the published set.
        """

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories of one click each, files by name, rows in order.

        Raises:
            SourceError: the source has another layout.
        """
        root = source_root(path)
        has_table = False
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            elif self.is_table(file):
                has_table = True
                yield from self._read(file, root)
        if not has_table:
            raise SourceError(f"{root}: is not laid out as {self.name}: {self.layout}")

    def _read(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        name = relative_name(file, root)
        targets: list[_Target] = []
        try:
            inside(root, name, "")
            for row in json_rows(file):
                try:
                    targets.append(self._read_target(row, file, root))
                except FieldError as error:
                    yield Rejected(name, row.location, error.field, error.reason)
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
        except OSError as error:
            yield Rejected(name, "", "", f"cannot be read ({error.strerror or error})")
        elements = _elements(targets)
        stem = os.path.splitext(name)[0]
        for target in targets:
            try:
                yield self._trajectory(target, stem, elements.get(target.image, ()))
            except FieldError as error:
                yield Rejected(name, target.row.location, error.field, error.reason)

    def _read_target(self, row: JsonRow, file: Path, root: Path) -> _Target:
        record = row.record
        value = record.get(self.picture)
        image, size = picture_at(value, file, root, self.picture, (self.folder,))
        if self.size_field:
            _check_size(record.get(self.size_field), size, self.size_field)
        return _Target(row, image, size, self.target(record, size))

    def _trajectory(self, entry: _Target, stem: str, around: tuple[Box, ...]) -> Trajectory:
        record = entry.row.record
        program, platform = program_and_platform(record)
        target = entry.target
        extra: dict[str, Any] = {key: record[key] for key in self.extra_fields if key in record}
        extra.update(target.extra or {})
        text = json.dumps(extra, ensure_ascii=False) if extra else ""
        step = Step(
            0,
            entry.image,
            target.action,
            target_box=target.box,
            elements=around if len(around) > 1 else (),
            extra=fields.storable(text, "extra"),
        )
        return RecordedTrajectory(
            id=f"{stem}/{entry.row.number:06d}",
            source=self.name,
            instruction=fields.text(record, "instruction"),
            steps=(step,),
            domain=screen_domain(platform),
            apps=fields.strings([program]),
            episode=Path(entry.image).name,
        )


def click_at(record: JsonObject, key: str, form: Form, size: Size) -> GroundingTarget:
    """Return a click at the middle of a row's box."""
    box = box_in(form, record.get(key), size, key)
    x, y = box_center(box)
    return GroundingTarget(action=Action("click", x, y), box=box)


def _check_size(recorded_size: object, size: Size, field: str) -> None:
    """Check the size that a row states.

    Raises:
        FieldError: the picture has another size, or no size is stated.
    """
    height, width = size
    if recorded_size != [width, height]:
        reason = f"is {short_repr(recorded_size)}, but the picture is {width}x{height}"
        raise FieldError(field, reason)


def _elements(targets: list[_Target]) -> dict[str, tuple[Box, ...]]:
    """Return the boxes of each picture, each once."""
    boxes_by_image: dict[str, dict[Box, None]] = {}
    for entry in targets:
        if entry.target.box is not None:
            boxes_by_image.setdefault(entry.image, {}).setdefault(entry.target.box)
    return {image: tuple(boxes) for image, boxes in boxes_by_image.items()}
