"""Results of other harnesses in columns: millions of episodes in little memory.

`OutcomeColumns` collects them as a reader yields them; `EpisodeColumns` is what a `Run` holds. It
is a sequence of records like that of a run of this library, and makes each record when it is asked
for. A report computes on the columns.
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from math import nan
from types import MappingProxyType
from typing import Any, TypeAlias, overload

import numpy as np
import numpy.typing as npt

Integers: TypeAlias = npt.NDArray[np.int64]
Floats: TypeAlias = npt.NDArray[np.float64]
# Agent and corruption.
CellKey: TypeAlias = tuple[str, str]
# The key of paired episodes: the task, the seed of its variant and the seed of the corruption's
# draws.
PairKey: TypeAlias = tuple[str, Any, int]


class NameNumbers(dict[str, int]):
    """The number of each name, in the order in which they came."""

    def __missing__(self, name: str) -> int:
        number = self[name] = len(self)
        return number


class OutcomeColumns:
    """Collects outcomes; a column grows by a number for each.

    Attributes:
        agents: names of agents by their numbers, as are `conditions` and `tasks`.
        problems: why an outcome has no score, by its position.
    """

    def __init__(self) -> None:
        self.agents, self.conditions, self.tasks = NameNumbers(), NameNumbers(), NameNumbers()
        self.problems: dict[int, str] = {}
        self._agent, self._condition, self._task = array("i"), array("i"), array("i")
        self._seed, self._has_seed = array("q"), array("b")
        self._score = array("d")
        self._amounts: dict[str, array[float]] = {}

    def __len__(self) -> int:
        return len(self._score)

    def extend(
        self,
        *,
        agents: Sequence[str],
        conditions: Sequence[str],
        tasks: Sequence[str],
        scores: Sequence[float | None],
        seeds: Sequence[int | None] | None,
        problems: Mapping[int, str],
        amounts: Mapping[str, Sequence[float | None]] = MappingProxyType({}),
    ) -> None:
        """Add outcomes.

        Args:
            agents: of each outcome.
            conditions: of each outcome.
            tasks: of each outcome.
            scores: 0..1; `None` where there is no outcome.
            seeds: of each outcome; `None` where, or if, the source does not say.
            problems: why there is no score, by position in `scores`.
            amounts: what each outcome took, `None` where the source does not say, by name.

        Raises:
            OverflowError: A seed has more than 63 bits.
        """
        start = len(self)
        self._agent.extend(map(self.agents.__getitem__, agents))
        self._condition.extend(map(self.conditions.__getitem__, conditions))
        self._task.extend(map(self.tasks.__getitem__, tasks))
        if seeds is None:
            self._seed.frombytes(bytes(8 * len(scores)))
            self._has_seed.frombytes(bytes(len(scores)))
        else:
            self._seed.extend([seed or 0 for seed in seeds])
            self._has_seed.extend([seed is not None for seed in seeds])
        if problems:
            self.problems.update({start + at: problem for at, problem in problems.items()})
            scores = [nan if score is None else score for score in scores]
        self._score.extend(scores)  # type: ignore[arg-type]
        for name, values in amounts.items():
            column = self._amounts.setdefault(name, array("d", [nan]) * start)
            column.extend([nan if value is None else value for value in values])
        for column in self._amounts.values():
            column.extend(array("d", [nan]) * (len(self) - len(column)))

    def columns(self) -> "EpisodeColumns":
        """Return what was collected; outcomes without a seed are numbered, task by task."""
        agent, condition, task = (
            np.frombuffer(column, np.int32) if column else np.zeros(0, np.int32)
            for column in (self._agent, self._condition, self._task)
        )
        seed = np.array(self._seed, np.int64)
        unnumbered = np.flatnonzero(np.array(self._has_seed, np.int8) == 0)
        if unnumbered.size:
            groups = agent[unnumbered].astype(np.int64) * len(self.conditions)
            groups = (groups + condition[unnumbered]) * len(self.tasks) + task[unnumbered]
            seed[unnumbered] = _positions_in_group(groups)
        return EpisodeColumns(
            agents=tuple(self.agents),
            conditions=tuple(self.conditions),
            tasks=tuple(self.tasks),
            agent=agent,
            condition=condition,
            task=task,
            seed=seed,
            score=np.array(self._score, np.float64),
            problems=self.problems,
            amounts={name: np.array(column) for name, column in self._amounts.items()},
        )


def _positions_in_group(groups: Integers) -> Integers:
    """Return how many earlier items are of the same group, for each item."""
    order = np.argsort(groups, kind="stable")
    in_order = groups[order]
    starts = np.flatnonzero(np.r_[True, in_order[1:] != in_order[:-1]])
    lengths = np.diff(np.r_[starts, len(groups)])
    positions = np.empty(len(groups), np.int64)
    positions[order] = np.arange(len(groups)) - np.repeat(starts, lengths)
    return positions


@dataclass(frozen=True, eq=False, kw_only=True)
class EpisodeColumns(Sequence[dict[str, Any]]):
    """Episodes of other harnesses in columns; as a sequence, their records.

    Attributes:
        agents: names of agents.
        conditions: names of conditions.
        tasks: names of tasks.
        agent: the number of its agent for each episode, int32 `[episodes]`.
        condition: of its condition, likewise.
        task: of its task, likewise.
        seed: which repetition of the task it is, int64 `[episodes]`.
        score: 0..1, NaN if it has no outcome, float64 `[episodes]`.
        problems: why an episode has no outcome, by its position.
        amounts: what each episode took, NaN where the source does not say, float64 `[episodes]`, by
            the names in `outcome_formats.AMOUNTS`; those that no episode has are left out.
        paired: whether conditions are compared task by task; else as samples of different tasks.
    """

    agents: tuple[str, ...]
    conditions: tuple[str, ...]
    tasks: tuple[str, ...]
    agent: npt.NDArray[np.int32]
    condition: npt.NDArray[np.int32]
    task: npt.NDArray[np.int32]
    seed: Integers
    score: Floats
    problems: Mapping[int, str]
    amounts: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    paired: bool = True

    def __len__(self) -> int:
        return len(self.score)

    @overload
    def __getitem__(self, at: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, at: slice) -> list[dict[str, Any]]: ...
    def __getitem__(self, at: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        if isinstance(at, slice):
            return [self[position] for position in range(*at.indices(len(self)))]
        at = range(len(self))[at]
        record: dict[str, Any] = {
            "agent": self.agents[self.agent[at]],
            "task": self.tasks[self.task[at]],
            "corruption": self.conditions[self.condition[at]],
            "seed": int(self.seed[at]),
            "status": "ok",
            "score": float(self.score[at]),
        }
        if at in self.problems:
            name = f"{record['task']} under {record['corruption']}, seed {record['seed']}"
            record |= {
                "status": "invalid",
                "score": None,
                "id": f"{name}, {record['agent']}",
                "problem": self.problems[at],
            }
        return record

    def take(self, mask: npt.NDArray[np.bool_]) -> "EpisodeColumns":
        """Return the episodes for which `mask`, bool `[episodes]`, is true."""
        position = np.cumsum(mask) - 1
        return EpisodeColumns(
            agents=self.agents,
            conditions=self.conditions,
            tasks=self.tasks,
            agent=self.agent[mask],
            condition=self.condition[mask],
            task=self.task[mask],
            seed=self.seed[mask],
            score=self.score[mask],
            amounts={name: values[mask] for name, values in self.amounts.items()},
            paired=self.paired,
            problems={int(position[at]): why for at, why in self.problems.items() if mask[at]},
        )

    def rank_in_task(self, positions: Integers) -> Integers:
        """Return how many of the episodes at `positions` are of the same task with a lower seed."""
        order = np.lexsort((self.seed[positions], self.task[positions]))
        ranks = np.empty(len(positions), np.int64)
        ranks[order] = _positions_in_group(self.task[positions][order].astype(np.int64))
        return ranks

    def number_cases(self) -> Integers:
        """Return the number of the case (task and seed) of each episode, int64 `[episodes]`."""
        seeds, ranks = np.unique(self.seed, return_inverse=True)
        keys = self.task.astype(np.int64) * len(seeds) + ranks
        if len(self.tasks) * len(seeds) <= 4 * len(self) + 1024:
            return keys
        return np.unique(keys, return_inverse=True)[1].astype(np.int64)

    def find_repeat(self, cases: Integers) -> int | None:
        """Return the position of an episode that is there twice, or `None`.

        Args:
            cases: what `number_cases` returns.
        """
        keys = (self.agent.astype(np.int64) * len(self.conditions) + self.condition) * (
            int(cases.max(initial=0)) + 1
        ) + cases
        order = np.argsort(keys, kind="stable")
        twice = np.flatnonzero(keys[order][1:] == keys[order][:-1])
        return int(order[twice + 1].min()) if twice.size else None

    def cells(self) -> dict[CellKey, "CellEpisodes"]:
        """Return the episodes of each agent and condition, in the order of their first ones."""
        cases = self.number_cases()
        case_count = int(cases.max(initial=0)) + 1
        keys = self.agent.astype(np.int64) * len(self.conditions) + self.condition
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.r_[True, keys[order][1:] != keys[order][:-1]])
        groups = sorted(np.split(order, starts[1:]), key=lambda positions: int(positions[0]))
        return {
            (
                self.agents[self.agent[positions[0]]],
                self.conditions[self.condition[positions[0]]],
            ): CellEpisodes(self, positions, cases, case_count)
            for positions in groups
            if len(positions)
        }


class CellEpisodes(Mapping[PairKey, dict[str, Any]]):
    """The episodes of an agent under a condition; as a mapping, their records by case."""

    def __init__(
        self, columns: EpisodeColumns, positions: Integers, cases: Integers, case_count: int
    ) -> None:
        self.columns = columns
        self.positions = positions
        self._scored_positions = positions[~np.isnan(columns.score[positions])]
        self._cases = cases
        self._case_count = case_count
        self.scored = self._values(columns.score, self._scored_positions)
        self._by_case: dict[PairKey, int] | None = None

    def __len__(self) -> int:
        return len(self.positions)

    def __iter__(self) -> Iterator[PairKey]:
        return _case_keys(self.columns, self.positions)

    def __getitem__(self, case: PairKey) -> dict[str, Any]:
        if self._by_case is None:
            self._by_case = dict(zip(self, self.positions.tolist(), strict=True))
        return self.columns[self._by_case[case]]

    def amounts(self, name: str) -> "CellScores":
        """Return what the episodes with a score took, of those that say so.

        Args:
            name: one of `outcome_formats.AMOUNTS`.
        """
        values = self.columns.amounts.get(name)
        if values is None:
            return self._values(self.columns.score, self._scored_positions[:0])
        has_amount = ~np.isnan(values[self._scored_positions])
        return self._values(values, self._scored_positions[has_amount])

    def _values(self, values: Floats, positions: Integers) -> "CellScores":
        return CellScores(self.columns, values, positions, self._cases, self._case_count)


class CellScores(Mapping[PairKey, float]):
    """The scores, or amounts, of an agent under a condition in columns; as a mapping, by case.

    Attributes:
        tasks: the number of the task of each, int32 `[episodes]`.
        scores: 0..1, or amounts from 0 on, float64 `[episodes]`.
    """

    def __init__(
        self,
        columns: EpisodeColumns,
        values: Floats,
        positions: Integers,
        cases: Integers,
        case_count: int,
    ) -> None:
        self.tasks = columns.task[positions]
        self.scores = values[positions]
        self._columns = columns
        self._positions = positions
        self._cases = cases[positions]
        self._case_count = case_count
        self._by_case: dict[PairKey, float] | None = None

    def __len__(self) -> int:
        return len(self.scores)

    def __iter__(self) -> Iterator[PairKey]:
        return _case_keys(self._columns, self._positions)

    def __getitem__(self, case: PairKey) -> float:
        if self._by_case is None:
            self._by_case = dict(zip(self, self.scores.tolist(), strict=True))
        return self._by_case[case]

    def pair(self, earlier: "CellScores") -> tuple[Floats, Floats, npt.NDArray[np.int32]] | None:
        """Return both scores and the task of each case that `earlier` has, too.

        `None` if the two are not of the same columns.
        """
        if earlier._columns is not self._columns:
            return None
        index_by_case = np.full(self._case_count, -1, np.int64)
        index_by_case[earlier._cases] = np.arange(len(earlier))
        before = index_by_case[self._cases]
        has_both = before >= 0
        return earlier.scores[before[has_both]], self.scores[has_both], self.tasks[has_both]


def _case_keys(columns: EpisodeColumns, positions: Integers) -> Iterator[PairKey]:
    tasks = (columns.tasks[number] for number in columns.task[positions].tolist())
    return zip(tasks, repeat(None), columns.seed[positions].tolist(), strict=False)
