"""Check one episode: its record against its lines, and its effects against its plans."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import HijackError
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner
from hijack_data.runs.run_log import CHAINED, EPISODE, REINIT, RUN, STEPS, VERSION, digest_of
from hijack_data.runs.run_planners import params_of, read_back, written
from hijack_data.types import Scene, Size

from ...readers import fields
from ...readers.fields import FieldError
from ...readers.files import lines, parse_file
from .journal import Journal, given_problems, id_of
from .observation import Key, ReplayedObservation, check_observation

BEFORE = -1  # the step number of effects before the episode
SAID = 2000  # characters of the agent's last words that the record keeps
_Due = tuple[int, str]  # step and kind of an effect


@dataclass
class Seen:
    """The record and the observations of an episode that was checked."""

    record: Mapping[str, Any] = field(default_factory=dict[str, Any])
    lines: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    plans: list[Plan] = field(default_factory=list[Plan])
    steps: int = 0
    disturbed: int = 0
    last: str = ""  # the hash of the previous line

    def add(self, line: Mapping[str, Any], found: ReplayedObservation) -> None:
        """Add an observation."""
        self.lines.append(line)
        self.plans.append(found.plan)
        self.disturbed += bool(found.plan.ops)


def check_episode(folder: Path, journal: Journal, seen: Seen) -> Iterator[str]:
    """Yield the problems of an episode, each with its file.

    Args:
        folder: the episode.
        journal: that of its run.
        seen: collects the record and the observations.
    """
    try:
        record = parse_file(folder / EPISODE)
        seen.record = record
        version = _version(record)
        yield from _in_record(_identity(folder, record))
        yield from _in_record(given_problems(record))
        planner, known = _planner(record, journal)
        yield from _in_record(_agrees(record, planner, known, journal))
        key = _key(record, planner, known)
        whole = True
        for problem in _lines(folder, key, seen, version):
            whole = False
            yield f"{STEPS}: {problem}"
        if version >= CHAINED:
            yield from _in_record(_end(seen))
        if whole or len(seen.lines) == seen.steps:
            yield from _in_record(_record_problems(seen, key))
    except FieldError as error:
        yield f"{EPISODE}: {error}"
    except OSError as error:
        yield f"{STEPS}: cannot be read ({error.strerror or error})"


def _in_record(problems: Iterator[str]) -> Iterator[str]:
    for text in problems:
        yield f"{EPISODE}: {text}"


def _identity(folder: Path, record: Mapping[str, Any]) -> Iterator[str]:
    name = record.get("id")
    expected = id_of(record)
    if name != expected:
        yield f"id is {name!r}, by task, corruption, seed and agent it is {expected!r}"
    if name != folder.name:
        yield f"id is {name!r}, the folder is {folder.name!r}"
    sample = record.get("sample")
    task = record.get("task")
    if sample != task:
        yield f"sample is {sample!r}, the task is {task!r}"


def _planner(record: Mapping[str, Any], journal: Journal) -> tuple[Planner | None, bool]:
    """Return the planner of the episode, and whether the log states it outside the plans.

    The configuration of the run comes first, then the record of the episode.
    """
    label = fields.text(record, "corruption")
    if journal.planners is not None:
        if label not in journal.planners:
            raise FieldError("corruption", f"{label!r} is none of the corruptions of {RUN}")
        return journal.planners[label], True
    if record.get("planner") is None:
        is_clean = label == CLEAN and not record.get("params")
        return None, is_clean
    try:
        return read_back(fields.text(record, "planner")), True
    except HijackError as error:
        raise FieldError("planner", f"is {error}") from None


def _agrees(
    record: Mapping[str, Any], planner: Planner | None, known: bool, journal: Journal
) -> Iterator[str]:
    """Yield the differences of planner and rules between the record and the configuration."""
    if known:
        params = json.loads(json.dumps(params_of(planner), default=repr))
        if record.get("params") != params:
            yield "params are not those of the corruption"
        recorded = record.get("planner")
        if recorded is not None and recorded != written(planner):
            yield f"planner is not what {RUN} has under {record.get('corruption')!r}"
    rules = {"recovery": _recovery(record).get("policy"), "max_steps": record.get("max_steps")}
    for name, value in rules.items():
        if value is None or name not in journal.config:
            continue
        planned = journal.config[name]
        if planned != value:
            yield f"{name} is {value!r}, in {RUN} it is {planned!r}"


def _recovery(record: Mapping[str, Any]) -> Mapping[str, Any]:
    found = record.get("recovery")
    return found if isinstance(found, dict) else {}


def _key(record: Mapping[str, Any], planner: Planner | None, known: bool) -> Key:
    return Key(
        seed=_seed(record),
        sample=fields.text(record, "sample"),
        apps=fields.strings(record.get("apps")),
        planner=planner,
        known=known,
        size=_size(record),
        allow_code=record.get("allow_code"),
        hashed=_version(record) >= CHAINED,
    )


def _lines(folder: Path, key: Key, seen: Seen, version: int) -> Iterator[str]:
    """Check each line on its own, and the hashes that chain the lines."""
    seen.last = digest_of(folder.name.encode())
    for place, line in enumerate(lines(folder / STEPS)):
        where = f"line {line.number}"
        try:
            seen.steps += 1
            data = line.record()
            step = fields.step_number(data, "step")
            if step != place:
                yield f"{where}: has step {step} where step {place} belongs"
            if version >= CHAINED and data.get("previous") != seen.last:
                yield f"{where}: does not follow on the line before (previous)"
            found = check_observation(folder, data, key)
            seen.add(data, found)
            for problem in found.problems:
                yield f"step {step}: {problem}"
        except HijackError as error:
            yield f"{where}: {error}"
        content = line.data or b""
        seen.last = digest_of(content.rstrip(b"\r\n"))


def _end(seen: Seen) -> Iterator[str]:
    """Yield a problem if the lines do not end with the last one of the record."""
    number = seen.record.get("lines")
    if number != seen.steps:
        yield f"lines is {number}, {STEPS} has {seen.steps}"
    if seen.record.get("chain") != seen.last:
        yield f"does not follow on the last line of {STEPS} (chain)"


def _record_problems(seen: Seen, key: Key) -> Iterator[str]:
    """Yield the differences between the record of the episode and its lines."""
    record = seen.record
    status = record.get("status")
    score = record.get("score")
    ok = status == "ok"
    if ok == (score is None):
        yield f"status is {status!r}, and the score {score!r}"
    if not ok:
        return
    if not _is_share(record["score"]):
        yield f"score is {score!r}, no number in 0..1"
    for name, value in _counted(seen).items():
        if record.get(name) != value:
            yield f"{name} is {record.get(name)!r}, by {STEPS} it is {value!r}"
    yield from _requests(seen)
    for line in seen.lines:
        is_last = line is seen.lines[-1]
        if (line.get("raw") is None) != is_last:
            yield f"each line of {STEPS} but the last has an action"
            break
    yield from _effects(seen, key)


def _is_share(score: object) -> bool:
    if isinstance(score, bool) or not isinstance(score, int | float):
        return False
    return 0 <= score <= 1


def _requests(seen: Seen) -> Iterator[str]:
    """Yield a problem if the record's number of requests for recovery is not that of the lines."""
    if not isinstance(seen.record.get("recovery"), dict):
        return
    asked = sum(line.get("code") == REINIT for line in seen.lines)
    counted = _recovery(seen.record).get("requests")
    if counted != asked:
        yield f"recovery.requests is {counted!r}, by {STEPS} it is {asked}"


