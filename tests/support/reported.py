"""Runs for tests of reports: records with given scores, in a folder as `hijack bench` leaves it."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import VERSION
from online_env.report.identity import NINE
from online_env.results import reading, records

CONDITIONS = (CLEAN, *NINE)


def made(
    agent: str,
    task: str,
    corruption: str = CLEAN,
    score: float | None = 1.0,
    seed: int = 0,
    **more: Any,
) -> dict[str, Any]:
    """A record of an episode that counts; a score of `None` is that of an agent that raised."""
    return {
        "version": VERSION,
        "id": f"{task}-{seed}__{corruption}__s{seed}__{agent}",
        "agent": agent,
        "task": f"{task}-{seed}",
        "task_seed": seed,
        "corruption": corruption,
        "seed": seed,
        "status": "error" if score is None else "ok",
        "score": score,
        "problem": "it raised" if score is None else "",
        "steps": 4,
        "seconds": 2.0,
        "malformed": 1,
        "attempt": 0,
        **more,
    }


def scored(
    agent: str, corruption: str, scores: Sequence[float], seed: int = 0
) -> list[dict[str, Any]]:
    """Records of the tasks t0, t1, ... with these scores."""
    return [
        made(agent, f"t{number}", corruption, score, seed) for number, score in enumerate(scores)
    ]


def run_of(folder: Path, found: Iterable[Mapping[str, Any]], **config: Any) -> Path:
    """Write a run; its configuration follows from its records, unless it is given."""
    listed = [dict(record) for record in found]
    settings = {
        "source": "small.yaml",
        "desktop": {"provider": "embedded", "size": [1920, 1080]},
        "agents": list(dict.fromkeys(record["agent"] for record in listed)),
        "tasks": list(dict.fromkeys(record["task"] for record in listed)),
        "corruptions": list(dict.fromkeys(record["corruption"] for record in listed)),
        "seeds": [0],
        "recovery": "none",
        "max_steps": 15,
        **config,
    }
    with records.create(folder, settings, [str(record["id"]) for record in listed]):
        records.append_all(folder, listed)
    return folder


def read_run(folder: Path, found: Iterable[Mapping[str, Any]], **config: Any) -> reading.Run:
    """Write a run, and read it."""
    return reading.read(run_of(folder, found, **config))


def whole(agent: str, solved: Mapping[str, int], tasks: int = 10) -> list[dict[str, Any]]:
    """Records of an agent under all ten conditions; `solved` says how many tasks it solves."""
    return [
        record
        for label in CONDITIONS
        for record in scored(agent, label, [float(n < solved[label]) for n in range(tasks)])
    ]
