"""Folders of pictures: each is a trajectory of one step, without an action."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from hijack_data.actions import calls_pyautogui, parse_pyautogui
from hijack_data.errors import HijackError
from hijack_data.types import Action, Platform, Size, Step, Trajectory

from . import fields
from .base import Rejected, register
from .fields import FieldError, JsonObject
from .plain_fields import (
    FIELDS,
    LineProblems,
    check_agreement,
    check_names,
    extra_json,
    read_action,
    read_apps,
    read_boxes,
)
from .reader_options import NO_CHOICES, ReaderOptions
from .recording_facts import RecordedTrajectory, stated_episode
from .safe_files import (
    Part,
    RecordLine,
    Source,
    image_size,
    inside,
    is_picture,
    line_at,
    lines,
    parse,
    parse_file,
    relative_name,
    source_root,
    walk,
)

METADATA = "metadata.jsonl"
FILE_NAME = "file_name"
# Fields of the plain format that do not apply: the place of a picture decides its trajectory and
# step.
KNOWN = (FILE_NAME, *(name for name in FIELDS if name not in ("trajectory_id", "step", "image")))
RECORDS = (
    *(".json", ".jsonl", ".ndjson", ".parquet", ".csv", ".tsv", ".arrow", ".tfrecord", ".trace"),
    *(".tar", ".tgz", ".zip", ".7z", ".gz", ".xz", ".bz2", ".zst"),
)


@register
@dataclass(frozen=True)
class Images:
    """Reads a folder of pictures, or one picture.

    A picture is a trajectory of one step whose action is `"other"`, with nothing to say; the id is
    its path in the source. What is known about it stands in a `metadata.jsonl` in its folder or one
    above, a line a picture with its `file_name` (as `datasets` has it for an image folder), or in a
    JSON object of the same name beside it (`a.png`, `a.json`): `instruction`, `action`,
    `action_code`, `target_box`, `elements`, `domain`, `apps` and `id`, as in the plain format, all
    optional. Other fields are kept as `extra`.

    Coordinates: pixels of the picture, origin top-left.
    """

    choices: ReaderOptions = NO_CHOICES
    name = "images"
    fallback = True
    takes = ("episode_key",)
    episodes = "one picture"

    def detect(self, path: Path) -> bool:
        """Return whether `path` is a picture, or a folder with no records but those of pictures."""
        if path.is_file():
            return is_picture(path)
        pictures = 0
        for item in walk(path):
            if not isinstance(item, Path) or _is_other(item):  # records, or what may hold some
                return False
            pictures += is_picture(item)
        return pictures > 0

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the pictures' names."""
        root = source_root(path)
        metadata = _Metadata(root)
        for item in _files(path):
            if isinstance(item, Path) and item.name == METADATA:
                yield from metadata.add(item)
        for item in _files(path):
            if not isinstance(item, Path):
                yield Rejected(relative_name(item[0], root), "", "", item[1])
            elif is_picture(item):
                yield from _picture(item, root, metadata, self.choices.episode_key)
        yield from metadata.unused()


def _files(source: Source) -> Iterable[Path | tuple[Path, str]]:
    return source.files if isinstance(source, Part) else walk(source, pictures=True)


def _is_other(file: Path) -> bool:
    """Return whether a file has records other than metadata of the pictures."""
    if file.suffix.lower() not in RECORDS or file.name == METADATA:
        return False
    return file.suffix != ".json" or not any(_beside(file))


def _beside(file: Path) -> Iterator[Path]:
    """Yield the pictures that a JSON file may describe."""
    for suffix in (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".tif", ".tiff"):
        for picture in (file.with_suffix(suffix), file.with_suffix(suffix.upper())):
            if picture.is_file():
                yield picture