def _counted(seen: Seen) -> dict[str, Any]:
    """Return the fields of the record that can be computed from the lines."""
    acted = seen.lines[:-1]
    taken = [_taken(line) for line in acted]
    found: dict[str, Any] = {
        "steps": len(acted),
        "malformed": sum(line.get("error") is not None for line in acted),
        "last_action": taken[-1] if taken else None,
    }
    if _version(seen.record) >= CHAINED:
        found["said"] = ""
        for line in seen.lines:
            said = line.get("said")
            if isinstance(said, str):
                found["said"] = said[:SAID]
        found["ended"] = _ended(seen, taken)
    return found


def _taken(line: Mapping[str, Any]) -> Any:
    """Return the code that ran, or the answer of the agent if none did."""
    if line.get("code") is None:
        return line["raw"]
    return line["code"]


def _ended(seen: Seen, taken: list[Any]) -> str:
    if taken and taken[-1] in ("DONE", "FAIL"):
        return "agent"
    if len(taken) == seen.record.get("max_steps"):
        return "max_steps"
    return "outside"


def _effects(seen: Seen, key: Key) -> Iterator[str]:
    """Yield the effects that were due but are not done, not proved, or not recorded."""
    done: list[Mapping[str, Any]] = []
    for line in seen.lines:
        done += _objects(line.get("events"))
    kept = _objects(seen.record.get("effects"))
    due = _due(seen, key)
    if [(event.get("step"), event.get("effect")) for event in done] != due:
        yield f"events of {STEPS} are not what was due: {_shown(due)}"
    if [(entry.get("step"), _record(entry).get("effect")) for entry in kept] != due:
        yield f"effects are not what was due: {_shown(due)}"
        return
    for event, entry in zip(done, kept, strict=False):
        yield from _proof(event, entry)


