"""The tables of what a report tests beside success."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from . import formatting
from .model import Equivalence, MeasureChange, RunReport, SeverityCurve


class FurtherTable(NamedTuple):
    """A table; the first two columns are agent and condition.

    Attributes:
        title: what it shows.
        headings: of the columns.
        rows: texts.
    """

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]


def further_tables(report: RunReport) -> Iterator[FurtherTable]:
    """Yield the tables of a report that have rows."""
    if report.curves:
        yield _curve_table(report.curves)
    if report.equivalences:
        yield _equivalence_table(report.equivalences)
    if report.measures:
        yield _measure_table(report.measures)


def _curve_table(curves: Sequence[SeverityCurve]) -> FurtherTable:
    levels = sorted({level for curve in curves for level in curve.levels})
    headings = (
        *("agent", "corruption", *(f"level {level}, %" for level in levels)),
        *("area, %", "95 %", "loss", "95 %", "CE, %"),
    )
    rows = [
        (
            curve.agent,
            curve.corruption,
            *_by_level(curve, levels),
            formatting.percent(curve.area),
            formatting.interval(curve.area_low, curve.area_high),
            formatting.percent(curve.delta, "+"),
            formatting.interval(curve.delta_low, curve.delta_high, "+"),
            formatting.percent(curve.ce),
        )
        for curve in curves
    ]
    title = "success by severity; area and loss are means over levels 1 to 5"
    return FurtherTable(title, headings, rows)


def _by_level(curve: SeverityCurve, levels: Sequence[int]) -> list[str]:
    success = dict(zip(curve.levels, curve.success, strict=True))
    return [formatting.percent(success.get(level)) for level in levels]


def _equivalence_table(rows: Sequence[Equivalence]) -> FurtherTable:
    return FurtherTable(
        f"no more than {100 * rows[0].margin:g} points lost (one-sided, Gaffke; Holm)",
        ("agent", "corruption", "tasks", "lost", "p"),
        [
            (
                row.agent,
                row.corruption,
                str(row.tasks),
                formatting.percent(row.loss, "+"),
                formatting.p_value(row.p),
            )
            for row in rows
        ],
    )


def _measure_table(rows: Sequence[MeasureChange]) -> FurtherTable:
    return FurtherTable(
        "an episode, clean and corrupted (paired t over tasks; Holm by measure)",
        ("agent", "corruption", "measure", "tasks", "clean", "corrupted", "change", "95 %", "p"),
        [
            (
                row.agent,
                row.corruption,
                row.measure,
                str(row.tasks),
                f"{row.mean_clean:.4g}",
                f"{row.mean_corrupted:.4g}",
                f"{row.change:+.3g}",
                _ends(row.change_low, row.change_high),
                formatting.p_value(row.p),
            )
            for row in rows
        ],
    )


def _ends(low: float | None, high: float | None) -> str:
    return "" if low is None or high is None else f"[{low:+.3g}, {high:+.3g}]"
