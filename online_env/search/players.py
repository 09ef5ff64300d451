"""Who plays the corruptions that a search proposes: an agent live, or an agent over rows."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from hijack_data.errors import ParameterError
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.types import Size

from ..bench.config import Bench
from ..bench.models import ModelOptions
from ..bench.run_command import play_run
from ..bench.workers import open_stage
from ..environment.script import check_corruptions
from ..errors import MissingCapabilityError
from ..results import records
from ..results.scores import ScoreByCase, group_records
from ..scoring.cases import RowPlans
from ..scoring.run import ScoreRun, ScoreSettings

ROUNDS = "rounds"
MIN_VISIBLE = 0.5  # share of a row's target that must show, as in a build
Losses = dict[str, list[float]]
Conditions = dict[str, Planner | None]


class _Player(ABC):
    """What both players do: the clean cases are played once, with the first corruptions."""

    def __init__(self, agent: str) -> None:
        self._agent = agent
        self._clean: dict[bool, ScoreByCase] = {}

    @abstractmethod
    def _play(
        self, name: str, planners: Conditions, held_out: bool
    ) -> Sequence[records.ResultRecord]:
        """Return the records of a round, which is played as far as it was not before."""

    def losses(self, name: str, planners: Mapping[str, Planner], *, held_out: bool) -> Losses:
        """Play corruptions, as the protocol says; the first of either kind plays clean, too."""
        clean: dict[str, Planner | None] = {} if held_out in self._clean else {CLEAN: None}
        scored = group_records(self._play(name, {**clean, **planners}, held_out)).scored
        if clean:
            self._clean[held_out] = scored.get((self._agent, CLEAN), {})
        before = self._clean[held_out]
        return {
            label: _differences(before, scored.get((self._agent, label), {})) for label in planners
        }


class LivePlayer(_Player):
    """Plays on live desktops: each round is a run of `hijack bench` in a folder of its own.

    Args:
        bench: Its agent (one), tasks and seeds; confirmations have as many seeds after these.
        out: The folder of the search.
        desktops: The most desktops side by side; by default as many as fit.
    """

    def __init__(self, bench: Bench, out: Path, desktops: int | None = None) -> None:
        (agent,) = bench.agents
        super().__init__(agent)
        self._bench = bench
        self._out = out
        self._desktops = desktops

    @property
    def cases(self) -> int:
        """Tasks times seeds."""
        return len(self._bench.tasks) * len(self._bench.seeds)

    @property
    def held_out(self) -> int:
        """The same number, of other seeds."""
        return self.cases

    @property
    def size(self) -> Size:
        """Of the desktop."""
        return self._bench.size

    def check(self, planners: Iterable[Planner]) -> None:
        """Start a desktop, and check that corruptions can be played on it, before any is.

        Raises:
            MissingCapabilityError: It lacks what one of them needs.
            ParameterError: One of them cannot work on it.
        """
        bench = self._bench
        with open_stage(bench, None) as stage:
            for planner in planners:
                try:
                    check_corruptions([planner], bench.max_steps, stage.desktop, bench.layer)
                except (MissingCapabilityError, ParameterError) as error:
                    advice = "leave it out of the search: name the others with --corruptions"
                    raise type(error)(f"{error}; {advice}") from None

    @property
    def held_out_seeds(self) -> tuple[int, ...]:
        """The seeds of confirmations."""
        after = max(self._bench.seeds) + 1
        return tuple(range(after, after + len(self._bench.seeds)))

    def _play(
        self, name: str, planners: Conditions, held_out: bool
    ) -> Sequence[records.ResultRecord]:
        bench = replace(self._bench, corruptions=planners)
        if held_out:
            bench = replace(bench, seeds=self.held_out_seeds)
        out = self._out / ROUNDS / name
        return play_run(bench, out, ModelOptions(), resume=True, desktops=self._desktops).records


class RowPlayer(_Player):
    """Asks an agent about the clean rows of a dataset, corrupted while they are read.

    Every other trajectory is held out. Rows whose target is hidden count for nothing: no agent
    could hit it.

    Args:
        settings: The dataset and the agent (one).
        seed: Of all draws.
        size: `(height, width)` of the screens.
        out: The folder of the search.
    """

    def __init__(self, settings: ScoreSettings, seed: int, size: Size, out: Path) -> None:
        (agent,) = settings.agents
        super().__init__(agent)
        self._settings = settings
        self._seed = seed
        self._out = out
        self.size = size
        self.cases = self._count(held_out=False)
        self.held_out = self._count(held_out=True)

    def _run(self, planners: Conditions, held_out: bool) -> ScoreRun:
        part = "held_out" if held_out else "search"
        plans = RowPlans(planners=planners, seed=self._seed, part=part)
        return ScoreRun(replace(self._settings, plans=plans))

    def _count(self, held_out: bool) -> int:
        return len(self._run({CLEAN: None}, held_out).cases.cases)

    def _play(
        self, name: str, planners: Conditions, held_out: bool
    ) -> Sequence[records.ResultRecord]:
        run = self._run(planners, held_out)
        out = self._out / ROUNDS / name
        with run.begin(out, resume=True):
            run.play(out, run.remaining_cases(out), lambda *_: None, lambda *_: None)
        return [record for record in records.read(out).records if _is_visible(record)]


def _is_visible(record: records.ResultRecord) -> bool:
    share = record.get("target_visible")
    return share is None or share >= MIN_VISIBLE


def _differences(before: ScoreByCase, after: ScoreByCase) -> list[float]:
    """Return what each case lost that has a score in both conditions."""
    return [before[case] - after[case] for case in after if case in before]
