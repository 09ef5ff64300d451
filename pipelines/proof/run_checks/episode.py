"""Check one episode: its record against its lines, and its effects against its plans."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.actions.agent_actions import REINIT
from hijack_data.errors import HijackError, short_repr
from hijack_data.plan import CLEAN, Effect, Plan
from hijack_data.planner import Planner
from hijack_data.runs.run_log import EPISODE, RUN, STEPS, VERSION, sha256_hex
from hijack_data.runs.run_planners import dump_planner, load_planner, planner_params
from hijack_data.types import Scene, Size, as_boxes

from ...readers import fields
from ...readers.fields import FieldError, FieldTypeError
from ...readers.safe_files import lines, parse_file
from . import field_checks
from .input_checks import InputReplay, input_problems
from .journal import Journal, privileged_input_problems
from .observation import ReplayedObservation, ReplayInputs, answer_points, check_observation

BEFORE = -1  # the step number of effects before the episode
MAX_LAST_WORDS = 2000  # characters of the agent's last words that the record keeps


@dataclass
class EpisodeReplay:
    """The record and the observations of an episode that was checked."""

    record: Mapping[str, Any] = field(default_factory=dict[str, Any])
    lines: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    plans: list[Plan] = field(default_factory=list[Plan])
    steps: int = 0
    disturbed: int = 0
    last: str = ""  # the hash of the previous line

    def add(self, line: Mapping[str, Any], observation: ReplayedObservation) -> None:
        """Add an observation."""
        self.lines.append(line)
        self.plans.append(observation.plan)
        self.disturbed += bool(observation.plan.ops)


def check_episode(folder: Path, journal: Journal, replay: EpisodeReplay) -> Iterator[str]:
    """Yield the problems of an episode, each with its file.

    Args:
        folder: the episode.
        journal: that of its run.
        replay: collects the record and the observations.
    """
    try:
        record = parse_file(folder / EPISODE)
        replay.record = record
        _check_version(record)
        yield from _in_record(_identity(folder, record))
        yield from _in_record(privileged_input_problems(record))
        planner, is_stated = _planner(record, journal)
        yield from _in_record(_agrees(record, planner, is_stated))
        key = _key(record, planner, is_stated, _has_page_layer(journal))
        is_whole = True
        for problem in _lines(folder, key, replay):
            is_whole = False
            yield f"{STEPS}: {problem}"
        yield from _in_record(_end(replay))
        if is_whole or len(replay.lines) == replay.steps:
            if not journal.exists:  # otherwise the journal's line is checked, which is the same
                yield from _in_record(field_checks.unknown_fields(record, EPISODE))
                yield from _in_record(field_checks.outcome_problems(record))
            yield from _in_record(_record_problems(replay, key))
            yield from field_checks.episode_file_problems(folder, replay.lines)
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

    Raises:
        FieldError: the label is not one of the run, or the record's planner cannot be read.
    """
    label = fields.text(record, "corruption")
    if journal.planners is not None:
        if label not in journal.planners:
            raise FieldError("corruption", f"{label!r} is none of the corruptions of {RUN}")
        return journal.planners[label], True
    if record.get("planner") is None and label != CLEAN:
        return None, False  # no file can hold this planner
    try:
        return load_planner(fields.text(record, "planner")), True
    except HijackError as error:
        raise FieldError("planner", f"is {error}") from None


def _agrees(record: Mapping[str, Any], planner: Planner | None, is_stated: bool) -> Iterator[str]:
    """Yield the differences of the planner between the record and the configuration."""
    if is_stated:
        params = json.loads(json.dumps(planner_params(planner), default=repr))
        if record.get("params") != params:
            yield "params are not those of the corruption"
        recorded = record.get("planner")
        if recorded is not None and recorded != dump_planner(planner):
            yield f"planner is not what {RUN} has under {record.get('corruption')!r}"


def _has_page_layer(journal: Journal) -> bool:
    """Return whether the browser may have drawn plans; a log without a head does not say."""
    return journal.config.get("layer") == "dom" or not journal.exists


