"""AgentNet recordings (JSON Lines) and AgentNetBench tasks (JSON)."""

import os
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from hijack_data.actions import parse_pyautogui, scale_normalized
from hijack_data.errors import HijackError
from hijack_data.platforms import find_platform
from hijack_data.types import Action, Box, Platform, Size, Step, Trajectory

from . import fields
from .base import FileReader, Rejected, files_below, register
from .fields import FieldError, JsonObject
from .recording_facts import RecordedTrajectory
from .safe_files import (
    Part,
    Source,
    image_size,
    inside,
    lines,
    parse_file,
    relative_name,
    source_root,
)

# Beside the file, and as the Hub has them: unpacked there, or into a folder of their own.
IMAGES = ("images", "ubuntu_images", "win_mac_images")
_UNPACKED = ("", "images", "extracted")
BROWSER = "browser"


@register
class AgentNet(FileReader):
    """Reads AgentNet and AgentNetBench.

    A source is a file, or a folder with any number of them; screenshots lie beside the file, in
    `images/`, or in the Hub's `ubuntu_images/` and `win_mac_images/`, unpacked. A line of an
    AgentNet `.jsonl` file is a trajectory: `task_id, instruction, traj: [{index, image, value:
    {code}}]`. An AgentNetBench `.json` file is one: `task_id, high_level_task_description, steps:
    [{step_num, image, action, ground_truth_actions}]`; the first labelled box of a step's ground
    truth is its target. `meta_info`, where there is one, tells domain, applications, the platform
    (`system`) and, by `websites`, that there is a browser.

    Coordinates: fractions 0..1 of the screenshot, in code as well as in `rel_bbox` (x, y, width,
    height); `abs_bbox`, which says the same in pixels, is not read.
    """

    name = "agentnet"
    adopts = True
    keys = (frozenset({"traj"}), frozenset({"task_id", "steps"}))

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories, files by name, lines in order."""
        root = source_root(path)
        ids: set[str] = set()
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
                continue
            if not _is_read(file, path):
                continue
            name = relative_name(file, root)
            try:
                inside(root, name, "")
                if file.suffix == ".json":
                    yield from _record(parse_file(file), name, "", file.parent, ids)
                    continue
                for line in lines(file):
                    location = f"line {line.number}"
                    try:
                        yield from _record(line.record(), name, location, file.parent, ids)
                    except FieldError as error:
                        yield Rejected(name, f"line {line.number}", error.field, error.reason)
            except FieldError as error:
                yield Rejected(name, "", error.field, error.reason)
            except OSError as error:
                yield Rejected(name, "", "", f"cannot be read ({error.strerror or error})")


def _is_read(file: Path, source: Source) -> bool:
    """Return whether a file may have records; of a folder, only those at its top may."""
    at_top = isinstance(source, Part) or file.parent == source_root(source)
    return at_top and file.suffix in (".json", ".jsonl")


def _record(
    record: JsonObject, file: str, location: str, root: Path, ids: set[str]
) -> Iterator[Any]:
    name = fields.text(record, "task_id")
    if name in ids:
        raise FieldError("task_id", f"{name!r} was there before")
    is_bench = "steps" in record and "traj" not in record
    instruction = fields.text(record, _instruction_key(record) if is_bench else "instruction")
    entries = fields.items(record, "steps" if is_bench else "traj")
    about = _about(record, file)
    ids.add(name)
    steps: dict[int, Step] = {}
    for position, entry in enumerate(entries):
        try:
            data = fields.mapping(entry, "")
            step = _bench_step(data, root) if is_bench else _step(data, root)
            if step.index in steps:
                field = "step_num" if is_bench else "index"
                raise FieldError(field, f"step {step.index} was there before")
            steps[step.index] = step
        except FieldError as error:
            parts = (location, name, f"entry {position}")
            yield Rejected(file, ", ".join(filter(None, parts)), error.field, error.reason)
    if not entries:
        raise FieldError("steps" if is_bench else "traj", "is empty")
    if steps:
        ordered = tuple(steps[index] for index in sorted(steps))
        yield RecordedTrajectory(
            name, AgentNet.name, instruction, ordered, **about, screen="desktop"
        )


def _instruction_key(record: JsonObject) -> str:
    # The benchmark gives its models the high-level text; some tasks have only the annotator's own.
    high_level = "high_level_task_description"
    key = "user_task_description"
    if record.get(key) and not record.get(high_level):
        return key
    return high_level


def _about(record: JsonObject, file: str) -> dict[str, Any]:
    meta: object = record.get("meta_info")
    facts = cast("JsonObject", meta) if isinstance(meta, dict) else {}
    apps = fields.strings(facts.get("applications"))
    # Websites are looked at in some browser, which is not always named among the applications.
    if fields.strings(facts.get("websites")):
        apps = (*apps, BROWSER)
    return {
        "domain": fields.text(facts, "domain", "meta_info.domain", default=""),
        "apps": apps,
        "platform": find_platform(facts.get("system")) or _platform(file),
    }


def _platform(file: str) -> Platform | None:
    """Return the platform in the name of a file, such as `agentnet_ubuntu_5k.jsonl`."""
    return "linux" if "ubuntu" in file.lower() else None


def _step(entry: JsonObject, root: Path) -> Step:
    value = fields.mapping(entry.get("value"), "value")
    index = fields.step_number(entry, "index")
    image, size = _image(entry, root)
    action, code = _action(fields.text(value, "code", "value.code"), size, "value.code")
    return Step(index, os.fspath(image), action, code)


def _bench_step(entry: JsonObject, root: Path) -> Step:
    index = fields.step_number(entry, "step_num")
    image, size = _image(entry, root)
    action, code = _action(fields.text(entry, "action"), size, "action")
    target = _target(entry.get("ground_truth_actions"), size)
    return Step(index, os.fspath(image), action, code, target)


def _image(entry: JsonObject, root: Path) -> tuple[Path, Size]:
    name = fields.text(entry, "image")
    image = inside(root, _picture_path(name, root))
    return image, image_size(image)


def _picture_path(name: str, root: Path) -> str:
    """Return the path of a picture in the source: the name itself, or one in a known folder.

    Raises:
        FieldError: the picture is in several folders, or still packed.
    """
    if os.path.isabs(name) or (root / name).is_file():
        return name
    folders = [folder for folder in IMAGES if (root / folder).is_dir()]
    candidates = [os.path.join(folder, inner, name) for folder in folders for inner in _UNPACKED]
    existing = [candidate for candidate in candidates if (root / candidate).is_file()]
    if len(existing) > 1:
        several = " and in ".join(map(os.path.dirname, existing))
        raise FieldError("image", f"{name!r} is in {several}; keep one")
    if existing:
        return existing[0]
    if any(_packed(root / folder) for folder in folders):
        raise FieldError("image", f"{name!r} is not there: unpack the zip files into their folder")
    first = folders[0] if folders else ""
    return os.path.join(first, name)


@lru_cache(maxsize=8)
def _packed(folder: Path) -> bool:
    return any(re.search(r"\.z(ip|\d\d)$", file.name) for file in folder.iterdir())


def _action(code: str, size: Size, field: str) -> tuple[Action, str]:
    """Return the action, and its code, in pixels of the screenshot.

    Raises:
        FieldError: the code is not an action, or points outside the screenshot.
    """
    try:
        action = parse_pyautogui(code, size, normalized=True)
        pixels = scale_normalized(code, size)
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    return fields.check_on_screen(action, size, field), pixels


def _target(ground_truth: object, size: Size) -> Box | None:
    """Return the first labelled box that shows, if there is one."""
    for index, entry in enumerate(fields.listed(ground_truth)):
        field = f"ground_truth_actions[{index}]"
        labels = fields.mapping(entry, field).get("metadata") or {}
        for box in fields.boxes(labels, size, f"{field}.metadata"):
            x1, y1, x2, y2 = box
            if x2 > x1 and y2 > y1:
                return box
    return None
