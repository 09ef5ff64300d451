"""The title of a report, and its conclusion: a sentence on each agent.

Both are computed from the numbers of the report, so every format that shows them says the same.
"""

from collections.abc import Sequence

from hijack_data.errors import quantity
from hijack_data.plan import CLEAN

from ..results.intervals import TOLERANCE
from ..results.scores import can_infer
from . import formatting
from .model import AgentSummary, Cell, RunReport

MAX_NAMED_AGENTS = 2  # in a title
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def report_title(report: RunReport) -> str:
    """Return who was played on what, such as `pixel on embedded_core`."""
    agents = list(report.agents)
    who = " and ".join(agents)
    if not agents or len(agents) > MAX_NAMED_AGENTS:
        who = quantity(len(agents), "agent")
    return f"{who} on {suite_name(report)}"


def suite_name(report: RunReport) -> str:
    """Return the name of the configuration or dataset that was played, else that of the run."""
    name = report.run.source.removeprefix("benchmark/")
    return name.removesuffix(".yaml").removesuffix(".yml") or report.run.name


def report_extent(report: RunReport) -> str:
    """Return how much was played: tasks, conditions, seeds and episodes."""
    run = report.run
    unit = "row" if run.kind == "score" else "episode"
    parts = [quantity(run.tasks, "task"), quantity(len(report.labels), "condition")]
    if run.kind != "score":
        parts.append(quantity(len(run.seeds), "seed"))
    parts.append(f"{quantity(sum(row.n for row in report.summaries), unit)} that count")
    return ", ".join(parts)


def conclude(report: RunReport) -> list[str]:
    """Return a sentence on each agent: its worst corruption, and which losses are shown."""
    return [f"{_name(row)}: {_conclude_agent(report, row)}." for row in report.summaries]


def _name(row: AgentSummary) -> str:
    inputs = formatting.privileged_inputs(row.given)
    return f"{row.agent} (given {inputs})" if inputs else row.agent


def _conclude_agent(report: RunReport, row: AgentSummary) -> str:
    cells = [cell for cell in report.cells if cell.agent == row.agent]
    corrupted = [cell for cell in cells if cell.corruption != CLEAN and cell.success is not None]
    if not corrupted:
        clean = "" if row.clean is None else f"solves {formatting.percent(row.clean)} % clean; "
        return f"{clean}no corruption was played"
    compared = [cell for cell in corrupted if cell.delta is not None]
    worst = report.worst_corruptions(row.agent)
    if not compared:
        return f"{_worst_success(corrupted, worst)}; without clean episodes no loss is known"
    if not any(cell.success for cell in cells):
        return "solves nothing, clean or corrupted, so no loss can be seen"
    if row.clean == 0:
        return "solves nothing clean, so no loss can be seen"
    return f"{_worst_loss(compared, worst)}; {_significance(compared)}"


def _worst_success(cells: Sequence[Cell], worst: Sequence[str]) -> str:
    if not worst:
        return f"solves {formatting.percent(cells[0].success)} % under each corruption"
    (cell, *_) = [cell for cell in cells if cell.corruption in worst]
    return f"worst under {join(worst)}, solves {formatting.percent(cell.success)} %"


def _worst_loss(cells: Sequence[Cell], worst: Sequence[str]) -> str:
    """Return the loss under the worst corruptions, with the interval of the first of them."""
    compared = [cell for cell in cells if cell.corruption in worst] or list(cells)
    cell = min(compared, key=lambda cell: cell.delta or 0.0)
    if (cell.delta or 0.0) > -TOLERANCE:
        return f"loses nothing under its {quantity(len(cells), 'corruption')}"
    if not worst:
        scope = f"each of its {_number(len(cells))} corruptions"
        return f"loses {_loss(cell)} under {cell.corruption if len(cells) == 1 else scope}"
    tied = [item for item in compared if item.delta == cell.delta]
    names = [item.corruption for item in tied]
    suffix = " each" if len(tied) > 1 else ""
    return f"worst under {join(names)}, loses {_loss(cell)}{suffix}"


def _loss(cell: Cell) -> str:
    """Return a loss in points, with its interval."""
    loss = -(cell.delta or 0.0)
    number = _points(loss)
    text = f"{number} point{'' if number == '1' else 's'}"
    if cell.delta_low is None or cell.delta_high is None:
        return text
    return f"{text} [{_points(-cell.delta_high)}, {_points(-cell.delta_low)}]"


def _points(share: float) -> str:
    """Return a difference in whole points, with a digit after the point if it is below one."""
    return f"{100 * share:z.0f}" if abs(share) >= 0.01 or not share else f"{100 * share:z.1f}"


def _significance(cells: Sequence[Cell]) -> str:
    """Return how many losses and gains the test shows."""
    losses = [cell for cell in cells if (cell.delta or 0.0) < -TOLERANCE]
    gains = [cell for cell in cells if (cell.delta or 0.0) > TOLERANCE]
    if any(cell.p is None for cell in cells):
        lack = "with a single task" if can_infer() else "without scipy"
        return f"whether this is chance is not known {lack}"
    shown_count = sum(_is_shown(cell) for cell in losses)
    parts = [_count_losses(len(losses), shown_count)] if losses else []
    shown_gains = [cell.corruption for cell in gains if _is_shown(cell)]
    if shown_gains:
        parts.append(f"does better than clean under {join(shown_gains)}, which is shown")
    if not losses:
        parts.append("a loss too small for so few tasks may be there unseen")
    return ", ".join(parts)


def _count_losses(losses: int, shown_count: int) -> str:
    if losses == 1:
        return "this only loss is shown" if shown_count else "this only loss may be chance"
    if shown_count == losses:
        return "both losses are shown" if losses == 2 else f"all {_number(losses)} losses are shown"
    if not shown_count and losses == 2:
        return "neither of its two losses is shown, they may be chance"
    if not shown_count:
        return f"none of its {_number(losses)} losses is shown, they may be chance"
    verb = "is" if shown_count == 1 else "are"
    return (
        f"{_number(shown_count)} of {_number(losses)} losses {verb} shown,"
        f" {_number(losses - shown_count)} may be chance"
    )


def _is_shown(cell: Cell) -> bool:
    return cell.p is not None and cell.p < formatting.SIGNIFICANT_P


def _number(count: int) -> str:
    return _NUMBERS[count] if count < len(_NUMBERS) else str(count)


def join(names: Sequence[str]) -> str:
    """Return names as a list in words: `a, b and c`."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
