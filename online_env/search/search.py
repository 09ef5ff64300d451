"""The search for the worst case: Optuna proposes corruptions, an agent plays them.

The state of a search is what was played. One that was broken off asks the sampler again, which is
seeded, and finds the scores of its earlier rounds in their folders, so it ends with the same trials
as one that was not. The maximum over many trials is partly luck; the worst corruptions are
therefore played again on cases that the search did not use.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import Any, Protocol

from hijack_data import extras
from hijack_data.errors import HijackError, ParameterError
from hijack_data.file_io import write_atomic
from hijack_data.planner import Planner
from hijack_data.types import Size

from ..bench.plan_set import Loss, PlanSetError, WorstPlan, plan_episode
from .space import SearchSpace

TRIALS = "trials.json"
SETTINGS = "search.json"
MAX_UNFIT = 200  # proposals in a row that are known, or cannot be played
# The loss of what cannot be played. The sampler would propose it again if it were not told a value.
UNPLAYABLE = -1.0
MIN_STARTUP_TRIALS = 5  # random ones, before the sampler learns from the others


class CorruptionPlayer(Protocol):
    """Plays corruptions: live, or over the rows of a dataset."""

    @property
    def cases(self) -> int:
        """How many cases one corruption is played on."""
        ...

    @property
    def held_out(self) -> int:
        """How many cases a confirmation is played on."""
        ...

    @property
    def size(self) -> Size:
        """`(height, width)` of the screen."""
        ...

    def losses(
        self, name: str, planners: Mapping[str, Planner], *, held_out: bool
    ) -> dict[str, list[float]]:
        """Play corruptions, and return by label the score that each case loses, -1 to 1.

        What was played under this name before is not played again.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """How a search is made.

    Args:
        space: What it tries.
        budget: The most episodes or rows, of all that are played.
        seed: Of the sampler.
        keep: How many of the worst are confirmed.
        batch: How many corruptions are proposed and played together.
    """

    space: SearchSpace
    budget: int
    seed: int = 0
    keep: int = 5
    batch: int = 5

    def count_trials(self, player: CorruptionPlayer) -> int:
        """Return how many corruptions the budget pays for, beside the clean cases and the end.

        Raises:
            ParameterError: It pays for none.
        """
        fixed = player.cases + (1 + self.keep) * player.held_out
        trials = (self.budget - fixed) // player.cases
        if trials < max(1, self.keep):
            least = fixed + max(1, self.keep) * player.cases
            raise ParameterError(
                f"--budget {self.budget} is too small: {player.cases} cases clean and under"
                f" {max(1, self.keep)} corruptions, and {player.held_out} held-out cases of the"
                f" {self.keep} worst, are {least}; raise it, or take fewer tasks, seeds or --keep"
            )
        return trials


@dataclass
class _Trials:
    """The corruptions that were tried, each once, with what their cases lost.

    `fail` is Optuna's state of a trial without a value, `cases` how many each is played on.
    """

    fail: Any
    cases: int
    planners: dict[str, Planner] = field(default_factory=dict[str, Planner])
    losses: dict[str, list[float]] = field(default_factory=dict[str, list[float]])

    def label(self, planner: Planner) -> str | None:
        """Return the label under which the same corruption was tried."""
        config = planner.to_config()
        return next(
            (key for key, tried in self.planners.items() if tried.to_config() == config), None
        )

    def loss(self, label: str) -> Loss:
        return _mean(self.losses[label])

    def value(self, label: str) -> float:
        """Return what the sampler is told of a corruption."""
        loss = self.loss(label)
        return _loss_over_all(loss, self.cases) if loss.n else UNPLAYABLE

    def ranked(self) -> list[str]:
        """Return the labels of those that cost anything, the worst first."""
        tried = [label for label, losses in self.losses.items() if losses]
        costly = [label for label in tried if self.loss(label).loss > 0]
        return sorted(costly, key=lambda label: -_loss_over_all(self.loss(label), self.cases))


