"""Compute the report of a run from its records."""

from collections.abc import Hashable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from statistics import fmean
from typing import Any, TypeAlias

from hijack_data.errors import UnknownNameError, suggest
from hijack_data.plan import CLEAN
from hijack_data.runs.given import given_to
from hijack_data.runs.run_log import FORMAT as RUN_FORMAT
from hijack_data.runs.run_log import GIVEN_KINDS, RUN

from ..bench import reading, scores
from ..bench.reading import ResultRecord, Run
from . import used
from .by_task import Compared, by_task_note
from .identity import NINE, agents_of, conditions_of, has_all_nine, identity_of
from .model import AgentSummary, Cell, ReportError, RunIdentity, RunReport, from_data
from .notes import notes_of, recovery_note

CEILING = "recovering"  # the agent that acts like a careful user
_Key: TypeAlias = tuple[str, str]
_Scored: TypeAlias = dict[_Key, scores.ScoreByCase]


def load_report(path: Path, reference: str = "") -> RunReport:
    """Return the report of a run's folder, or the one in a file `report.json`.

    `RunError` is raised for a folder that is not a run or of a newer version.

    Args:
        path: the folder, or the file.
        reference: the reference agent of mCE; a file keeps its own.

    Raises:
        ReportError: the run has no episodes, or the file is not a report.
    """
    if not path.is_file():
        return build_report(reading.read(path), reference=reference)
    found = read_report(path)
    if reference and reference != found.reference:
        raise ReportError(
            f"{path}: is a finished report, whose reference agent is {found.reference!r}; give the"
            " folder of the run for another --reference"
        )
    return found


def read_report(path: Path) -> RunReport:
    """Return the report in a file that `--format json` wrote.

    Raises:
        ReportError: the file is not a report, or is of a newer version.
    """
    from hijack_data.files import read_versioned_json

    from .model import FORMAT, VERSION

    if path.name == RUN:
        raise ReportError(f"{path}: is the head of a run ({RUN_FORMAT}); give its folder")
    data = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        what="a report (hijack report RUNS --format json)",
        error=ReportError,
    )
    return from_data(data, str(path))


def build_report(run: Run, *, reference: str = "") -> RunReport:
    """Return the report of a run.

    Args:
        run: a run of `hijack bench` or `hijack score`, or the episodes logged by an environment.
        reference: the agent of the run that is the reference of mCE; empty for no mCE.

    Raises:
        ReportError: the run has no episodes.
        UnknownNameError: the reference agent is not in the run.
    """
    if not run.records:
        raise ReportError(f"{run.folder}: holds no episodes yet; {_how_to_go_on(run)}")
    identity = identity_of(run)
    cells = cells_of(run, run.records)
    agents = list(dict.fromkeys(cell.agent for cell in cells))
    if reference and reference not in agents:
        raise UnknownNameError(
            f"--reference: {reference!r} is not in {run.folder}{suggest(reference, agents)}"
        )
    feasible, infeasible = _apart(run)
    report = RunReport(
        run=identity,
        cells=tuple(cells),
        summaries=tuple(_summaries(run, identity, cells, reference)),
        feasible=tuple(feasible),
        infeasible=tuple(infeasible),
        parts=tuple(_parts(run)),
        reference=reference,
    )
    notes = (
        *recovery_note(run),
        *notes_of(report, scores.partial(run.records)),
        *by_task_note(_compared(run, cells), run.is_scored),
    )
    return RunReport(**{**vars(report), "notes": notes})