def _key(
    record: Mapping[str, Any], planner: Planner | None, is_stated: bool, has_page_layer: bool
) -> ReplayInputs:
    return ReplayInputs(
        seed=_seed(record),
        sample=fields.text(record, "sample"),
        apps=fields.strings(record.get("apps")),
        planner=planner,
        is_stated=is_stated,
        size=_size(record),
        allow_code=_allow_code(record),
        has_page_layer=has_page_layer,
    )


def _lines(folder: Path, key: ReplayInputs, replay: EpisodeReplay) -> Iterator[str]:
    """Check each line on its own, and the hashes that chain the lines."""
    replay.last = sha256_hex(folder.name.encode())
    inputs: InputReplay | None = None
    for index, line in enumerate(lines(folder / STEPS)):
        line_name = f"line {line.number}"
        try:
            replay.steps += 1
            data = line.record()
            step = fields.step_number(data, "step")
            if step != index:
                yield f"{line_name}: has step {step} where step {index} belongs"
            if data.get("previous") != replay.last:
                yield f"{line_name}: does not follow on the line before (previous)"
            for text in field_checks.line_problems(data):
                yield f"step {step}: {text}"
            observation = check_observation(folder, data, key)
            replay.add(data, observation)
            if inputs is None:
                inputs = InputReplay(_plan_before(observation.plan.size, key))
            for problem in inputs.problems(data, observation.plan):
                yield f"step {step}: {problem}"
            for problem in observation.problems:
                yield f"step {step}: {problem}"
        except HijackError as error:
            yield f"{line_name}: {error}"
        content = line.data or b""
        replay.last = sha256_hex(content.rstrip(b"\r\n"))


def _end(replay: EpisodeReplay) -> Iterator[str]:
    """Yield a problem if the lines do not end with the last one of the record."""
    number = replay.record.get("lines")
    if number != replay.steps:
        yield f"lines is {number}, {STEPS} has {replay.steps}"
    if replay.record.get("chain") != replay.last:
        yield f"does not follow on the last line of {STEPS} (chain)"


def _record_problems(replay: EpisodeReplay, key: ReplayInputs) -> Iterator[str]:
    """Yield the differences between the record of the episode and its lines."""
    record = replay.record
    is_ok = record.get("status") == "ok"
    for name, value in _derived_fields(replay, is_ok).items():
        if record.get(name) != value:
            yield f"{name} is {record.get(name)!r}, by {STEPS} it is {value!r}"
    requests = sum(line.get("code") == REINIT for line in replay.lines)
    yield from field_checks.recovery_problems(record, replay.lines, requests)
    yield from field_checks.guard_problems(record, replay.lines)
    yield from field_checks.time_problems(record, replay.lines)
    is_declared = key.planner is not None and bool(key.planner.inputs)
    yield from input_problems(record, replay.lines, is_declared)
    for line in replay.lines:
        is_last = line is replay.lines[-1]
        if line.get("raw") is None and not is_last:
            yield f"each line of {STEPS} but the last has an action"
            break
    if is_ok:
        if replay.lines and replay.lines[-1].get("raw") is not None:
            yield f"the last line of {STEPS} has an action, and no observation follows"
        yield from _effect_problems(replay, key)
    elif replay.lines:
        has_effects = any(plan.effects or plan.inputs for plan in _plans(replay, key))
        yield from field_checks.early_end_problems(record, replay.lines, has_effects)


def _derived_fields(replay: EpisodeReplay, is_ok: bool) -> dict[str, Any]:
    """Return the fields of the record that can be computed from the lines."""
    acted = [line for line in replay.lines if line.get("raw") is not None]
    actions = [_action_text(line) for line in acted]
    steps = len(acted) - field_checks.free_requests(replay.record, replay.lines)
    is_cut = not is_ok and len(acted) == len(replay.lines) > 0
    if is_cut and replay.record.get("steps") == steps - 1:
        steps -= 1  # the desktop died while it carried out the last action
    points = [answer_points(line["raw"], _allow_code(replay.record)) for line in acted]
    texts = [line["said"] for line in replay.lines if isinstance(line.get("said"), str)]
    fields_from_lines: dict[str, Any] = {
        "steps": steps,
        "malformed": sum(line.get("error") is not None for line in acted),
        "last_action": actions[-1] if actions else None,
        "points": {
            "named": sum(point_count for point_count, _ in points),
            "fractions": sum(fractions for _, fractions in points),
        },
        "said": texts[-1][:MAX_LAST_WORDS] if texts else "",
    }
    if is_ok:
        fields_from_lines["ended"] = _end_reason(replay, actions)
    return fields_from_lines


