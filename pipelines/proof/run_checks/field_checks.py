"""Every field of a run's files, and what it is compared with: a closed world.

A field that is not in `FIELDS` is a problem, and so is a file that no part of the run names.
The site shows it as a table, on the page of docs/verify_runs.md.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Final, TypeGuard

from hijack_data.actions.agent_actions import REINIT
from hijack_data.errors import short_repr
from hijack_data.runs.page_layer import LAYER
from hijack_data.runs.run_head import config_digest
from hijack_data.runs.run_log import (
    EPISODE,
    EPISODES,
    FRAMES,
    GIVEN,
    LOCK,
    RECORDS,
    REQUESTS,
    ROW,
    RUN,
    SEAL,
    SESSIONS,
    SIGNATURE,
    STEPS,
    TEXTS,
    UNTIL_RETENTION,
    episode_slug,
    row_slug,
)

from .library import LIBRARY_INPUTS, Library

DERIVED: Final = "derived"  # computed again from other files
COPIED: Final = "copied"  # stands elsewhere, too, and is compared
LIBRARY: Final = "library"  # follows from what the library knows
FREE: Final = "free"  # only a hash protects it

CONFIG, DESKTOP, RECOVERY, EVENT, EFFECT = "config", "desktop", "recovery", "event", "effect"
INPUT = "input"
GUARD, INTERVENTION = "guard", "intervention"
_CODE_LISTS = ("agents", "tasks")  # the lists whose names may have an entry in `config.code`
_JUDGES = ("desktop_env",)  # foreign code that judges tasks, and may have one, too

FIELDS: Mapping[str, Mapping[str, str]] = {
    RUN: {
        "format": LIBRARY,
        "version": COPIED,
        "config": COPIED,
        "episodes": DERIVED,
        "config_sha256": DERIVED,
        "versions": FREE,
        "created": FREE,
        "git": FREE,
        "machine": FREE,
        "desktops": FREE,
        "workers": FREE,
    },
    CONFIG: {
        "source": FREE,
        "desktop": COPIED,
        "agents": COPIED,
        "tasks": COPIED,
        "corruptions": COPIED,
        "seeds": COPIED,
        "max_steps": COPIED,
        "recovery": COPIED,
        "environment_errors": COPIED,
        "retries": DERIVED,
        "agent_timeout": FREE,
        "episode_timeout": FREE,
        "osworld_files": FREE,
        "text_boxes": FREE,
        "guard": COPIED,
        "layer": FREE,
        "unplayable": FREE,
        "unplayable_score": FREE,
        "code": FREE,
        "until_retention": DERIVED,
    },
    SESSIONS: {
        "at": FREE,
        "records": DERIVED,
        "config_sha256": COPIED,
        "git": FREE,
        "machine": FREE,
        "desktops": FREE,
        "workers": FREE,
        "versions": COPIED,
    },
    EPISODE: {
        "version": COPIED,
        "id": DERIVED,
        "agent": COPIED,
        "task": LIBRARY,
        "task_seed": LIBRARY,
        "instruction": LIBRARY,
        "apps": LIBRARY,
        "infeasible": LIBRARY,
        "corruption": COPIED,
        "params": DERIVED,
        "planner": DERIVED,
        "seed": COPIED,
        "sample": DERIVED,
        "attempt": DERIVED,
        "max_steps": COPIED,
        "allow_code": LIBRARY,
        "status": DERIVED,
        "score": FREE,
        "reason": FREE,
        "ended": DERIVED,
        "steps": DERIVED,
        "seconds": FREE,
        "setup_seconds": FREE,
        "effects": DERIVED,
        "inputs": DERIVED,
        "environment_errors": COPIED,
        "problem": FREE,
        "cause": DERIVED,
        "traceback": FREE,
        "recovery": DERIVED,
        "malformed": DERIVED,
        "points": DERIVED,
        "last_action": DERIVED,
        "said": DERIVED,
        "usage": FREE,
        "guard": COPIED,
        GIVEN: LIBRARY,
        "desktop": COPIED,
        "lines": DERIVED,
        "chain": DERIVED,
    },
    DESKTOP: {"provider": LIBRARY, "size": COPIED, "settle": LIBRARY, "machine": FREE},
    RECOVERY: {
        "policy": COPIED,
        "requests": DERIVED,
        "false_alarms": FREE,
        "repaired": DERIVED,
        "free": DERIVED,
    },
    GUARD: {"name": COPIED, "settings": FREE, "interventions": DERIVED},
    INTERVENTION: {"step": DERIVED, "kind": FREE, "actions": DERIVED},
    STEPS: {
        "said": FREE,
        "step": DERIVED,
        "image": DERIVED,
        "image_sha256": DERIVED,
        "seen": DERIVED,
        LAYER: DERIVED,
        "seen_sha256": DERIVED,
        "plan": DERIVED,
        "plan_digest": DERIVED,
        "boxes": FREE,
        "effect_boxes": FREE,
        "apps": COPIED,
        "raw": FREE,
        "cut": FREE,
        "code": DERIVED,
        "error": DERIVED,
        "events": DERIVED,
        "input": DERIVED,
        "result": FREE,
        "still": FREE,
        "seconds": FREE,
        "previous": DERIVED,
    },
    EVENT: {"step": DERIVED, "effect": DERIVED, "record": COPIED},
    EFFECT: {"step": DERIVED, "record": COPIED, "held_at_end": FREE},
    INPUT: {"sent": DERIVED, "faults": DERIVED, "probe": FREE},
}
# Files and folders of a run. Those of agents are the requests of models and what OCR has read.
RUN_FILES = frozenset({RUN, RECORDS, SESSIONS, LOCK, SEAL, SIGNATURE, EPISODES, REQUESTS, TEXTS})
EPISODE_FILES = frozenset({EPISODE, STEPS, FRAMES})
STATUSES = ("ok", "invalid", "error")
CAUSES = ("agent", "machine")  # of an error in a run; "outside" ends a run, and is played again
SECONDS = ("settle", "tree", "boxes", "effects", "corrupt", "action")  # of a step
NESTED_SECONDS = ("tree",)  # those that another one includes
_HALF_WRITTEN = f".{EPISODE}.*.tmp"  # what a killed `write_atomic` leaves
ROUNDING_S = 0.001  # by which the sum of rounded seconds may be too large, for each step


def unknown_fields(data: Mapping[str, Any], kind: str, extra: Sequence[str] = ()) -> Iterator[str]:
    """Yield a problem for each field that files of a run do not have."""
    for name in data:
        if name not in FIELDS[kind] and name not in extra:
            yield f"has a field {short_repr(name)}, which no {kind} has"


# Ids


def first_attempt_id(record: Mapping[str, Any]) -> str:
    """Return the id of the first attempt at the episode of a record."""
    return expected_id({**record, "attempt": 0})


def expected_id(record: Mapping[str, Any]) -> str:
    """Return the id that a record must have."""
    task = str(record.get("task"))
    label = str(record.get("corruption"))
    seed = record.get("seed", 0)
    agent = str(record.get("agent"))
    attempt = record.get("attempt", 0)
    if ROW not in record:
        return episode_slug(task, label, seed, agent, attempt)
    variant = str(record.get("task_seed"))
    return row_slug(task, variant, label, seed, agent)


# run.json and sessions.jsonl


def head_problems(
    head: Mapping[str, Any], labels: Sequence[str], library: Library
) -> Iterator[str]:
    """Yield the problems of `run.json` by itself.

    Args:
        head: its content.
        labels: those of its corruptions.
        library: what is known of the version that played it.
    """
    config = head.get("config", {})
    yield from unknown_fields(head, RUN)
    stored = head.get("config_sha256")
    if stored is not None and stored != config_digest(config):
        yield "config_sha256 is not that of the config"
    if config.get("kind") is not None:
        return  # of `hijack score`
    for text in unknown_fields(config, CONFIG):
        yield f"config: {text}"
    code = config.get("code", {})
    plugin_names = {str(name) for key in _CODE_LISTS for name in config.get(key, ())}
    plugin_names.update(_JUDGES)
    plugin_names.add(str(_mapping(config.get("desktop")).get("provider")))
    plugin_names.add(str(config.get(GUARD)))
    for name in code if isinstance(code, dict) else [short_repr(code)]:
        if name not in plugin_names:
            yield f"config.code has {short_repr(name)}, which the config does not use"
    episodes = head.get("episodes")
    if not isinstance(episodes, list) or not labels:
        return
    planned_ids = library.planned_episodes(config, labels)
    if planned_ids is not None and Counter(planned_ids) != Counter(episodes):
        only = next(iter(Counter(episodes) - Counter(planned_ids)), None)
        example = f"such as {only}" if only else f"{len(planned_ids) - len(episodes)} are missing"
        yield f"episodes are not those of the config ({example})"
    elif planned_ids is not None and UNTIL_RETENTION in config and planned_ids != episodes:
        yield f"episodes are not task by task, as config.{UNTIL_RETENTION} asks for"
    elif len(set(episodes)) != len(episodes) or len(episodes) != _count(config):
        yield f"episodes are {len(episodes)}, by the config there are {_count(config)}"


def session_problems(
    sessions: Sequence[Mapping[str, Any]], head: Mapping[str, Any], record_count: int
) -> Iterator[str]:
    """Yield the problems of `sessions.jsonl`.

    Args:
        sessions: its lines.
        head: the content of `run.json`.
        record_count: the number of records.
    """
    before = 0
    for number, session in enumerate(sessions, 1):
        for text in unknown_fields(session, SESSIONS):
            yield f"line {number}: {text}"
        if session.get("config_sha256") != head.get("config_sha256"):
            yield f"line {number}: config_sha256 is another than in {RUN}"
        package = "agenthijack"
        if _mapping(session.get("versions")).get(package) != _mapping(head.get("versions")).get(
            package
        ):
            yield f"line {number}: versions have another {package} than {RUN}"
        records = session.get("records")
        if not isinstance(records, int) or not before <= records <= record_count:
            yield f"line {number}: records is {short_repr(records)}, there are {record_count}"
        else:
            before = records


# Records


def record_problems(
    record: Mapping[str, Any], config: Mapping[str, Any], library: Library
) -> Iterator[str]:
    """Yield the differences of a record of `hijack bench` from configuration and library."""
    for name, value, source in _expected(record, config, library):
        stored = _at(record, name)
        if stored != value:
            yield f"{name} is {short_repr(stored)}, by {source} it is {short_repr(value)}"
    name = str(record.get("task")).rpartition("-")[0]
    is_known = library.task_fields(name, record.get("seed")) is not None
    if is_known and name not in config.get("tasks", [name]):
        yield f"task {name!r} is none of the tasks of {RUN}"
    steps, max_steps = record.get("steps"), config.get("max_steps")
    if isinstance(steps, int) and isinstance(max_steps, int) and steps > max_steps:
        yield f"steps is {steps}, max_steps of {RUN} is {max_steps}"
    orders = (None, "after_setup", config.get("environment_errors"))
    if record.get("environment_errors") not in orders:
        order = short_repr(record["environment_errors"])
        yield f"environment_errors is {order}, by {RUN} it is {short_repr(orders[-1])}"
    is_error = record.get("status") == "error" and "cause" in record
    if is_error and record["cause"] not in CAUSES:
        yield f"cause is {short_repr(record.get('cause'))}: the episode is to be played again"
    if record.get("ended") == "outside":
        yield "ended is 'outside', which no episode of a run does"


def outcome_problems(record: Mapping[str, Any]) -> Iterator[str]:
    """Yield the contradictions between a record's status and its other fields."""
    status, score = record.get("status"), record.get("score")
    is_ok = status == "ok"
    if status not in STATUSES:
        yield f"status is {short_repr(status)}, none of {', '.join(STATUSES)}"
    if is_ok == (score is None):
        yield f"status is {status!r}, and the score {score!r}"
    if is_ok and not _is_share(score):
        yield f"score is {score!r}, no number in 0..1"
    if is_ok == bool(record.get("problem")):
        yield f"status is {status!r}, and the problem {short_repr(record.get('problem'))}"
    if not is_ok and record.get("reason"):
        yield f"status is {status!r}, and there is a reason"
    if is_ok and record.get("traceback"):
        yield "status is 'ok', and there is a traceback"
    if is_ok and record.get("cause") is not None:
        yield f"status is 'ok', and the cause {short_repr(record.get('cause'))}"
    if not is_ok and record.get("ended") is not None:
        yield f"status is {status!r}, and ended {short_repr(record.get('ended'))}"
    setup, seconds = record.get("setup_seconds"), record.get("seconds")
    if not _is_time(seconds):
        yield f"seconds is {short_repr(seconds)}, no number of at least 0"
    elif setup is not None and not (_is_time(setup) and setup <= seconds + ROUNDING_S):
        yield f"setup_seconds is {short_repr(setup)}, seconds is {seconds}"
    for key in (DESKTOP, RECOVERY, GUARD):
        for text in unknown_fields(_mapping(record.get(key)), key):
            yield f"{key}: {text}"


