"""The data of a report, which every format shows and `report.json` stores.

All shares (success, retention, differences ...) are fractions, not percent. A value that does not
exist is `None`: an interval without scipy, a difference without a clean condition.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from types import UnionType
from typing import Any, TypeVar, cast, get_args, get_type_hints

from hijack_data.errors import HijackError, short_repr
from hijack_data.file_io import check_versioned
from hijack_data.runs.amounts import MAX_AMOUNT
from hijack_data.runs.run_log import GIVEN_KINDS

FORMAT = "agenthijack-report"
VERSION = 1
T = TypeVar("T")
UNPAIRED_NOTE = (
    "Unpaired: each agent was played clean and corrupted on different tasks. Differences and ratios"
    " are of two means, their intervals Newcombe's and Donner and Zou's for independent samples of"
    " tasks, and p is of Welch's t test over tasks."
)
_SHARES = frozenset(
    [
        *("success", "ci_low", "ci_high", "p", "ceiling"),
        *("clean", "corrupted", "corrupted_low", "corrupted_high", "worst_success"),
        *("nine", "paper_average", "margin", "area", "area_low", "area_high"),
    ]
)
_CHANGES = frozenset({"delta", "delta_low", "delta_high", "loss"})
_AMOUNT_CHANGES = frozenset({"change", "change_low", "change_high"})
YEAR_10000 = 253_402_300_800  # in seconds since 1970
_ROUNDING = 1e-9  # rounding tolerance: a mean may exceed its range by this much
# Keys of the file that are not fields of the report.
_EXTRA_KEYS = ("format", "version", "comparison", "paper")


class ReportError(HijackError, ValueError):
    """A report that cannot be made, or a file that is not a report; the message has the remedy."""


@dataclass(frozen=True, kw_only=True)
class RunIdentity:
    """The run of a report, and how it was played.

    Attributes:
        name: of the run's folder.
        kind: `bench` or `score`; `results` for results of other harnesses.
        source: name of the configuration or of its file, or of the dataset's folder; no path,
            which would mean nothing elsewhere.
        head_sha256: of `run.json`, as 64 hexadecimal digits; empty for a log without a head.
        setting_sha256: of what was played (tasks, conditions, seeds, steps, desktop, recovery
            policy ...), the agents apart: agents of runs with the same one may be ranked.
        created: when the run began, in seconds since 1970.
        versions: of Python, the system and the packages that played it.
        provider: what gave the desktops; empty for a scoring run.
        recovery: the recovery policy; empty where there is none.
        guard: what watched every agent; empty for nothing.
        max_steps: actions until an episode is cut off.
        seeds: of variants and of the corruptions' draws.
        tasks: how many tasks there are, whatever their variants.
        corruptions: the corruption's name by label, `clean` included.
        settings: what differs from the corruption's defaults, by label.
        changed: labels whose parameters are not the defaults, which are the paper's.
        planned: cases that were to be run.
        missing: of them, cases without a record.
        damaged: lines that could not be read.
        early: episodes with a score that ended before their corruption was due, in all cells.
        left_out: seeds that the report was told to leave out.
    """

    name: str
    kind: str
    source: str = ""
    head_sha256: str = ""
    setting_sha256: str = ""
    created: float | None = None
    versions: Mapping[str, str] = field(default_factory=dict[str, str])
    provider: str = ""
    recovery: str = ""
    guard: str = ""
    max_steps: int | None = None
    seeds: tuple[int, ...] = ()
    tasks: int = 0
    corruptions: Mapping[str, str] = field(default_factory=dict[str, str])
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    changed: tuple[str, ...] = ()
    planned: int = 0
    missing: int = 0
    damaged: int = 0
    early: int = 0
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Cell:
    """An agent under one condition.

    Attributes:
        agent: its name.
        corruption: the label of the condition; `clean` for none.
        n: episodes that count for the agent.
        tasks: tasks that they belong to; intervals and tests rest on these.
        success: mean score.
        ci_low: lower end of its 95 % interval.
        ci_high: upper end.
        delta: mean difference to clean over the cases that have both.
        delta_low: lower end of its interval.
        delta_high: upper end.
        p: of the exact sign-flip test over the tasks of these cases, adjusted for the agent's
            corruptions (Holm).
        retention: ratio to clean over the same cases.
        retention_low: lower end of its interval.
        retention_high: upper end; `None`, too, if it is unbounded.
        detectable: the smallest true difference to clean that as many tasks would show with a
            power of 80 %.
        pass_hat: for k = 1, 2, ..., the probability that k seeds of one task are all solved.
        ceiling: success of the agent `recovering` under the same condition in the same run.
        steps: actions an episode.
        seconds: duration of an episode.
        malformed: share of the actions that were none.
        requests: to models, in all episodes.
        input_tokens: read by models.
        output_tokens: written by models.
        usd: what they cost.
        errors: episodes of `n` without a score.
        invalid: episodes that say nothing about the agent, and are not in `n`.
        early: episodes of `n` with a score that ended before the corruption was due.
    """

    agent: str
    corruption: str
    n: int
    tasks: int = 0
    success: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    delta: float | None = None
    delta_low: float | None = None
    delta_high: float | None = None
    p: float | None = None
    retention: float | None = None
    retention_low: float | None = None
    retention_high: float | None = None
    detectable: float | None = None
    pass_hat: tuple[float, ...] = ()
    ceiling: float | None = None
    steps: float | None = None
    seconds: float | None = None
    malformed: float | None = None
    requests: int | None = None
    input_tokens: int | None = None
    output_tokens: int | None = None
    usd: float | None = None
    errors: int = 0
    invalid: int = 0
    early: int = 0


@dataclass(frozen=True, kw_only=True)
class AgentSummary:
    """An agent over all its conditions.

    Attributes:
        agent: its name.
        n: episodes that count for it.
        given: beside instruction and pictures, in all episodes or in some, of
            `run_log.GIVEN_KINDS`; `None` if no record says.
        clean: success without corruption.
        conditions: how many corruptions it was played under.
        corrupted: mean success over them.
        corrupted_low: lower end of its 95 % interval.
        corrupted_high: upper end.
        retention: share of its clean success that it keeps, over all cases that have both.
        retention_low: lower end of its interval.
        retention_high: upper end; `None`, too, if it is unbounded.
        worst: the first label under which it does worst; `RunReport.worst_corruptions` returns
            all. `None` if no corruption is worse than another.
        worst_success: the least success under a corruption.
        nine: mean success over the paper's nine; `None` unless all nine are there.
        paper_average: the paper's "Average", over the nine and clean, ten columns; likewise.
        mce: mean ratio of its errors to those of the reference agent, over the corruptions that
            both have (mean corruption error of Hendrycks and Dietterich, 2019).
        ceiling: mean success of the agent `recovering` over the same corruptions.
        steps: actions an episode.
        seconds: duration of an episode.
        malformed: share of the actions that were none.
        requests: to models.
        input_tokens: read by models.
        output_tokens: written by models.
        usd: what they cost.
        errors: episodes of `n` without a score.
        invalid: episodes that say nothing about it.
    """

    agent: str
    n: int
    given: tuple[str, ...] | None = None
    clean: float | None = None
    conditions: int = 0
    corrupted: float | None = None
    corrupted_low: float | None = None
    corrupted_high: float | None = None
    retention: float | None = None
    retention_low: float | None = None
    retention_high: float | None = None
    worst: str | None = None
    worst_success: float | None = None
    nine: float | None = None
    paper_average: float | None = None
    mce: float | None = None
    ceiling: float | None = None
    steps: float | None = None
    seconds: float | None = None
    malformed: float | None = None
    requests: int | None = None
    input_tokens: int | None = None
    output_tokens: int | None = None
    usd: float | None = None
    errors: int = 0
    invalid: int = 0


@dataclass(frozen=True, kw_only=True)
class MeasureChange:
    """What an agent spends, or scores in part, under a condition, beside the same cases clean.

    Each task counts once. The interval and p are those of the paired t test over tasks.

    Attributes:
        agent: its name.
        corruption: the label of the condition.
        measure: `score`, `steps`, `seconds`, `tokens` or `usd`, an episode.
        tasks: with the measure under both conditions.
        mean_clean: its mean, clean.
        mean_corrupted: its mean under the condition.
        change: the difference.
        change_low: lower end of its 95 % interval; `None` with fewer than three tasks, or if all
            differ by the same amount.
        change_high: upper end, likewise.
        p: two-sided, adjusted for the conditions of the agent and the measure (Holm).
    """

    agent: str
    corruption: str
    measure: str
    tasks: int
    mean_clean: float
    mean_corrupted: float
    change: float
    change_low: float | None = None
    change_high: float | None = None
    p: float | None = None


@dataclass(frozen=True, kw_only=True)
class Equivalence:
    """Whether a condition is shown to cost no more than a margin (a test of non-inferiority).

    Attributes:
        agent: its name.
        corruption: the label of the condition.
        margin: the loss, a share, that is refuted.
        tasks: the cases of the test.
        loss: mean of the tasks' losses.
        p: one-sided, by Gaffke's method, adjusted for the conditions of the agent (Holm).
    """

    agent: str
    corruption: str
    margin: float
    tasks: int
    loss: float
    p: float


@dataclass(frozen=True, kw_only=True)
class SeverityCurve:
    """Success of an agent by the severity of a corruption.

    Attributes:
        agent: its name.
        corruption: the name of the corruption.
        levels: those that were played, of 1 to 5, each once.
        success: the success at each.
        area: mean success over the five levels; `None` unless all were played.
        area_low: lower end of its 95 % interval.
        area_high: upper end.
        delta: mean difference to clean over the five levels, likewise.
        delta_low: lower end of its interval.
        delta_high: upper end.
        ce: sum of the errors divided by that of the reference agent (the corruption error of
            Hendrycks and Dietterich, 2019); `None` without one, or if it has no errors.
    """

    agent: str
    corruption: str
    levels: tuple[int, ...]
    success: tuple[float, ...]
    area: float | None = None
    area_low: float | None = None
    area_high: float | None = None
    delta: float | None = None
    delta_low: float | None = None
    delta_high: float | None = None
    ce: float | None = None


@dataclass(frozen=True, kw_only=True)
class AppSuccess:
    """An agent in one application.

    Attributes:
        agent: its name.
        app: the application, as tasks name it; `several` for tasks with more than one, empty for
            tasks that name none.
        tasks: how many tasks there are, whatever their variants.
        clean: mean score without corruption.
        corrupted: mean score of all episodes with a corruption.
    """

    agent: str
    app: str
    tasks: int
    clean: float | None = None
    corrupted: float | None = None


@dataclass(frozen=True, kw_only=True)
class DisturbedCount:
    """How many episodes of an agent were disturbed at all.

    Attributes:
        agent: its name.
        n: episodes with a corruption that count for it.
        disturbed: of them, those in which it acted on a changed picture or after an effect.
        unknown: of them, those of which only the steps would tell, which are not there.
        lost: of the disturbed ones, those that scored less than the same case clean.
    """

    agent: str
    n: int
    disturbed: int
    unknown: int
    lost: int


@dataclass(frozen=True, kw_only=True)
class LossCause:
    """A cause of lost episodes, under one condition in one application; see `causes.RULES`.

    Attributes:
        agent: the agent.
        corruption: the label.
        app: the application, as in `AppSuccess`.
        cause: one of `causes.CAUSES`.
        n: lost episodes with this cause.
        turns: the steps where they turned, in ascending order, of those whose step is known.
    """

    agent: str
    corruption: str
    app: str
    cause: str
    n: int
    turns: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """The report of a run.

    Attributes:
        run: which run it is.
        cells: a row for each agent and condition, in the order of the configuration.
        summaries: a row for each agent.
        feasible: the cells of the feasible tasks; empty if all tasks are.
        infeasible: the cells of the infeasible tasks.
        applications: a row for each agent and application; empty if all tasks have the same one.
        measures: a row for each agent, corruption and measure that the records have.
        equivalences: a row for each agent and corruption.
        curves: a row for each agent and corruption that was played at several severities.
        disturbed: a row for each agent that played corrupted episodes; empty unless causes were
            asked for.
        causes: why disturbed episodes were lost; likewise.
        parts: for a scoring run, the results other than the success (`scoring.parts.part_rows`).
        reference: the reference agent of `mce`; empty for none.
        notes: sentences that a reader has to know.
    """

    run: RunIdentity
    cells: tuple[Cell, ...] = ()
    summaries: tuple[AgentSummary, ...] = ()
    feasible: tuple[Cell, ...] = ()
    infeasible: tuple[Cell, ...] = ()
    applications: tuple[AppSuccess, ...] = ()
    measures: tuple[MeasureChange, ...] = ()
    equivalences: tuple[Equivalence, ...] = ()
    curves: tuple[SeverityCurve, ...] = ()
    disturbed: tuple[DisturbedCount, ...] = ()
    causes: tuple[LossCause, ...] = ()
    parts: tuple[Mapping[str, Any], ...] = ()
    reference: str = ""
    notes: tuple[str, ...] = ()

    @property
    def agents(self) -> tuple[str, ...]:
        """The agents, in their order."""
        return tuple(dict.fromkeys(cell.agent for cell in self.cells))

    @property
    def is_paired(self) -> bool:
        """Whether conditions were compared case by case, not as samples of different tasks."""
        return UNPAIRED_NOTE not in self.notes

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of the conditions, in their order."""
        order = [label for label in self.run.corruptions if self._has(label)]
        return tuple(dict.fromkeys([*order, *(cell.corruption for cell in self.cells)]))

    def cell(self, agent: str, label: str) -> Cell | None:
        """Return the cell of an agent under a condition, or `None` if it was not played."""
        for cell in self.cells:
            if (cell.agent, cell.corruption) == (agent, label):
                return cell
        return None

    def worst_corruptions(self, agent: str) -> tuple[str, ...]:
        """The labels under which an agent does worst; none if none is worse than another."""
        from ..results.scores import worst_labels  # numpy: `hijack report --help` does without it

        cells = [cell for cell in self.cells if cell.agent == agent]
        success = {cell.corruption: cell.success for cell in cells if cell.success is not None}
        return worst_labels(success)

    def to_data(self) -> dict[str, Any]:
        """Return the report as JSON data, with its format and version."""
        return {"format": FORMAT, "version": VERSION, **asdict(self)}

    def _has(self, label: str) -> bool:
        return any(cell.corruption == label for cell in self.cells)


