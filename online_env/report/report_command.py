"""`hijack report`, `compare`, `gate` and `leaderboard`.

A command imports what it needs when it runs: `--help` answers at once.

Exit codes: 0 done, 1 something of the run is missing, invalid, failed or damaged, or a score is too
low, 2 bad usage or a run that cannot be reported, 3 the disk is full or fails.
"""

import gc
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from hijack_data.cli.completion import complete
from hijack_data.cli.options import BriefCommand, Command, FiniteRange
from hijack_data.cli.terminal import console, echo
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.runs.own_files import refuse_own_file

from .formats import (
    COMPARISON,
    FORMATS,
    FORMATS_BY_OPTION,
    TERMINAL,
    WITH_CAUSES,
    check_shown,
    choose_format,
    write,
)
from .gate_options import gate_options
from .model import ReportError
from .sources import PAIRING, READING, SOURCES, SourceOptions, is_own_run, source_options

if TYPE_CHECKING:
    from ..results.reading import Run
    from .document import ReportDocument
    from .model import RunReport


def _output_options(command: Command) -> Command:
    """Add `--format`, `--out` and `--json`."""
    format_name = click.option(
        "--format",
        "format_name",
        metavar="NAME",
        shell_complete=complete("online_env.report.formats:FORMATS"),
        help=f"One of {', '.join(FORMATS)}.",
    )
    out = click.option(
        "-o",
        "--out",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help="Write to a file, whose name tells the format unless --format does.",
    )
    as_json = click.option("--json", "as_json", is_flag=True, help="Print a list of rows.")
    return format_name(out(as_json(command)))


def _without_collector(command: Command) -> Command:
    """Decorator: pause the garbage collector, which else goes through all records again and again.

    Records have no circles, and the process ends with its report.
    """

    @wraps(command)
    def called(*arguments: Any, **values: Any) -> Any:
        was_enabled = gc.isenabled()
        gc.disable()
        try:
            return command(*arguments, **values)
        finally:
            if was_enabled:
                gc.enable()

    return cast("Command", called)


@click.command(cls=BriefCommand, more=("reference", "margin", "clean", *PAIRING))
@SOURCES
@_output_options
@click.option("--seeds", type=click.IntRange(1), metavar="N", help="Seeds 0 to N-1 only.")
@click.option("--reference", metavar="AGENT", help="Agent of the run that mCE refers to.")
@click.option(
    "--margin",
    type=FiniteRange(0, 100, min_open=True, max_open=True),
    metavar="POINTS",
    help="Loss that the tests of equivalence refute.  [default: 5]",
)
@click.option("--paper", is_flag=True, help="Set the agents beside the paper's main table.")
@click.option("--full", is_flag=True, help="All tables, notes and causes.")
@source_options(*READING, *PAIRING)
@_without_collector
def report(
    sources: tuple[Path, ...],
    format_name: str | None,
    out: Path | None,
    as_json: bool,
    seeds: int | None,
    reference: str | None,
    margin: float | None,
    paper: bool,
    full: bool,
    options: SourceOptions,
) -> None:
    """Show the results of a run, such as: hijack report runs/small.

    SOURCE is the folder of a run of hijack bench or hijack score, a report.json, or results of
    others: tables, logs of Inspect, folders of OSWorld, Harbor, AgentLab or cua-bench, trajectories
    in ATIF. Several of others are one report.
    """
    from ..results.scores import COLUMNS
    from . import terminal
    from .build import build_report, load_report
    from .further_tests import MARGIN
    from .outcome import report_exit_code

    runs = sources[0]
    is_own = is_own_run(sources)
    if seeds and not is_own:
        raise ReportError("--seeds chooses episodes of a run of this library; give its folder")
    if seeds and runs.is_file():
        raise ReportError("--seeds chooses episodes of a run; give the folder of one")
    share = None if margin is None else margin / 100
    requested = {"--margin": margin, "--paper": paper, "--reference": reference, "--full": full}
    beside = [name for name, value in requested.items() if value]
    for option in [*beside, *([f"--format {format_name}"] if format_name else [])]:
        if as_json:
            raise ReportError(
                f"--json is a list of rows, without {option}; give --format json alone"
            )
    if is_own and runs.is_file():
        if options.stated:
            raise ReportError(f"{runs}: is a finished report, which {options.stated[0]} is not for")
        finished = load_report(runs, reference or "", share)
        if as_json:
            cells = [{name: getattr(cell, name) for name in COLUMNS} for cell in finished.cells]
            _output(json.dumps(cells, indent=1) + "\n", out)
        else:
            format = _format(format_name, out, beside)
            _write(_document(finished, paper=paper, full=full), format, out)
        raise SystemExit(report_exit_code(finished))
    run = options.read(sources, partial(_read, seeds=seeds))
    if as_json:
        _output(json.dumps(terminal.score_rows(run), indent=1) + "\n", out)
        raise SystemExit(_finish(run))
    format = _format(format_name, out, beside)
    if format == TERMINAL and out is None:
        terminal.show(run, reference or "", paper=paper, full=full, margin=share or MARGIN)
        raise SystemExit(_finish(run))
    run_report = build_report(
        run, reference=reference or "", margin=share or MARGIN, causes=full or format in WITH_CAUSES
    )
    _write(_document(run_report, paper=paper, full=full), format, out)
    raise SystemExit(_finish(run))


