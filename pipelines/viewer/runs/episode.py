"""One episode for the page: its steps with pictures, words and actions, and any damage."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, cast

from hijack_data.coords import CoordMap
from hijack_data.errors import HijackError
from hijack_data.runs.run_log import EPISODE, EPISODES, LINKS, RECORDS, STEPS
from hijack_data.types import Size, UInt8Array

from ...dataset.image_codec import decode
from ...errors import DatasetError
from ...readers.fields import FieldError, listed, mapping, objects
from ...readers.safe_files import image_size, inside, lines, parse_file
from ..source import Fields, display_text
from .action_strokes import parse_strokes
from .listing import number
from .model_requests import TurnMessages, read_turns, turn_numbers

MAX_STEPS = 1000
MAX_TEXT_CHARS = 20_000  # characters of one text
MAX_BOXES = 2000
NOT_SHOWN = ("plan", "boxes", "said", "raw", "events", "previous")
NO_STEPS = "This run was published without its steps: the record below is all that there is."
StepData: TypeAlias = dict[str, Any]


@dataclass(kw_only=True)
class EpisodeLines:
    """The content of an episode's files.

    Args:
        home: its folder.
        record: `episode.json`, or the line of the journal if there is no such file.
        lines: of its steps; one that cannot be read is an empty object.
        problems: the damage found; that of a step by its place.
        broken: why a line cannot be read, by its place.
        published: whether the steps of the run were published with its records.
    """

    home: Path
    record: Mapping[str, Any] = field(default_factory=dict[str, Any])
    lines: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    problems: list[str] = field(default_factory=list[str])
    broken: dict[int, str] = field(default_factory=dict[int, str])
    published: bool = True


def read_lines(folder: Path, name: str, journal: Mapping[str, Any]) -> EpisodeLines:
    """Read the files of an episode; damage is noted, never raised.

    Args:
        folder: of the run.
        name: of the episode.
        journal: its line in the journal; empty if there is none.
    """
    episode = EpisodeLines(home=folder / EPISODES / name, record=journal)
    if not episode.home.is_dir():
        if not (folder / EPISODES).is_dir():
            episode.published = False
        elif journal.get("status") == "ok" or journal.get("steps"):
            episode.problems.append(f"there is no {EPISODES}/{name}: its steps are lost")
        return episode
    _read_record(episode, journal)
    _read_steps(episode)
    line_count = episode.record.get("lines")
    if isinstance(line_count, int) and line_count != len(episode.lines):
        episode.problems.append(
            f"{STEPS} has {len(episode.lines)} lines, {EPISODE} says {line_count}"
        )
    return episode


def _read_record(episode: EpisodeLines, journal: Mapping[str, Any]) -> None:
    path = episode.home / EPISODE
    if not path.exists():
        episode.problems.append(f"it has no {EPISODE}: it is being played, or was broken off")
        return
    try:
        episode.record = parse_file(path)
    except FieldError as error:
        episode.problems.append(f"{EPISODE}: {error}")
        return
    if not journal:
        return
    differ = [
        key
        for key in sorted({*journal, *episode.record} - set(LINKS))
        if journal.get(key) != episode.record.get(key)
    ]
    if differ:
        names = ", ".join(differ[:4])
        episode.problems.append(f"{EPISODE} and its line in {RECORDS} differ in {names}")


def _read_steps(episode: EpisodeLines) -> None:
    try:
        for index, line in enumerate(lines(inside(episode.home, STEPS, STEPS))):
            if index == MAX_STEPS:
                episode.problems.append(f"only the first {MAX_STEPS} steps are shown")
                return
            try:
                episode.lines.append(mapping(line.record(), ""))
            except FieldError as error:
                episode.lines.append({})
                episode.broken[index] = f"line {line.number} of {STEPS}: {error}"
                episode.problems.append(episode.broken[index])
    except FieldError as error:
        episode.problems.append(f"{STEPS}: {error.reason}")
    except OSError as error:
        episode.problems.append(f"{STEPS}: cannot be read ({error.strerror or error})")


def episode_data(folder: Path, name: str, episode: EpisodeLines) -> dict[str, Any]:
    """Return the page's data of an episode in a folder."""
    turn_messages, problem = read_turns(folder, name, episode.record)
    turns = turn_numbers(episode.lines)
    effects = _effects(episode)
    steps = [
        _step(episode, index, turn_messages.get(-1 if turn is None else turn), effects)
        for index, turn in enumerate(turns)
    ]
    missing = sum(bool(step["lost"]) for step in steps)
    problems = [*episode.problems, problem]
    if missing:
        problems.append(f"the pictures of {missing} of {len(steps)} steps cannot be shown")
    return {
        "problems": [text for text in problems if text],
        "steps": steps,
        "no_steps": "" if episode.published else NO_STEPS,
        "effects": effects,
        **about(episode.record),
    }