def from_data(data: object, source: str) -> RunReport:
    """Return the report that `RunReport.to_data` gave; `source` begins the messages.

    Raises:
        ReportError: the data are not a report, are of a newer version, or lack a field.
    """
    document = check_versioned(
        data,
        format=FORMAT,
        version=VERSION,
        source=source,
        description="a report",
        error=ReportError,
    )
    values = {key: value for key, value in document.items() if key not in _EXTRA_KEYS}
    try:
        json.dumps(values, ensure_ascii=False, allow_nan=False).encode()
    except ValueError as error:
        problem = f"holds what JSON does not have ({str(error)[:100]})"
        raise ReportError(f"{source}: {problem}; make the report again") from None
    return _make_dataclass(RunReport, values, source)


def _make_dataclass(kind: type[T], data: object, location: str) -> T:
    """Return a dataclass made from JSON data, after checking every field.

    Raises:
        ReportError: The data are not an object, or a field is missing or unknown.
    """
    if not isinstance(data, dict):
        raise ReportError(
            f"{location}: must be an object, got {short_repr(data)}; make the report again"
        )
    hints = get_type_hints(kind)
    names = {entry.name for entry in fields(kind)}  # type: ignore[arg-type]
    unknown = sorted(map(str, data.keys() - names))
    if unknown:
        raise ReportError(f"{location}: unknown field {unknown[0]!r}; make the report again")
    values = {key: _convert(hints[key], value, f"{location}: {key}") for key, value in data.items()}
    for key, value in values.items():
        _check_range(key, value, f"{location}: {key}")
    try:
        return kind(**values)
    except TypeError as error:
        raise ReportError(f"{location}: {error}; make the report again") from None


