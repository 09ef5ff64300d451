"""Grounding sets in JSON: a picture, a text and the box that it names."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.platforms import find_platform
from hijack_data.types import Action, Box, Size, Step, Trajectory

from ..choices import FRACTIONS, PIXELS, XYWH, XYXY
from . import fields
from .base import FileReader, Rejected, register
from .box_forms import Form, box_center, box_in, detect_form
from .fields import FieldError, JsonObject
from .file_head import FileHead, one_of_each
from .json_rows import FOLDERS, JsonRow, json_rows, picture_at, read_tables
from .parquet_rows import screen_domain
from .reader_options import NO_CHOICES, ReaderOptions
from .recording_facts import PICTURE_EPISODES, RecordedTrajectory, stated_episode
from .safe_files import Source, relative_name, source_root

PICTURES = ("img_filename", "image_path", "img_path")
BOXES = ("bbox", "box_coordinates")
TEXTS = ("prompt_to_evaluate", "instruction", "text")
_WAY_OUT = "--format osworld_g reads OSWorld-G whole"
# Folders of the pictures, as they are published.
_FOLDERS = (*FOLDERS, "screenspotv2_image", "screenspot_imgs")


@register
@dataclass(frozen=True)
class Grounding(FileReader):
    """Reads grounding sets in JSON.

    Known sets are ScreenSpot, ScreenSpot-v2, ScreenSpot-Pro, OSWorld-G, UI-Vision, GroundCUA,
    MMBench-GUI and OS-Atlas. A source is a `.json` file with a list of rows, a `.jsonl` file, or a
    folder with them anywhere below. A row has `img_filename` or `image_path` (seen from the file or
    the source, or from `images/` in either), `bbox` or `box_coordinates`, and `instruction`,
    `prompt_to_evaluate` or `text`. It is a trajectory of one click at the middle of the box; rows
    with `elements` are one for each. The id is the file and the row's number. The other boxes of
    the picture in the same file are its elements.

    Coordinates: decided for the whole file, see `box_forms`. If rows leave several forms, the set's
    own layout counts: x, y, width, height in pixels (ScreenSpot, OSWorld-G), two corners in pixels
    (ScreenSpot-Pro, UI-Vision, GroundCUA), two corners in fractions (OS-Atlas, MMBench-GUI).
    """

    choices: ReaderOptions = NO_CHOICES
    name = "grounding"
    takes = ("coordinates", "boxes", "episode_key")
    episodes = PICTURE_EPISODES
    keys = one_of_each(PICTURES, (*BOXES, "elements"))

    def recognizes(self, head: FileHead) -> bool:
        """Return whether one of the first records names a picture and a box, or boxes in it."""
        for record in head.records:
            parts = (record, *fields.objects(record.get("elements")))
            if record.keys() & set(PICTURES) and any(part.keys() & set(BOXES) for part in parts):
                return True
        return False

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, rows in order."""
        root = source_root(path)
        yield from read_tables(path, lambda file: _Table(file, root, self.choices).read())


@dataclass(frozen=True)
class _Entry:
    """One box of a row."""

    row: JsonRow
    part: JsonObject
    name: str

    @property
    def box(self) -> object:
        return self.part.get(_key(self.part, BOXES))


