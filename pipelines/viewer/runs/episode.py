"""One episode for the page: its steps with pictures, words and actions, and any damage."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, cast

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

MOST_STEPS = 1000
LONGEST = 20_000  # characters of one text
BOXES = 2000
NOT_SHOWN = ("plan", "boxes", "said", "raw", "events", "previous")
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
    """

    home: Path
    record: Mapping[str, Any] = field(default_factory=dict[str, Any])
    lines: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    problems: list[str] = field(default_factory=list[str])
    broken: dict[int, str] = field(default_factory=dict[int, str])


def read_lines(folder: Path, name: str, journal: Mapping[str, Any]) -> EpisodeLines:
    """Read the files of an episode; damage is noted, never raised.

    Args:
        folder: of the run.
        name: of the episode.
        journal: its line in the journal; empty if there is none.
    """
    found = EpisodeLines(home=folder / EPISODES / name, record=journal)
    if not found.home.is_dir():
        if journal.get("status") == "ok" or journal.get("steps"):
            found.problems.append(f"there is no {EPISODES}/{name}: its steps are lost")
        return found
    _read_record(found, journal)
    _read_steps(found)
    told = found.record.get("lines")
    if isinstance(told, int) and told != len(found.lines):
        found.problems.append(f"{STEPS} has {len(found.lines)} lines, {EPISODE} says {told}")
    return found


def _read_record(found: EpisodeLines, journal: Mapping[str, Any]) -> None:
    path = found.home / EPISODE
    if not path.exists():
        found.problems.append(f"it has no {EPISODE}: it is being played, or was broken off")
        return
    try:
        found.record = parse_file(path)
    except FieldError as error:
        found.problems.append(f"{EPISODE}: {error}")
        return
    if not journal:
        return
    # the journal of version 1 had the agent's words, and the episode had not
    later = {*LINKS, *({"said"} if journal.get("version", 1) == 1 else ())}
    differ = [
        key
        for key in sorted({*journal, *found.record} - later)
        if journal.get(key) != found.record.get(key)
    ]
    if differ:
        names = ", ".join(differ[:4])
        found.problems.append(f"{EPISODE} and its line in {RECORDS} differ in {names}")


def _read_steps(found: EpisodeLines) -> None:
    try:
        for place, line in enumerate(lines(inside(found.home, STEPS, STEPS))):
            if place == MOST_STEPS:
                found.problems.append(f"only the first {MOST_STEPS} steps are shown")
                return
            try:
                found.lines.append(mapping(line.record(), ""))
            except FieldError as error:
                found.lines.append({})
                found.broken[place] = f"line {line.number} of {STEPS}: {error}"
                found.problems.append(found.broken[place])
    except FieldError as error:
        found.problems.append(f"{STEPS}: {error.reason}")
    except OSError as error:
        found.problems.append(f"{STEPS}: cannot be read ({error.strerror or error})")


def episode_data(folder: Path, name: str, found: EpisodeLines) -> dict[str, Any]:
    """Return the page's data of an episode in a folder."""
    talk, problem = read_turns(folder, name, found.record)
    turns = turn_numbers(found.lines)
    effects = _effects(found)
    steps = [
        _step(found, place, talk.get(-1 if turn is None else turn), effects)
        for place, turn in enumerate(turns)
    ]
    missing = sum(bool(step["lost"]) for step in steps)
    problems = [*found.problems, problem]
    if missing:
        problems.append(f"the pictures of {missing} of {len(steps)} steps cannot be shown")
    return {
        "problems": [text for text in problems if text],
        "steps": steps,
        "effects": effects,
        **about(found.record),
    }