def _action_text(line: Mapping[str, Any]) -> Any:
    """Return the code that ran, or the answer of the agent if none did."""
    if line.get("code") is None:
        return line["raw"]
    return line["code"]


def _end_reason(replay: EpisodeReplay, actions: list[Any]) -> str:
    if actions and actions[-1] in ("DONE", "FAIL"):
        return "agent"
    free = field_checks.free_requests(replay.record, replay.lines)
    if len(actions) - free == replay.record.get("max_steps"):
        return "max_steps"
    return "outside"


def _effect_problems(replay: EpisodeReplay, key: ReplayInputs) -> Iterator[str]:
    """Yield the effects that were due but are not done, not proved, or not recorded."""
    events: list[Mapping[str, Any]] = []
    for line in replay.lines:
        events += _objects(line.get("events"))
    entries = _objects(replay.record.get("effects"))
    due_effects = _due_effects(replay, key)
    repeats = _repeats(entries)
    first_entries = [entry for number, entry in enumerate(entries) if number not in repeats]
    due_effects = _with_delayed(due_effects, first_entries)
    expected = [(step, effect.kind) for step, effect in due_effects]
    logged = [(event.get("step"), event.get("effect")) for event in events]
    if [effect for number, effect in enumerate(logged) if number not in repeats] != expected:
        yield f"events of {STEPS} are not what was due: {_list_effects(expected)}"
    if [(entry.get("step"), _record(entry).get("effect")) for entry in first_entries] != expected:
        yield f"effects are not what was due: {_list_effects(expected)}"
        return
    for (step, effect), entry in zip(due_effects, first_entries, strict=True):
        if _record(entry).get("params") != dict(effect.params):
            yield f"{effect.kind} at step {step} has other params than its plan"
    for entry in entries:
        for text in field_checks.unknown_fields(entry, field_checks.EFFECT):
            yield f"effects: {text}"
    for event, entry in zip(events, entries, strict=False):
        yield from _probe_problems(event, entry)


def _with_delayed(
    due: list[tuple[int, Effect]], entries: Sequence[Mapping[str, Any]]
) -> list[tuple[int, Effect]]:
    """Return what was due, with the effects that begin at a second at the steps of the record.

    Lines have no time of day, so a record decides at which later step such an effect began, or that
    the episode was over before. Of one step they come before the step's own effects.
    """
    at_once = [(step, effect) for step, effect in due if not effect.is_delayed]
    began: list[tuple[int, Effect]] = []
    candidates = list(entries)
    for step, effect in due:
        if not effect.is_delayed:
            continue
        entry = next((entry for entry in candidates if _is_later(entry, step, effect)), None)
        if entry is not None:
            candidates.remove(entry)
            began.append((entry["step"], effect))
    return sorted([*began, *at_once], key=lambda pair: pair[0])


def _is_later(entry: Mapping[str, Any], step: int, effect: Effect) -> bool:
    """Return whether an entry of the record is this effect, applied after this step."""
    first, record = entry.get("step"), _record(entry)
    is_same = record.get("effect") == effect.kind
    is_same = is_same and record.get("params") == effect.to_data()["params"]
    return is_same and isinstance(first, int) and first > step


def _repeats(entries: Sequence[Mapping[str, Any]]) -> set[int]:
    """Return the numbers of the effects that were applied once more.

    The same effect of the same step stands before each, was gone before the agent saw it, as its
    last probe says, and was undone.
    """
    repeats: set[int] = set()
    gone: list[tuple[Any, Any, Any]] = []
    for number, entry in enumerate(entries):
        record = _record(entry)
        effect = (entry.get("step"), record.get("effect"), record.get("params"))
        if effect in gone:
            gone.remove(effect)
            repeats.add(number)
            continue
        probes = _objects(record.get("probes"))
        if probes and probes[-1].get("ok") is not True and _objects(record.get("undone")):
            gone.append(effect)
    return repeats


