"""The rule by which a run ends before all its episodes are played: once a retention is shown.

Tasks are drawn in a random order, and one after the other is played whole: with all its seeds and
conditions. After each, a bet is settled (`mean_bounds.BettingSequence`), which holds the error rate
however often one looks. Only tasks before the first incomplete one count, so that tasks which end
sooner are not preferred.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data.errors import ParameterError
from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import UNTIL_RETENTION, draw_task_order

from .intervals import LEVEL
from .mean_bounds import BettingSequence
from .record_score import ResultRecord, counts, first_id, score_value


@dataclass(frozen=True, kw_only=True)
class StopRule:
    """When a run ends before all its episodes are played, as its configuration states.

    Attributes:
        retention: the retention that is to be shown, above 0 and below 1.
        confidence: the level, between 0.5 and 1.
        seed: of the order in which the tasks were drawn.
    """

    retention: float
    confidence: float = LEVEL
    seed: int = 0

    @classmethod
    def read(cls, config: Mapping[str, Any]) -> "StopRule | None":
        """Return the rule in a run's configuration; `None` if it has none.

        Raises:
            ParameterError: it is not a rule, or the run cannot have one.
        """
        data = config.get(UNTIL_RETENTION)
        if data is None:
            return None
        keys = ("retention", "confidence", "seed")
        if not isinstance(data, dict) or set(data) != set(keys):
            raise ParameterError(f"{UNTIL_RETENTION}: must have {', '.join(keys)}")
        keys = ("agents", "seeds", "corruptions")
        agents, seeds, corruptions = (
            names if isinstance(names := config.get(key), list) else [] for key in keys
        )
        if len(agents) != 1:
            raise ParameterError(
                f"{UNTIL_RETENTION}: a run that ends at a bound has one agent; give --agent NAME"
            )
        if not seeds or len(corruptions) < 2 or CLEAN not in corruptions:
            raise ParameterError(
                f"{UNTIL_RETENTION}: retention needs seeds, the clean condition and a corruption;"
                " see --seeds and --corruptions"
            )
        rule = cls(**data)
        tasks = config.get("tasks")
        if not isinstance(tasks, list) or tasks != list(draw_task_order(tasks, rule.seed)):
            raise ParameterError(
                f"{UNTIL_RETENTION}: tasks are not in the order that its seed draws"
            )
        return rule

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ParameterError: one is out of range.
        """
        for name, value, low in (
            ("retention", self.retention, 0.0),
            ("confidence", self.confidence, 0.5),
        ):
            if isinstance(value, bool) or not isinstance(value, int | float) or not low < value < 1:
                raise ParameterError(
                    f"{UNTIL_RETENTION}.{name} must be above {low:g} and below 1, got {value!r}"
                )

        if isinstance(self.seed, bool) or not isinstance(self.seed, int):
            raise ParameterError(f"{UNTIL_RETENTION}.seed must be an integer, got {self.seed!r}")

    def to_data(self) -> dict[str, Any]:
        """Return the rule as JSON data."""
        return {"retention": self.retention, "confidence": self.confidence, "seed": self.seed}

    @property
    def tasks_needed(self) -> int:
        """How many tasks show the retention if all are solved and nothing is lost."""
        count = 64
        while True:
            ones = np.ones(count)
            stop = BettingSequence(clean=ones, corrupted=ones).stop(self.retention, self.confidence)
            if stop is not None:
                return stop
            count *= 2

    def due_episodes(
        self, config: Mapping[str, Any], episodes: Sequence[str], records: Sequence[ResultRecord]
    ) -> tuple[str, ...]:
        """Return the ids of the episodes that a run needs: all of them until it may end."""
        stop = self.stop(config, episodes, records)
        return tuple(episodes if stop is None else episodes[: stop * _episodes_per_task(config)])

    def stop(
        self, config: Mapping[str, Any], episodes: Sequence[str], records: Sequence[ResultRecord]
    ) -> int | None:
        """Return after how many tasks a run may end; `None` if it goes on.

        Arguments as for `settle_bets`.
        """
        bets, _, _ = settle_bets(config, episodes, records)
        return bets.stop(self.retention, self.confidence)


class SequentialTest:
    """The test of a run while it is played.

    Args:
        rule: when the run ends.
        config: of the run.
        episodes: ids of all planned episodes, task by task.
        records: those so far.
    """

    def __init__(
        self,
        rule: StopRule,
        config: Mapping[str, Any],
        episodes: Sequence[str],
        records: Sequence[ResultRecord],
    ) -> None:
        self._rule = rule
        self._config = config
        self._episodes = episodes
        self._last = {first_id(record): record for record in records}
        self.is_over = self._stops()

    def add(self, record: ResultRecord) -> None:
        """Count an episode that has ended."""
        self._last[first_id(record)] = record
        self.is_over = self.is_over or self._stops()

    def _stops(self) -> bool:
        bets, _, _ = _settle(self._config, self._episodes, self._last)
        return bets.stop(self._rule.retention, self._rule.confidence) is not None


def settle_bets(
    config: Mapping[str, Any], episodes: Sequence[str], records: Sequence[ResultRecord]
) -> tuple[BettingSequence, int, tuple[str, ...]]:
    """Return the bets on the tasks that a run has played, in the order in which they were drawn.

    All conditions have one weight. An episode that says nothing about the agent counts as lost: 1
    clean, 0 corrupted.

    Args:
        config: of the run, which has one agent.
        episodes: ids of all planned episodes, task by task.
        records: all attempts, in their order.

    Returns:
        The bets, the number of episodes in them with a score, and the ids of those without.

    Raises:
        ParameterError: the episodes are not task by task.
    """
    return _settle(config, episodes, {first_id(record): record for record in records})


def _settle(
    config: Mapping[str, Any], episodes: Sequence[str], last: Mapping[str, ResultRecord]
) -> tuple[BettingSequence, int, tuple[str, ...]]:
    """Return what `settle_bets` does, of the last attempt at each episode, by its first id.

    Raises:
        ParameterError: as there.
    """
    size = _episodes_per_task(config)
    clean: list[float] = []
    corrupted: list[float] = []
    missing: list[str] = []
    for start in range(0, len(episodes), size):
        task = episodes[start : start + size]
        if any(name not in last for name in task):
            break
        values: tuple[list[float], list[float]] = [], []
        for name in task:
            is_clean = last[name]["corruption"] == CLEAN
            if not counts(last[name]):
                missing.append(name)
            score = score_value(last[name]) if counts(last[name]) else float(is_clean)
            values[not is_clean].append(score)
        if len(values[0]) != len(config["seeds"]):
            raise ParameterError(f"{UNTIL_RETENTION}: episodes are not task by task: {task[0]}")
        clean.append(float(np.mean(values[0])))
        corrupted.append(float(np.mean(values[1])))
    bets = BettingSequence(clean=np.array(clean), corrupted=np.array(corrupted))
    return bets, len(clean) * size - len(missing), tuple(missing)


def _episodes_per_task(config: Mapping[str, Any]) -> int:
    return len(config["seeds"]) * len(config["corruptions"])
