"""Results of this repository: `docs/results/NAME/report.json` is all that a page of its own needs.

The file is what `hijack report RUNS -o report.json` writes. An `about.md` beside it stands before
its figures; its heading, if it has one, is the title. The leaderboard is that of
`hijack leaderboard docs/results`.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path

from charts import SUCCESS_LEGEND, Bar, chart
from copied import plain_fences

from online_env.report.board_page import board_page
from online_env.report.build import read_report
from online_env.report.conclusions import conclude
from online_env.report.document import ReportDocument
from online_env.report.formats import write
from online_env.report.leaderboard import RULE, Standing, rank_agents, read_reports
from online_env.report.model import AgentSummary, RunReport

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs" / "results"
REPORT = "report.json"
FULL = "report.html"
BOARD = "board.html"
_HEADING = re.compile(r"# (.+)\n\n")
_ABOUT = re.compile(r"^(\w+)/about\.md")
_LINK = re.compile(r"\]\((?!#|[a-z]+:)([^)\s]+)\)")


def pages(folder: Path = RESULTS) -> dict[str, str]:
    """The text of every page, by file: one of each report, the leaderboard, and the list of all."""
    result = reports(folder)
    entries = {
        f"results/{name}.md": of_report(name, report, folder) for name, report in result.items()
    }
    entries["results/leaderboard.md"] = board(folder, result)
    entries["results/index.md"] = index(result, folder)
    return entries


def files(folder: Path = RESULTS) -> dict[str, str]:
    """Whole pages that stand beside them, by file: each report, and the leaderboard."""
    result = reports(folder)
    entries = {
        f"results/{name}/{FULL}": write(ReportDocument(report=report), "html")
        for name, report in result.items()
    }
    if result:
        entries[f"results/{BOARD}"] = board_page(read_reports(folder))
    return entries


def reports(folder: Path) -> dict[str, RunReport]:
    """The reports by the names of their folders.

    `ReportError` is raised for a file that is not a report.
    """
    return {path.parent.name: read_report(path) for path in sorted(folder.glob(f"*/{REPORT}"))}


def index(found: dict[str, RunReport], folder: Path) -> str:
    """The list of all results."""
    lines = [
        "# Results\n",
        "What was measured, and by whom. Each page says how it was made.\n",
        "| result | what was measured |\n|---|---|",
        "| [The paper's table](../paper_results.md) | success on OSWorld's tasks, clean and under"
        " each of the nine; the paper's numbers, not run here |",
        "| [Ten episodes to look at](ten_episodes.md) | one agent at one task, clean and under each"
        " of the nine, with every picture |",
        "| [Training with DA-GRPO](da_grpo.md) | what training with corruptions adds on the toy"
        " desktop, with intervals |",
        "| [Training on the real desktop](desktop_training.md) | a small network that learns from"
        " real screenshots, by imitation and with DA-GRPO |",
        "| [Which tasks can be solved](suite.md) | oracles on the tasks of the suite,"
        " clean and under each corruption |",
        "| [What goes wrong for pixel](pixel_failures.md) | failures of an agent without a model,"
        " looked at |",
        "| [Is the augmentation worth using?](../proof.md) | a small grounding network,"
        " trained with and without corruptions |",
        "| [Reading by OCR: the agent pixel](../results.md#reading-by-ocr-the-agent-pixel) | single"
        " episodes of an agent without a model |",
    ]
    for name, report in found.items():
        agents = ", ".join(f"`{agent}`" for agent in report.agents)
        title, _ = introduction(name, folder)
        lines.append(f"| [{title}]({name}.md) | {_played(report)}: {agents} |")
    lines += [
        "",
        "[The leaderboard](leaderboard.md) ranks the agents of the runs above that played the same"
        " setting. [Figures](../figures.md) has speed and memory.\n",
    ]
    return "\n".join(lines)


def introduction(name: str, folder: Path) -> tuple[str, str]:
    """The title of a result and the text below it.

    Without a heading in `about.md`, the title comes from the name of the folder.
    """
    about = folder / name / "about.md"
    text = about.read_text(encoding="utf-8") if about.is_file() else ""
    heading = _HEADING.match(text)
    if heading:
        return heading[1], text[heading.end() :]
    return name.replace("_", " ").replace("-", " ").capitalize(), text


def of_report(name: str, report: RunReport, folder: Path) -> str:
    """The page of one report."""
    title, text = introduction(name, folder)
    lines = [f"# {title}\n"]
    if text:
        lines.append(_a_folder_up(plain_fences(text), name))
    lines.append(f"{_played(report)}.\n")
    lines += [f"* {sentence}" for sentence in conclude(report)]
    lines.append("")
    lines += _table(report)
    lines += [_bars(report, row) for row in report.summaries]
    lines += [f"* {note}" for note in report.notes]
    lines.append(f"\n[The whole report]({name}/{FULL}) has intervals, differences and costs.\n")
    return "\n".join(lines)


def _a_folder_up(text: str, name: str) -> str:
    """A text with the links that it needs beside the folder that it comes from.

    The `about.md` of another folder is a part of the page of that folder.
    """

    def moved(match: re.Match[str]) -> str:
        target = os.path.normpath(f"{name}/{match[1]}")
        page = _ABOUT.sub(r"\1.md", target)
        return f"]({page})"

    return _LINK.sub(moved, text)


def board(folder: Path, found: dict[str, RunReport]) -> str:
    """The page of the leaderboard: one table; the page beside it sorts and filters."""
    lines = ["# Leaderboard\n", f"{RULE}\n"]
    if not found:
        lines.append("No run of a whole agent has been added yet.\n")
    else:
        lines.append(f"[Sort, filter and choose columns]({BOARD}).\n")
        lines.append("| rank | agent | given | setting | corrupted | clean | retention |")
        lines.append("|---|---|---|---|---:|---:|---:|")
        for ranking in rank_agents(read_reports(folder)):
            lines += [_board_row(line, ranking.title) for line in ranking.lines]
        lines.append("")
    lines += [
        "## Add a run\n",
        "Open a pull request with a folder `submissions/NAME`: the signed run, its report and the"
        " public key ([the rules](../reports.md#submit-a-run)).\n",
        "`hijack leaderboard runs -o leaderboard.html` ranks runs of your own.\n",
    ]
    return "\n".join(lines)


def _board_row(line: Standing, setting: str) -> str:
    rank = line.reason if line.rank is None else f"{line.rank} of {line.rivals}"
    row = line.row
    values = " | ".join(map(_percent, (row.corrupted, row.clean, row.retention)))
    return f"| {rank} | `{row.agent}` | {line.inputs} | {setting} | {values} |"


def _played(report: RunReport) -> str:
    run = report.run
    kind = "rows of a dataset" if run.kind == "score" else "live episodes"
    episodes = sum(cell.n for cell in report.cells)
    return f"{episodes:,} {kind}, {run.tasks} tasks, {len(report.labels)} conditions"


def _table(report: RunReport) -> Iterator[str]:
    yield "| agent | over corruptions | keeps of clean | worst under |\n|---|---:|---:|---|"
    for row in report.summaries:
        worst = _worst(report.worst_corruptions(row.agent), row.worst_success)
        yield f"| `{row.agent}` | {_percent(row.corrupted)} | {_percent(row.retention)} | {worst} |"
    yield ""


def _worst(labels: tuple[str, ...], success: float | None) -> str:
    if success is None or not labels:
        return "" if success is None else "none"
    return f"{', '.join(f'`{label}`' for label in labels)}, {_percent(success)}"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f} %"


def _bars(report: RunReport, row: AgentSummary) -> str:
    """Success of one agent under each condition."""
    bars: list[Bar] = []
    for label in report.labels:
        cell = report.cell(row.agent, label)
        if cell is None or cell.success is None:
            continue
        share = 100 * cell.success
        bars.append(Bar(label, share, f"{share:.1f} %", label == "clean"))
    return chart(f"{row.agent}: tasks solved", bars, legend=SUCCESS_LEGEND)