def search(
    player: CorruptionPlayer, settings: SearchSettings, out: Path, say: Callable[[str], object]
) -> list[WorstPlan]:
    """Return the corruptions that cost an agent most, the worst confirmed loss first.

    Args:
        player: Plays them.
        settings: How to search.
        out: A folder, which gets `trials.json`.
        say: Called with lines for the user.

    Raises:
        MissingDependencyError: Optuna is not installed.
        ParameterError: The budget is too small, or nothing of the space can be played.
    """
    optuna: Any = extras.load("optuna", "hijack search", "search")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    count = settings.count_trials(player)
    startup = max(MIN_STARTUP_TRIALS, min(count // 3, 2 * len(settings.space.names)))
    samplers = (
        optuna.samplers.TPESampler(seed=settings.seed, n_startup_trials=startup),
        optuna.samplers.RandomSampler(seed=settings.seed),
    )
    study = optuna.create_study(direction="maximize", sampler=samplers[0])
    if count >= 2 * len(settings.space.names):
        for values in settings.space.defaults():
            study.enqueue_trial(values)
    trials = _Trials(optuna.trial.TrialState.FAIL, player.cases)
    rounds = 0
    while len(trials.losses) < count:
        batch = min(settings.batch, count - len(trials.losses))
        proposals = _propose(study, samplers, settings.space, trials, batch, player.size)
        if not proposals:
            break  # the space holds fewer corruptions than the budget pays for
        rounds += 1
        fresh = {label: trials.planners[label] for label in proposals.values()}
        trials.losses |= player.losses(f"round-{rounds:03d}", fresh, held_out=False)
        for number, label in proposals.items():
            study.tell(number, trials.value(label))
        _write_trials(out, trials)
        say(_round_line(trials, count))
    return _confirm(player, trials, settings.keep)


def _propose(
    study: Any, samplers: Any, space: SearchSpace, trials: _Trials, count: int, size: Size
) -> dict[int, str]:
    """Return labels of new corruptions, at most `count`, by the number of their trial in Optuna.

    What the sampler has proposed before gives way to a random proposal, so that a search goes on
    where the sampler would settle.

    Raises:
        ParameterError: Too many in a row cannot be played; the message has the last reason.
    """
    proposals: dict[int, str] = {}
    unfit = 0
    problem: HijackError | None = None
    while len(proposals) < count and unfit < MAX_UNFIT:
        study.sampler = samplers[min(unfit, 1)]
        trial = study.ask()
        planner = space.draw(trial)
        label = trials.label(planner)
        unfit += 1
        if label is not None:
            if label in trials.losses:
                study.tell(trial, trials.value(label))
            else:
                study.tell(trial, state=trials.fail)  # it is played in this round
            continue
        try:
            plan_episode(planner, size)
        except HijackError as error:
            study.tell(trial, UNPLAYABLE)
            problem = error
            continue
        unfit = 0
        label = f"t{len(trials.planners):03d}_{planner.label}"
        trials.planners[label] = planner
        proposals[trial.number] = label
    if not trials.planners and problem is not None:
        raise ParameterError(f"nothing can be searched for: {problem}") from problem
    return proposals


def _confirm(player: CorruptionPlayer, trials: _Trials, keep: int) -> list[WorstPlan]:
    """Play the worst on held-out cases."""
    worst = {label: trials.planners[label] for label in trials.ranked()[:keep]}
    if not worst:
        return []
    confirmed = player.losses("confirmation", worst, held_out=True)
    plans = [
        WorstPlan(
            label=label,
            planner=planner,
            found=trials.loss(label),
            confirmed=_mean(confirmed.get(label, [])),
        )
        for label, planner in worst.items()
    ]
    return sorted(
        plans,
        key=lambda plan: (
            -_loss_over_all(plan.confirmed, player.held_out),
            -_loss_over_all(plan.found, player.cases),
        ),
    )


def _loss_over_all(loss: Loss, cases: int) -> float:
    """Return a mean loss as if the cases that do not count had lost nothing.

    By this corruptions are compared, so that one lost case of one that counts is not the worst.
    """
    return loss.loss * (loss.n / cases)


def _mean(losses: Sequence[float]) -> Loss:
    return Loss(round(fmean(losses), 6) if losses else 0.0, len(losses))


def _round_line(trials: _Trials, count: int) -> str:
    ranked = trials.ranked()
    worst = "none cost anything yet"
    if ranked:
        worst = f"worst so far {ranked[0]}, {100 * trials.loss(ranked[0]).loss:.0f} points lost"
    return f"{len(trials.losses)} of {count} corruptions tried; {worst}"


def _write_trials(out: Path, trials: _Trials) -> None:
    rows = [
        {
            "label": label,
            "corruption": trials.planners[label].to_config(),
            **trials.loss(label)._asdict(),
        }
        for label in trials.losses
    ]
    write_atomic(out / TRIALS, json.dumps(rows, indent=1) + "\n")


def begin(out: Path, settings: Mapping[str, Any], resume: bool) -> None:
    """Write the settings of a search into its folder, or check that they are the same.

    Raises:
        PlanSetError: The folder is not empty, or holds another search.
    """
    from ..results.records import difference

    path = out / SETTINGS
    text = json.dumps(settings, indent=1, ensure_ascii=False) + "\n"
    if resume and path.exists():
        change = difference(json.loads(path.read_text(encoding="utf-8")), json.loads(text))
        if change:
            raise PlanSetError(f"{out}: is another search: {change}; begin a new one")
        return
    if out.exists() and any(out.iterdir()):
        raise PlanSetError(f"{out}: is not empty; --resume goes on, or give a new folder")
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(path, text)
