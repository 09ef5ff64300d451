"""A page that ranks the agents of all runs in a folder.

Agents are ranked by their mean success over the corruptions, and only among agents with the same
setting: kind of run, tasks, conditions with their parameters, seeds, steps, desktop and recovery
policy. Reference agents and runs that lack episodes are shown without a rank.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hijack_data.errors import HijackError, counted
from hijack_data.runs.run_log import EPISODES, RUN

from . import formatting
from .build import load_report
from .compare import PACKAGE
from .html import render
from .model import AgentSummary, ReportError, RunIdentity, RunReport
from .named_scores import YARDSTICKS

_SKIPPED = (EPISODES, "requests", ".git")
_SUFFIX = "report.json"


@dataclass(frozen=True, kw_only=True)
class ReportFolder:
    """The reports in a folder.

    Attributes:
        folder: where they are.
        reports: by their place in it.
        problems: the unreadable reports, and the reasons.
    """

    folder: Path
    reports: tuple[tuple[str, RunReport], ...]
    problems: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A line of the leaderboard.

    Attributes:
        rank: from 1; `None` for an unranked agent.
        why: why it is unranked; empty if it is ranked.
        place: of the run in the folder.
        run: its identity.
        row: the agent.
        worst: the labels under which it does worst, in words.
        values: success in percent by label.
        shares: success by label, 0..100, rounded; 0 where there is none.
    """

    rank: int | None
    why: str
    place: str
    run: RunIdentity
    row: AgentSummary
    worst: str
    values: tuple[str, ...]
    shares: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """The agents that were played under one setting.

    Attributes:
        title: the setting, in words.
        labels: of the conditions.
        lines: the agents, best first.
    """

    title: str
    labels: tuple[str, ...]
    lines: tuple[Standing, ...]


def read_reports(folder: Path) -> ReportFolder:
    """Read all runs below a folder, and files named `report.json` or `*.report.json`.

    Symbolic links are followed. A run counts once, however many links or reports of it there are.

    Raises:
        ReportError: there is no such folder, or it holds no readable report.
    """
    if not folder.is_dir():
        raise ReportError(f"{folder}: is no folder; --leaderboard takes a folder of runs")
    reports: list[tuple[str, RunReport]] = []
    problems: list[str] = []
    for path in sorted(_places(folder, problems)):
        place = str(path.relative_to(folder))
        try:
            found = load_report(path)
        except HijackError as error:
            said = " ".join(str(error).split("\n"))
            problems.append(said.replace(str(path), place))  # a page is read elsewhere
        else:
            reports.append((place, found))
    reports = _each_once(reports, problems)
    if not reports:
        said = f" ({problems[0]})" if problems else ""
        raise ReportError(
            f"{folder}: holds no run with episodes{said}; give the folder that --out folders of"
            " hijack bench are in"
        )
    return ReportFolder(folder=folder, reports=tuple(reports), problems=tuple(problems))


def rank_agents(found: ReportFolder) -> list[Ranking]:
    """Return one ranking for each setting, the one with the most agents first."""
    groups: dict[str, list[tuple[str, RunReport]]] = {}
    for place, report in found.reports:
        groups.setdefault(report.run.setting_sha256, []).append((place, report))
    made = [_board(group) for group in groups.values()]
    return sorted(made, key=lambda board: -len(board.lines))


def leaderboard(found: ReportFolder) -> str:
    """Return the page."""
    return render(
        "leaderboard.html",
        title="AgentHijack leaderboard",
        boards=rank_agents(found),
        problems=found.problems,
        runs=len(found.reports),
        interval=formatting.interval,
    )


def _places(folder: Path, problems: list[str]) -> Iterator[Path]:
    """Yield the folders of runs and the files of reports, each once.

    Links are followed after all that lies in the folder itself, so that a run has the place where
    it is. `problems` takes in the links that lead nowhere, or to a folder above, which would be
    everything that is there.
    """
    root = os.path.realpath(folder)
    seen: set[str] = set()
    waiting = [folder]
    while waiting:
        start = waiting.pop(0)
        problem = _problem_of(start, root)
        if problem:
            problems.append(f"{start.relative_to(folder)}: {problem}")
            continue
        for found in _walked(start, seen):
            if found.is_symlink() and not os.path.isfile(found):
                waiting.append(found)
            else:
                yield found


def _problem_of(start: Path, root: str) -> str:
    """Return why a link is not followed, or nothing."""
    if not os.path.exists(start):
        return f"is a symbolic link to {os.readlink(start)}, which cannot be reached"
    target = os.path.realpath(start)
    if target != root and os.path.commonpath([target, root]) == target:
        return f"is a symbolic link to {os.readlink(start)}, a folder above; it is not followed"
    return ""


