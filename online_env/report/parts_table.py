"""The table of a scoring run that stands below the report's."""

from collections.abc import Sequence

from hijack_data.cli.figure_table import FigureTable, grouped

from ..results.parts import REMINDER_COLUMNS, STEP_COLUMNS, PartsRow, part_rows
from ..results.reading import Run
from .identity import agent_names, corruptions_by_label

_COUNT_COLUMNS = ("hidden",)


def parts_table(run: Run) -> FigureTable | None:
    """Return the parts of a scoring run as a table; `None` for a live run."""
    question = str(run.config.get("question", "steps"))
    columns = {"steps": STEP_COLUMNS, "reminders": REMINDER_COLUMNS}.get(question, ())
    if not run.is_scored or not columns:
        return None
    return _table(_sort_rows(run, part_rows(run.records)), columns)


def _sort_rows(run: Run, rows: Sequence[PartsRow]) -> list[PartsRow]:
    """Return the rows in the order of the configuration."""
    agents = agent_names(run.config)
    labels = list(corruptions_by_label(run.config))

    def position(row: PartsRow) -> tuple[int, int]:
        label = row["corruption"]
        last = len(labels)
        label_position = labels.index(label) if label in labels else last
        agent = row["agent"]
        return agents.index(agent) if agent in agents else len(agents), label_position

    return sorted(rows, key=position)


def _table(rows: Sequence[PartsRow], columns: Sequence[str]) -> FigureTable:
    headings = [name.replace("_", " ") for name in ("n", *columns)]
    cells = [(row["agent"], row["corruption"], *_figures(row, columns)) for row in rows]
    return FigureTable("corruption", headings, grouped(cells), "right, in percent")


def _figures(row: PartsRow, columns: Sequence[str]) -> list[str]:
    return [str(row["n"]), *(_cell(name, row.get(name)) for name in columns)]


def _cell(name: str, value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if name in _COUNT_COLUMNS else f"{100 * value:.1f}"
