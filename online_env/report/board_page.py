"""The leaderboard as one page: a table that sorts and filters, and as the folder of a static Space.

Everything is in the page: it needs no other file and no network. Without JavaScript it shows the
whole table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import yaml

from hijack_data.file_io import make_folder, write_atomic

from . import formatting
from .comparison import PACKAGE
from .html import PAGE, render
from .identity import NINE
from .leaderboard import RULE, Ranking, ReportFolder, Standing, rank_agents

INDEX = "index.html"
README = "README.md"
_TITLE = "AgentHijack leaderboard"


@dataclass(frozen=True, kw_only=True)
class BoardColumn:
    """A column of the table.

    Attributes:
        key: its name in the address of the page.
        heading: its name for readers.
        is_shown: whether it is shown at first.
        is_number: whether values sort as numbers, the greatest first.
    """

    key: str
    heading: str
    is_shown: bool = True
    is_number: bool = False


@dataclass(frozen=True, kw_only=True)
class BoardCell:
    """A value of the table.

    Attributes:
        text: what it says; empty for no value.
        detail: a second line in small type.
        order: what it is sorted by; `None` comes last.
        share: a success in whole percent, which colours the cell; `None` for other columns.
    """

    text: str
    detail: str = ""
    order: float | str | None = None
    share: int | None = None


COLUMNS = (
    BoardColumn(key="rank", heading="rank"),
    BoardColumn(key="agent", heading="agent"),
    BoardColumn(key="inputs", heading="given"),
    BoardColumn(key="setting", heading="setting"),
    BoardColumn(key="corrupted", heading="corrupted, %", is_number=True),
    BoardColumn(key="clean", heading="clean, %", is_number=True),
    BoardColumn(key="retention", heading="retention, %", is_number=True),
    BoardColumn(key="worst", heading="worst, %", is_number=True),
    BoardColumn(key="average", heading="paper's average, %", is_shown=False, is_number=True),
    BoardColumn(key="steps", heading="steps", is_shown=False, is_number=True),
    BoardColumn(key="usd", heading="USD", is_shown=False, is_number=True),
    BoardColumn(key="tasks", heading="tasks", is_shown=False),
    BoardColumn(key="seeds", heading="seeds", is_shown=False),
    BoardColumn(key="actions", heading="actions", is_shown=False),
    BoardColumn(key="desktop", heading="desktop", is_shown=False),
    BoardColumn(key="recovery", heading="recovery", is_shown=False),
    BoardColumn(key="version", heading="version", is_shown=False),
    BoardColumn(key="played", heading="played", is_shown=False),
    BoardColumn(key="run", heading="run", is_shown=False),
)


def board_page(folder: ReportFolder) -> str:
    """Return the page."""
    rankings = rank_agents(folder)
    labels = _labels(rankings)
    columns = [*COLUMNS, *(_label_column(label) for label in labels)]
    return render(
        "leaderboard.html",
        title=_TITLE,
        rule=RULE,
        columns=columns,
        rows=[
            (line.rank is not None, [_cell(column.key, line, ranking) for column in columns])
            for ranking in rankings
            for line in ranking.lines
        ],
        settings=[ranking.title for ranking in rankings],
        inputs=sorted({line.inputs for ranking in rankings for line in ranking.lines}),
        problems=folder.problems,
        runs=len(folder.reports),
        script=(PAGE / "leaderboard.js").read_text(encoding="utf-8"),
    )


def write_space(folder: ReportFolder, space: Path) -> None:
    """Write the folder of a static Space of the Hugging Face Hub: the page, and its README.

    Args:
        folder: the runs.
        space: where to write; files of other names that are there stay.

    Raises:
        HijackError: the folder cannot be written.
    """
    make_folder(space, space)
    write_atomic(space / INDEX, board_page(folder))
    head = {
        "title": _TITLE,
        "sdk": "static",
        "app_file": INDEX,
        "pinned": False,
        "license": "apache-2.0",
        "tags": ["leaderboard", "computer-use", "robustness"],
    }
    text = f"---\n{yaml.safe_dump(head, sort_keys=False)}---\n\n# {_TITLE}\n\n{RULE}\n"
    write_atomic(space / README, text)


def _labels(rankings: Sequence[Ranking]) -> list[str]:
    """Return the labels of all conditions, the paper's nine first; clean has its own column."""
    labels = dict.fromkeys(label for ranking in rankings for label in ranking.labels)
    labels.pop("clean", None)
    return [*(name for name in NINE if name in labels), *(x for x in labels if x not in NINE)]


def _label_column(label: str) -> BoardColumn:
    return BoardColumn(
        key=f"under-{label}", heading=label.replace("_", " "), is_shown=False, is_number=True
    )


def _cell(key: str, line: Standing, ranking: Ranking) -> BoardCell:
    row = line.row
    values: Mapping[str, BoardCell] = {
        "rank": BoardCell(
            text="–" if line.rank is None else str(line.rank),
            detail=line.reason or f"of {line.rivals}",
            order=line.rank,
        ),
        "agent": BoardCell(text=row.agent, order=row.agent.lower()),
        "inputs": BoardCell(text=line.inputs, order=line.inputs),
        "setting": BoardCell(text=ranking.title, order=ranking.title),
        "corrupted": BoardCell(
            text=formatting.percent(row.corrupted),
            detail=formatting.interval(row.corrupted_low, row.corrupted_high),
            order=row.corrupted,
        ),
        "clean": BoardCell(text=formatting.percent(row.clean), order=row.clean),
        "retention": BoardCell(
            text=formatting.percent(row.retention),
            detail=formatting.retention_interval(row.retention_low, row.retention_high),
            order=row.retention,
        ),
        "worst": BoardCell(
            text=formatting.percent(row.worst_success),
            detail=line.worst.replace("_", " "),
            order=row.worst_success,
        ),
        "average": BoardCell(text=formatting.percent(row.paper_average), order=row.paper_average),
        "steps": BoardCell(text=formatting.number(row.steps), order=row.steps),
        "usd": BoardCell(text=formatting.money(row.usd), order=row.usd),
        "played": _date_cell(line),
        "run": BoardCell(text=line.path, order=line.path),
        "version": _text(line.run.versions.get(PACKAGE, "")),
    }
    if key in values:
        return values[key]
    if key.startswith("under-"):
        return _success_cell(key.removeprefix("under-"), line, ranking)
    return _text(ranking.facts.get(key, ""))


def _success_cell(label: str, line: Standing, ranking: Ranking) -> BoardCell:
    if label not in ranking.labels:
        return BoardCell(text="")
    index = ranking.labels.index(label)
    text = line.values[index]
    if not text:
        return BoardCell(text="")
    return BoardCell(text=text, order=float(text), share=line.shares[index])


def _date_cell(line: Standing) -> BoardCell:
    created = line.run.created
    if created is None:
        return BoardCell(text="")
    return BoardCell(text=f"{datetime.fromtimestamp(created, UTC):%Y-%m-%d}", order=created)


def _text(text: str) -> BoardCell:
    return BoardCell(text=text, order=text or None)
