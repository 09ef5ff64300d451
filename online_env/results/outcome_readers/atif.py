"""Trajectories in ATIF, Harbor's format of what an agent did (versions 1.0 to 1.8).

ATIF has no field for the task, the condition or the score. `--columns` names keys of `extra`, the
format's place for what it does not define; a job of Harbor has the rewards beside the trajectories.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.plan import CLEAN

from ..outcome_formats import AMOUNTS, FIELDS
from ..outcomes import EpisodeOutcome, OutcomeError
from .result_folders import check_score, field, has_keys, head, read_object, sum_amounts

_VERSIONS = frozenset(f"ATIF-v1.{minor}" for minor in range(9))
_NONE = type(None)


class AtifReader:
    """Reads a trajectory, or those of a folder: its task and score are keys of `extra`."""

    fields = FIELDS

    def detect(self, source: Path) -> bool:
        """Return whether a file is a trajectory in ATIF, or a folder holds one."""
        if source.is_dir():
            return any(map(is_atif, source.glob("*.json")))
        return source.suffix == ".json" and is_atif(source)

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcome of each trajectory.

        Args:
            source: the file or folder.
            columns: keys of `extra` by field; `task` and `score` must be there.

        Raises:
            OutcomeError: a trajectory has another form, or a key is not stated or not there.
        """
        missing = [name for name in ("task", "score") if name not in columns]
        if missing:
            raise OutcomeError(
                f"{source}: a trajectory in ATIF has no field for its {' and '.join(missing)}; name"
                " keys of its extra with --columns task=KEY,score=KEY, or give the folder of the"
                " Harbor job, which has the rewards"
            )
        paths = sorted(source.glob("*.json")) if source.is_dir() else [source]
        for path in paths:
            if path == source or has_keys(path, "schema_version", "steps"):
                yield _outcome(path, columns)


def is_atif(path: Path) -> bool:
    """Return whether a file is a trajectory in ATIF, from its first bytes."""
    start = head(path)
    return b'"schema_version"' in start and b'"ATIF-v' in start


def read_trajectory(path: Path) -> dict[str, Any]:
    """Return a trajectory.

    Raises:
        OutcomeError: it cannot be read, or is of a version that is not known.
    """
    trajectory = read_object(path, "a trajectory in ATIF")
    version = field(trajectory, path, "schema_version", kind=str)
    if version not in _VERSIONS:
        raise OutcomeError(f"{path}: schema_version {version!r} is not known; known are 1.0 to 1.8")
    return trajectory


def trajectory_amounts(trajectory: Mapping[str, Any], path: Path) -> dict[str, float | None]:
    """Return steps, tokens and cost of a trajectory.

    Steps are those of the agent alone; `total_steps` counts what the user and the system said, too.

    Raises:
        OutcomeError: its steps are no list of objects, or an amount is none.
    """
    steps = field(trajectory, path, "steps", kind=list)
    totals = trajectory.get("final_metrics")
    if not all(isinstance(step, dict) for step in steps):
        raise OutcomeError(f"{path}: field 'steps' must hold objects")
    return {
        "steps": float(sum(step.get("source") == "agent" for step in steps)),
        "tokens": sum_amounts(totals, path, "total_prompt_tokens", "total_completion_tokens"),
        "cost": sum_amounts(totals, path, "total_cost_usd"),
    }


def _outcome(path: Path, columns: Mapping[str, str]) -> EpisodeOutcome:
    trajectory = read_trajectory(path)
    agent = field(trajectory, path, "agent", "name", kind=str)
    model = field(trajectory, path, "agent", kind=dict).get("model_name")
    if trajectory.get("continued_trajectory_ref"):
        raise OutcomeError(f"{path}: is continued in another file; give the last one alone")
    values = {
        name: field(trajectory, path, "extra", key, kind=(str, int, float, _NONE))
        for name, key in columns.items()
    }
    for name in ("task", "condition", "agent"):
        if name in columns and values[name] in (None, ""):
            raise OutcomeError(f"{path}: extra.{columns[name]} names no {name}")
    seed = values.get("seed")
    if seed is not None and not isinstance(seed, int):
        raise OutcomeError(f"{path}: the seed {short_repr(seed)} is no whole number")
    score: Any = values["score"]
    if score is not None:
        score = check_score(score, path, f"extra.{columns['score']}")
    amounts = trajectory_amounts(trajectory, path)
    extra = trajectory.get("extra")
    amounts |= {
        name: sum_amounts(extra, path, columns[name]) for name in AMOUNTS if name in columns
    }
    return EpisodeOutcome(
        agent=str(values.get("agent", f"{agent} ({model})" if model else agent)),
        task=str(values["task"]),
        condition=str(values.get("condition", CLEAN)),
        score=score,
        seed=seed,
        problem="" if score is not None else f"extra.{columns['score']} is null",
        version=f"{agent} {field(trajectory, path, 'agent', 'version', kind=str)}",
        steps=amounts.get("steps"),
        tokens=amounts.get("tokens"),
        cost=amounts.get("cost"),
    )
