"""The paper's ablations in a report: levels of a corruption, and agents without a module.

Conditions of one corruption that differ in the same parameters are the levels of an ablation, such
as three values of `scale`. The identity of the run lists these parameters.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from hijack_data.plan import CLEAN

from . import formatting
from .model import Cell, RunReport

# Agents by the module that they lack; the paper's "necessity of each module".
MODULES: Mapping[str, Mapping[str, str]] = {
    "pixel_onlooker": {
        "pixel": "no onlooker",
        "pixel_onlooker_no_check": "no check",
        "pixel_onlooker_no_summary": "no summary",
        "pixel_onlooker": "all modules",
    },
    "agenthijack-agent": {
        "agenthijack-agent-no-rl": "no RL",
        "agenthijack-agent-no-onlooker": "no onlooker",
        "agenthijack-agent-no-check": "no check",
        "agenthijack-agent-no-summary": "no summary",
        "agenthijack-agent": "all modules",
    },
}
# The paper's "different onlookers": one agent by the model that watches it.
ONLOOKERS: Mapping[str, Mapping[str, str]] = {
    "agenthijack-agent": {
        "agenthijack-agent": "its own model",
        "agenthijack-agent-onlooker-qwen2.5-vl-72b": "Qwen2.5-VL-72B",
        "agenthijack-agent-onlooker-qwen3-vl-235b": "Qwen3-VL-235B",
    }
}
Texts = Sequence[str]


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """Success by level and agent.

    Attributes:
        title: what is varied.
        levels: label of the condition and name of the level, in the order of the configuration.
        series: the agents, each with its name in this ablation.
    """

    title: str
    levels: tuple[tuple[str, str], ...]
    series: tuple[tuple[str, str], ...]


def find_ablations(report: RunReport) -> tuple[Ablation, ...]:
    """Return the ablations that a report holds; none if no corruption has several levels."""
    return (*_parameter_ablations(report), *_module_ablations(report))


def level_table(report: RunReport, ablation: Ablation) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of an ablation: a line per level, two columns per agent.

    If episodes ended before their corruption was due, a third column has how many did not: a level
    that comes late looks harmless where it rarely comes at all.
    """
    with_early = any(
        cell.early
        for agent, _ in ablation.series
        for label, _ in ablation.levels
        if (cell := report.cell(agent, label)) is not None
    )
    headings = ["level"]
    for _, name in ablation.series:
        headings += [f"{name}, %", "95 %"]
        if with_early:
            headings.append("disturbed")
    rows: list[Texts] = []
    for label, level in ablation.levels:
        row = [level]
        for agent, _ in ablation.series:
            row += _cell_figures(report.cell(agent, label), with_early)
        rows.append(row)
    return headings, rows


def _cell_figures(cell: Cell | None, with_early: bool) -> list[str]:
    if cell is None:
        return [""] * (3 if with_early else 2)
    figures = [formatting.percent(cell.success), formatting.interval(cell.ci_low, cell.ci_high)]
    if with_early:
        disturbed = "" if cell.corruption == CLEAN else f"{cell.n - cell.early} of {cell.n}"
        figures.append(disturbed)
    return figures


def _parameter_ablations(report: RunReport) -> Iterator[Ablation]:
    labels: dict[str, list[str]] = {}
    for label in report.labels:
        if label != CLEAN:
            labels.setdefault(report.run.corruptions.get(label, label), []).append(label)
    series = tuple((agent, agent) for agent in report.agents)
    for corruption, corruption_labels in labels.items():
        varied = {
            label: frozenset(report.run.settings.get(label, {})) for label in corruption_labels
        }
        for parameters in _largest_sets(varied.values()):
            levels = [label for label in corruption_labels if varied[label] <= parameters]
            if len(levels) < 2:
                continue
            level_names = [(label, _level(label, corruption)) for label in levels]
            clean = [(CLEAN, CLEAN)] if CLEAN in report.labels else []
            yield Ablation(
                title=f"{corruption}: {', '.join(sorted(parameters))}",
                levels=(*clean, *level_names),
                series=series,
            )


def _largest_sets(parameter_sets: Iterable[frozenset[str]]) -> list[frozenset[str]]:
    """Return the sets of parameters that are not subsets of others."""
    distinct = list(dict.fromkeys(parameter_sets))
    return [
        parameters
        for parameters in distinct
        if parameters and not any(parameters < superset for superset in distinct)
    ]


def _level(label: str, corruption: str) -> str:
    """Return the label without the name of its corruption."""
    short = label.removeprefix(corruption).strip("_-")
    return (short or label).replace("_", " ")


def _module_ablations(report: RunReport) -> Iterator[Ablation]:
    levels = tuple((label, label.replace("_", " ")) for label in report.labels)
    for kind, agents in (("modules", MODULES), ("onlookers", ONLOOKERS)):
        for agent, variants in agents.items():
            series = tuple((name, text) for name, text in variants.items() if name in report.agents)
            if agent in report.agents and len(series) > 2:
                yield Ablation(title=f"{kind} of {agent}", levels=levels, series=series)
