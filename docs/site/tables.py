"""The tables of benchmarks/RESULTS.md, as rows, and of the paper."""

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.proof.run_checks.field_checks import FIELDS

HERE = Path(__file__).resolve().parent
RESULTS = HERE.parents[1] / "benchmarks" / "RESULTS.md"


class NoTable(Exception):
    """A table that a chart is made of is not there."""


@dataclass
class Table:
    """A table of Markdown: the line before it, and its rows by column."""

    said: str = ""
    rows: list[dict[str, str]] = field(default_factory=list)


def tables(text: str) -> list[Table]:
    """Read all tables of a page."""
    items: list[Table] = []
    output, head = "", []
    for line in text.splitlines():
        if not line.startswith("|"):
            head = []
            output = line.strip() or output
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not head:
            head = cells
            items.append(Table(output))
        elif not re.fullmatch(r"[\s|:-]+", line):
            items[-1].rows.append(dict(zip(head, cells, strict=False)))
    return items


def section(title: str) -> str:
    """The text of a section of RESULTS.md.

    Raises:
        NoTable: there is no such section.
    """
    parts = RESULTS.read_text(encoding="utf-8").split("\n## ")
    for part in parts[1:]:
        if part.startswith(f"{title}\n"):
            return part
    raise NoTable(f"{RESULTS.name} has no section {title!r}; benchmarks/run.py writes it")


def table(title: str, *columns: str) -> Table:
    """The first table of a section that has some columns.

    Raises:
        NoTable: there is none.
    """
    for item in tables(section(title)):
        if item.rows and set(columns) <= set(item.rows[0]):
            return item
    raise NoTable(f"{RESULTS.name}, {title!r}: no table with the columns {', '.join(columns)}")


def number(text: str) -> float:
    """The first number in a cell; of `min / median / max` it is the minimum.

    Raises:
        NoTable: the cell holds none.
    """
    match = re.search(r"[-+]?\d[\d,]*\.?\d*", text)
    if match is None:
        raise NoTable(f"{text!r} holds no number")
    return float(match[0].replace(",", ""))


def paper() -> list[dict[str, str]]:
    """The paper's table of success rates in percent: an agent a row, a condition a column."""
    with (HERE / "paper.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def fields_of_a_run() -> str:
    """Every field of a run's files and what it is compared with, as a table."""
    rows = ["| in | is | fields |", "|---|---|---|"]
    for kind, checks in FIELDS.items():
        for check in dict.fromkeys(checks.values()):
            fields = " ".join(f"`{name}`" for name, value in checks.items() if value == check)
            rows.append(f"| `{kind}` | {check} | {fields} |")
    return "\n".join(rows)