def _check_range(key: str, value: object, location: str) -> None:
    """Check the content of a field that is used for ranking agents or drawing pages.

    Raises:
        ReportError: the value is out of range, or of an unknown kind.
    """
    problem = ""
    if isinstance(value, int | float):
        low = -1 if key in _CHANGES else 0
        if key in _AMOUNT_CHANGES:
            low = -MAX_AMOUNT
        high = 1 if key in _CHANGES | _SHARES else MAX_AMOUNT
        if key == "created":
            high = YEAR_10000 - 1
        if not low - _ROUNDING <= value <= high + _ROUNDING:
            problem = f"must be from {low} to {high}"
    elif key == "given" and isinstance(value, tuple) and not set(GIVEN_KINDS).issuperset(value):
        problem = f"must be among {', '.join(GIVEN_KINDS)}"
    elif key == "settings" and not _holds_objects(value):
        problem = "must hold the parameters of each label"
    if problem:
        raise ReportError(f"{location}: {problem}, got {short_repr(value)}; make the report again")


def _holds_objects(value: object) -> bool:
    parameters = cast("Mapping[str, object]", value)
    return all(isinstance(item, dict) for item in parameters.values())


def _convert(hint: Any, value: object, location: str) -> Any:
    """Convert a value to the type of its field.

    Raises:
        ReportError: The value has another type.
    """
    arguments = get_args(hint)
    if isinstance(hint, UnionType):
        return None if value is None else _convert(arguments[0], value, location)
    if getattr(hint, "__origin__", None) is tuple:
        if not isinstance(value, list | tuple):
            raise ReportError(
                f"{location}: must be a list, got {short_repr(value)}; make the report again"
            )
        return tuple(_convert(arguments[0], item, location) for item in value)
    if is_dataclass(hint):
        return _make_dataclass(hint, value, location)  # type: ignore[arg-type]
    expected = getattr(hint, "__origin__", hint)
    if expected is float and isinstance(value, int) and not isinstance(value, bool):
        return float(max(-2 * MAX_AMOUNT, min(value, 2 * MAX_AMOUNT)))  # out of range stays so
    if isinstance(value, bool) or not isinstance(value, expected):
        name = getattr(expected, "__name__", expected)
        raise ReportError(
            f"{location}: must be {name}, got {short_repr(value)}; make the report again"
        )
    if isinstance(value, Mapping) and arguments and arguments[1] is not Any:
        return {
            key: _convert(arguments[1], entry, f"{location}: {key}") for key, entry in value.items()
        }
    return value