def _proof(event: Mapping[str, Any], entry: Mapping[str, Any]) -> Iterator[str]:
    """Yield a problem if the first probe of an effect failed, or differs between the files."""
    name = f"{event.get('effect')} at step {event.get('step')}"
    first = _objects(_record(entry).get("probes"))[:1]
    is_proved = bool(first) and first[0].get("ok") is True
    if not is_proved:
        yield f"{name} was not proved, and the status is 'ok'"
    if _objects(_record(event).get("probes"))[:1] != first:
        yield f"{name} has other probes in {STEPS}"


def _due(seen: Seen, key: Key) -> list[_Due]:
    """Return the effects of the plans, in their order."""
    if not seen.plans:
        return []
    plans = list(enumerate(seen.plans))
    # No effect is applied before the last observation, unless the episode was ended from outside.
    if seen.record.get("ended") != "outside":
        plans.pop()
    if key.known and key.planner is not None:
        scene = Scene(seen.plans[0].size, apps=key.apps)
        first = key.planner.plan(scene, seed=key.seed, sample=key.sample, step=BEFORE)
        plans.insert(0, (BEFORE, first))
    return [(step, effect.kind) for step, plan in plans for effect in plan.effects]


def _objects(value: object) -> list[Mapping[str, Any]]:
    if not isinstance(value, list):
        return []
    return [entry for entry in cast("list[Any]", value) if isinstance(entry, dict)]


def _record(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    found = entry.get("record")
    return found if isinstance(found, dict) else {}


def _shown(due: list[_Due]) -> str:
    return ", ".join(f"{kind} at step {step}" for step, kind in due) or "nothing"


def _version(record: Mapping[str, Any]) -> int:
    version = record.get("version", 1)
    is_number = isinstance(version, int) and not isinstance(version, bool)
    if not is_number or not 1 <= version <= VERSION:
        raise FieldError("version", f"is {version!r}; this library reads 1 to {VERSION}")
    return version


def _seed(record: Mapping[str, Any]) -> int:
    seed = record.get("seed")
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise FieldError("seed", f"must be an integer, got {fields.shown(seed)}")
    return seed


def _size(record: Mapping[str, Any]) -> Size | None:
    desktop = record.get("desktop")
    if not isinstance(desktop, dict):
        return None
    match cast("dict[str, Any]", desktop).get("size"):
        case [int() as width, int() as height]:
            return height, width
        case _:
            return None
