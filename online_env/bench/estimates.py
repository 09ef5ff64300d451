"""Estimate the time, disk space and money of a run from earlier measurements.

An episode is expected to take as much as the same agent took in earlier runs in neighbouring
folders; otherwise as much as the oracle needed for the task
(`online_env/tasks/suite/measured.yaml`); otherwise all of its allowed steps.
"""

import heapq
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path
from stat import S_ISREG
from statistics import fmean
from typing import Any, Literal, TypeAlias, cast

from hijack_data.errors import HijackError
from hijack_data.plan import CLEAN
from hijack_data.runs.amounts import is_amount
from hijack_data.runs.run_log import EPISODES, RUN

from ..agents.makers import FileAgentMaker
from ..agents.registry import AGENTS
from ..results import scores
from ..results.reading import ResultRecord, read
from ..tasks import TASKS, task_sets
from .config import Bench
from .jobs import Job

Basis: TypeAlias = Literal["runs", "suite", "limit"]

# For a task that was never measured, on two cores.
EPISODE_SECONDS = 5.0  # seconds to begin and to judge an episode
STEP_SECONDS = 0.8
MACHINE_STEP_SECONDS = 3.5  # on a machine behind OSWorld's routes
# A step keeps a full-HD PNG, and a second one if the agent saw something else.
STEP_BYTES = 430_000
# Agents with a known number of steps; `None` means one step more than the oracle.
STEPS: Mapping[str, int | None] = {"oracle": None, "recovering": None, "do_nothing": 6, "fail": 1}
INSTANT_AGENTS = (*STEPS, "random")  # agents whose answers take no time
MAX_RUNS = 20
MAX_RECORDS = 20_000
MAX_MEASURED_FOLDERS = 100  # episodes whose files are measured


@dataclass(frozen=True, kw_only=True)
class EpisodeEstimate:
    """The expected cost of one episode.

    Args:
        seconds: Time from its beginning to that of the next episode.
        bytes: Disk space.
        usd: For models; `None` if it is not known.
        basis: Earlier runs, the suite's figures, or the limit on its steps.
    """

    seconds: float
    bytes: float
    usd: float | None
    basis: Basis


@dataclass(frozen=True, kw_only=True)
class History:
    """Time, steps, money and disk space of the episodes of earlier runs.

    Args:
        seconds: By agent, task and corruption; also by agent and task, and by agent alone.
        steps: Likewise.
        usd: Likewise, for episodes with known cost.
        losses: By agent and corruption, and by task: corrupted minus clean score of each seed.
        step_bytes: Disk space of a step; `None` without an earlier episode.
        runs: How many runs were read.
    """

    seconds: Mapping[tuple[str, ...], list[float]] = field(default_factory=dict[Any, Any])
    steps: Mapping[tuple[str, ...], list[float]] = field(default_factory=dict[Any, Any])
    usd: Mapping[tuple[str, ...], list[float]] = field(default_factory=dict[Any, Any])
    losses: Mapping[tuple[str, str], dict[str, list[float]]] = field(default_factory=dict[Any, Any])
    step_bytes: float | None = None
    runs: int = 0


def estimate(
    bench: Bench, planned_jobs: Sequence[Job], desktops: int = 1, history: History | None = None
) -> str:
    """Return what jobs will take, in words.

    Args:
        bench: The benchmark.
        planned_jobs: The jobs, in their order.
        desktops: How many desktops play side by side.
        history: Measurements of earlier runs.
    """
    estimates = expected(bench, planned_jobs, history or History())
    seconds = makespan([item.seconds for item in estimates], desktops)
    gigabytes = sum(item.bytes for item in estimates) / 1e9
    bases = [item.basis for item in estimates]
    about = "at most" if "limit" in bases else "about"
    parts = [
        f"{about} {format_duration(seconds)} and {gigabytes:.1f} GB",
        *_money(planned_jobs, estimates),
    ]
    basis_words = {
        "runs": "measured in earlier runs",
        "suite": "as the suite's figures",
        "limit": f"with all {bench.max_steps} steps",
    }
    basis_counts = [
        f"{bases.count(key)} {words}" for key, words in basis_words.items() if key in bases
    ]
    text = f"{', '.join(parts)} ({', '.join(basis_counts)})"
    unknown = dict.fromkeys(_unmeasured(planned_jobs, estimates))
    if unknown:
        text += f"; without the time that {', '.join(unknown)} takes to answer"
    if bench.machines is not None and "limit" in bases:
        text += "; without that of the machines' reverts"
    return text