@dataclass
class _Metadata:
    """The positions of the pictures' metadata lines, kept instead of the lines to save memory."""

    root: Path
    places: dict[Path, tuple[Path, int, int]] = field(
        default_factory=dict[Path, tuple[Path, int, int]]
    )

    def add(self, file: Path) -> Iterator[Rejected]:
        """Index a file of metadata; yield the lines that cannot be read."""
        for line in lines(file):
            try:
                self._line(file, line)
            except FieldError as error:
                name = relative_name(file, self.root)
                yield Rejected(name, f"line {line.number}", error.field, error.reason)

    def _line(self, file: Path, line: RecordLine) -> None:
        name = fields.text(line.record(), FILE_NAME)
        picture = inside(self.root, relative_name(file.parent / name, self.root), FILE_NAME)
        if self.places.setdefault(picture, (file, line.offset, line.number))[1:] != (
            line.offset,
            line.number,
        ):
            raise FieldError(FILE_NAME, f"{name!r} was there before")

    def of(self, picture: Path) -> JsonObject:
        """Return the metadata of a picture.

        Raises:
            FieldError: they cannot be read, stand in two places, or may be of another picture.
        """
        location = self.places.pop(picture, None)
        beside = picture.with_suffix(".json")
        if location is not None:
            if beside.is_file():
                reason = f"is described in {METADATA} and in {beside.name}; keep one of the two"
                raise FieldError("", reason)
            with location[0].open("rb") as file:
                return fields.mapping(parse(line_at(file, location[1])), "")
        if not beside.is_file():
            return {}
        names = sorted({other.name for other in _beside(beside)})
        if len(names) > 1:
            raise FieldError(
                "",
                f"{beside.name} may describe {' or '.join(names)}; keep one of the pictures, or"
                f" describe them in {METADATA}",
            )
        return parse_file(beside)

    def unused(self) -> Iterator[Rejected]:
        """Yield the lines whose file is not a picture."""
        for picture, (file, _, number) in self.places.items():
            name = relative_name(picture, self.root)
            reason = f"{name!r} is not a picture by its name"
            yield Rejected(relative_name(file, self.root), f"line {number}", FILE_NAME, reason)


def _picture(
    file: Path, root: Path, metadata: _Metadata, episode_key: str | None
) -> Iterator[Trajectory | Rejected]:
    name = relative_name(file, root)
    try:
        yield _trajectory(name, file, metadata.of(file), episode_key)
    except FieldError as error:
        yield Rejected(name, "", error.field, error.reason)


def _trajectory(name: str, file: Path, record: JsonObject, episode_key: str | None) -> Trajectory:
    problems = LineProblems()
    size = problems.of(lambda: image_size(file))
    problems.check()
    check_names(record, problems, KNOWN)
    if size:
        problems.of(lambda: fields.check_stated_size(record, size))
    target, elements = read_boxes(record, size, problems)
    texts = {
        key: problems.of(lambda key=key: fields.text(record, key, default=""))
        for key in ("instruction", "domain", "action_code", "id")
    }
    action = problems.of(lambda: _action(record, texts["action_code"] or "", size, problems))
    apps = problems.of(lambda: read_apps(record))
    platform = problems.of(lambda: fields.platform(record.get("platform"), "platform"))
    extra = problems.of(lambda: extra_json(record, KNOWN))
    episode = None
    if episode_key is not None:
        episode = problems.of(lambda: stated_episode(record, episode_key))
    problems.check()
    step = Step(
        index=0,
        image=os.fspath(file),
        action=action or Action("other"),
        action_code=texts["action_code"] or "",
        target_box=target,
        elements=elements,
        id=texts["id"] or None,
        extra=extra or "",
    )
    about = texts["instruction"] or "", (step,), texts["domain"] or "", apps or ()
    return RecordedTrajectory(
        name, Images.name, *about, platform=cast("Platform | None", platform), episode=episode
    )


def _action(record: JsonObject, code: str, size: Size | None, problems: LineProblems) -> Action:
    """Return the action of a picture: the described one, or the one in its code.

    Raises:
        FieldError: the two contradict each other, or the code points outside the picture.
    """
    if size is None:
        return Action("other")
    if record.get("action") is not None:
        action = read_action(record["action"], size, problems) or Action("other")
        check_agreement(action, code, size)
        return action
    check_agreement(Action("other"), code, size)  # fractions would be taken for pixels
    if not calls_pyautogui(code, or_computer=True):
        return Action("other")
    try:
        parsed_action = parse_pyautogui(code, None)
    except HijackError:  # the effect of the code is known only when it runs
        return Action("other")
    return fields.check_on_screen(parsed_action, size, "action_code")