def about(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the page's data of an episode's record."""
    where = [str(frame) for frame in listed(record.get("traceback"))]
    return {
        "reason": _cut(record.get("reason")),
        "problem": _cut(record.get("problem")),
        "ended": _cut(record.get("ended")),
        "traceback": "\n".join(where)[:LONGEST],
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
    seen = None if before else line.get("seen")
    name = seen or line.get("image")
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
    found: EpisodeLines, place: int, talk: TurnMessages | None, effects: list[dict[str, Any]]
) -> StepData:
    line = found.lines[place]
    raw = line.get("raw")
    code = raw if isinstance(raw, str) else ""
    step: StepData = {
        "step": place,
        "problem": found.broken.get(place, ""),
        "lost": "",
        "size": None,
        "corrupted": bool(line.get("seen")),
        "no_before": "" if line.get("seen") else "the agent saw the clean screen",
        "code": _cut(code),
        "ran": _cut(line.get("code")) if line.get("code") != raw else "",
        "said": _cut(line.get("said")),
        "error": _cut(line.get("error")),
        "result": _result(line.get("result")),
        "onlooker": [] if talk is None else [[r, _cut(text)] for r, text in talk.onlooker],
        "usage": _numbers({} if talk is None else talk.usage),
        "seconds": _numbers(line.get("seconds")),
        "still": line.get("still") is not False,
        "effects": [k for k, effect in enumerate(effects) if effect["step"] == place],
        "plan": "" if line.get("plan") is None else _cut(display_text(line["plan"])),
        "boxes": _boxes(line.get("boxes")),
        "fields": record_fields(line, *NOT_SHOWN),
        "action": "",
        "strokes": [],
        "target": None,
        "recorded": "",
    }
    size: Size | None = None
    try:
        size = image_size(picture_file(found.home, line, False))
        step["size"] = [size[1], size[0]]
    except FieldError as error:
        step["lost"] = found.broken.get(place) or str(error)
    if code:
        step["action"], step["strokes"] = parse_strokes(code, size)
    return step


def _effects(found: EpisodeLines) -> list[dict[str, Any]]:
    """Return all effects of an episode: from its record, or from its lines if it has none."""
    recorded = objects(found.record.get("effects"))
    if recorded:
        return [_effect(entry, entry.get("step")) for entry in recorded]
    return [
        _effect(event, place)
        for place, line in enumerate(found.lines)
        for event in objects(line.get("events"))
    ]


def _effect(entry: Mapping[str, Any], step: object) -> dict[str, Any]:
    record = entry.get("record")
    told: Mapping[str, Any] = record if isinstance(record, dict) else {}
    # effects before the episode are first visible in observation 0
    place = max(0, step) if isinstance(step, int) else 0
    known = ("effect", "probes", "undone", "at")
    return {
        "step": place,
        "kind": _cut(told.get("effect") or entry.get("effect") or "effect"),
        "did": _cut(display_text({key: told[key] for key in told if key not in known})),
        "probes": [_probe(probe) for probe in objects(told.get("probes"))],
        "undone": [_probe(probe) for probe in objects(told.get("undone"))],
    }


def _probe(probe: Mapping[str, Any]) -> dict[str, Any]:
    facts = probe.get("facts")
    return {
        "ok": probe.get("ok") is True,
        "facts": _cut(display_text(facts)) if facts else "",
        "problem": _cut(probe.get("problem")),
    }


def _boxes(value: object) -> list[list[float]]:
    found: list[list[float]] = []
    for box in listed(value)[:BOXES]:
        sides = [side for side in map(number, listed(box)) if side is not None]
        if len(sides) == 4:
            found.append(sides)
    return found


def _numbers(value: object) -> dict[str, float]:
    """Return the entries of an object that are numbers."""
    found = cast("dict[str, object]", value) if isinstance(value, dict) else {}
    numbers = {name: number(one) for name, one in found.items()}
    return {name: one for name, one in numbers.items() if one is not None}


def _result(value: object) -> str:
    if not isinstance(value, dict):
        return ""
    parts = [display_text(v) for v in value.values() if v not in ("", None, "ok", "success", 0)]
    return _cut("\n".join(part for part in parts if part))


def _cut(value: object) -> str:
    """Return a text, shortened if it is too long for a page."""
    text = value if isinstance(value, str) else ""
    if len(text) <= LONGEST:
        return text
    return f"{text[:LONGEST]}\n... {len(text) - LONGEST:,} characters more"
