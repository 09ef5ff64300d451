"""Reading a run: its head, the records that can be read, and the lines that cannot."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any, TypeAlias, cast

from hijack_data.errors import HijackError
from hijack_data.runs.run_log import (
    EPISODE,
    EPISODES,
    FORMAT,
    LINKS,
    RECORDS,
    RUN,
    SCORE_RUN,
    VERSION,
)

ResultRecord: TypeAlias = dict[str, Any]
STATUSES = ("ok", "invalid", "error")
MAX_LINE = 8 * 2**20

_FIELDS = {
    "agent": str,
    "task": str,
    "corruption": str,
    "seed": int,
    "status": str,
}


class RunError(HijackError, ValueError):
    """A folder that is no run, holds something already, or is another process's."""


class _DamagedError(HijackError):
    """Why a line is no record."""


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
        folder: Where it was read from.
        config: What was to be run, as `Bench.to_data` gives it.
        records: The records that can be read, in their order.
        damaged: The lines that cannot.
        episodes: Ids of the first attempts at all that was planned.
    """

    folder: Path
    config: Mapping[str, Any] = field(default_factory=dict[str, Any])
    records: list[ResultRecord] = field(default_factory=list[ResultRecord])
    damaged: list[Damage] = field(default_factory=list[Damage])
    episodes: tuple[str, ...] = ()

    @property
    def is_scored(self) -> bool:
        """Whether it was made by `hijack score`, from a dataset and without a desktop."""
        return self.config.get("kind") == SCORE_RUN

    @property
    def planned(self) -> int:
        """How many cases were to be run: agents times tasks, seeds and corruptions."""
        if self.episodes:
            return len(self.episodes)
        lists = [self.config.get(key) for key in ("agents", "tasks", "seeds", "corruptions")]
        return prod(len(found) if isinstance(found, list) else 0 for found in lists)

    @property
    def missing(self) -> int:
        """How many of them have no record."""
        cases = {
            (r["agent"], r["task"], r.get("task_seed"), r["corruption"], r["seed"])
            for r in self.records
        }
        return max(0, self.planned - len(cases))


def read(folder: Path) -> Run:
    """Read a run, or the episodes that a `CorruptedEnv` logged without a benchmark around it.

    A line that cannot be read is listed in `damaged`, and the others are kept.

    Raises:
        RunError: The folder is neither, or was written by a newer version.
    """
    if not (folder / RUN).exists() and (folder / EPISODES).is_dir():
        return _episodes(folder)
    head = read_head(folder)
    run = Run(
        folder=folder,
        config=cast("Mapping[str, Any]", head.get("config") or {}),
        episodes=tuple(head.get("episodes") or ()),
    )
    try:
        lines = (folder / RECORDS).read_bytes().split(b"\n")
    except OSError as error:
        raise RunError(f"{folder / RECORDS}: cannot be read ({error.strerror or error})") from None
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            run.records.append(_parsed(line))
        except _DamagedError as damage:
            run.damaged.append(Damage(number, str(damage)))
    return run


def read_head(folder: Path) -> dict[str, Any]:
    """Read `run.json`.

    Raises:
        RunError: It is missing, damaged, or of a newer version.
    """
    path = folder / RUN
    try:
        data: object = json.loads(path.read_bytes())
    except OSError as error:
        why = error.strerror or error
        raise RunError(
            f"{folder}: is not the folder of a run ({RUN}: {why}); `hijack bench` makes one"
        ) from None
    except (ValueError, RecursionError) as error:
        raise RunError(f"{path}: is not JSON ({str(error)[:200]})") from None
    head = cast("dict[str, Any]", data) if isinstance(data, dict) else {}
    if head.get("format") != FORMAT:
        raise RunError(f"{path}: is not the head of a run (field 'format' must be {FORMAT!r})")
    version = head.get("version")
    if not isinstance(version, int) or version > VERSION:
        problem = f"version {version!r} is newer than this library reads"
        raise RunError(f"{path}: {problem}; upgrade agenthijack")
    for key in ("config", "versions"):
        if not isinstance(head.get(key, {}), dict):
            raise RunError(f"{path}: field {key!r} is not an object")
    return head


def _episodes(folder: Path) -> Run:
    """Read the records of all episodes that ended, in the order of their ids."""
    run = Run(folder=folder)
    for path in sorted((folder / EPISODES).glob(f"*/{EPISODE}")):
        try:
            run.records.append(_parsed(path.read_bytes()))
        except OSError as error:
            problem = f"cannot be read ({error.strerror or error})"
        except _DamagedError as damage:
            problem = str(damage)
        else:
            continue
        run.damaged.append(Damage(1, problem, str(path.relative_to(folder))))
    return run


def _parsed(line: bytes) -> ResultRecord:
    """Return the record of a line; `_DamagedError` is raised for a line that is none.

    Raises:
        _DamagedError: The line is no record.
    """
    if len(line) > MAX_LINE:
        raise _DamagedError(f"longer than {MAX_LINE} bytes")
    try:
        data: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise _DamagedError(f"not JSON, perhaps cut off ({str(error)[:120]})") from None
    if not isinstance(data, dict):
        raise _DamagedError("not an object")
    record = cast("ResultRecord", data)
    for key, kind in _FIELDS.items():
        if not isinstance(record.get(key), kind):
            raise _DamagedError(f"field {key!r} is missing or of the wrong type")
    _check_score(record)
    return {key: value for key, value in record.items() if key not in LINKS}


def _check_score(record: ResultRecord) -> None:
    status = record["status"]
    if status not in STATUSES:
        raise _DamagedError(f"status {status!r} is none of {', '.join(STATUSES)}")
    if status != "ok":
        return
    score = record.get("score")
    if not isinstance(score, int | float) or not 0 <= score <= 1:
        raise _DamagedError(f"score {score!r} is no number in 0..1")