def _probe_problems(event: Mapping[str, Any], entry: Mapping[str, Any]) -> Iterator[str]:
    """Yield a problem if the first probe of an effect failed, or its two accounts differ.

    The record has what the line has, and the probes that followed.
    """
    name = f"{event.get('effect')} at step {event.get('step')}"
    first, recorded = _record(event), _record(entry)
    probes = _objects(recorded.get("probes"))
    if not probes or probes[0].get("ok") is not True:
        yield f"{name} was not proved, and the status is 'ok'"
    for key in ("effect", "params", "at", "seconds"):
        if first.get(key) != recorded.get(key):
            yield f"{name} has another {key} in {STEPS}"
    for key in ("probes", "undone"):
        early = _objects(first.get(key))
        if early != _objects(recorded.get(key))[: len(early)]:
            yield f"{name} has other {key} in {STEPS}"


def _due_effects(replay: EpisodeReplay, key: ReplayInputs) -> list[tuple[int, Effect]]:
    """Return the effects of the plans with their steps, in their order."""
    plans = _plans(replay, key)
    return [
        (step, effect)
        for step, plan in zip(range(BEFORE, len(plans)), plans, strict=False)
        for effect in plan.effects
    ]


def _plans(replay: EpisodeReplay, key: ReplayInputs) -> list[Plan]:
    """Return the plans whose effects were due: before the episode, then at each step."""
    if not replay.plans:
        return []
    plans = [
        _plan_of_effects(line, plan, key)
        for line, plan in zip(replay.lines, replay.plans, strict=False)
    ]
    # No effect is applied before the last observation, unless the episode was ended from outside.
    if replay.record.get("ended") != "outside":
        plans.pop()
    return [_plan_before(replay.plans[0].size, key), *plans]


def _plan_before(size: Size, key: ReplayInputs) -> Plan:
    """Return the plan before the episode; a clean one if the log does not state the planner."""
    if not key.is_stated or key.planner is None:
        return Plan.clean(size)
    scene = Scene(size, apps=key.apps)
    return key.planner.plan(scene, seed=key.seed, sample=key.sample, step=BEFORE)


def _plan_of_effects(line: Mapping[str, Any], plan: Plan, key: ReplayInputs) -> Plan:
    """Return the plan by which the effects of a step were applied: on the elements before them.

    Args:
        line: one line of the steps, with `effect_boxes` if effects were applied.
        plan: its plan, which was made on the elements that the effects left.
        key: what decides the plans.
    """
    if line.get("effect_boxes") is None:
        return plan
    boxes = as_boxes(fields.items(line, "effect_boxes"))
    scene = Scene(plan.size, boxes, fields.strings(line.get("apps")))
    return key.plan(scene, fields.step_number(line, "step"), Plan.from_data(line.get("plan")))


def _objects(value: object) -> list[Mapping[str, Any]]:
    if not isinstance(value, list):
        return []
    return [entry for entry in cast("list[Any]", value) if isinstance(entry, dict)]


def _record(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    record = entry.get("record")
    return record if isinstance(record, dict) else {}


def _list_effects(effects: list[tuple[int, str]]) -> str:
    return ", ".join(f"{kind} at step {step}" for step, kind in effects) or "nothing"


def _check_version(record: Mapping[str, Any]) -> None:
    version = record.get("version")
    if isinstance(version, bool) or version != VERSION:
        raise FieldError("version", f"is {version!r}; this library reads {VERSION}")


def _allow_code(record: Mapping[str, Any]) -> bool:
    value = record.get("allow_code")
    if not isinstance(value, bool):
        raise FieldTypeError("allow_code", "true or false", value)
    return value


def _seed(record: Mapping[str, Any]) -> int:
    seed = record.get("seed")
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise FieldError("seed", f"must be an integer, got {short_repr(seed)}")
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
