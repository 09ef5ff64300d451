"""Reading a run: its head, the records that can be read, and the lines that cannot."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import prod
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import HijackError, short_repr
from hijack_data.file_io import read_regular
from hijack_data.runs.amounts import is_amount
from hijack_data.runs.run_head import check_head
from hijack_data.runs.run_log import (
    EPISODE,
    EPISODES,
    LINKS,
    RECORDS,
    RUN,
    SCORE_RUN,
    UNTIL_RETENTION,
    find_run,
)
from hijack_data.surrogates import has_half

from .episode_columns import EpisodeColumns
from .log_config import read_log_config
from .record_score import ResultRecord, first_id

STATUSES = ("ok", "invalid", "error")
MAX_LINE = 8 * 2**20

_FIELDS = {"agent": str, "task": str, "corruption": str, "seed": int, "status": str}
_AMOUNTS = ("attempt", "steps", "seconds", "malformed")  # checked in records that have them


class RunError(HijackError, ValueError):
    """A folder that is not a run, is not empty, or is in use by another process."""


class _DamagedError(HijackError):
    """The reason why a line is not a record."""


@dataclass(frozen=True)
class Damage:
    """A line of `records.jsonl` (or of `file`) that was skipped, counted from 1, and why."""

    line: int
    problem: str
    file: str = RECORDS


@dataclass(frozen=True, kw_only=True)
class Run:
    """The content of the folder of a run.

    Args:
        folder: The folder.
        config: The configuration, in the form of `Bench.to_data`.
        records: The readable records, in order.
        damaged: The lines that cannot be read.
        episodes: Ids of the first attempts at all planned cases; of a run that ended at its bound,
            at those before it.
        left_out: Seeds of the run that were left out of it; see `with_first_seeds`.
    """

    folder: Path
    config: Mapping[str, Any] = field(default_factory=dict[str, Any])
    records: Sequence[ResultRecord] = field(default_factory=list[ResultRecord])
    damaged: list[Damage] = field(default_factory=list[Damage])
    episodes: tuple[str, ...] = ()
    left_out: tuple[int, ...] = ()

    @property
    def is_scored(self) -> bool:
        """Whether the run was made by `hijack score`, from a dataset and without a desktop."""
        return self.config.get("kind") == SCORE_RUN

    @property
    def is_live(self) -> bool:
        """Whether an environment of this library played it, and recorded its effects."""
        return "kind" not in self.config

    @cached_property
    def last_attempts(self) -> Sequence[ResultRecord]:
        """The last record of each case: agent, condition, task, the task's seed and the seed."""
        if isinstance(self.records, EpisodeColumns):
            return self.records
        cases = {
            (r["agent"], r["corruption"], r["task"], r.get("task_seed"), r["seed"]): r
            for r in self.records
        }
        return list(cases.values())

    @cached_property
    def failures(self) -> list[ResultRecord]:
        """The last attempts that are invalid or failed."""
        last = self.last_attempts
        if isinstance(last, EpisodeColumns):
            return [last[position] for position in last.problems]
        return [record for record in last if record["status"] != "ok"]

    @property
    def planned(self) -> int:
        """The number of planned cases: agents times tasks, seeds and corruptions."""
        if self.episodes:
            return len(self.episodes)
        lists = [self.config.get(key) for key in ("agents", "tasks", "seeds", "corruptions")]
        return prod(len(names) if isinstance(names, list) else 0 for names in lists)

    @property
    def missing(self) -> int:
        """The number of planned cases without a record."""
        if self.episodes:
            return len(self.unplayed)
        return max(0, self.planned - len(self.last_attempts)) if self.planned else 0

    @cached_property
    def unplayed(self) -> tuple[str, ...]:
        """The ids in `episodes` without a record."""
        played_ids = {str(record.get("id")) for record in self.records}
        played_ids |= {first_id(record) for record in self.records}
        return tuple(name for name in self.episodes if name not in played_ids)