def about(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the page's data of an episode's record."""
    frames = [str(frame) for frame in listed(record.get("traceback"))]
    return {
        "reason": _cut(record.get("reason")),
        "problem": _cut(record.get("problem")),
        "ended": _cut(record.get("ended")),
        "traceback": "\n".join(frames)[:MAX_TEXT_CHARS],
        "malformed": record.get("malformed") if isinstance(record.get("malformed"), int) else 0,
        "fields": record_fields(record, "instruction", "traceback", "effects"),
    }


def record_fields(record: Mapping[str, Any], *without: str) -> Fields:
    """Return the names and values of a record as text, without some fields."""
    return [(name, _cut(display_text(v))) for name, v in record.items() if name not in without]


def picture_file(home: Path, line: Mapping[str, Any], before: bool) -> Path:
    """Return the file of the clean screen, or of the agent's picture.

    Raises:
        FieldError: there is no such file, or it leaves the folder of the episode.
    """
    agent_picture = None if before else line.get("seen")
    name = agent_picture or line.get("image")
    if not isinstance(name, str):
        raise FieldError("image", "names no picture")
    return inside(home, name)


def read_picture(path: Path) -> tuple[bytes, UInt8Array]:
    """Return the bytes of a picture, and its pixels, uint8 RGB `[H, W, 3]`.

    Raises:
        DatasetError: it cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path.name}: cannot be read ({error.strerror or error})") from None
    return data, decode(data, path.name)


def _step(
    episode: EpisodeLines, index: int, messages: TurnMessages | None, effects: list[dict[str, Any]]
) -> StepData:
    line = episode.lines[index]
    raw = line.get("raw")
    code = raw if isinstance(raw, str) else ""
    step: StepData = {
        "step": index,
        "problem": episode.broken.get(index, ""),
        "lost": "",
        "size": None,
        "corrupted": bool(line.get("seen")),
        "no_before": "" if line.get("seen") else "the agent saw the clean screen",
        "code": _cut(code),
        "ran": _cut(line.get("code")) if line.get("code") != raw else "",
        "said": _cut(line.get("said")),
        "error": _cut(line.get("error")),
        "result": _result(line.get("result")),
        "onlooker": [] if messages is None else [[r, _cut(text)] for r, text in messages.onlooker],
        "usage": _numbers({} if messages is None else messages.usage),
        "seconds": _numbers(line.get("seconds")),
        "still": line.get("still") is not False,
        "effects": [k for k, effect in enumerate(effects) if effect["step"] == index],
        "plan": "" if line.get("plan") is None else _cut(display_text(line["plan"])),
        "boxes": [],
        "fields": record_fields(line, *NOT_SHOWN),
        "action": "",
        "strokes": [],
        "faults": [],
        "arrived": "",
        "arrived_strokes": [],
        "target": None,
        "recorded": "",
    }
    size: Size | None = None
    try:
        size = image_size(picture_file(episode.home, line, False))
        step["size"] = [size[1], size[0]]
        with suppress(FieldError):  # the page says itself that the clean screen is damaged
            screen = image_size(picture_file(episode.home, line, True))
            coords = CoordMap(observation=size, screen=screen)
            step["boxes"] = _boxes(line.get("boxes"), coords)
            step.update(_input(line.get("input"), coords))
    except FieldError as error:
        step["lost"] = episode.broken.get(index) or str(error)
    if code:
        step["action"], step["strokes"] = parse_strokes(code, size)
    return step