class _Table:
    """One file, while it is read."""

    def __init__(self, file: Path, root: Path, choices: ReaderOptions) -> None:
        self.file = file
        self.root = root
        self.choices = choices
        self.name = relative_name(file, root)
        self.sizes: dict[str, tuple[str, Size]] = {}

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield the broken rows and the trajectories.

        Boxes whose form is not clear are a `FieldError`.
        """
        entries, broken = self._entries()
        yield from broken
        if not entries:
            yield Rejected(self.name, "", "", "holds no row with a picture and a box")
            return
        form = detect_form(
            [entry.box for entry in entries],
            lambda index: self._size(entries[index]),
            self.choices,
            _published(entries[0].row.record),
        )
        elements = self._elements(entries, form)
        for entry in entries:
            try:
                yield self._trajectory(entry, form, elements)
            except FieldError as error:
                yield Rejected(self.name, entry.row.location, error.field, error.reason)

    def _entries(self) -> tuple[list[_Entry], list[Rejected]]:
        entries: list[_Entry] = []
        broken: list[Rejected] = []
        stem = os.path.splitext(self.name)[0]
        for row in json_rows(self.file):
            try:
                entries += _row_entries(row, f"{stem}/{row.number:06d}")
            except FieldError as error:
                broken.append(Rejected(self.name, row.location, error.field, error.reason))
        return entries, broken

    def _picture(self, entry: _Entry) -> tuple[str, Size]:
        record = entry.row.record
        key = _key(record, PICTURES)
        value: Any = record.get(key)
        platform = record.get("platform")
        folders = _FOLDERS
        if isinstance(platform, str) and platform:
            folders = (*folders, platform)
        size = self.sizes.get(value) if isinstance(value, str) else None
        if size is None:
            size = picture_at(value, self.file, self.root, key, folders)
        self.sizes[value] = size
        recorded_size: object = record.get("img_size", record.get("image_size"))
        height, width = size[1]
        if isinstance(recorded_size, list) and recorded_size != [width, height]:
            reason = f"is {short_repr(recorded_size)}, but the picture is {width}x{height}"
            raise FieldError("img_size", reason)
        return size

    def _size(self, entry: _Entry) -> Size | None:
        try:
            return self._picture(entry)[1]
        except FieldError:
            return None

    def _elements(self, entries: list[_Entry], form: Form) -> dict[str, list[Box]]:
        """Return the boxes of each picture."""
        boxes: dict[str, list[Box]] = {}
        for entry in entries:
            try:
                image, size = self._picture(entry)
                boxes.setdefault(image, []).append(box_in(form, entry.box, size, "bbox"))
            except FieldError:
                continue
        return boxes

    def _trajectory(self, entry: _Entry, form: Form, elements: dict[str, list[Box]]) -> Trajectory:
        record = entry.row.record
        image, size = self._picture(entry)
        if form[0] == PIXELS:
            fields.check_stated_size(record, size)
        box = box_in(form, entry.box, size, _key(entry.part, BOXES))
        x, y = box_center(box)
        around = tuple(dict.fromkeys(elements[image]))
        if len(around) == 1:
            around = ()
        text = fields.text(entry.part, _key(entry.part, TEXTS))
        step = Step(0, image, Action("click", x, y), target_box=box, elements=around)
        program, platform = program_and_platform(record)
        return RecordedTrajectory(
            id=entry.name,
            source=Grounding.name,
            instruction=text,
            steps=(step,),
            domain=screen_domain(platform),
            apps=fields.strings([program]),
            episode=self._episode(record, image),
        )

    def _episode(self, record: JsonObject, image: str) -> str:
        key = self.choices.episode_key
        return stated_episode(record, key) if key else relative_name(Path(image), self.root)


def program_and_platform(record: JsonObject) -> tuple[object, object]:
    """Return the program and the platform that a row names."""
    source = record.get("data_source")
    # UI-Vision and GroundCUA call the program a platform.
    if "prompt_to_evaluate" in record or "category" in record:
        return record.get("platform"), source
    program = record.get("application")
    # UI-Venus calls the platform an application.
    if find_platform(program) is not None:
        return None, record.get("platform", program)
    return program, record.get("platform", source)


def _row_entries(row: JsonRow, name: str) -> Iterator[_Entry]:
    """Yield the boxes of a row: its own, or those of its elements."""
    record = row.record
    _check_kind(record)
    parts: object = record.get("elements")
    if not isinstance(parts, list):
        yield _Entry(row, record, name)
        return
    elements = fields.mappings(fields.listed(parts), "elements")
    for index, part in enumerate(elements):
        yield _Entry(row, part, f"{name}-{index}")


def _check_kind(record: JsonObject) -> None:
    # OSWorld-G has other labels beside boxes.
    kind = record.get("box_type", "bbox")
    if kind == "refusal":
        reason = f"'refusal': nothing on the picture is meant, so there is no action; {_WAY_OUT}"
        raise FieldError("box_type", reason)
    if kind != "bbox":
        reason = f"{short_repr(kind)} is not read, only boxes are; {_WAY_OUT}"
        raise FieldError("box_type", reason)


def _published(record: JsonObject) -> tuple[Form, ...]:
    """Return the forms in which a set with these fields is published, the likelier first."""
    keys = set(record)
    if "box_type" in keys:
        return ((PIXELS, XYWH),)
    if {"prompt_to_evaluate", "img_size", "category"} & keys:
        return ((PIXELS, XYXY), (FRACTIONS, XYXY))
    if {"data_type", "data_source"} <= keys:
        return ((PIXELS, XYWH), (FRACTIONS, XYXY))
    return ((FRACTIONS, XYXY),)


def _key(record: JsonObject, names: tuple[str, ...]) -> str:
    return next((name for name in names if record.get(name) is not None), names[0])
