"""The table of a published page: what agents lose under each corruption, from the run's records.

The page marks its place with two comments, between which nothing is written by hand.
"""

from collections.abc import Sequence
from pathlib import Path

from hijack_data.files import write_atomic
from hijack_data.plan import CLEAN
from online_env.bench import scores
from online_env.bench.reading import Run
from online_env.report import words
from online_env.report.by_task import p_by_task
from online_env.report.cells import cells_of, compared
from online_env.report.model import Cell

AGENTS = {  # those of the columns, by the name of a result
    "all_tasks": ("pixel",),
    "reference_agents": ("pixel", "pixel_onlooker"),
}
BEGIN = "<!-- the table is made by benchmarks/published.py -->\n"
END = "<!-- end of the table -->\n"


def rewrite(page: Path, run: Run, agents: Sequence[str]) -> None:
    """Write the table of a run between the two comments of its page.

    Raises:
        ValueError: the page lacks one of the comments.
    """
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"{page}: has no place for the table; write {BEGIN}{END}where it belongs")
    write_atomic(page, f"{before}{BEGIN}\n{table(run, agents)}\n{END}{after}")


def table(run: Run, agents: Sequence[str]) -> str:
    """Return success, difference to clean and p of some agents, as Markdown.

    p is that of the exact test in which each task is one case, whatever its seeds.

    Args:
        run: the run, with records of each agent, clean and corrupted.
        agents: the agents, in the order of the columns.
    """
    groups = scores.grouped(run.records)
    cells = cells_of(run, groups)
    found = compared(cells, groups)
    tests = {agent: p_by_task(found[agent]) for agent in agents}
    by_key = {(cell.agent, cell.corruption): cell for cell in cells}
    titles = ["corruption"]
    for agent in agents:
        titles += [f"`{agent}`", "to clean, 95 %", "p"]
    lines = [_line(titles), "|---" * len(titles) + "|"]
    for label in dict.fromkeys(cell.corruption for cell in cells):
        row = [label]
        for agent in agents:
            row += _columns(by_key[agent, label], tests[agent].get(label))
        lines.append(_line(row))
    return "".join(f"{line}\n" for line in lines)


def _columns(cell: Cell, p: float | None) -> list[str]:
    success = words.percent(cell.success)
    if cell.corruption == CLEAN:
        return [success, "", ""]
    change = words.percent(cell.delta, "+")
    return [
        success,
        f"{change} {words.interval(cell.delta_low, cell.delta_high, '+')}",
        words.p_value(p),
    ]


def _line(row: Sequence[str]) -> str:
    return f"| {' | '.join(row)} |"