def alike_problems(records: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the fields that differ between records of one task, or of one run."""
    first: dict[tuple[str, str], Any] = {}
    for number, record in enumerate(records, 1):
        task = str(record.get("task"))
        names: list[tuple[str, str]] = [
            (task, key) for key in ("instruction", "apps", "infeasible")
        ]
        if _mapping(record.get(DESKTOP)):
            names += [("", f"{DESKTOP}.{key}") for key in ("provider", "settle")]
        for owner, name in names:
            value = _at(record, name)
            if value in (None, ""):
                continue
            before = first.setdefault((owner, name), value)
            if value != before:
                owner_text = f"of {owner} " if owner else ""
                yield (
                    f"line {number}: {name} {owner_text}is {short_repr(value)}, in an earlier"
                    f" line it is {short_repr(before)}"
                )


def _expected(
    record: Mapping[str, Any], config: Mapping[str, Any], library: Library
) -> Iterator[tuple[str, Any, str]]:
    """Yield the fields that have one right value: name, value, and from what it follows."""
    seed = record.get("seed")
    name = str(record.get("task")).rpartition("-")[0]
    task_fields = library.task_fields(name, seed)
    for key, value in (task_fields or {}).items():
        yield key, value, f"task {name!r} and seed {seed}"
    is_played = isinstance(record.get("steps"), int) and record["steps"] > 0
    inputs = library.privileged_inputs(record.get("agent"))
    recorded_inputs = record.get(GIVEN)
    if is_played and inputs is not None and record.get("agent") not in config.get("code", {}):
        other_inputs = (
            [kind for kind in recorded_inputs if kind not in LIBRARY_INPUTS]
            if isinstance(recorded_inputs, list)
            else []
        )
        yield (
            GIVEN,
            [*(kind for kind in LIBRARY_INPUTS if kind in inputs), *other_inputs],
            "the agent",
        )
    if is_played or record.get("allow_code") is not None:  # an episode may never have begun
        yield "allow_code", False, "hijack bench"
    if record.get("max_steps") is not None and "max_steps" in config:
        yield "max_steps", config["max_steps"], RUN
    if _mapping(record.get(RECOVERY)) and "recovery" in config:
        yield f"{RECOVERY}.policy", config["recovery"], RUN
    guard = config.get(GUARD)
    if guard is not None and is_played:
        yield f"{GUARD}.name", "rules" if guard == "rules" else "model", RUN
    elif guard is None:
        yield GUARD, None, RUN
    desktop, planned_desktop = _mapping(record.get(DESKTOP)), _mapping(config.get(DESKTOP))
    if not desktop:
        return  # no desktop came up
    if desktop.get("size") is not None and "size" in planned_desktop:
        yield f"{DESKTOP}.size", planned_desktop["size"], RUN
    if task_fields is not None:
        for key, value in library.desktop_fields(planned_desktop.get("provider")):
            yield f"{DESKTOP}.{key}", value, f"the provider {planned_desktop.get('provider')!r}"


# Steps


def guard_problems(record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the interventions of a guard that are not in `steps.jsonl`."""
    by_step = {line.get("step"): line.get("raw") for line in lines}
    for intervention in _mappings(_mapping(record.get(GUARD)).get("interventions")):
        for text in unknown_fields(intervention, INTERVENTION):
            yield f"{GUARD}.interventions: {text}"
        actions = intervention.get("actions")
        first = intervention.get("step")
        if not isinstance(first, int) or not isinstance(actions, list):
            entry = short_repr(intervention)
            yield f"{GUARD}.interventions has {entry}: step or actions is missing"
            continue
        if not actions and first not in by_step:
            yield f"{GUARD}.interventions has step {first}, which {STEPS} has not"
        for step, action in enumerate(actions, first):
            # The episode may have ended between two actions.
            if by_step.get(step) != action and (step in by_step or step == first):
                yield (
                    f"{GUARD}.interventions has {short_repr(action)} at step {step}, by {STEPS}"
                    f" it is {short_repr(by_step.get(step))}"
                )


def line_problems(line: Mapping[str, Any]) -> Iterator[str]:
    """Yield the contradictions between the fields of one line of `steps.jsonl`."""
    yield from unknown_fields(line, STEPS)
    for event in _mappings(line.get("events")):
        for text in unknown_fields(event, EVENT):
            yield f"events: {text}"
    step = line.get("step")
    if isinstance(step, int):
        for key, end in (("image", ".png"), ("seen", ".seen.png")):
            name = f"{FRAMES}/{step:04d}{end}"
            if line.get(key) not in (name, None):
                yield f"{key} is {short_repr(line.get(key))}, the file of step {step} is {name}"
    raw, code, error = line.get("raw"), line.get("code"), line.get("error")
    if (raw is None) != (code is None and error is None) or None not in (code, error):
        yield (
            f"raw is {short_repr(raw)}, code {short_repr(code)} and error"
            f" {short_repr(error)}: an answer runs or is refused"
        )
    if line.get("result") is not None and code is None:
        yield "there is a result, and nothing ran"
    times = line.get("seconds")
    if times is not None:
        is_valid = isinstance(times, dict) and all(
            key in SECONDS and _is_time(value) for key, value in times.items()
        )
        if not is_valid:
            yield f"seconds are {short_repr(times)}: not times of {', '.join(SECONDS)}"


def time_problems(record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a problem if the steps of an episode took longer than the episode."""
    total, setup = record.get("seconds"), record.get("setup_seconds") or 0.0
    if not _is_time(total) or not _is_time(setup):
        return
    seconds = setup
    for line in lines:
        times = _mapping(line.get("seconds"))
        seconds += sum(
            value for key, value in times.items() if key not in NESTED_SECONDS and _is_time(value)
        )
    if seconds > total + ROUNDING_S * (1 + len(lines)):
        yield f"seconds is {total}, setting up and the steps took {seconds:.3f}"


def free_requests(record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]]) -> int:
    """Return how many requests of an episode cost no step: the first action, if it was one.

    In the logs of earlier versions, which do not name this number, each cost a step.
    """
    recovery = _mapping(record.get(RECOVERY))
    if "free" not in recovery or recovery.get("policy") == "none" or not lines:
        return 0
    if len(lines) == 1 and recovery["free"] == 0:
        return 0  # the desktop died while it was carried out
    return int(lines[0].get("code") == REINIT)


def recovery_problems(
    record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], requests: int
) -> Iterator[str]:
    """Yield the contradictions between the requests for recovery and their results.

    Args:
        record: of the episode.
        lines: its steps.
        requests: in how many of them the agent asked for recovery.
    """
    recovery = _mapping(record.get(RECOVERY))
    if not recovery:
        return
    if recovery.get("free", 0) != free_requests(record, lines):
        value = free_requests(record, lines)
        yield f"recovery.free is {short_repr(recovery['free'])}, by {STEPS} it is {value}"
    counts = {key: recovery.get(key) for key in ("requests", "repaired", "false_alarms")}
    helped = sum(_mapping(line.get("result")).get("helped") is True for line in lines)
    for key, value in (("requests", requests), ("repaired", helped)):
        if counts[key] != value:
            yield f"recovery.{key} is {counts[key]!r}, by {STEPS} it is {value}"
    alarms = counts["false_alarms"]
    if not isinstance(alarms, int) or not 0 <= alarms <= requests - helped:
        yield (
            f"recovery.false_alarms is {alarms!r} of {requests} requests, of which {helped} helped"
        )


def early_end_problems(
    record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], has_effects: bool
) -> Iterator[str]:
    """Yield a problem if an episode that was played to its end has a status that denies it.

    Args:
        record: of the episode, whose status is not `ok`.
        lines: its steps.
        has_effects: whether its corruption acts on the machine, or on the agent's input.
    """
    acted = [line for line in lines if line.get("raw") is not None]
    is_last_seen = bool(lines) and lines[-1].get("raw") is None
    is_over = bool(acted) and (
        acted[-1].get("code") in ("DONE", "FAIL")
        or len(acted) - free_requests(record, lines) == record.get("max_steps")
    )
    if not is_over or not is_last_seen:
        return
    blames_evaluator = record.get("status") == "error" and record.get("cause") == "machine"
    if not has_effects and not blames_evaluator:
        yield (
            f"status is {record.get('status')!r} with the cause {record.get('cause')!r}, and the"
            " episode was played to its end, with no effect that could fail"
        )


# Files


def file_problems(
    folder: Path, names: Sequence[str], records: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """Yield the files and folders that are no part of a run.

    Args:
        folder: of the run.
        names: the ids of the planned episodes; empty if they are not known.
        records: of the run.
    """
    for path in sorted(folder.iterdir()):
        if path.name not in RUN_FILES and not path.name.startswith("."):
            yield f"{path.name}: is no part of the run; move it elsewhere"
    record_ids = {str(record.get("id")) for record in records}
    home = folder / REQUESTS
    for path in sorted(home.iterdir()) if home.is_dir() else ():
        if path.name.removesuffix(".jsonl") not in record_ids | set(names):
            yield f"{REQUESTS}/{path.name}: is of no episode of the run"
    home = folder / EPISODES
    for path in sorted(home.iterdir()) if home.is_dir() else ():
        name = path.name
        if not path.is_dir():
            yield f"{EPISODES}/{name}: is no folder of an episode"
        elif not (path / EPISODE).is_file() and names and not _may_be_begun(name, names, records):
            yield f"{EPISODES}/{name}: was not planned ({RUN})"


def episode_file_problems(folder: Path, lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the files in the folder of an episode that no line names."""
    for path in sorted(folder.iterdir()):
        if path.name not in EPISODE_FILES and not fnmatch(path.name, _HALF_WRITTEN):
            yield f"{path.name}: is no part of an episode"
    frames = {str(line.get(key)) for line in lines for key in ("image", "seen")}
    home = folder / FRAMES
    for path in sorted(home.iterdir()) if home.is_dir() else ():
        if f"{FRAMES}/{path.name}" not in frames:
            yield f"{FRAMES}/{path.name}: no line of {STEPS} names it"


def _may_be_begun(name: str, names: Sequence[str], records: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether an episode without an end may lie in a folder.

    It was killed, and its record says so or its next attempt is due.
    """
    if any(record.get("id") == name and record.get("status") != "ok" for record in records):
        return True
    attempts: Counter[str] = Counter()
    last: dict[str, Mapping[str, Any]] = {}
    for record in records:
        base = first_attempt_id(record)
        attempts[base] += 1
        last[base] = record
    for base in names:
        attempt = attempts[base]
        record = last.get(base)
        if record is None:
            if name == base:
                return True
        elif name == expected_id({**record, "attempt": attempt}) and (
            record.get("status") == "invalid" or record.get("cause") == "machine"
        ):
            return True
    return False


def _count(config: Mapping[str, Any]) -> int:
    """Return the number of episodes that a configuration asks for."""
    total = 1
    for key in ("agents", "tasks", "seeds", "corruptions"):
        total *= len(config.get(key, ()))
    return total


def _at(record: Mapping[str, Any], name: str) -> Any:
    """Return the value of a field such as `desktop.size`."""
    owner, dot, key = name.partition(".")
    return _mapping(record.get(owner)).get(key) if dot else record.get(name)


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _mappings(value: object) -> list[Mapping[str, Any]]:
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list) else []


def _is_time(value: object) -> TypeGuard[float]:
    """Return whether a value is a number of seconds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < 1e12


def _is_share(score: object) -> bool:
    return isinstance(score, int | float) and not isinstance(score, bool) and 0 <= score <= 1