def expected(bench: Bench, listed: Sequence[Job], history: History) -> list[EpisodeEstimate]:
    """Return the expected cost of each job; the arguments are those of `estimate`."""
    measured = task_sets.read_measurements()
    return [_estimate_job(bench, job, history, measured) for job in listed]


def _estimate_job(
    bench: Bench, job: Job, history: History, measured: Mapping[str, task_sets.Measured]
) -> EpisodeEstimate:
    per_step = history.step_bytes or STEP_BYTES
    usd = 0.0
    if isinstance(AGENTS.entries.get(job.agent), FileAgentMaker):
        usd = _mean(history.usd, job)
    seconds = _mean(history.seconds, job)
    steps = _mean(history.steps, job)
    if seconds is not None and steps is not None:
        return EpisodeEstimate(seconds=seconds, bytes=(steps + 1) * per_step, usd=usd, basis="runs")
    basis: Basis = "suite"
    task = measured.get(job.task)
    before = EPISODE_SECONDS
    step = STEP_SECONDS
    if task is None:
        basis = "limit"
        number = bench.max_steps
        before += getattr(TASKS.entries.get(job.task), "fixed_waits", 0.0)
        if bench.machines is not None:
            step = MACHINE_STEP_SECONDS
    else:
        before = task.setup
        step = (task.seconds - task.setup) / (task.actions + 1)
        number = STEPS.get(job.agent, bench.max_steps)
        if number is None:
            number = task.actions + 1
    if job.agent not in STEPS:
        basis = "limit"
    number = min(number, bench.max_steps)
    return EpisodeEstimate(
        seconds=before + number * step, bytes=(number + 1) * per_step, usd=usd, basis=basis
    )


def _mean(measurements: Mapping[tuple[str, ...], list[float]], job: Job) -> float | None:
    """Return the mean over the earlier episodes that are most similar to a job."""
    key = (job.agent, job.task, job.corruption)
    for count in (3, 2, 1):
        values = measurements.get(key[:count])
        if values:
            return fmean(values)
    return None


def _money(listed: Sequence[Job], estimates: Sequence[EpisodeEstimate]) -> Iterator[str]:
    """Yield the expected cost of models in words; nothing without a model."""
    unknown = {job.agent for job, item in zip(listed, estimates, strict=True) if item.usd is None}
    total = sum(item.usd or 0.0 for item in estimates)
    if total:
        yield f"{total:.2f} USD"
    if unknown:
        agents = ", ".join(sorted(unknown))
        yield f"money not known: no earlier run of {agents} here (--max-cost limits it)"


def _unmeasured(listed: Sequence[Job], estimates: Sequence[EpisodeEstimate]) -> Iterator[str]:
    """Yield the agents whose answering time is unknown and not counted."""
    for job, item in zip(listed, estimates, strict=True):
        if item.basis != "runs" and job.agent not in INSTANT_AGENTS:
            yield job.agent


def format_duration(seconds: float) -> str:
    """Return a time in minutes or hours."""
    if seconds > 5400:
        return f"{seconds / 3600:.1f} h"
    minutes = max(1, round(seconds / 60))
    return f"{minutes} min"


def makespan(durations: Iterable[float], machines: int) -> float:
    """Return when the last job ends, if each begins, in order, on the first free machine.

    Args:
        durations: Seconds of each job.
        machines: The number of machines, at least 1; each desktop counts as a machine.

    Returns:
        Seconds, 0 without a job.
    """
    ends = [0.0] * machines
    for seconds in durations:
        heapq.heapreplace(ends, ends[0] + seconds)
    return max(ends)


