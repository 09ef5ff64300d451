"""Rank the agents of all runs in a folder by `RULE`; `board_page` shows them."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hijack_data.errors import HijackError, quantity
from hijack_data.runs.run_log import EPISODES, RUN

from . import formatting
from .build import load_report
from .comparison import PACKAGE
from .conclusions import suite_name
from .model import AgentSummary, ReportError, RunIdentity, RunReport
from .named_scores import YARDSTICKS

# The rule by which agents are ranked, as the page declares it.
RULE = (
    "Agents are ranked by their mean success over the corruptions; equal means share a rank. Ranked"
    " together are only agents that were played under one setting (kind of run, tasks, conditions"
    " with their parameters, seeds, actions, desktop, recovery policy, guard) and were given the"
    " same inputs. Yardsticks (oracle, recovering, do_nothing, random, fail) and runs with missing,"
    " damaged or invalid episodes have no rank."
)
PICTURES = "instruction and pictures"
_SKIPPED = (EPISODES, "requests", ".git")
_SUFFIX = "report.json"
_DIGITS = 9  # means that agree in them are equal: a mean of 0.1 and 0.2 is not that of 0.3 and 0


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
        reason: why it is unranked; empty if it is ranked.
        inputs: what the agent was given, in words; agents with other inputs have ranks of their
            own.
        rivals: how many agents of the setting with the same inputs have a rank, this one included.
        path: that of the run in the folder.
        run: its identity.
        row: the agent.
        worst: the labels under which it does worst, in words.
        values: success in percent by label.
        shares: success by label, 0..100, rounded; 0 where there is none.
    """

    rank: int | None
    reason: str
    inputs: str
    rivals: int
    path: str
    run: RunIdentity
    row: AgentSummary
    worst: str
    values: tuple[str, ...]
    shares: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """The agents that were played under one setting.

    Attributes:
        title: a short name of the setting, which no other setting of the folder has.
        facts: the setting in detail, by the name of the fact.
        labels: of the conditions.
        lines: the agents, best first.
    """

    title: str
    facts: Mapping[str, str]
    labels: tuple[str, ...]
    lines: tuple[Standing, ...]


def read_reports(folder: Path) -> ReportFolder:
    """Read all runs below a folder, and files named `report.json` or `*.report.json`.

    Symbolic links are followed. A run counts once, however many links or reports of it there are.

    Raises:
        ReportError: there is no such folder, or it holds no readable report.
    """
    if not folder.is_dir():
        raise ReportError(f"{folder}: is no folder of runs")
    reports: list[tuple[str, RunReport]] = []
    problems: list[str] = []
    for path in sorted(_find_paths(folder, problems)):
        path_in_folder = str(path.relative_to(folder))
        try:
            report = load_report(path)
        except HijackError as error:
            message = " ".join(str(error).split("\n"))
            problems.append(message.replace(str(path), path_in_folder))  # a page is read elsewhere
        else:
            reports.append((path_in_folder, report))
    reports = _without_duplicates(reports, problems)
    if not reports:
        message = f" ({problems[0]})" if problems else ""
        raise ReportError(
            f"{folder}: holds no run with episodes{message}; give the folder that --out folders of"
            " hijack bench are in"
        )
    return ReportFolder(folder=folder, reports=tuple(reports), problems=tuple(problems))


def rank_agents(folder: ReportFolder) -> list[Ranking]:
    """Return one ranking for each setting, the one with the most agents first."""
    groups: dict[str, list[tuple[str, RunReport]]] = {}
    for path, report in folder.reports:
        groups.setdefault(report.run.setting_sha256, []).append((path, report))
    rankings = [_make_ranking(group) for group in groups.values()]
    titles = _distinct_titles(rankings)
    named = [replace(ranking, title=title) for ranking, title in zip(rankings, titles, strict=True)]
    return sorted(named, key=lambda board: -len(board.lines))


def _distinct_titles(rankings: Sequence[Ranking]) -> list[str]:
    """Return a title for each setting: its suite, and the facts that tell it from others of it."""
    titles: list[str] = []
    for ranking in rankings:
        rivals = [rival for rival in rankings if rival.title == ranking.title]
        differing = [
            fact
            for key, fact in ranking.facts.items()
            if any(rival.facts.get(key) != fact for rival in rivals)
        ]
        titles.append(", ".join([ranking.title, *differing]))
    return [
        title if titles.count(title) == 1 else f"{title} ({1 + titles[:number].count(title)})"
        for number, title in enumerate(titles)
    ]


def _find_paths(folder: Path, problems: list[str]) -> Iterator[Path]:
    """Yield the folders of runs and the files of reports, each once.

    Links are followed after all that lies in the folder itself, so that a run has the place where
    it is. `problems` takes in the links that lead nowhere, or to a folder above, which would be
    everything that is there.
    """
    root = os.path.realpath(folder)
    real_paths: set[str] = set()
    waiting = [folder]
    while waiting:
        start = waiting.pop(0)
        problem = _link_problem(start, root)
        if problem:
            problems.append(f"{start.relative_to(folder)}: {problem}")
            continue
        for path in _find_entries(start, real_paths):
            if path.is_symlink() and not os.path.isfile(path):
                waiting.append(path)
            else:
                yield path


def _link_problem(start: Path, root: str) -> str:
    """Return why a link is not followed, or nothing."""
    if not os.path.exists(start):
        return f"is a symbolic link to {os.readlink(start)}, which cannot be reached"
    target = os.path.realpath(start)
    if target != root and os.path.commonpath([target, root]) == target:
        return f"is a symbolic link to {os.readlink(start)}, a folder above; it is not followed"
    return ""


