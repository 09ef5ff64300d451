"""Results of other benchmarks and harnesses: what a reader yields, and how a run is made of it.

A reader turns one source into `EpisodeOutcome`s, or into `OutcomeBatch`es of many; `collect_run`
makes a `Run` of them, which every report, comparison and format then takes. Tasks are the cases and
seeds repeat them. What is not an outcome (an error of the harness, a missing result) has no score,
and is never counted as 0.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from hijack_data.choices import CLEAN
from hijack_data.entries import Lazy
from hijack_data.errors import HijackError, quantity, shorten_list, suggest
from hijack_data.surrogates import has_half

from .episode_columns import EpisodeColumns, Integers, OutcomeColumns
from .outcome_formats import AMOUNTS, FIELDS, READERS
from .reading import Run

TaskNumbers: TypeAlias = npt.NDArray[np.integer]

RESULTS = "results"  # the kind of a run that was made of outcomes
READ_WITH = "read_with"  # in its configuration: the arguments that `collect_run` read it with


class OutcomeError(HijackError, ValueError):
    """Results that cannot be read or paired; the message has the remedy."""


class PairingError(OutcomeError):
    """Conditions that were not played on the same tasks.

    Args:
        difference: which tasks are of one condition alone.
        remedy: how they can be reported nevertheless.
    """

    def __init__(self, difference: str, remedy: str) -> None:
        super().__init__(f"{difference}; {remedy}")
        self.difference = difference


@dataclass(frozen=True, kw_only=True, slots=True)
class EpisodeOutcome:
    """One episode of an agent, wherever it was played.

    Attributes:
        agent: its name.
        task: the task; outcomes of one task resemble each other, and it is one case.
        condition: what was done to the agent's desktop, such as `clean` or `marks`.
        score: 0..1; `None` if the episode has no outcome.
        seed: which repetition of the task it is; `None` if the source does not say.
        problem: why there is no score; empty if there is one.
        version: of the harness that played it, with its name; empty if the source does not say.
        content: what identifies the content of the task, such as a checksum; empty if the source
            does not say.
        steps: actions of the agent; `None` if the source does not say, as for the next two.
        tokens: that its models read and wrote, cached ones included.
        cost: of its models, in USD.
    """

    agent: str
    task: str
    condition: str
    score: float | None
    seed: int | None = None
    problem: str = ""
    version: str = ""
    content: str = ""
    steps: float | None = None
    tokens: float | None = None
    cost: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class OutcomeBatch:
    """Many episodes in columns; the attributes are those of `EpisodeOutcome`.

    Attributes:
        agents: of each episode.
        tasks: of each.
        conditions: of each.
        scores: of each.
        seeds: of each; `None` if the source has no seeds.
        problems: why an episode has no score, by its position; for every `None` in `scores`.
        amounts: steps, tokens and cost of each, as far as the source has them, by name.
    """

    agents: Sequence[str]
    tasks: Sequence[str]
    conditions: Sequence[str]
    scores: Sequence[float | None]
    seeds: Sequence[int] | None
    problems: Mapping[int, str]
    amounts: Mapping[str, Sequence[float | None]] = field(
        default_factory=dict[str, Sequence[float | None]]
    )


class OutcomeReader(Protocol):
    """Reads the results of one format.

    Attributes:
        fields: those of `FIELDS` that `columns` may name.
    """

    fields: Sequence[str]

    def detect(self, source: Path) -> bool:
        """Return whether a file or folder is of this format, from names and first bytes."""
        ...

    def read(
        self, source: Path, columns: Mapping[str, str]
    ) -> Iterator[EpisodeOutcome] | Iterator[OutcomeBatch]:
        """Yield the outcomes of a source.

        Args:
            source: the file or folder.
            columns: where the source has each of `FIELDS`; those left out are where the format has
                them.

        Raises:
            OutcomeError: something in it is no result; the message names the place.
        """
        ...


def is_result(source: Path) -> bool:
    """Return whether a reader takes a source."""
    return any(Lazy(reference).load()().detect(source) for reference in READERS.values())


def find_reader(source: Path, name: str | None = None) -> OutcomeReader:
    """Return the reader of a source, or the one with a name.

    Raises:
        OutcomeError: no reader takes the source, or none has the name.
    """
    if name is not None:
        if name not in READERS:
            raise OutcomeError(f"--from: no reader {name!r}{suggest(name, READERS)}")
        return Lazy(READERS[name]).load()()
    for reference in READERS.values():
        reader: OutcomeReader = Lazy(reference).load()()
        if reader.detect(source):
            return reader
    report = source / "report.json"
    if report.exists():
        raise OutcomeError(f"{source}: is not the folder of a run; give {report}")
    raise OutcomeError(
        f"{source}: is not the folder of a run (hijack bench and hijack score make one), no table"
        " (.csv, .jsonl, .parquet), no log of Inspect (.eval, .json), no job of Harbor, no study of"
        " AgentLab, no run of cua-bench, no trajectory in ATIF, and no folder of OSWorld with a"
        " result.txt for each task; name the columns of a table with"
        " --columns task=,condition=,agent=,score="
    )


def collect_run(
    sources: Sequence[Path],
    *,
    reader: str | None = None,
    columns: Mapping[str, str] = MappingProxyType({}),
    clean: str = CLEAN,
    common_tasks: bool = False,
    unpaired: bool = False,
) -> Run:
    """Read several files and folders together, and return them as one run.

    Args:
        sources: files and folders.
        reader: the name of the reader; by default each source is asked what it is.
        columns: where the sources have each of `FIELDS`.
        clean: the condition that the others are compared with.
        common_tasks: compare over the tasks that clean and corrupted conditions share, instead of
            refusing sets of tasks that differ.
        unpaired: compare the conditions as samples of different tasks.

    Raises:
        OutcomeError: a source cannot be read, there is no outcome, or conditions cannot be paired.
    """
    for number, source in enumerate(sources):
        if not source.exists():
            raise OutcomeError(f"{source}: is not there")
        if any(source.resolve() == earlier.resolve() for earlier in sources[:number]):
            raise OutcomeError(f"{source}: is given twice; its results would count as repetitions")
    run = merge_outcomes(
        {str(source): _read(source, reader, columns) for source in sources},
        folder=sources[0],
        name=" and ".join(source.name for source in sources[:2])
        + (f" and {len(sources) - 2} more" if len(sources) > 2 else ""),
        clean=clean,
        common_tasks=common_tasks,
        unpaired=unpaired,
    )
    read_with = {"reader": reader, "columns": dict(columns), "clean": clean}
    return replace(run, config={**run.config, READ_WITH: read_with})


def _read(
    source: Path, reader: str | None, columns: Mapping[str, str]
) -> Iterator[EpisodeOutcome] | Iterator[OutcomeBatch]:
    """Return the outcomes of a source.

    Raises:
        OutcomeError: no reader takes it, or the reader cannot be told where it has a field.
    """
    chosen = find_reader(source, reader)
    for name in columns:
        if name not in chosen.fields:
            raise OutcomeError(
                f"{source}: --columns {name}= is not for this format, which takes"
                f" {', '.join(chosen.fields)}; write the results to a table for other columns"
            )
    return chosen.read(source, columns)


def merge_outcomes(
    outcomes: Mapping[str, Iterable[EpisodeOutcome | OutcomeBatch]],
    *,
    folder: Path,
    name: str,
    clean: str = CLEAN,
    common_tasks: bool = False,
    unpaired: bool = False,
) -> Run:
    """Return the outcomes of one or several sources as one run.

    Args:
        outcomes: those of each source, by its name.
        folder: of the run; a report reads nothing from it.
        name: of what was read, for titles.
        clean: as for `collect_run`, as are the others.
        common_tasks: likewise.
        unpaired: likewise.

    Raises:
        OutcomeError: as for `collect_run`.
    """
    if common_tasks and unpaired:
        raise OutcomeError("--unpaired compares different tasks, --common-tasks the same; give one")
    collected = _Collected()
    starts: list[int] = []
    for listed in outcomes.values():
        starts.append(len(collected.columns))
        for outcome in listed:
            collected.add(outcome)
    if not len(collected.columns):
        raise OutcomeError(f"{', '.join(outcomes)}: no results in it")
    origin = _Origin(list(outcomes), starts)
    episodes = collected.columns.columns()
    _check_names(episodes, origin)
    episodes = _rename_clean(episodes, clean)
    if len(outcomes) > 1 and not unpaired:
        _check_task_names(episodes.tasks)
    _check_unique(episodes, origin)
    merged = _merged_cells(episodes, starts)
    tasks = _tasks_by_cell(episodes)
    if unpaired:
        _check_unpaired(tasks)
    else:
        episodes = _pair_tasks(episodes, tasks, common_tasks)
    reordered: Sequence[str] = ()
    if unpaired:
        episodes = replace(episodes, paired=False)
    else:
        episodes, reordered = _match_seeds(episodes)
    conditions = [episodes.conditions[number] for number in _in_order(episodes.condition)]
    return Run(
        folder=folder,
        config={
            "kind": RESULTS,
            "source": name,
            "agents": [episodes.agents[number] for number in _in_order(episodes.agent)],
            "corruptions": sorted(conditions, key=lambda label: label != CLEAN),
            "merged": merged,
            "left_out_by_common_tasks": len(collected.columns) - len(episodes)
            if common_tasks
            else None,
            "seeds_matched_in_order": list(reordered),
            "versions": {name: sorted(users) for name, users in sorted(collected.versions.items())},
        },
        records=episodes,
    )


class _Collected:
    """The outcomes of all sources.

    Attributes:
        columns: the outcomes.
        versions: agents and conditions by the version of the harness that played them.
    """

    def __init__(self) -> None:
        self.columns = OutcomeColumns()
        self.versions: dict[str, set[str]] = {}
        self._contents: dict[str, tuple[str, str]] = {}

    def add(self, outcome: EpisodeOutcome | OutcomeBatch) -> None:
        """Add an outcome, or many.

        Raises:
            OutcomeError: a task of the same name has other content.
        """
        if isinstance(outcome, OutcomeBatch):
            self.columns.extend(
                agents=outcome.agents,
                tasks=outcome.tasks,
                conditions=outcome.conditions,
                scores=outcome.scores,
                seeds=outcome.seeds,
                problems=outcome.problems,
                amounts=outcome.amounts,
            )
            return
        condition = f"{outcome.agent} under {outcome.condition}"
        if outcome.version:
            self.versions.setdefault(outcome.version, set()).add(condition)
        content, first = self._contents.setdefault(outcome.task, (outcome.content, condition))
        if outcome.content != content:
            raise OutcomeError(
                f"the task {outcome.task} is not the same for {condition} as for {first}: its"
                f" content is {outcome.content or 'not stated'} and {content or 'not stated'}; play"
                " both on one version of the task, or name another column with --columns task="
            )
        self.columns.extend(
            agents=[outcome.agent],
            tasks=[outcome.task],
            conditions=[outcome.condition],
            scores=[outcome.score],
            seeds=[outcome.seed],
            problems={} if outcome.score is not None else {0: outcome.problem},
            amounts={
                name: [value] for name in AMOUNTS if (value := getattr(outcome, name)) is not None
            },
        )


def parse_columns(text: str) -> dict[str, str]:
    """Return the columns in `task=ID,score=reward`, by field.

    Raises:
        OutcomeError: it has another form, or a field is unknown or there twice.
    """
    columns: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        field, sign, column = part.partition("=")
        if field not in FIELDS:
            raise OutcomeError(f"--columns: no field {field!r}{suggest(field, FIELDS)}")
        if not sign or not column:
            raise OutcomeError(f"--columns: {part!r} is not FIELD=COLUMN, such as task=task_id")
        if field in columns:
            raise OutcomeError(f"--columns: names the {field} twice: {text!r}; remove one")
        columns[field] = column
    return columns


def _rename_clean(episodes: EpisodeColumns, clean: str) -> EpisodeColumns:
    """Return the episodes with the condition `clean` under the name that reports know.

    Raises:
        OutcomeError: there is no such condition, or another has that name.
    """
    conditions = episodes.conditions
    if clean == CLEAN:
        return episodes
    if clean not in conditions:
        raise OutcomeError(f"--clean: no condition {clean!r}{suggest(clean, list(conditions))}")
    if CLEAN in conditions:
        raise OutcomeError(
            f"--clean {clean}: the results have a condition named {CLEAN}, too; leave --clean out,"
            " or rename that condition"
        )
    names = tuple(CLEAN if name == clean else name for name in conditions)
    return replace(episodes, conditions=names)


def _check_task_names(names: Sequence[str]) -> None:
    """Check that tasks of several sources have names; numbers agree by chance.

    Raises:
        OutcomeError: all tasks are numbers.
    """
    if all(name.isdecimal() for name in names):
        raise OutcomeError(
            f"the tasks of the sources are numbers ({shorten_list(sorted(names), 3)}), which match"
            " by chance where they are positions in a list; name the column of their ids with"
            " --columns task=COLUMN, or put the results into one table"
        )


@dataclass(frozen=True)
class _Origin:
    """Where each episode was read.

    Attributes:
        sources: their names.
        starts: the position of the first episode of each.
    """

    sources: Sequence[str]
    starts: Sequence[int]

    def name(self, position: int) -> str:
        """Return the source of an episode, and which of its results it is."""
        number = bisect_right(self.starts, position) - 1
        return f"{self.sources[number]}: result {position - self.starts[number] + 1}"


def _check_names(episodes: EpisodeColumns, origin: _Origin) -> None:
    """Check that names do not differ unseen: by spaces around them, or conditions by capitals.

    Raises:
        OutcomeError: one does, or cannot be written.
    """
    for what, names, numbers in (
        ("agent", episodes.agents, episodes.agent),
        ("condition", episodes.conditions, episodes.condition),
        ("task", episodes.tasks, episodes.task),
    ):
        for number, name in enumerate(names):
            if name == name.strip() != "" and not has_half(name):
                continue
            place = origin.name(int(np.argmax(numbers == number)))
            problem = "holds half of a surrogate pair"
            if not name.strip():
                problem = "is empty"
            elif name != name.strip():
                problem = "begins or ends with a space; remove it"
            raise OutcomeError(f"{place}: the {what} {name!r} {problem}")
    spellings: dict[str, str] = {}
    for name in episodes.conditions:
        other = spellings.setdefault(name.lower(), name)
        if other != name:
            raise OutcomeError(
                f"the conditions {other!r} and {name!r} differ in capital letters alone; write one"
                " of them everywhere"
            )


def _check_unique(episodes: EpisodeColumns, origin: _Origin) -> None:
    """Check that no outcome is there twice.

    Raises:
        OutcomeError: one is.
    """
    at = episodes.find_repeat(episodes.number_cases())
    if at is not None:
        record = episodes[at]
        raise OutcomeError(
            f"{origin.name(at)}: {record['agent']} has two results of the task {record['task']}"
            f" under {record['corruption']} with seed {record['seed']}; remove one, or name the"
            " column that tells repetitions apart with --columns seed=COLUMN"
        )


def _merged_cells(episodes: EpisodeColumns, starts: Sequence[int]) -> list[str]:
    """Return the agents and conditions that several sources have on the same tasks.

    Args:
        episodes: of all sources.
        starts: the position of the first episode of each source.
    """
    keys = episodes.agent.astype(np.int64) * len(episodes.conditions) + episodes.condition
    keys = keys * len(episodes.tasks) + episodes.task
    merged: dict[str, None] = {}
    earlier_cells = np.zeros(0, np.int64)
    for source in np.split(keys, starts[1:]) if len(starts) > 1 else ():
        cells = np.unique(source)
        for cell in np.unique(np.intersect1d(cells, earlier_cells) // len(episodes.tasks)).tolist():
            agent, condition = divmod(cell, len(episodes.conditions))
            merged[f"{episodes.agents[agent]} under {episodes.conditions[condition]}"] = None
        earlier_cells = np.union1d(earlier_cells, cells)
    return list(merged)


def _in_order(numbers: TaskNumbers) -> list[int]:
    """Return each number once, in the order of first appearance."""
    values, first = np.unique(numbers, return_index=True)
    return values[np.argsort(first)].tolist()


def _tasks_by_cell(episodes: EpisodeColumns) -> dict[str, dict[str, TaskNumbers]]:
    """Return the numbers of the tasks of each condition of each agent, in ascending order."""
    tasks: dict[str, dict[str, TaskNumbers]] = {}
    for (agent, label), cell in episodes.cells().items():
        tasks.setdefault(agent, {})[label] = np.unique(episodes.task[cell.positions])
    return tasks


def _pair_tasks(
    episodes: EpisodeColumns, tasks: Mapping[str, Mapping[str, TaskNumbers]], common_tasks: bool
) -> EpisodeColumns:
    """Return the episodes whose conditions can be compared task by task.

    Raises:
        PairingError: the conditions of an agent have other tasks, and `common_tasks` is not asked
            for; or they share none.
        OutcomeError: no task is left.
    """
    mask = np.ones(len(episodes), np.bool_)
    for agent, by_label in tasks.items():
        shared = _shared(by_label)
        base = by_label.get(CLEAN)
        for label, numbers in by_label.items():
            if base is None or np.array_equal(numbers, base):
                continue
            difference = _difference(episodes, agent, label, numbers, base)
            remedy = "--unpaired compares them as samples of different tasks"
            if not np.intersect1d(numbers, base).size:
                raise PairingError(difference, f"they share none, and {remedy}")
            if not common_tasks:
                raise PairingError(
                    difference,
                    f"--common-tasks reports the {quantity(len(shared), 'task')} that all"
                    f" conditions have, {remedy}",
                )
        if common_tasks and not len(shared):
            raise OutcomeError("--common-tasks: the conditions share no task")
        if common_tasks:
            is_agent = episodes.agent == episodes.agents.index(agent)
            mask &= ~is_agent | np.isin(episodes.task, shared)
    return episodes if mask.all() else episodes.take(mask)


def _shared(by_label: Mapping[str, TaskNumbers]) -> TaskNumbers:
    """Return the tasks that all conditions have."""
    first, *further = by_label.values()
    for numbers in further:
        first = np.intersect1d(first, numbers)
    return first


def _check_unpaired(tasks: Mapping[str, Mapping[str, TaskNumbers]]) -> None:
    """Check that conditions that are to be compared as unpaired have other tasks than clean.

    Raises:
        OutcomeError: one has the same; taken as unpaired its interval would be too wide.
    """
    for agent, by_label in tasks.items():
        base = by_label.get(CLEAN)
        for label, numbers in by_label.items():
            if label != CLEAN and base is not None and np.array_equal(numbers, base):
                raise OutcomeError(
                    f"--unpaired: {agent} was played on the same"
                    f" {quantity(len(numbers), 'task')} clean and under {label}; leave --unpaired"
                    " out, pairs tell more"
                )


def _match_seeds(episodes: EpisodeColumns) -> tuple[EpisodeColumns, Sequence[str]]:
    """Return the episodes, with the seeds of clean where a condition has none of them.

    Seeds are repetitions of a task. If a condition of an agent shares no seed with the clean one,
    its first repetition of each task gets the seed of the first clean one, and so on. The seeds of
    the other conditions stay, so that their pairs do.

    Returns:
        The episodes, and the agents some of whose conditions got other seeds.
    """
    cells = episodes.cells()
    matched: dict[str, None] = {}
    seed = episodes.seed.copy()
    for (agent, _), cell in cells.items():
        clean = cells.get((agent, CLEAN))
        if clean is None:
            continue
        if not np.intersect1d(episodes.seed[cell.positions], episodes.seed[clean.positions]).size:
            matched[agent] = None
            seed[cell.positions] = _seeds_by_rank(episodes, cell.positions, clean.positions)
    return (replace(episodes, seed=seed) if matched else episodes), tuple(matched)


def _seeds_by_rank(episodes: EpisodeColumns, positions: Integers, clean: Integers) -> Integers:
    """Return for each episode at `positions` the seed of the clean one of its task and rank.

    One without such a clean episode gets a seed that no episode has.
    """
    ranks, clean_ranks = episodes.rank_in_task(positions), episodes.rank_in_task(clean)
    most = int(max(ranks.max(), clean_ranks.max())) + 1
    keys = episodes.task[positions].astype(np.int64) * most + ranks
    clean_keys = episodes.task[clean].astype(np.int64) * most + clean_ranks
    order = np.argsort(clean_keys)
    at = np.searchsorted(clean_keys, keys, sorter=order).clip(max=len(clean) - 1)
    has_partner = clean_keys[order][at] == keys
    unused = np.setdiff1d(np.arange(len(np.unique(episodes.seed)) + most), episodes.seed)
    return np.where(has_partner, episodes.seed[clean[order][at]], unused[ranks])


def _difference(
    episodes: EpisodeColumns, agent: str, label: str, numbers: TaskNumbers, base: TaskNumbers
) -> str:
    """Return how the tasks of a condition differ from those of the clean one."""
    parts = [
        f"{quantity(len(only), 'task')} only {condition}"
        f" ({shorten_list(sorted(episodes.tasks[number] for number in only.tolist()), 3)})"
        for only, condition in (
            (np.setdiff1d(numbers, base), f"under {label}"),
            (np.setdiff1d(base, numbers), "clean"),
        )
        if len(only)
    ]
    return f"{agent} was not played on the same tasks: {', '.join(parts)}"
