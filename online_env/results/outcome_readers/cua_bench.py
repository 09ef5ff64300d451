"""Runs of cua-bench: `RUN/TASK_vVARIANT/task_VARIANT_trace`, a dataset in Arrow (cua-bench 0.3).

The event `evaluate` of a trace has the result. Newer runs have a `result.json` beside the trace,
which says who played; in older ones the agent is the run's folder.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr

from ...extra import require
from ..outcomes import EpisodeOutcome, OutcomeError
from .atif import is_atif, read_trajectory, trajectory_amounts
from .result_folders import check_score, field, find_condition, read_object

_RESULT = "result.json"
_TRACE = "task_*_trace"
_TRAJECTORY = "trajectory.json"
_SCHEMA_VERSIONS = (1,)
_EPISODE = re.compile(r"(?P<task>.+)_v(?P<variant>\d+)(_a(?P<attempt>\d+))?")
_COLUMNS = ("event_name", "data_json")
_EVALUATED = "evaluate"
_NONE = type(None)


class CuaBenchReader:
    """Reads the episodes of a run, or of a folder of runs.

    A task is a task with its variant, and attempts repeat it. An episode that was not evaluated has
    no outcome. The condition is a folder named after a corruption, or `--columns condition=N`.
    Steps and tokens are those of `trajectory.json`, which newer versions write.
    """

    fields = ("condition",)

    def detect(self, source: Path) -> bool:
        """Return whether a folder holds the trace of an episode."""
        return source.is_dir() and next(_traces(source), None) is not None

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcome of each episode, in the order of their folders.

        Args:
            source: the folder of a run, or of several.
            columns: the number of a folder for `condition`.

        Raises:
            OutcomeError: a trace or a result has another form.
        """
        require("a run of cua-bench", ("pyarrow",))
        paths = [*source.rglob(_TRACE), *source.rglob(_RESULT)]
        for folder in sorted({path.parent for path in paths}):
            match = _EPISODE.fullmatch(folder.name)
            if match is not None:
                yield _outcome(source, folder, match, columns)


def _traces(source: Path) -> Iterator[Path]:
    for path in source.rglob(_TRACE):
        if path.is_dir() and _EPISODE.fullmatch(path.parent.name):
            yield path


def _outcome(
    source: Path, folder: Path, match: re.Match[str], columns: Mapping[str, str]
) -> EpisodeOutcome:
    agent = folder.resolve().parent.name
    path = folder / _RESULT
    if path.exists():
        result = read_object(path, "a result of cua-bench")
        if field(result, path, "schema_version", kind=int) not in _SCHEMA_VERSIONS:
            raise OutcomeError(f"{path}: schema_version is not known; this reader knows 1")
        agent = field(result, path, "agent_info", "name", kind=str)
        if field(result, path, "agent_info", "model_info", kind=(dict, _NONE)) is not None:
            agent += f" ({field(result, path, 'agent_info', 'model_info', 'name', kind=str)})"
        reward = field(result, path, "reward", kind=(int, float, _NONE))
        problem = str(result.get("error") or "was not evaluated")
        score = None if reward is None else check_score(reward, path, "reward")
    else:
        score, problem = _evaluated(_find_trace(folder)), "was not evaluated"
    trajectory = folder / _TRAJECTORY
    amounts: dict[str, float | None] = {}
    if is_atif(trajectory):
        amounts = trajectory_amounts(read_trajectory(trajectory), trajectory)
    return EpisodeOutcome(
        agent=agent,
        task=f"{match['task']}_v{match['variant']}",
        condition=find_condition(source, folder, columns),
        score=score,
        seed=int(match["attempt"] or 0),
        problem="" if score is not None else problem[:200],
        steps=amounts.get("steps"),
        tokens=amounts.get("tokens"),
        cost=amounts.get("cost"),
    )


def _find_trace(folder: Path) -> Path:
    """Return the trace of an episode.

    Raises:
        OutcomeError: there are several.
    """
    trace, *further = sorted(folder.glob(_TRACE))
    if further:
        raise OutcomeError(f"{folder}: holds {len(further) + 1} traces; leave the one that counts")
    return trace


def _evaluated(trace: Path) -> float | None:
    """Return the score in a trace; `None` if the episode was not evaluated.

    Raises:
        OutcomeError: the trace is no dataset, or its result is no score.
    """
    import pyarrow as pa

    results: list[Any] = []
    files = sorted(trace.glob("data-*.arrow"))
    if not files:
        raise OutcomeError(f"{trace}: holds no data-*.arrow, so it is not a trace of cua-bench")
    for path in files:
        try:
            with pa.memory_map(str(path)) as file:
                table = pa.ipc.open_stream(file).read_all()
        except (OSError, pa.ArrowException) as error:
            raise OutcomeError(f"{path}: is no Arrow stream ({str(error)[:120]})") from None
        missing = [name for name in _COLUMNS if name not in table.column_names]
        if missing:
            raise OutcomeError(f"{path}: has no column {missing[0]!r}, so it is no trace")
        for event, text in zip(*(table.column(name).to_pylist() for name in _COLUMNS), strict=True):
            if event == _EVALUATED:
                results.append(_result(path, text))
    if len(results) > 1:
        raise OutcomeError(f"{trace}: was evaluated {len(results)} times; keep one evaluate event")
    return _mean(results[0], trace) if results else None


def _result(path: Path, text: object) -> Any:
    try:
        return json.loads(str(text))["result"]
    except (ValueError, RecursionError, KeyError, TypeError):
        raise OutcomeError(
            f"{path}: the data_json of an evaluate event has no 'result', got {short_repr(text)}"
        ) from None


def _mean(result: Any, trace: Path) -> float | None:
    """Return the score of an evaluation: a number, true or false, or the mean of a list of them.

    Raises:
        OutcomeError: it is something else.
    """
    if result is None or result == []:
        return None
    values = result if isinstance(result, list) else [result]
    numbers = [float(value) if isinstance(value, bool) else value for value in values]
    scores = [check_score(number, trace, "the result of evaluate") for number in numbers]
    return sum(scores) / len(scores)