def cells_of(run: Run, chosen: Sequence[ResultRecord]) -> list[Cell]:
    """Return a cell for each agent and condition in some records of a run."""
    found = scores.by_cell(chosen)
    attempts = scores.attempts_by_cell(chosen)
    scored = {key: scores.scored(cases) for key, cases in found.items()}
    names = {} if run.is_scored else conditions_of(run.config)
    rows = scores.rows(chosen, agents_of(run.config), list(conditions_of(run.config)))
    top = {row["corruption"]: row["success"] for row in rows if row["agent"] == CEILING}
    inferred = _inferred(rows, scored)
    return [
        Cell(
            **row,
            **inferred.get((row["agent"], row["corruption"]), {}),
            **used.means(
                found[row["agent"], row["corruption"]].values(),
                attempts[row["agent"], row["corruption"]],
            ),
            tasks=len(set(scores.task_names(scored[row["agent"], row["corruption"]]))),
            pass_hat=_pass_hat(run, scored[row["agent"], row["corruption"]]),
            ceiling=top.get(row["corruption"]),
            early=scores.unreached(found[row["agent"], row["corruption"]].values(), names),
        )
        for row in rows
    ]


def _inferred(
    rows: Sequence[scores.ScoreRow], scored: _Scored
) -> dict[_Key, dict[str, float | None]]:
    """Return the intervals of the retention, and the detectable differences, by cell."""
    keys = [(row["agent"], row["corruption"]) for row in rows if row["delta"] is not None]
    if not keys or not scores.can_infer():
        return {}
    from ..bench import statistics

    cells = [scores.pairs(scored[agent, CLEAN], scored[agent, label]) for agent, label in keys]
    kept = statistics.retention_intervals(cells)
    return {
        key: {
            "retention_low": interval.low if interval else None,
            "retention_high": _finite(interval.high) if interval else None,
            "detectable": statistics.detectable_difference(*cell),
        }
        for key, cell, interval in zip(keys, cells, kept, strict=True)
    }


def _compared(run: Run, cells: Sequence[Cell]) -> dict[str, dict[str, Compared]]:
    """Return the comparisons with clean that have a p value, by agent and corruption."""
    scored = {key: scores.scored(cases) for key, cases in scores.by_cell(run.records).items()}
    found: dict[str, dict[str, Compared]] = {}
    for cell in cells:
        if cell.p is not None:
            cases = scores.pairs(scored[cell.agent, CLEAN], scored[cell.agent, cell.corruption])
            found.setdefault(cell.agent, {})[cell.corruption] = Compared(cell.p, cases)
    return found


def _pass_hat(run: Run, scored: Mapping[scores.PairKey, float]) -> tuple[float, ...]:
    """Return pass^k for k = 1 up to the number of seeds that every task has.

    The rows of a dataset are steps, not repetitions of a task, so a scoring run has none.
    """
    if run.is_scored or not scored or not scores.can_infer():
        return ()
    from ..bench.statistics import pass_hat_k

    solved: dict[Hashable, list[bool]] = {}
    for name, score in zip(scores.task_names(scored), scored.values(), strict=True):
        solved.setdefault(name, []).append(score == 1.0)
    seeds = min(map(len, solved.values()))
    found = [pass_hat_k(solved, k) for k in range(1, seeds + 1)]
    return tuple(value for value in found if value is not None)


def _summaries(
    run: Run,
    identity: RunIdentity,
    cells: Sequence[Cell],
    reference: str,
) -> list[AgentSummary]:
    found = scores.by_cell(run.records)
    attempts = scores.attempts_by_cell(run.records)
    scored = {key: scores.scored(cases) for key, cases in found.items()}
    by_agent: dict[str, dict[str, Cell]] = {}
    for cell in cells:
        by_agent.setdefault(cell.agent, {})[cell.corruption] = cell
    return [
        AgentSummary(
            agent=agent,
            n=sum(cell.n for cell in own.values()),
            given=_given(run, agent),
            errors=sum(cell.errors for cell in own.values()),
            invalid=sum(cell.invalid for cell in own.values()),
            **_means(own, identity),
            **_retained(agent, own, scored),
            **_intervals(agent, own, scored),
            **used.means(
                [record for label in own for record in found[agent, label].values()],
                [record for label in own for record in attempts[agent, label]],
            ),
            mce=_mce(own, by_agent.get(reference, {})),
        )
        for agent, own in by_agent.items()
    ]