@click.command("compare")
@click.argument("runs", type=click.Path(path_type=Path))
@click.argument("earlier", type=click.Path(path_type=Path))
@click.option(
    "--pair",
    "pairs",
    multiple=True,
    metavar="OLD=NEW",
    help="Agents of other names that are compared; may be repeated.",
)
@_output_options
def compare_command(
    runs: Path,
    earlier: Path,
    pairs: tuple[str, ...],
    format_name: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compare a run case by case with an earlier one: hijack compare runs/new runs/old."""
    from .build import build_report
    from .comparison import compare_runs
    from .document import ReportDocument

    for folder in (runs, earlier):
        if folder.is_file():
            raise ReportError(f"{folder} is a finished report; give the folders of runs")
    if as_json and format_name:
        raise ReportError(
            f"--json is a list of rows, without --format {format_name}; give --format json alone"
        )
    run = _read(runs)
    comparison = compare_runs(_read(earlier), run, _parse_pairs(pairs))
    if as_json:
        _output(json.dumps([asdict(cell) for cell in comparison.cells], indent=1) + "\n", out)
    else:
        format = _format(format_name, out, [COMPARISON])
        _write(ReportDocument(report=build_report(run), comparison=comparison), format, out)
    raise SystemExit(_finish(run))


@click.command()
@SOURCES
@gate_options
@source_options(*READING, *PAIRING)
def gate(
    sources: tuple[Path, ...],
    fail_under: tuple[str, ...],
    junit: Path | None,
    options: SourceOptions,
) -> None:
    """Exit with 1 if a score is too low: hijack gate RUNS --fail-under retention=0.8."""
    from .gate import ReleaseGate

    if not fail_under and junit is None:
        raise click.UsageError("say what is too low: --fail-under SCORE=X")
    if is_own_run(sources) and sources[0].is_file():
        raise ReportError(f"{sources[0]} is a finished report; give the folder of a run")
    run = options.read(sources, _read)
    passed = ReleaseGate.read(fail_under, junit, *_agents_and_labels(run)).conclude(run)
    code = _finish(run)
    raise SystemExit(code if passed else 1)


@click.command("leaderboard")
@click.argument("folder", metavar="RUNS", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="The page to write.",
)
@click.option(
    "--space",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write the page as the folder of a static Space of the Hugging Face Hub.",
)
def leaderboard_command(folder: Path, out: Path | None, space: Path | None) -> None:
    """Rank the agents of all runs in a folder on one page."""
    from . import board_page, leaderboard  # its page needs modules that a report does not

    if out is None and space is None:
        raise click.UsageError("say where to write: -o FILE.html or --space FOLDER")
    reports = leaderboard.read_reports(folder)
    for problem in reports.problems:
        echo(f"hijack: left out: {problem}", err=True)
    if out is not None:
        _output(board_page.board_page(reports), out)
    if space is not None:
        refuse_own_file(space / board_page.INDEX, "--space")
        board_page.write_space(reports, space)
        echo(f"wrote {space}")
    raise SystemExit(1 if reports.problems else 0)


def _format(format_name: str | None, out: Path | None, beside: Sequence[str]) -> str:
    """Return the format, which has to show what the options `beside` ask for."""
    format = choose_format(format_name, out)
    for option in beside:
        if option in FORMATS_BY_OPTION:
            check_shown(option, format)
    return format


def _read(folder: Path, seeds: int | None = None) -> "Run":
    """Read a run that has episodes, of all seeds or of the first ones.

    Raises:
        ReportError: it has none.
        RunError: it has no such seeds.
    """
    from ..results import reading

    run = reading.read(folder)
    if seeds is not None:
        run = reading.with_first_seeds(run, seeds)
    for damage in run.damaged:
        location = f"{folder / damage.file}:{damage.line}"
        echo(f"hijack: {location}: skipped: {damage.problem}", err=True)
    if not run.records:
        command = "score" if run.is_scored else "bench"
        raise ReportError(
            f"{folder}: holds no episodes yet; hijack {command} ... --out {folder} --resume runs"
            " them"
        )
    return run


def _agents_and_labels(run: "Run") -> tuple[list[str], list[str]]:
    """Return the agents and the conditions of a run; a log without a head has those it played."""
    from ..results.episode_columns import EpisodeColumns
    from .identity import agent_names, corruptions_by_label

    if isinstance(run.records, EpisodeColumns):
        return agent_names(run.config), list(corruptions_by_label(run.config))
    agents = [*agent_names(run.config), *(record["agent"] for record in run.records)]
    labels = [*corruptions_by_label(run.config), *(record["corruption"] for record in run.records)]
    return list(dict.fromkeys(agents)), list(dict.fromkeys(labels))


def _finish(run: "Run") -> int:
    """Print on standard error what is missing, and return the exit code."""
    from .outcome import exit_code, missing_line

    if run.missing:
        echo(f"hijack: {run.folder}: {missing_line(run)}", err=True)
    return exit_code(run)


def _document(report: "RunReport", *, paper: bool, full: bool) -> "ReportDocument":
    from .document import ReportDocument
    from .paper import compare_with_paper

    beside = compare_with_paper(report) if paper else None
    return ReportDocument(report=report, paper=beside, full=full)


def _write(document: "ReportDocument", format: str, out: Path | None) -> None:
    if format == TERMINAL and out is None:
        from . import terminal

        terminal.show_document(document, console())
        return
    _output(write(document, format), out)


def _output(text: str, out: Path | None) -> None:
    if out is None:
        echo(text, nl=False)
        return
    refuse_own_file(out, "--out")
    make_folder(out.parent, out)
    write_atomic(out, text)
    echo(f"wrote {out}")


def _parse_pairs(pairs: tuple[str, ...]) -> Mapping[str, str] | None:
    """Return the agents that are compared.

    Raises:
        ReportError: a pair is not two names.
    """
    agent_pairs: dict[str, str] = {}
    for pair in pairs:
        first, _, second = pair.partition("=")
        if not first or not second:
            raise ReportError(f"--pair: {pair!r} is not OLD=NEW, two names of agents")
        if first in agent_pairs:
            raise ReportError(
                f"--pair: {first!r} is compared with {agent_pairs[first]!r} already; compare it"
                f" with {second!r} by a command of its own"
            )
        agent_pairs[first] = second
    return agent_pairs or None
