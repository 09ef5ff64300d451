"""Compute the report of a run from its records."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from math import isclose
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import UnknownNameError, suggest
from hijack_data.runs.run_log import FORMAT as RUN_FORMAT
from hijack_data.runs.run_log import RUN

from ..results import reading, scores
from ..results.parts import part_rows
from ..results.reading import Run
from .app_success import app_successes
from .causes import loss_causes
from .cells import compute_cells, feasible_and_not
from .further_tests import MARGIN, equivalence_tests, measure_changes, severity_curves
from .identity import run_identity
from .model import ReportError, RunReport, from_data
from .notes import (
    commit_note,
    design_notes,
    early_end_note,
    error_order_note,
    fraction_note,
    guard_note,
    recovery_note,
    repeat_note,
    report_notes,
    unscored_note,
)
from .summaries import summarise_agents
from .unplayable import counted_records, unplayable_note

_ROUNDING = 1e-9  # relative for large numbers, absolute for those near 0


def load_report(
    path: Path, reference: str = "", margin: float | None = None, *, causes: bool = False
) -> RunReport:
    """Return the report of a run's folder, or the one in a file `report.json`.

    Args:
        path: the folder, or the file.
        reference: the reference agent of mCE; a file keeps its own.
        margin: the loss, a share, that equivalence tests refute; likewise.
        causes: as in `build_report`; a file has those that were computed with it.

    Raises:
        ReportError: the run has no episodes, or the file is not a report.
        RunError: The folder is not a run, or the run is of a newer version.
    """
    if not path.is_file():
        return build_report(
            reading.read(path), reference=reference, margin=margin or MARGIN, causes=causes
        )
    report = read_report(path)
    if reference and reference != report.reference:
        raise ReportError(
            f"{path}: is a finished report, whose reference agent is {report.reference!r}; give the"
            " folder of the run for another --reference"
        )
    if margin is not None and {row.margin for row in report.equivalences} != {margin}:
        raise ReportError(f"{path}: is a finished report; give the folder of the run for --margin")
    return report


def read_report(path: Path) -> RunReport:
    """Return the report in a file that `--format json` wrote.

    Raises:
        ReportError: the file is not a report, or is of a newer version.
    """
    from hijack_data.file_io import read_versioned_json

    from .model import FORMAT, VERSION

    if path.name == RUN:
        raise ReportError(f"{path}: is the head of a run ({RUN_FORMAT}); give its folder")
    data = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        description="a report (hijack report RUNS --format json)",
        error=ReportError,
    )
    return from_data(data, str(path))


def build_report(
    run: Run,
    *,
    reference: str = "",
    full: bool = True,
    margin: float = MARGIN,
    causes: bool = False,
) -> RunReport:
    """Return the report of a run.

    Args:
        run: a run of `hijack bench` or `hijack score`, or the episodes logged by an environment.
        reference: the agent of the run that is the reference of mCE; empty for no mCE.
        full: compute what a short form does not show, too: cells of feasible and of infeasible
            tasks, tests of measures and of equivalence, severity curves.
        margin: the loss, a share above 0, that equivalence tests refute.
        causes: find out why disturbed episodes were lost, which reads the steps of each.

    Raises:
        ReportError: the run has no episodes.
        UnknownNameError: the reference agent is not in the run.
    """
    if not run.records:
        raise ReportError(f"{run.folder}: holds no episodes yet; {_how_to_go_on(run)}")
    identity = run_identity(run)
    groups = scores.group_records(counted_records(run))
    cells = compute_cells(run, groups)
    agents = list(dict.fromkeys(cell.agent for cell in cells))
    order = {(cell.agent, cell.corruption): number for number, cell in enumerate(cells)}
    measures = measure_changes(groups) if full else []
    equivalences = equivalence_tests(groups, margin) if full else []
    if reference and reference not in agents:
        raise UnknownNameError(
            f"--reference: {reference!r} is not in {run.folder}{suggest(reference, agents)}"
        )
    feasible, infeasible = feasible_and_not(run) if full else ([], [])
    disturbed, loss_rows = loss_causes(run, groups) if causes else ((), ())
    report = RunReport(
        run=identity,
        cells=tuple(cells),
        summaries=tuple(summarise_agents(identity, cells, groups, reference)),
        feasible=tuple(feasible),
        infeasible=tuple(infeasible),
        applications=tuple(app_successes(groups)),
        measures=tuple(sorted(measures, key=lambda row: order[row.agent, row.corruption])),
        equivalences=tuple(sorted(equivalences, key=lambda row: order[row.agent, row.corruption])),
        curves=tuple(severity_curves(identity, groups, reference)) if full else (),
        disturbed=tuple(disturbed),
        causes=tuple(loss_rows),
        parts=tuple(_parts(run)),
        reference=reference,
    )
    notes = (
        *early_end_note(run),
        *unplayable_note(run),
        *unscored_note(run),
        *commit_note(run),
        *repeat_note(run),
        *recovery_note(run),
        *error_order_note(run),
        *guard_note(run),
        *fraction_note(run),
        *design_notes(run, groups),
        *report_notes(report, scores.count_partial(run.last_attempts)),
    )
    return RunReport(**{**vars(report), "notes": notes})


def reports_agree(first: RunReport, second: RunReport) -> bool:
    """Return whether two reports of a run say the same, wherever the run and its reports were made.

    The name of the run's folder does not count. Numbers may differ by `_ROUNDING`: the last digit
    of an interval depends on the processor, for which the C library chooses its logarithm.
    """
    renamed = replace(second, run=replace(second.run, name=first.run.name))
    return _are_equal(asdict(first), asdict(renamed))


def _are_equal(first: object, second: object) -> bool:
    if isinstance(first, float) and isinstance(second, float):
        return isclose(first, second, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    if isinstance(first, dict) and isinstance(second, dict):
        left, right = cast("dict[str, object]", first), cast("dict[str, object]", second)
        return left.keys() == right.keys() and all(_are_equal(left[k], right[k]) for k in left)
    if isinstance(first, list | tuple) and isinstance(second, list | tuple):
        items, others = cast("list[object]", first), cast("list[object]", second)
        return len(items) == len(others) and all(map(_are_equal, items, others))
    return first == second


def _parts(run: Run) -> list[Mapping[str, Any]]:
    if not run.is_scored:
        return []
    return list(part_rows(run.records))


def _how_to_go_on(run: Run) -> str:
    command = "score" if run.is_scored else "bench"
    return f"hijack {command} ... --out {run.folder} --resume runs them"
