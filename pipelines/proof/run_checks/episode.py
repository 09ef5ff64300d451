"""Check one episode: its record against its lines, and its effects against its plans."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.actions.allowed import REINIT
from hijack_data.errors import HijackError
from hijack_data.plan import CLEAN, Effect, Plan
from hijack_data.planner import Planner
from hijack_data.runs.run_log import CHAINED, EPISODE, RUN, STEPS, VERSION, digest_of
from hijack_data.runs.run_planners import planner_params
from hijack_data.types import Scene, Size

from ...readers import fields
from ...readers.fields import FieldError
from ...readers.safe_files import lines, parse_file
from . import field_checks
from .journal import Journal, privileged_input_problems
from .observation import ReplayedObservation, ReplayInputs, answer_points, check_observation

BEFORE = -1  # the step number of effects before the episode
SAID = 2000  # characters of the agent's last words that the record keeps


@dataclass
class EpisodeReplay:
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


def check_episode(folder: Path, journal: Journal, seen: EpisodeReplay) -> Iterator[str]:
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
        yield from _in_record(privileged_input_problems(record))
        planner, known = _planner(record, journal)
        yield from _in_record(_agrees(record, planner, known))
        key = _key(record, planner, known)
        whole = True
        for problem in _lines(folder, key, seen, version):
            whole = False
            yield f"{STEPS}: {problem}"
        if version >= CHAINED:
            yield from _in_record(_end(seen))
        if whole or len(seen.lines) == seen.steps:
            if not journal.exists:  # otherwise the journal's line is checked, which is the same
                yield from _in_record(field_checks.unknown_fields(record, EPISODE))
                yield from _in_record(field_checks.outcome_problems(record))
            yield from _in_record(_record_problems(seen, key))
            yield from field_checks.episode_file_problems(folder, seen.lines)
    except FieldError as error:
        yield f"{EPISODE}: {error}"
    except OSError as error:
        yield f"{STEPS}: cannot be read ({error.strerror or error})"


def _in_record(problems: Iterator[str]) -> Iterator[str]:
    for text in problems:
        yield f"{EPISODE}: {text}"


def _identity(folder: Path, record: Mapping[str, Any]) -> Iterator[str]:
    name = record.get("id")
    expected = field_checks.expected_id(record)
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


def _agrees(record: Mapping[str, Any], planner: Planner | None, known: bool) -> Iterator[str]:
    """Yield the differences of the planner between the record and the configuration."""
    if known:
        params = json.loads(json.dumps(planner_params(planner), default=repr))
        if record.get("params") != params:
            yield "params are not those of the corruption"
        recorded = record.get("planner")
        if recorded is not None and recorded != written(planner):
            yield f"planner is not what {RUN} has under {record.get('corruption')!r}"


def _key(record: Mapping[str, Any], planner: Planner | None, known: bool) -> ReplayInputs:
    return ReplayInputs(
        seed=_seed(record),
        sample=fields.text(record, "sample"),
        apps=fields.strings(record.get("apps")),
        planner=planner,
        known=known,
        size=_size(record),
        allow_code=record.get("allow_code"),
        hashed=_version(record) >= CHAINED,
    )


def _lines(folder: Path, key: ReplayInputs, seen: EpisodeReplay, version: int) -> Iterator[str]:
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
            for text in field_checks.line_problems(data):
                yield f"step {step}: {text}"
            found = check_observation(folder, data, key)
            seen.add(data, found)
            for problem in found.problems:
                yield f"step {step}: {problem}"
        except HijackError as error:
            yield f"{where}: {error}"
        content = line.data or b""
        seen.last = digest_of(content.rstrip(b"\r\n"))


def _end(seen: EpisodeReplay) -> Iterator[str]:
    """Yield a problem if the lines do not end with the last one of the record."""
    number = seen.record.get("lines")
    if number != seen.steps:
        yield f"lines is {number}, {STEPS} has {seen.steps}"
    if seen.record.get("chain") != seen.last:
        yield f"does not follow on the last line of {STEPS} (chain)"


def _record_problems(seen: EpisodeReplay, key: ReplayInputs) -> Iterator[str]:
    """Yield the differences between the record of the episode and its lines."""
    record = seen.record
    is_ok = record.get("status") == "ok"
    for name, value in _counted(seen, is_ok).items():
        if record.get(name) != value:
            yield f"{name} is {record.get(name)!r}, by {STEPS} it is {value!r}"
    asked = sum(line.get("code") == REINIT for line in seen.lines)
    yield from field_checks.recovery_problems(record, seen.lines, asked)
    yield from field_checks.time_problems(record, seen.lines)
    for line in seen.lines:
        is_last = line is seen.lines[-1]
        if line.get("raw") is None and not is_last:
            yield f"each line of {STEPS} but the last has an action"
            break
    if is_ok:
        if seen.lines and seen.lines[-1].get("raw") is not None:
            yield f"the last line of {STEPS} has an action, and no observation follows"
        yield from _effects(seen, key)
    elif seen.lines:
        has_effects = any(plan.effects for plan in _plans(seen, key))
        yield from field_checks.early_end_problems(record, seen.lines, has_effects)


def _counted(seen: EpisodeReplay, is_ok: bool) -> dict[str, Any]:
    """Return the fields of the record that can be computed from the lines."""
    acted = [line for line in seen.lines if line.get("raw") is not None]
    taken = [_taken(line) for line in acted]
    steps = len(acted)
    is_cut = not is_ok and steps == len(seen.lines) > 0
    if is_cut and seen.record.get("steps") == steps - 1:
        steps -= 1  # the desktop died while it carried out the last action
    found: dict[str, Any] = {
        "steps": steps,
        "malformed": sum(line.get("error") is not None for line in acted),
        "last_action": taken[-1] if taken else None,
    }
    if "points" in seen.record:
        allow_code = seen.record.get("allow_code") is True
        points = [answer_points(line["raw"], allow_code) for line in acted]
        found["points"] = {
            "named": sum(named for named, _ in points),
            "fractions": sum(fractions for _, fractions in points),
        }
    if _version(seen.record) >= CHAINED:
        found["said"] = ""
        for line in seen.lines:
            said = line.get("said")
            if isinstance(said, str):
                found["said"] = said[:SAID]
        if is_ok:
            found["ended"] = _ended(seen, taken)
    return found


def _taken(line: Mapping[str, Any]) -> Any:
    """Return the code that ran, or the answer of the agent if none did."""
    if line.get("code") is None:
        return line["raw"]
    return line["code"]


def _ended(seen: EpisodeReplay, taken: list[Any]) -> str:
    if taken and taken[-1] in ("DONE", "FAIL"):
        return "agent"
    if len(taken) == seen.record.get("max_steps"):
        return "max_steps"
    return "outside"


def _effects(seen: EpisodeReplay, key: ReplayInputs) -> Iterator[str]:
    """Yield the effects that were due but are not done, not proved, or not recorded."""
    done: list[Mapping[str, Any]] = []
    for line in seen.lines:
        done += _objects(line.get("events"))
    kept = _objects(seen.record.get("effects"))
    due = _due(seen, key)
    named = [(step, effect.kind) for step, effect in due]
    if [(event.get("step"), event.get("effect")) for event in done] != named:
        yield f"events of {STEPS} are not what was due: {_shown(named)}"
    if [(entry.get("step"), _record(entry).get("effect")) for entry in kept] != named:
        yield f"effects are not what was due: {_shown(named)}"
        return
    for (step, effect), entry in zip(due, kept, strict=True):
        if _record(entry).get("params") != dict(effect.params):
            yield f"{effect.kind} at step {step} has other params than its plan"
        for text in field_checks.unknown_fields(entry, field_checks.EFFECT):
            yield f"effects: {text}"
    for event, entry in zip(done, kept, strict=False):
        yield from _proof(event, entry)


def _proof(event: Mapping[str, Any], entry: Mapping[str, Any]) -> Iterator[str]:
    """Yield a problem if the first probe of an effect failed, or its two accounts differ.

    The record has what the line has, and the probes that followed.
    """
    name = f"{event.get('effect')} at step {event.get('step')}"
    first, whole = _record(event), _record(entry)
    probes = _objects(whole.get("probes"))
    if not probes or probes[0].get("ok") is not True:
        yield f"{name} was not proved, and the status is 'ok'"
    for key in ("effect", "params", "at", "seconds"):
        if first.get(key) != whole.get(key):
            yield f"{name} has another {key} in {STEPS}"
    for key in ("probes", "undone"):
        early = _objects(first.get(key))
        if early != _objects(whole.get(key))[: len(early)]:
            yield f"{name} has other {key} in {STEPS}"


def _due(seen: EpisodeReplay, key: ReplayInputs) -> list[tuple[int, Effect]]:
    """Return the effects of the plans with their steps, in their order."""
    plans = _plans(seen, key)
    return [
        (step, effect)
        for step, plan in zip(range(BEFORE, len(plans)), plans, strict=False)
        for effect in plan.effects
    ]


def _plans(seen: EpisodeReplay, key: ReplayInputs) -> list[Plan]:
    """Return the plans whose effects were due: before the episode, then at each step."""
    if not seen.plans:
        return []
    plans = list(seen.plans)
    # No effect is applied before the last observation, unless the episode was ended from outside.
    if seen.record.get("ended") != "outside":
        plans.pop()
    first = Plan.clean(seen.plans[0].size)
    if key.known and key.planner is not None:
        scene = Scene(seen.plans[0].size, apps=key.apps)
        first = key.planner.plan(scene, seed=key.seed, sample=key.sample, step=BEFORE)
    return [first, *plans]


def _objects(value: object) -> list[Mapping[str, Any]]:
    if not isinstance(value, list):
        return []
    return [entry for entry in cast("list[Any]", value) if isinstance(entry, dict)]


def _record(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    found = entry.get("record")
    return found if isinstance(found, dict) else {}


def _shown(due: list[tuple[int, str]]) -> str:
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
