"""What a report tests beside success: other measures, equivalence, and curves of severity.

A task is one case in all of them, with the mean of its seeds.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from hijack_data.plan import CLEAN
from hijack_data.runs.amounts import is_amount

from ..results import scores
from ..results.episode_columns import CellEpisodes
from ..results.intervals import Floats64, number_tasks
from ..results.reading import ResultRecord
from .identity import severity_level
from .model import Equivalence, MeasureChange, RunIdentity, SeverityCurve

MARGIN = 0.05
LEVELS = (1, 2, 3, 4, 5)
MIN_TASKS = 3  # for an interval by t
Row = TypeVar("Row", MeasureChange, Equivalence)


def _amount(name: str) -> Callable[[ResultRecord], float | None]:
    def read(record: ResultRecord) -> float | None:
        value = record.get(name)
        return float(value) if is_amount(value) else None

    return read


def _tokens(record: ResultRecord) -> float | None:
    usage = record.get("usage")
    if not isinstance(usage, Mapping):
        return None
    counts = [usage.get("input_tokens"), usage.get("output_tokens")]
    return float(sum(filter(is_amount, counts))) if all(map(is_amount, counts)) else None


def _usd(record: ResultRecord) -> float | None:
    usage = record.get("usage")
    usd = usage.get("usd") if isinstance(usage, Mapping) else None
    return float(usd) if is_amount(usd) else None


# By name, how it is read from a record.
MEASURES: Mapping[str, Callable[[ResultRecord], float | None]] = {
    "score": scores.score_value,
    "steps": _amount("steps"),
    "seconds": _amount("seconds"),
    "tokens": _tokens,
    "usd": _usd,
}
# By name, which of `outcome_formats.AMOUNTS` it is in results of other harnesses.
_AMOUNT_NAMES = {"steps": "steps", "tokens": "tokens", "usd": "cost"}


def measure_changes(groups: scores.GroupedRecords) -> Iterator[MeasureChange]:
    """Yield the measures of each agent and corruption, as far as records have them.

    Scores are among them if some are neither 0 nor 1: p of the report takes these for not solved.
    Tokens and USD are of the last attempt at each case. Unpaired conditions have none.
    """
    if not scores.can_infer() or not groups.paired:
        return
    has_partial = any(_has_partial(cell) for cell in groups.scored.values())
    rows: list[MeasureChange] = []
    measures = [name for name in MEASURES if name != "score" or has_partial]
    values = {
        (key, name): groups.scored[key] if name == "score" else _values(cases, name)
        for key, cases in groups.last.items()
        for name in measures
    }
    for agent, label in groups.last:
        if label == CLEAN:
            continue
        for name in measures:
            clean = values.get(((agent, CLEAN), name), {})
            before, after, tasks = scores.pairs(clean, values[(agent, label), name])
            if len(tasks) and (any(before) or any(after)):
                means = _task_means(before, tasks), _task_means(after, tasks)
                rows.append(_measure_change(agent, label, name, *means))
    yield from _adjusted(rows, lambda row: (row.agent, row.measure))


def _has_partial(cell: scores.ScoreByCase) -> bool:
    values = np.asarray(scores.score_lists(cell)[0])
    return bool(((values > 0) & (values < 1)).any())


def _measure_change(
    agent: str, label: str, name: str, before: Floats64, after: Floats64
) -> MeasureChange:
    from ..results.statistics import paired_t

    test = paired_t((after - before).tolist()) if len(before) >= MIN_TASKS else None
    return MeasureChange(
        agent=agent,
        corruption=label,
        measure=name,
        tasks=len(before),
        mean_clean=float(before.mean()),
        mean_corrupted=float(after.mean()),
        change=float((after - before).mean()),
        change_low=test.low if test else None,
        change_high=test.high if test else None,
        p=test.p if test else None,
    )


def equivalence_tests(groups: scores.GroupedRecords, margin: float) -> Iterator[Equivalence]:
    """Yield for each agent and corruption whether no more than a margin is lost.

    Args:
        groups: the records.
        margin: a share, above 0 and below 1.
    """
    if not scores.can_infer() or not groups.paired:
        return
    from ..results.mean_bounds import mean_p_value

    rows: list[Equivalence] = []
    for agent, label in groups.scored:
        before, after, tasks = scores.pairs_in_cell((agent, label), groups)
        if not len(tasks):
            continue
        changes = _task_means(after, tasks) - _task_means(before, tasks)
        rows.append(
            Equivalence(
                agent=agent,
                corruption=label,
                margin=margin,
                tasks=len(changes),
                loss=-float(changes.mean()),
                p=mean_p_value(changes + margin, margin - 1),
            )
        )
    yield from _adjusted(rows, lambda row: (row.agent,))


def severity_curves(
    identity: RunIdentity, groups: scores.GroupedRecords, reference: str
) -> Iterator[SeverityCurve]:
    """Yield a curve for each agent and corruption that was played at several severities.

    Args:
        identity: of the run; it has the parameters of each label.
        groups: its records.
        reference: the reference agent of the corruption error; empty for none.
    """
    agents = list(dict.fromkeys(agent for agent, _ in groups.scored))
    for name, labels in _severity_labels(identity).items():
        for agent in agents:
            cells = {
                level: groups.scored[agent, label]
                for level, label in labels.items()
                if groups.scored.get((agent, label))
            }
            if len(cells) > 1:
                curve = SeverityCurve(
                    agent=agent,
                    corruption=name,
                    levels=tuple(cells),
                    success=tuple(
                        float(np.mean(scores.score_lists(cell)[0])) for cell in cells.values()
                    ),
                    ce=_corruption_error(agent, reference, list(labels.values()), groups),
                )
                is_whole = tuple(cells) == LEVELS and scores.can_infer()
                clean = groups.scored.get((agent, CLEAN), {})
                yield _with_area(curve, list(cells.values()), clean) if is_whole else curve


def _severity_labels(identity: RunIdentity) -> dict[str, dict[int, str]]:
    """Return by corruption the first label of each level, in the order of the levels."""
    labels: dict[str, dict[int, str]] = {}
    for label, name in identity.corruptions.items():
        if label in identity.settings:
            level = severity_level(name, identity.settings[label])
            if level is not None:
                labels.setdefault(name, {}).setdefault(level, label)
    return {name: dict(sorted(levels.items())) for name, levels in labels.items()}


def _with_area(
    curve: SeverityCurve, cells: Sequence[scores.ScoreByCase], clean: scores.ScoreByCase
) -> SeverityCurve:
    """Return a curve of all five levels with its area, and with the loss over it."""
    from ..results.statistics import difference_interval, grand_mean_interval

    area = grand_mean_interval([scores.score_lists(cell) for cell in cells])
    curve = replace(curve, area=area.value, area_low=area.low, area_high=area.high)
    before: list[float] = []
    after: list[float] = []
    tasks: list[str] = []
    for cell in cells:
        pairs = scores.pairs(clean, cell)
        for column, values in zip((before, after, tasks), pairs, strict=True):
            column += list(values)  # type: ignore[operator]
    if not tasks:
        return curve
    delta = difference_interval(before, after, tasks)
    return replace(curve, delta=delta.value, delta_low=delta.low, delta_high=delta.high)


def _corruption_error(
    agent: str, reference: str, labels: Iterable[str], groups: scores.GroupedRecords
) -> float | None:
    """Return the sum of an agent's errors over that of the reference agent's."""
    shared = [
        (groups.scored[agent, label], groups.scored[reference, label])
        for label in labels
        if groups.scored.get((agent, label)) and groups.scored.get((reference, label))
    ]
    errors, reference_errors = (
        sum(1 - float(np.mean(scores.score_lists(pair[index])[0])) for pair in shared)
        for index in (0, 1)
    )
    return errors / reference_errors if reference_errors else None


def _values(cases: scores.Cases, name: str) -> scores.ScoreByCase:
    """Return a measure of each case that counts and has it."""
    if isinstance(cases, CellEpisodes):
        return cases.amounts(_AMOUNT_NAMES[name]) if name in _AMOUNT_NAMES else {}
    read = MEASURES[name]
    values = {case: read(record) for case, record in cases.items() if scores.counts(record)}
    return {case: value for case, value in values.items() if value is not None}


def _task_means(values: Sequence[float], tasks: Sequence[Hashable]) -> Floats64:
    """Return the mean of each task, float64 `[tasks]`, in the order of first appearance."""
    numbers = number_tasks(tasks)
    return np.bincount(numbers, weights=values) / np.bincount(numbers)


def _adjusted(rows: Sequence[Row], family: Callable[[Row], tuple[str, ...]]) -> Iterator[Row]:
    """Yield rows with p adjusted for the conditions of their family (Holm)."""
    from ..results.statistics import holm

    tests: dict[tuple[str, ...], dict[str, float]] = {}
    for row in rows:
        if row.p is not None:
            tests.setdefault(family(row), {})[row.corruption] = row.p
    adjusted = {name: holm(p_values) for name, p_values in tests.items()}
    for row in rows:
        yield row if row.p is None else replace(row, p=adjusted[family(row)][row.corruption])