def read(folder: Path) -> Run:
    """Read a run, or the episodes that a `CorruptedEnv` logged outside a benchmark.

    Of a published result (`docs/results/NAME`) it reads the run inside.
    A line that cannot be read is listed in `damaged`, and the others are kept.

    Raises:
        RunError: The folder holds neither, or was written by a newer version.
    """
    folder = find_run(folder)
    if not (folder / RUN).exists() and (folder / EPISODES).is_dir():
        return _read_episodes(folder)
    head = read_head(folder)
    records: list[ResultRecord] = []
    damaged: list[Damage] = []
    try:
        lines = read_regular(folder / RECORDS).split(b"\n")
    except OSError as error:
        raise RunError(f"{folder / RECORDS}: cannot be read ({error.strerror or error})") from None
    line_by_id: dict[object, int] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            record = _parse_record(line)
            _check_new(record, line_by_id, number)
        except _DamagedError as damage:
            damaged.append(Damage(number, str(damage)))
        else:
            records.append(record)
    run = Run(
        folder=folder,
        config=cast("Mapping[str, Any]", head.get("config") or {}),
        records=_by_attempt(records),
        damaged=damaged,
        episodes=tuple(head.get("episodes") or ()),
    )
    return _without_undue(run) if UNTIL_RETENTION in run.config else run


def _without_undue(run: Run) -> Run:
    """Return a run that ends once a retention is shown, without the episodes that it did not need.

    Raises:
        RunError: Its configuration is not that of such a run.
    """
    from .stop_rule import StopRule

    try:
        rule = StopRule.read(run.config)
        due = run.episodes
        if rule is not None:
            due = rule.due_episodes(run.config, run.episodes, run.records)
    except HijackError as error:
        raise RunError(f"{run.folder / RUN}: config.{error}") from None
    return replace(run, episodes=due)


def with_first_seeds(run: Run, count: int) -> Run:
    """Return a run without the seeds from `count` on, as if it had been meant to have no more.

    A run that is played seed by seed so gives an even table before its last seed is complete.

    Raises:
        RunError: The run has no such seeds, ended at a bound over all of them, or the seed of a
            planned episode cannot be told.
    """
    if run.config.get(UNTIL_RETENTION):
        raise RunError(
            f"{run.folder}: was to end at a retention over all its seeds, of which a part says"
            " nothing; report it with all seeds"
        )
    listed = run.config.get("seeds")
    seeds = [seed for seed in listed if isinstance(seed, int)] if isinstance(listed, list) else []
    seeds_kept = [seed for seed in seeds if seed < count]
    if not seeds_kept:
        what_it_has = f"its seeds are {', '.join(map(str, seeds))}" if seeds else "it has no seeds"
        raise RunError(f"{run.folder}: has no seed below {count}; {what_it_has}")
    return replace(
        run,
        config={**run.config, "seeds": seeds_kept},
        records=[record for record in run.records if record["seed"] in seeds_kept],
        episodes=tuple(
            name for name in run.episodes if _seed_in(name, seeds, run.folder) in seeds_kept
        ),
        left_out=tuple(seed for seed in seeds if seed not in seeds_kept),
    )


def _seed_in(name: str, seeds: Sequence[int], folder: Path) -> int:
    """Return the seed in the id of an episode.

    Raises:
        RunError: There is none, or more than one.
    """
    matching = [seed for seed in seeds if f"__s{seed}__" in name]
    if len(matching) != 1:
        raise RunError(
            f"{folder / RUN}: the seed of the episode {name} cannot be told from its id; report the"
            " run with all seeds"
        )
    return matching[0]


def read_head(folder: Path) -> dict[str, Any]:
    """Read `run.json`.

    Raises:
        RunError: The file is missing, damaged, or of a newer version.
    """
    path = folder / RUN
    try:
        data: object = json.loads(read_regular(path), parse_constant=_refuse)
        json.dumps(data, ensure_ascii=False).encode()  # half of a surrogate pair cannot be encoded
    except OSError as error:
        reason = error.strerror or error
        raise RunError(
            f"{folder}: is not the folder of a run ({RUN}: {reason}); `hijack bench` makes one"
        ) from None
    except (ValueError, RecursionError) as error:
        raise RunError(f"{path}: is not JSON ({str(error)[:200]})") from None
    try:
        return check_head(data)
    except HijackError as error:
        raise RunError(f"{path}: {error}") from None