def _find_entries(start: Path, real_paths: set[str]) -> Iterator[Path]:
    """Yield runs, reports and links below a folder; `real_paths` are those that are done."""
    for base, folders, files in os.walk(start):
        real = os.path.realpath(base)
        folders[:] = sorted(name for name in folders if name not in _SKIPPED)
        if real in real_paths:
            folders.clear()
            continue
        real_paths.add(real)
        run_folder = Path(base)
        if RUN in files:
            folders.clear()
            yield run_folder
            continue
        yield from (run_folder / name for name in folders if (run_folder / name).is_symlink())
        for name in sorted(files):
            path = run_folder / name
            real = os.path.realpath(path)
            if not os.path.exists(path):
                yield path
            elif _is_report(name) and real not in real_paths:
                real_paths.add(real)
                yield path


def _without_duplicates(
    reports: Sequence[tuple[str, RunReport]], problems: list[str]
) -> list[tuple[str, RunReport]]:
    """Return the reports without those of a run that is there already, by the hash of its head.

    Of several that differ, such as a copy that was made while the run went on, the one with the
    fewest missing episodes counts; `problems` names the others.
    """
    best: dict[str, tuple[str, RunReport]] = {}
    for path, report in reports:
        key = report.run.head_sha256 or f"without a head: {path}"
        earlier = best.get(key)
        if earlier is None:
            best[key] = (path, report)
            continue
        is_more = report.run.missing < earlier[1].run.missing
        (worse, _), (better, _) = (
            (earlier, (path, report)) if is_more else ((path, report), earlier)
        )
        if is_more:
            best[key] = (path, report)
        is_meant = bool(best[key][1].run.left_out)  # a report of the first seeds, as it says
        if earlier[1].cells != report.cells and not is_meant:
            problems.append(f"{worse}: is the run of {better}, with other episodes")
    return list(best.values())


def _is_report(name: str) -> bool:
    return name == _SUFFIX or name.endswith(f".{_SUFFIX}")


def _make_ranking(group: Sequence[tuple[str, RunReport]]) -> Ranking:
    # A run that was broken off has fewer tasks, seeds and conditions than it was to have.
    fullest = min((report for _, report in group), key=lambda report: report.run.missing)
    rows = [(path, report, row) for path, report in group for row in report.summaries]
    rows.sort(key=lambda entry: _sort_key(entry[2]), reverse=True)
    reasons = [_unranked_reason(report, row) for _, report, row in rows]
    ranked: dict[str, list[float]] = {}
    for (_, _, row), reason in zip(rows, reasons, strict=True):
        if not reason:
            ranked.setdefault(_inputs(row), []).append(_rounded(row.corrupted))
    lines: list[Standing] = []
    for (path, report, row), reason in zip(rows, reasons, strict=True):
        success = [_success(report, row.agent, label) for label in fullest.labels]
        rivals = ranked.get(_inputs(row), [])
        lines.append(
            Standing(
                rank=None if reason else 1 + rivals.index(_rounded(row.corrupted)),
                reason=reason,
                inputs=_inputs(row),
                rivals=len(rivals),
                path=path,
                run=report.run,
                row=row,
                worst=", ".join(report.worst_corruptions(row.agent)),
                values=tuple(formatting.percent(value) for value in success),
                shares=tuple(round(100 * (value or 0.0)) for value in success),
            )
        )
    return Ranking(
        title=suite_name(fullest),
        facts=_setting_facts(fullest, [report for _, report in group]),
        labels=fullest.labels,
        lines=tuple(lines),
    )


def _inputs(row: AgentSummary) -> str:
    """Return what an agent was given, in words."""
    return formatting.privileged_inputs(row.given) or PICTURES


def _sort_key(row: AgentSummary) -> tuple[float, float]:
    return _rounded(row.corrupted), _rounded(row.clean)


def _rounded(mean: float | None) -> float:
    """Return a mean without what rounding makes of equal means; -1 if there is none."""
    return -1.0 if mean is None else round(mean, _DIGITS)


def _unranked_reason(report: RunReport, row: AgentSummary) -> str:
    """Return why an agent has no rank; empty if it has one."""
    if not report.run.head_sha256:
        return "a log without run.json, so its setting is not known"
    if row.agent in YARDSTICKS:
        return "yardstick"
    if report.run.missing:
        return f"{report.run.missing} of {report.run.planned} episodes are missing"
    if report.run.damaged:
        return f"{quantity(report.run.damaged, 'line')} of the run cannot be read"
    if row.corrupted is None:
        return "no corruption was played"
    if row.invalid:
        return quantity(row.invalid, "invalid episode")
    return ""


def _success(report: RunReport, agent: str, label: str) -> float | None:
    cell = report.cell(agent, label)
    return cell.success if cell else None


def _setting_facts(report: RunReport, reports: Sequence[RunReport]) -> dict[str, str]:
    """Return a setting in detail: as a report has it, and the versions of all of them."""
    run = report.run
    facts = {
        "kind": "offline steps" if run.kind == "score" else "live episodes",
        "tasks": quantity(run.tasks, "task"),
        "conditions": quantity(len(report.labels), "condition"),
        "seeds": quantity(len(run.seeds), "seed"),
        "actions": "" if run.max_steps is None else f"at most {quantity(run.max_steps, 'action')}",
        "desktop": f"provider {run.provider}" if run.provider else "",
        "recovery": f"recovery {run.recovery}" if run.recovery else "",
        "guard": f"guard {run.guard}" if run.guard else "",
    }
    versions = sorted({item.run.versions.get(PACKAGE, "unknown") for item in reports})
    # Tasks and corruptions may have changed between versions.
    facts["version"] = f"{PACKAGE} {' and '.join(versions)}"
    return {name: fact for name, fact in facts.items() if fact}