def _walked(start: Path, seen: set[str]) -> Iterator[Path]:
    """Yield runs, reports and links below a folder; `seen` are the real paths that are done."""
    for base, folders, files in os.walk(start):
        real = os.path.realpath(base)
        folders[:] = sorted(name for name in folders if name not in _SKIPPED)
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        here = Path(base)
        if RUN in files:
            folders.clear()
            yield here
            continue
        yield from (here / name for name in folders if (here / name).is_symlink())
        for name in sorted(files):
            path = here / name
            real = os.path.realpath(path)
            if not os.path.exists(path):
                yield path
            elif _is_report(name) and real not in seen:
                seen.add(real)
                yield path


def _each_once(
    found: Sequence[tuple[str, RunReport]], problems: list[str]
) -> list[tuple[str, RunReport]]:
    """Return the reports without those of a run that is there already, by the hash of its head.

    Of several that differ, such as a copy that was made while the run went on, the one with the
    fewest missing episodes counts; `problems` names the others.
    """
    best: dict[str, tuple[str, RunReport]] = {}
    for place, report in found:
        key = report.run.head_sha256 or f"without a head: {place}"
        known = best.get(key)
        if known is None:
            best[key] = (place, report)
            continue
        is_more = report.run.missing < known[1].run.missing
        (worse, _), (better, _) = (known, (place, report)) if is_more else ((place, report), known)
        if is_more:
            best[key] = (place, report)
        if known[1].cells != report.cells:
            problems.append(f"{worse}: is the run of {better}, with other episodes")
    return list(best.values())


def _is_report(name: str) -> bool:
    return name == _SUFFIX or name.endswith(f".{_SUFFIX}")


def _board(group: Sequence[tuple[str, RunReport]]) -> Ranking:
    # A run that was broken off has fewer tasks, seeds and conditions than it was to have.
    fullest = min((report for _, report in group), key=lambda report: report.run.missing)
    rows = [(place, report, row) for place, report in group for row in report.summaries]
    rows.sort(key=lambda entry: _key(entry[2]), reverse=True)
    lines: list[Standing] = []
    ranked: list[float | None] = []
    for place, report, row in rows:
        why = _unranked(report, row)
        if not why:
            ranked.append(row.corrupted)
        success = [_success(report, row.agent, label) for label in fullest.labels]
        lines.append(
            Standing(
                rank=None if why else 1 + ranked.index(row.corrupted),
                why=why,
                place=place,
                run=report.run,
                row=row,
                worst=", ".join(report.worst_corruptions(row.agent)),
                values=tuple(formatting.percent(value) for value in success),
                shares=tuple(round(100 * (value or 0.0)) for value in success),
            )
        )
    return Ranking(
        title=_setting(fullest, [report for _, report in group]),
        labels=fullest.labels,
        lines=tuple(lines),
    )


def _key(row: AgentSummary) -> tuple[float, float]:
    return (
        -1.0 if row.corrupted is None else row.corrupted,
        -1.0 if row.clean is None else row.clean,
    )


def _unranked(report: RunReport, row: AgentSummary) -> str:
    """Return why an agent has no rank; empty if it has one."""
    if not report.run.head_sha256:
        return "a log without run.json, so its setting is not known"
    if row.given:
        return f"given {formatting.privileged_inputs(row.given)}"
    if row.agent in YARDSTICKS:
        return "reference agent"
    if report.run.missing:
        return f"{report.run.missing} of {report.run.planned} episodes are missing"
    if report.run.damaged:
        return f"{counted(report.run.damaged, 'line')} of the run cannot be read"
    if row.corrupted is None:
        return "no corruption was played"
    if row.invalid:
        return counted(row.invalid, "invalid episode")
    return ""


def _success(report: RunReport, agent: str, label: str) -> float | None:
    cell = report.cell(agent, label)
    return cell.success if cell else None


def _setting(report: RunReport, reports: Sequence[RunReport]) -> str:
    """Return a setting in words: as a report has it, and how all of them differ."""
    run = report.run
    parts = [f"{run.tasks} tasks", f"{len(report.labels)} conditions", f"{len(run.seeds)} seeds"]
    if run.max_steps is not None:
        parts.append(f"at most {run.max_steps} actions")
    if run.provider:
        parts.append(f"provider {run.provider}")
    if run.recovery:
        parts.append(f"recovery policy {run.recovery}")
    if run.kind == "score":
        parts.insert(0, "offline steps")
    versions = sorted({each.run.versions.get(PACKAGE, "unknown") for each in reports})
    if len(versions) > 1:  # tasks and corruptions may have changed between them
        parts.append(f"different versions of {PACKAGE}: {', '.join(versions)}")
    return ", ".join(parts)