def _effects(episode: EpisodeLines) -> list[dict[str, Any]]:
    """Return all effects of an episode: from its record, or from its lines if it has none."""
    recorded = objects(episode.record.get("effects"))
    if recorded:
        return [_effect(entry, entry.get("step")) for entry in recorded]
    return [
        _effect(event, index)
        for index, line in enumerate(episode.lines)
        for event in objects(line.get("events"))
    ]


def _effect(entry: Mapping[str, Any], step: object) -> dict[str, Any]:
    record = entry.get("record")
    details: Mapping[str, Any] = record if isinstance(record, dict) else {}
    # effects before the episode are first visible in observation 0
    first_step = max(0, step) if isinstance(step, int) else 0
    shown_fields = ("effect", "probes", "undone", "at")
    return {
        "step": first_step,
        "kind": _cut(details.get("effect") or entry.get("effect") or "effect"),
        "did": _cut(
            display_text({key: details[key] for key in details if key not in shown_fields})
        ),
        "probes": [_probe(probe) for probe in objects(details.get("probes"))],
        "undone": [_probe(probe) for probe in objects(details.get("undone"))],
    }


def _probe(probe: Mapping[str, Any]) -> dict[str, Any]:
    facts = probe.get("facts")
    return {
        "ok": probe.get("ok") is True,
        "facts": _cut(display_text(facts)) if facts else "",
        "problem": _cut(probe.get("problem")),
    }


def _boxes(value: object, coords: CoordMap) -> list[list[int]]:
    """Return elements, logged in pixels of the screen, in those of the agent's picture."""
    boxes: list[list[int]] = []
    for box in listed(value)[:MAX_BOXES]:
        sides = [side for side in map(number, listed(box)) if side is not None]
        if len(sides) == 4:
            with suppress(HijackError):  # damage: corners in the wrong order
                boxes += coords.boxes_to_observation([sides]).tolist()
    return boxes


def _input(value: object, coords: CoordMap) -> StepData:
    """Return what reached the machine of an action that a fault altered, in words and strokes."""
    if not isinstance(value, dict):
        return {}
    entry = cast("dict[str, object]", value)
    faults = [_cut(fault.get("input")) for fault in objects(entry.get("faults"))]
    sent = entry.get("sent")
    words, strokes = parse_strokes(sent if isinstance(sent, str) else "", coords.screen)
    for stroke in strokes:
        for key in stroke.keys() & {"at", "to"}:
            stroke[key] = coords.to_observation(stroke[key])
    if "drop" in faults:  # what is sent instead presses nothing
        words, strokes = "nothing was pressed", []
    probe = entry.get("probe")
    problem = _cut(probe.get("problem")) if isinstance(probe, dict) else ""
    arrived = f"{words}; not proved: {problem}" if problem else words
    return {"faults": faults, "arrived": _cut(arrived), "arrived_strokes": strokes}


def _numbers(value: object) -> dict[str, float]:
    """Return the entries of an object that are numbers."""
    entries = cast("dict[str, object]", value) if isinstance(value, dict) else {}
    numbers = {name: number(entry) for name, entry in entries.items()}
    return {name: entry for name, entry in numbers.items() if entry is not None}


def _result(value: object) -> str:
    if not isinstance(value, dict):
        return ""
    parts = [display_text(v) for v in value.values() if v not in ("", None, "ok", "success", 0)]
    return _cut("\n".join(part for part in parts if part))


def _cut(value: object) -> str:
    """Return a text, shortened if it is too long for a page."""
    text = value if isinstance(value, str) else ""
    if len(text) <= MAX_TEXT_CHARS:
        return text
    return f"{text[:MAX_TEXT_CHARS]}\n... {len(text) - MAX_TEXT_CHARS:,} characters more"
