"""The figures of a page: bars with intervals, as coordinates that the template draws as SVG.

A panel is one agent, a bar one condition. All lengths are in units of the SVG's view box.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hijack_data.plan import CLEAN

from ..results.scores import worst_labels
from . import formatting
from .model import Cell, RunReport

LEFT = 146.0  # width for the names of the conditions: 22 characters
WIDTH = 240.0  # of the bars
RIGHT = 46.0  # values
ROW = 24.0
TOP = 6.0
BOTTOM = 24.0  # numbers of the axis
_BAR = 13.0


@dataclass(frozen=True, kw_only=True)
class BarMark:
    """One bar.

    Attributes:
        label: the condition.
        kind: `clean`, `worst` or `other`, which have colours of their own.
        y: upper edge of the bar.
        width: its length.
        low: where its interval begins; `None` without one.
        high: where it ends.
        is_open: whether it goes on beyond the axis.
        mark: where the ceiling is; `None` without one.
        value: in words.
        title: the whole, in words, shown when the mouse rests on it.
    """

    label: str
    kind: str
    y: float
    width: float
    low: float | None
    high: float | None
    is_open: bool = False
    mark: float | None = None
    value: str
    title: str


@dataclass(frozen=True, kw_only=True)
class Panel:
    """The bars of an agent.

    Attributes:
        agent: its name.
        bars: from top to bottom.
        ticks: places and numbers of the axis.
        line: where the dashed line of the clean condition is; `None` without one.
        height: of the drawing.
        width: of the drawing.
    """

    agent: str
    bars: tuple[BarMark, ...]
    ticks: tuple[tuple[float, str], ...]
    line: float | None
    height: float
    width: float = LEFT + WIDTH + RIGHT


def success_panels(report: RunReport) -> list[Panel]:
    """Return success by condition, a panel for each agent; the line is its clean success."""
    panels: list[Panel] = []
    for agent in report.agents:
        cells = _cells(report, agent)
        clean = next((cell.success for cell in cells if cell.corruption == CLEAN), None)
        panels.append(_panel(agent, cells, _success_bar, clean, 1.0))
    return panels


def retention_panels(report: RunReport) -> list[Panel]:
    """Return retention by corruption; the line is at 100 percent. Agents without any are absent."""
    cells_by_agent = {
        agent: [cell for cell in _cells(report, agent) if cell.retention is not None]
        for agent in report.agents
    }
    end = _end([cell for cells in cells_by_agent.values() for cell in cells])
    return [
        _panel(agent, cells, _retention_bar, 1.0, end)
        for agent, cells in cells_by_agent.items()
        if cells
    ]


def _cells(report: RunReport, agent: str) -> list[Cell]:
    cells = (report.cell(agent, label) for label in report.labels)
    return [cell for cell in cells if cell is not None and cell.success is not None]


def _panel(
    agent: str,
    cells: Sequence[Cell],
    draw: Callable[[Cell, str, float, float], BarMark],
    line: float | None,
    end: float,
) -> Panel:
    corrupted = [cell for cell in cells if cell.corruption != CLEAN]
    success = {cell.corruption: cell.success for cell in cells if cell.success is not None}
    worst = worst_labels(success)
    bars: list[BarMark] = []
    for number, cell in enumerate(cells):
        kind = "clean" if cell.corruption == CLEAN else "other"
        if cell.corruption in worst and len(corrupted) > 1:
            kind = "worst"
        bars.append(draw(cell, kind, TOP + number * ROW + (ROW - _BAR) / 2, end))
    steps = [step / 100 for step in range(0, round(100 * end) + 1, 25)]
    return Panel(
        agent=agent,
        bars=tuple(bars),
        ticks=tuple((_x_position(step, end), f"{100 * step:.0f}") for step in steps),
        line=None if line is None else _x_position(line, end),
        height=TOP + len(cells) * ROW + BOTTOM,
    )


def _success_bar(cell: Cell, kind: str, y: float, end: float) -> BarMark:
    title = [f"{cell.corruption}: {formatting.percent(cell.success)} %"]
    if cell.ci_low is not None:
        title.append(f"95 % {formatting.interval(cell.ci_low, cell.ci_high)}")
    title.append(f"{cell.n} episodes of {cell.tasks} tasks")
    return BarMark(
        label=cell.corruption,
        kind=kind,
        y=y,
        width=_x_position(cell.success or 0.0, end),
        low=_maybe(cell.ci_low, end),
        high=_maybe(cell.ci_high, end),
        mark=_maybe(cell.ceiling, end),
        value=formatting.percent(cell.success),
        title=", ".join(title),
    )


def _retention_bar(cell: Cell, kind: str, y: float, end: float) -> BarMark:
    title = f"{cell.corruption}: keeps {formatting.percent(cell.retention)} % of its clean success"
    between = formatting.retention_interval(cell.retention_low, cell.retention_high)
    unbounded = cell.retention_low is not None and cell.retention_high is None
    return BarMark(
        label=cell.corruption,
        kind=kind,
        y=y,
        width=_x_position(cell.retention or 0.0, end),
        low=_maybe(cell.retention_low, end),
        high=WIDTH if unbounded else _maybe(cell.retention_high, end),
        is_open=unbounded or (cell.retention_high or 0.0) > end,
        value=formatting.percent(cell.retention),
        title=f"{title}, 95 % {between}" if between else title,
    )


def _end(cells: Sequence[Cell]) -> float:
    """Return where the axis of a retention ends: at 100, 125 or at most 150 percent."""
    ends = [max(cell.retention or 0.0, cell.retention_high or 0.0) for cell in cells]
    longest = max(ends, default=1.0)
    for end in (1.0, 1.25):
        if longest <= end:
            return end
    return 1.5


def _x_position(value: float, end: float) -> float:
    return round(WIDTH * min(max(value, 0.0), end) / end, 2)


def _maybe(value: float | None, end: float) -> float | None:
    return None if value is None else _x_position(value, end)