# Earlier runs


def history_near(out: Path | None) -> History:
    """Return the measurements of the run `out` and of the runs in the same parent folder.

    Args:
        out: The folder of a run, which need not exist; `None` stands for a run in `runs`.
    """
    run_folder = out if out is not None else Path("runs/new")
    parent = run_folder.absolute().parent
    # Unlike `Path.glob`, it passes over folders that end meanwhile: the parent may be /tmp.
    neighbours = [
        name for depth in ("*", "*/*") for name in glob(f"{depth}/{RUN}", root_dir=parent)
    ]
    by_age: dict[Path, float] = {}
    for head in (run_folder / RUN, *(parent / name for name in neighbours)):
        status = _file_status(head)
        if status is not None:
            by_age[head.resolve().parent] = status.st_mtime
    newest = sorted(by_age, key=by_age.__getitem__, reverse=True)
    return read_history(newest[:MAX_RUNS])


def _file_status(path: Path) -> os.stat_result | None:
    """Return the status of a file; `None` if it is no file or has gone meanwhile."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status if S_ISREG(status.st_mode) else None


def read_history(folders: Sequence[Path]) -> History:
    """Return the measurements of some runs, without runs that cannot be read."""
    history = History(runs=len(folders))
    sizes: list[float] = []
    remaining = MAX_RECORDS
    for folder in folders:
        try:
            run = read(folder)
        except HijackError:
            continue
        if run.is_scored:
            continue
        for record in run.records[:remaining]:
            _count(history, record)
        _add_losses(history, run.records[:remaining])
        remaining -= len(run.records[:remaining])
        sizes += _sizes(folder, run.records[: MAX_MEASURED_FOLDERS - len(sizes)])
    step_bytes = fmean(sizes) if sizes else None
    return History(
        seconds=history.seconds,
        steps=history.steps,
        usd=history.usd,
        losses=history.losses,
        step_bytes=step_bytes,
        runs=history.runs,
    )


def _count(history: History, record: ResultRecord) -> None:
    """Add an episode that has a score."""
    if record["status"] != "ok":
        return
    task = scores.task_name(record["task"], record.get("task_seed"))
    usage = record.get("usage")
    usd = usage.get("usd") if isinstance(usage, Mapping) else None
    values = {"seconds": record.get("seconds"), "steps": record.get("steps"), "usd": usd}
    key = (str(record["agent"]), task, str(record["corruption"]))
    for name, value in values.items():
        if not is_amount(value):
            continue
        by_key: dict[tuple[str, ...], list[float]] = getattr(history, name)
        for count in (3, 2, 1):
            by_key.setdefault(key[:count], []).append(float(value))


def _add_losses(history: History, records: Sequence[ResultRecord]) -> None:
    """Add how much less each case scored corrupted than clean."""
    cells = scores.group_records(records).scored
    losses: dict[tuple[str, str], dict[str, list[float]]] = cast("Any", history.losses)
    for (agent, label), cell in cells.items():
        if label == CLEAN:
            continue
        cases = scores.pairs(cells.get((agent, CLEAN), {}), cell)
        for clean, corrupted, task in zip(*cases, strict=True):
            losses.setdefault((agent, label), {}).setdefault(str(task), []).append(
                corrupted - clean
            )


def _sizes(folder: Path, records: Sequence[ResultRecord]) -> Iterator[float]:
    """Yield the disk space of a step of each episode, in bytes."""
    records_by_id = {
        str(record.get("id")): record for record in records
    }  # a foreign id may be any path
    for name in glob("*/", root_dir=folder / EPISODES):
        record = records_by_id.get(name.rstrip("/"))
        if record is None or not isinstance(record.get("steps"), int):
            continue
        files = glob("**", root_dir=folder / EPISODES / name, recursive=True, include_hidden=True)
        statuses = (_file_status(folder / EPISODES / name / file) for file in files)
        size = sum(status.st_size for status in statuses if status is not None)
        yield size / (record["steps"] + 1)