def _read_episodes(folder: Path) -> Run:
    """Read the records of all episodes that ended, in the order of their ids.

    Raises:
        RunError: The episodes were not played under one setting.
    """
    records: list[ResultRecord] = []
    damaged: list[Damage] = []
    for path in sorted((folder / EPISODES).glob(f"*/{EPISODE}")):
        try:
            records.append(_parse_record(read_regular(path)))
        except OSError as error:
            problem = f"cannot be read ({error.strerror or error})"
        except _DamagedError as damage:
            problem = str(damage)
        else:
            continue
        damaged.append(Damage(1, problem, str(path.relative_to(folder))))
    try:
        config = read_log_config(records)
    except HijackError as error:
        raise RunError(f"{folder}: {error}") from None
    return Run(folder=folder, config=config, records=_by_attempt(records), damaged=damaged)


def _by_attempt(records: Sequence[ResultRecord]) -> list[ResultRecord]:
    """Return records with later attempts after earlier ones, since the last one of a case counts.

    Lines may have been sorted or joined, and folders are sorted by name: `a10` before `a2`.
    """
    return sorted(records, key=lambda record: record.get("attempt") or 0)


def read_record(path: Path) -> ResultRecord:
    """Read the record in the folder of an episode.

    Raises:
        RunError: It cannot be read, or is none.
    """
    remedy = "remove the episode's folder to play it again"
    try:
        return _parse_record(read_regular(path))
    except OSError as error:
        raise RunError(f"{path}: cannot be read ({error.strerror or error}); {remedy}") from None
    except _DamagedError as error:
        raise RunError(f"{path}: {error}; {remedy}") from None


def _parse_record(line: bytes) -> ResultRecord:
    """Return the record of a line.

    Raises:
        _DamagedError: The line is not a record.
    """
    if len(line) > MAX_LINE:
        raise _DamagedError(f"longer than {MAX_LINE} bytes")
    try:
        data: object = _DECODER.decode(line.decode())
    except (ValueError, RecursionError) as error:
        raise _DamagedError(f"not JSON, perhaps cut off ({str(error)[:120]})") from None
    if not isinstance(data, dict):
        raise _DamagedError("not an object")
    record = cast("ResultRecord", data)
    for key, kind in _FIELDS.items():
        if not isinstance(record.get(key), kind) or isinstance(record[key], bool):
            raise _DamagedError(f"field {key!r} is missing or of the wrong type")
    if not isinstance(record.get("task_seed"), int | str | None):
        raise _DamagedError("field 'task_seed' is neither a number nor a text")
    for key in _AMOUNTS:
        if record.get(key) is not None and not is_amount(record[key]):
            raise _DamagedError(f"{key} {short_repr(record[key])} is not a number of at least 0")
    for key in ("agent", "task", "corruption"):
        if has_half(record[key]):
            raise _DamagedError(f"field {key!r} holds half of a surrogate pair")
    _check_score(record)
    _check_parts(record.get("parts"))
    return {key: value for key, value in record.items() if key not in LINKS}


def _refuse(name: str) -> object:
    """Refuse NaN and Infinity, which Python's parser accepts although JSON does not have them.

    Raises:
        ValueError: Always.
    """
    raise ValueError(f"{name} is not a number")


_DECODER = json.JSONDecoder(parse_constant=_refuse)  # making one for each line takes as long


def _check_new(record: ResultRecord, line_by_id: dict[object, int], number: int) -> None:
    """Check that no earlier line is of the same episode, and remember this one.

    Raises:
        _DamagedError: there is one; two journals were joined, or a line was duplicated.
    """
    name = record.get("id")
    if not isinstance(name, str):
        return
    first = line_by_id.setdefault(name, number)
    if first != number:
        raise _DamagedError(f"episode {short_repr(name)} is on line {first} already, which counts")


def _check_parts(parts: object) -> None:
    """Check the parts of a step that was scored, if there are any.

    Raises:
        _DamagedError: They are not right or wrong by name.
    """
    if parts is None:
        return
    values = cast("dict[str, Any]", parts).values() if isinstance(parts, dict) else [parts]
    if not all(isinstance(value, bool) for value in values):
        raise _DamagedError(f"parts {short_repr(parts)} are not true or false by name")


def _check_score(record: ResultRecord) -> None:
    status = record["status"]
    if status not in STATUSES:
        raise _DamagedError(f"status {status!r} is none of {', '.join(STATUSES)}")
    if status != "ok":
        return
    score = record.get("score")
    if isinstance(score, bool) or not isinstance(score, int | float) or not 0 <= score <= 1:
        raise _DamagedError(f"score {score!r} is not a number in 0..1")
