"""The figure of an ablation, one bar for each level and agent, as coordinates for the page.

All lengths are in units of the SVG's view box, and shared with `figures`.
"""

from dataclasses import dataclass

from . import formatting
from .ablations import Ablation
from .figures import BOTTOM, LEFT, RIGHT, TOP, WIDTH
from .model import RunReport

COLOURS = 5  # colours of the page for agents; with more agents they repeat
_BAR = 12.0
_GAP = 9.0  # between levels
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, kw_only=True)
class LevelBar:
    """One bar.

    Attributes:
        number: of its agent's colour, from 0.
        y: upper edge.
        width: its length.
        low: where its interval begins; `None` without one.
        high: where it ends.
        value: in words.
        title: the whole, in words, shown when the mouse rests on it.
    """

    number: int
    y: float
    width: float
    low: float | None
    high: float | None
    value: str
    title: str


@dataclass(frozen=True, kw_only=True)
class GroupedPanel:
    """The bars of an ablation.

    Attributes:
        names: of the agents, in the order of their colours.
        levels: the middle and the name of each level.
        bars: of all levels, from top to bottom.
        ticks: places and numbers of the axis.
        height: of the drawing.
        bar: height of a bar.
        width: of the drawing.
    """

    names: tuple[str, ...]
    levels: tuple[tuple[float, str], ...]
    bars: tuple[LevelBar, ...]
    ticks: tuple[tuple[float, str], ...]
    height: float
    bar: float = _BAR
    width: float = LEFT + WIDTH + RIGHT


def grouped_panel(report: RunReport, ablation: Ablation) -> GroupedPanel:
    """Return the figure of an ablation; an agent without a value at a level has no bar there."""
    group = len(ablation.series) * _BAR
    bars: list[LevelBar] = []
    levels: list[tuple[float, str]] = []
    for row, (label, level) in enumerate(ablation.levels):
        top = TOP + row * (group + _GAP)
        levels.append((top + group / 2, level))
        for number, (agent, name) in enumerate(ablation.series):
            cell = report.cell(agent, label)
            if cell is None or cell.success is None:
                continue
            between = formatting.interval(cell.ci_low, cell.ci_high)
            title = f"{name}, {level}: {formatting.percent(cell.success)} %"
            bar = LevelBar(
                number=number % COLOURS,
                y=top + number * _BAR,
                width=_x_position(cell.success),
                low=None if cell.ci_low is None else _x_position(cell.ci_low),
                high=None if cell.ci_high is None else _x_position(cell.ci_high),
                value=formatting.percent(cell.success),
                title=f"{title}, 95 % {between}" if between else title,
            )
            bars.append(bar)
    return GroupedPanel(
        names=tuple(name for _, name in ablation.series),
        levels=tuple(levels),
        bars=tuple(bars),
        ticks=tuple((_x_position(tick), f"{100 * tick:.0f}") for tick in _TICKS),
        height=TOP + len(ablation.levels) * (group + _GAP) + BOTTOM,
    )


def _x_position(share: float) -> float:
    return round(WIDTH * min(max(share, 0.0), 1.0), 2)