def _given(run: Run, agent: str) -> tuple[str, ...] | None:
    found = given_to(record for record in run.records if record["agent"] == agent)
    there = {kind for given in found for kind in given}
    return tuple(kind for kind in GIVEN_KINDS if kind in there) if found else None


def _means(own: Mapping[str, Cell], identity: RunIdentity) -> dict[str, Any]:
    """Return the means over the conditions of an agent."""
    success = {label: cell.success for label, cell in own.items() if cell.success is not None}
    corrupted = [label for label in success if label != CLEAN]
    means: dict[str, Any] = {
        **scores.means(success),
        "conditions": len(corrupted),
        "ceiling": _mean([own[label].ceiling for label in corrupted]),
    }
    if has_all_nine(identity, set(success)):
        means["nine"] = fmean(success[name] for name in NINE)
        if CLEAN in success:
            means["paper_average"] = fmean(success[name] for name in (CLEAN, *NINE))
    return means


def _retained(
    agent: str,
    own: Mapping[str, Cell],
    scored: _Scored,
) -> dict[str, float | None]:
    """Return the share of its clean success that an agent keeps over all its corruptions."""
    there: list[float] = []
    here: list[float] = []
    names: list[str] = []
    for label in own:
        if label == CLEAN:
            continue
        before, after, tasks = scores.pairs(scored.get((agent, CLEAN), {}), scored[agent, label])
        there += before
        here += after
        names += tasks
    if not sum(there):
        return {}
    found: dict[str, float | None] = {"retention": sum(here) / sum(there)}
    if scores.can_infer():
        from ..bench.statistics import retention_interval

        kept = retention_interval(there, here, names)
        found["retention_low"] = kept.low if kept else None
        found["retention_high"] = _finite(kept.high) if kept else None
    return found


def _intervals(
    agent: str,
    own: Mapping[str, Cell],
    scored: _Scored,
) -> dict[str, float]:
    """Return the interval of the mean over the corruptions."""
    cells = [scored[agent, label] for label in own if label != CLEAN]
    there = [cell for cell in cells if cell]
    if not there or not scores.can_infer():
        return {}
    from ..bench.statistics import grand_mean_interval

    pairs = [(list(cell.values()), scores.task_names(cell)) for cell in there]
    interval = grand_mean_interval(pairs)
    return {"corrupted_low": interval.low, "corrupted_high": interval.high}


def _mce(own: Mapping[str, Cell], reference: Mapping[str, Cell]) -> float | None:
    """Return the mean corruption error over the corruptions that both agents have."""
    if not scores.can_infer():
        return None
    from ..bench.statistics import mean_corruption_error

    there = _errors(reference)
    here = _errors(own)
    shared = [label for label in here if label in there]
    if not shared:
        return None
    return mean_corruption_error(
        {label: here[label] for label in shared},
        {label: there[label] for label in shared},
    )


def _errors(cells: Mapping[str, Cell]) -> dict[str, float]:
    return {
        label: 1 - cell.success
        for label, cell in cells.items()
        if label != CLEAN and cell.success is not None
    }


def _apart(run: Run) -> tuple[list[Cell], list[Cell]]:
    """Return the cells of feasible and of infeasible tasks, if there are infeasible ones."""
    infeasible = [record for record in run.records if record.get("infeasible")]
    if not infeasible:
        return [], []
    feasible = [record for record in run.records if not record.get("infeasible")]
    return cells_of(run, feasible), cells_of(run, infeasible)


def _parts(run: Run) -> list[Mapping[str, Any]]:
    if not run.is_scored:
        return []
    from ..scoring.parts import part_rows

    return list(part_rows(run.records))


def _how_to_go_on(run: Run) -> str:
    command = "score" if run.is_scored else "bench"
    return f"hijack {command} ... --out {run.folder} --resume runs them"


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean, or `None` if a value is missing."""
    there = [value for value in values if value is not None]
    return fmean(there) if there and len(there) == len(values) else None
