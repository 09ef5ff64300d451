"""`hijack report`.

Exit codes: 0 done, 1 something of the run is missing, invalid, failed or damaged, or a gate failed,
2 bad usage or a run that cannot be reported, 3 the disk is full or fails.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import click

from hijack_data.cli import console
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.printable import printable
from hijack_data.runs.own_files import refuse_own_file

from ..report.gate import ReleaseGate, gate_options
from ..results import reading
from ..results.reading import Run
from ..results.scores import COLUMNS
from . import terminal
from .build import build_report, load_report
from .compare import RunComparison, compare
from .document import ReportDocument
from .formats import FORMATS, FORMATS_BY_OPTION, TERMINAL, check_shown, choose_format, write
from .identity import agent_names, corruptions_by_label
from .model import ReportError, RunReport
from .outcome import exit_code, missing_line
from .paper import compare_with_paper


@click.command()
@click.argument("runs", type=click.Path(path_type=Path))
@click.option("--format", "named", metavar="NAME", help=f"One of {', '.join(FORMATS)}.")
@click.option(
    "-o",
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write to a file, whose name tells the format unless --format does.",
)
@click.option("--json", "as_json", is_flag=True, help="Print a list of rows.")
@click.option(
    "--seeds",
    type=click.IntRange(1),
    metavar="N",
    help="Leave out the seeds from N on, such as the last one of a run that goes on.",
)
@click.option("--reference", metavar="AGENT", help="Agent of the run that mCE refers to.")
@click.option(
    "--compare",
    "other",
    type=click.Path(path_type=Path),
    metavar="EARLIER",
    help="Compare the run case by case with an earlier one.",
)
@click.option(
    "--pair",
    "pairs",
    multiple=True,
    metavar="OLD=NEW",
    help="With --compare: agents of other names that are compared; may be repeated.",
)
@click.option("--paper", is_flag=True, help="Set the agents beside the paper's main table.")
@click.option("--leaderboard", is_flag=True, help="Rank the agents of all runs in the folder RUNS.")
@gate_options
def report(
    runs: Path,
    named: str | None,
    out: Path | None,
    as_json: bool,
    seeds: int | None,
    reference: str | None,
    other: Path | None,
    pairs: tuple[str, ...],
    paper: bool,
    leaderboard: bool,
    fail_under: tuple[str, ...],
    junit: Path | None,
) -> None:
    """Show the results of a run, such as: hijack report runs/small.

    RUNS is the folder of a run of hijack bench or hijack score, or a report.json.
    """
    if (fail_under or junit) and (leaderboard or runs.is_file()):
        raise ReportError("--fail-under and --junit judge a run; give the folder of one")
    if junit and out and junit.resolve() == out.resolve():
        raise ReportError(f"--junit {junit}: is the file of --out, too; give another name")
    if seeds and (leaderboard or runs.is_file()):
        raise ReportError("--seeds chooses episodes of a run; give the folder of one")
    given = {"--compare": other, "--pair": pairs, "--paper": paper, "--reference": reference}
    beside = [name for name, value in given.items() if value]
    if leaderboard and (beside or as_json):
        raise ReportError(f"--leaderboard is a page without {(*beside, '--json')[0]}; leave it out")
    whole = {"--paper": paper, f"--format {named}": named, "--reference": reference}
    for option in [name for name, value in whole.items() if value and as_json]:
        raise ReportError(f"--json is a list of rows, without {option}; give --format json alone")
    if leaderboard:
        raise SystemExit(_leaderboard(runs, named, out))
    if pairs and other is None:
        raise ReportError("--pair names agents of two runs; give the earlier one with --compare")
    if runs.is_file():
        if other is not None:
            raise ReportError(f"--compare: {runs} is a finished report; give the folders of runs")
        found = load_report(runs, reference or "")
        if as_json:
            cells = [{name: getattr(cell, name) for name in COLUMNS} for cell in found.cells]
            _put(json.dumps(cells, indent=1) + "\n", out)
            return
        format = _format(named, out, beside)
        _write(_document(found, None, paper), format, out)
        return
    run = _read(runs, seeds)
    gate = ReleaseGate.read(fail_under, junit, *_agents_and_labels(run))
    comparison = None
    if other is not None:
        comparison = compare(_read(other), run, _paired(pairs))
    if as_json:
        rows = terminal.score_rows(run, run.records)
        if comparison is not None:
            rows = [asdict(cell) for cell in comparison.cells]
        _put(json.dumps(rows, indent=1) + "\n", out)
        raise SystemExit(_told(run, gate))
    format = _format(named, out, beside)
    if format == TERMINAL and out is None and comparison is None:
        terminal.show(run, reference or "")
        if paper:
            terminal.show_paper(compare_with_paper(build_report(run)), console())
        raise SystemExit(_told(run, gate))
    document = _document(build_report(run, reference=reference or ""), comparison, paper)
    _write(document, format, out)
    raise SystemExit(_told(run, gate))


def _format(named: str | None, out: Path | None, beside: Sequence[str]) -> str:
    """Return the format, which has to show what the options `beside` ask for."""
    format = choose_format(named, out)
    for option in beside:
        if option in FORMATS_BY_OPTION:
            check_shown(option, format)
    return format


def _read(folder: Path, seeds: int | None = None) -> Run:
    """Read a run that has episodes, of all seeds or of the first ones.

    Raises:
        ReportError: it has none.
        RunError: it has no such seeds.
    """
    run = reading.read(folder)
    if seeds is not None:
        run = reading.with_first_seeds(run, seeds)
    for damage in run.damaged:
        place = f"{folder / damage.file}:{damage.line}"
        click.echo(printable(f"hijack: {place}: skipped: {damage.problem}"), err=True)
    if not run.records:
        command = "score" if run.is_scored else "bench"
        raise ReportError(
            f"{folder}: holds no episodes yet; hijack {command} ... --out {folder} --resume runs"
            " them"
        )
    return run


def _agents_and_labels(run: Run) -> tuple[list[str], list[str]]:
    """Return the agents and the conditions of a run; a log without a head has those it played."""
    agents = [*agent_names(run.config), *(record["agent"] for record in run.records)]
    labels = [*corruptions_by_label(run.config), *(record["corruption"] for record in run.records)]
    return list(dict.fromkeys(agents)), list(dict.fromkeys(labels))


def _told(run: Run, gate: ReleaseGate) -> int:
    """Say on standard error what is missing, judge the run, and return the exit code."""
    if run.missing:
        click.echo(f"hijack: {run.folder}: {missing_line(run)}", err=True)
    if not gate.conclude(run):
        return 1
    return exit_code(run)


def _document(report: RunReport, comparison: RunComparison | None, paper: bool) -> ReportDocument:
    return ReportDocument(
        report=report, comparison=comparison, paper=compare_with_paper(report) if paper else None
    )


def _write(document: ReportDocument, format: str, out: Path | None) -> None:
    if format == TERMINAL and out is None:
        terminal.show_document(document, console())
        return
    _put(write(document, format), out)


def _put(text: str, out: Path | None) -> None:
    if out is None:
        click.echo(printable(text), nl=False)
        return
    refuse_own_file(out, "--out")
    make_folder(out.parent, out)
    write_atomic(out, text)
    click.echo(f"wrote {out}")


def _paired(pairs: tuple[str, ...]) -> Mapping[str, str] | None:
    """Return the agents that are compared.

    Raises:
        ReportError: a pair is not two names.
    """
    found: dict[str, str] = {}
    for pair in pairs:
        first, _, second = pair.partition("=")
        if not first or not second:
            raise ReportError(f"--pair: {pair!r} is not OLD=NEW, two names of agents")
        if first in found:
            raise ReportError(
                f"--pair: {first!r} is compared with {found[first]!r} already; compare it with"
                f" {second!r} by a command of its own"
            )
        found[first] = second
    return found or None


def _leaderboard(folder: Path, named: str | None, out: Path | None) -> int:
    """Write the page of all runs in a folder; returns the exit code.

    Raises:
        ReportError: another format than a page was asked for.
    """
    from .leaderboard import leaderboard, read_reports

    if named not in (None, "html"):
        raise ReportError(f"--leaderboard is a page; --format {named} is not possible, give html")
    if out is None:
        raise ReportError("--leaderboard: say where the page goes, such as -o leaderboard.html")
    found = read_reports(folder)
    for problem in found.problems:
        click.echo(printable(f"hijack: left out: {problem}"), err=True)
    _put(leaderboard(found), out)
    return 1 if found.problems else 0
