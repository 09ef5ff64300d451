"""The table of a scoring run that stands below the report's."""

from collections.abc import Sequence
from typing import Any

from hijack_data.cli.figure_table import FigureTable, grouped
from hijack_data.runs.amounts import is_count

from ..results.parts import REMINDER_COLUMNS, STEP_COLUMNS, PartsRow, part_rows
from ..results.reading import Run
from .identity import agent_names, corruptions_by_label

_COUNTED = ("hidden",)


def show_parts(run: Run, screen: Any) -> None:
    """Print the parts of a scoring run, and what of the dataset is not in it."""
    rows = _sorted(run, part_rows(run.records))
    question = str(run.config.get("question", "steps"))
    columns = {"steps": STEP_COLUMNS, "reminders": REMINDER_COLUMNS}.get(question, ())
    if columns:
        screen.print("", _table(rows, columns), "", sep="\n")
    unscored = run.config.get("unscored")
    if is_count(unscored) and unscored:
        screen.print(f"{unscored} rows have an action of no known type and are not scored")
    unpaired = run.config.get("unpaired")
    if is_count(unpaired) and unpaired:
        screen.print(f"{unpaired} corrupted rows have no clean one: they are not in the delta")


def _sorted(run: Run, rows: Sequence[PartsRow]) -> list[PartsRow]:
    """Return the rows in the order of the configuration."""
    agents = agent_names(run.config)
    labels = list(corruptions_by_label(run.config))

    def place(row: PartsRow) -> tuple[int, int]:
        label = row["corruption"]
        last = len(labels)
        where = labels.index(label) if label in labels else last
        agent = row["agent"]
        return agents.index(agent) if agent in agents else len(agents), where

    return sorted(rows, key=place)


def _table(rows: Sequence[PartsRow], columns: Sequence[str]) -> FigureTable:
    headings = [name.replace("_", " ") for name in ("n", *columns)]
    shown = [(row["agent"], row["corruption"], *_figures(row, columns)) for row in rows]
    return FigureTable("corruption", headings, grouped(shown), "right, in percent")


def _figures(row: PartsRow, columns: Sequence[str]) -> list[str]:
    return [str(row["n"]), *(_cell(name, row.get(name)) for name in columns)]


def _cell(name: str, value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if name in _COUNTED else f"{100 * value:.1f}"
