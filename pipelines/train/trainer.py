"""The training loop of DA-GRPO (paper, Algorithm 10): sample, reward, replay, advantage, update."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import gymnasium
import torch

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.params import param, parameters
from hijack_data.rng import Stream, as_seed

from .errors import TrainError
from .journal import TrainJournal, load_checkpoint, save_checkpoint
from .objective import CLIP_HIGH, CLIP_LOW, clipped_loss, group_advantage, reward
from .replay import ReplayBuffer
from .rollouts import Policy, Rollout, RolloutRequest, play
from .sampler import CorruptionSampler

ReportProblem: TypeAlias = Callable[[str], object]


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """Settings of a run; the defaults are the paper's (section 6) where it names one.

    Args:
        epochs: how often every task is trained on.
        rollouts: rollouts a group, at least 2: the advantage compares them.
        batch: groups for each step of the optimiser. The paper has batches of 1 accumulated 4
            times, which is the same.
        max_steps: answers until a rollout is cut off.
        learning_rate: of AdamW; 1e-6 in the paper, for a model of 7 billion parameters.
        weight_decay: of AdamW.
        clip_low: how far the ratio may fall.
        clip_high: how far the ratio may rise.
        format_weight: the penalty of an answer in the wrong form.
        max_norm: the norm to which gradients are clipped.
        seed: of the order of the tasks, the environments and the policy's draws.
        save_every: steps from one checkpoint to the next.
    """

    epochs: int = param(15, "How often each task is trained on", low=1, high=10_000)
    rollouts: int = param(4, "Rollouts a group", low=2, high=1024)
    batch: int = param(4, "Groups a step of the optimiser", low=1, high=1024)
    max_steps: int = param(10, "Answers until a rollout is cut off", low=1, high=10_000)
    learning_rate: float = param(1e-6, "Of AdamW", low=1e-12, high=1)
    weight_decay: float = param(0.01, "Of AdamW", low=0, high=1)
    clip_low: float = param(CLIP_LOW, "How far the ratio may fall", low=0, high=1)
    clip_high: float = param(CLIP_HIGH, "How far the ratio may rise", low=0, high=10)
    format_weight: float = param(1.0, "Penalty of a wrong form", low=0, high=100)
    max_norm: float = param(1.0, "Norm to which gradients are clipped", low=1e-12)
    seed: int = 0
    save_every: int = param(50, "Steps from one checkpoint to the next", low=1)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ParameterError: one is out of its range.
            ParameterTypeError: one is no number, or no whole one.
        """
        for name, (parameter, _) in parameters(self).items():
            checked = parameter.check(f"TrainSettings: {name}", getattr(self, name))
            object.__setattr__(self, name, checked)
        object.__setattr__(self, "seed", as_seed(self.seed))


@dataclass(kw_only=True)
class StepReport:
    """What happened in one step.

    Args:
        step: its number, from 0.
        epoch: its epoch, from 0.
        loss: the loss; `None` if no group taught anything.
        success: the mean success of the rollouts that count.
        groups: groups that were trained on.
        equal: groups whose rewards were all equal.
        replayed: groups that got a stored rollout.
        problems: what failed, in words.
    """

    step: int
    epoch: int
    loss: float | None = None
    success: float = 0.0
    groups: int = 0
    equal: int = 0
    replayed: int = 0
    problems: list[str] = field(default_factory=list[str])


@dataclass(frozen=True)
class _Group:
    """The rollouts of a task that are trained on, with the advantage of each."""

    rollouts: list[Rollout]
    advantages: torch.Tensor


class Trainer:
    """Trains a policy.

    Args:
        policy: what is trained, from its present parameters on.
        environments: gymnasium environments, `settings.batch * settings.rollouts` of them.
        tasks: the training tasks, each different.
        sampler: which rollout meets which corruption; with planner `None` this is GRPO.
        settings: the numbers.
        replay: the replay buffer, or `None`.
        folder: where `rollouts.jsonl`, `steps.jsonl` and `checkpoint.pt` go; `None` writes none.
        threads: environments that reset and step at the same time; see `play`.
        report: called with each line on what went wrong.

    Raises:
        ParameterError: too few environments, no tasks, or one that is given twice.
        ParameterTypeError: `tasks` is one text.
    """

    def __init__(
        self,
        policy: Policy,
        environments: Sequence[gymnasium.Env[Any, str]],
        *,
        tasks: Sequence[str],
        sampler: CorruptionSampler,
        settings: TrainSettings,
        replay: ReplayBuffer | None = None,
        folder: Path | None = None,
        threads: int = 1,
        report: ReportProblem = lambda _: None,
    ) -> None:
        rollout_count = settings.batch * settings.rollouts
        if len(environments) < rollout_count:
            raise ParameterError(
                f"{len(environments)} environments for {rollout_count} rollouts a step (batch"
                f" {settings.batch} x rollouts {settings.rollouts}); make one for each"
            )
        if isinstance(tasks, str):
            raise ParameterTypeError(f"training tasks: give a list of names, such as [{tasks!r}]")
        twice = [task for task, count in Counter(tasks).items() if count > 1]
        if not tasks or twice:
            problem = f"{twice[0]!r} is given twice" if twice else "there are none"
            raise ParameterError(f"training tasks: {problem}")
        self.policy = policy
        self.tasks = tuple(tasks)
        self.settings = settings
        self.sampler = sampler
        self.replay = replay
        self.step_number = 0
        self._environments = environments
        self._threads = threads
        self._report = report
        self._optimiser = torch.optim.AdamW(
            policy.network().parameters(),
            lr=settings.learning_rate,
            weight_decay=settings.weight_decay,
        )
        self._journal = None if folder is None else TrainJournal(folder)

    @property
    def steps(self) -> int:
        """All steps of the run."""
        return self.steps_per_epoch * self.settings.epochs

    @property
    def steps_per_epoch(self) -> int:
        """Steps until every task was trained on; the last one of an epoch may have fewer tasks."""
        return -(-len(self.tasks) // self.settings.batch)

    @property
    def fingerprint(self) -> dict[str, Any]:
        """What a checkpoint must share with a run that goes on from it, as JSON data."""
        planner = self.sampler.planner
        replay = self.replay
        return {
            "tasks": list(self.tasks),
            "settings": asdict(self.settings),
            "per": self.sampler.per,
            "sampler_seed": self.sampler.seed,
            "corruptions": None if planner is None else planner.to_config(),
            "replay": None if replay is None else replay.to_data(),
        }

    def run(self) -> list[StepReport]:
        """Take the steps that are left, with checkpoints; return a report of each.

        Raises:
            TrainError: nothing of a step could be played, or its loss is not finite. The last
                checkpoint is as it was.
        """
        reports: list[StepReport] = []
        while self.step_number < self.steps:
            reports.append(self.step())
            is_last = self.step_number == self.steps
            if is_last or self.step_number % self.settings.save_every == 0:
                self.save()
        return reports

    def step(self) -> StepReport:
        """Take one step of the optimiser.

        Raises:
            TrainError: nothing could be played, or the loss is not finite.
        """
        epoch, batch_index = divmod(self.step_number, self.steps_per_epoch)
        report = StepReport(step=self.step_number, epoch=epoch)
        tasks = self._order(epoch)[batch_index * self.settings.batch :][: self.settings.batch]
        rollouts = play(
            self._environments,
            self.policy,
            [self._request(task, slot, epoch) for task in tasks for slot in self._slots()],
            max_steps=self.settings.max_steps,
            threads=self._threads,
        )
        self._check_played(rollouts, report)
        groups: list[_Group] = []
        for number in range(len(tasks)):
            first = number * self.settings.rollouts
            group_rollouts = rollouts[first : first + self.settings.rollouts]
            group = self._group(group_rollouts, report)
            if group is not None:
                groups.append(group)
        if groups:
            report.loss = self._update(groups)
        if self._journal is not None:
            self._journal.rollouts([rollout.to_data() for rollout in rollouts])
            self._journal.step(asdict(report))
        self.step_number += 1
        return report

    def save(self) -> None:
        """Write a checkpoint, from which `resume` goes on with the same future."""
        if self._journal is None:
            return
        state = {
            "step": self.step_number,
            "policy": self.policy.network().state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "replay": [] if self.replay is None else self.replay.state(),
        }
        save_checkpoint(self._journal, self.fingerprint, state)

    def resume(self) -> bool:
        """Continue from the checkpoint of the folder.

        Log lines that were written after the checkpoint are removed, since their steps are played
        again.

        Returns:
            Whether there was a checkpoint.

        Raises:
            TrainError: the checkpoint is damaged, or one of another run or network.
        """
        if self._journal is None:
            return False
        state = load_checkpoint(self._journal, self.fingerprint)
        if state is None:
            self._journal.cut({})
            return False
        try:
            self.policy.network().load_state_dict(state["policy"])
            self._optimiser.load_state_dict(state["optimiser"])
        except (RuntimeError, ValueError) as error:
            detail = " ".join(str(error).split()).rstrip(".")
            raise TrainError(
                f"{self._journal.folder}: the checkpoint is of another network ({detail}); give the"
                " policy that the run began with, or another folder"
            ) from None
        if self.replay is not None:
            self.replay.restore(state["replay"])
        self._journal.cut(state["lengths"])
        self.step_number = state["step"]
        return True

    def _slots(self) -> range:
        return range(self.settings.rollouts)

    def _order(self, epoch: int) -> list[str]:
        """Return the tasks in the order of an epoch."""
        stream = Stream(self.settings.seed, "task_order-v1", "tasks", epoch=epoch)
        tasks = list(self.tasks)
        for last in range(len(tasks) - 1, 0, -1):
            swap = stream.integer(0, last)
            tasks[last], tasks[swap] = tasks[swap], tasks[last]
        return tasks

    def _request(self, task: str, slot: int, epoch: int) -> RolloutRequest:
        seed = Stream(self.settings.seed, "environment_seed-v1", task, self.step_number)
        draw = self.sampler.draw(step=self.step_number, group=task, slot=slot, epoch=epoch)
        return RolloutRequest(
            step=self.step_number,
            group=task,
            slot=slot,
            seed=seed.integer(0, 2**32 - 1),
            draw=draw,
            stream_seed=self.settings.seed,
        )

    def _check_played(self, rollouts: Sequence[Rollout], report: StepReport) -> None:
        """Report the rollouts that failed.

        Raises:
            TrainError: none of the rollouts counts.
        """
        counting = [rollout for rollout in rollouts if rollout.counts]
        for rollout in rollouts:
            if not rollout.counts:
                line = (
                    f"step {self.step_number}: {rollout.request.group}, rollout"
                    f" {rollout.request.slot} is left out: {rollout.status}, {rollout.problem}"
                )
                report.problems.append(line)
                self._report(line)
        if not counting:
            raise TrainError(
                f"step {self.step_number}: none of {len(rollouts)} rollouts could be played; the"
                f" first: {report.problems[0]}"
            )
        report.success = sum(rollout.success for rollout in counting) / len(counting)

    def _group(self, group_rollouts: Sequence[Rollout], report: StepReport) -> _Group | None:
        """Return what is trained on of a group, or `None` if it teaches nothing."""
        rollouts = [rollout for rollout in group_rollouts if rollout.counts]
        if len(rollouts) < 2:
            line = f"step {self.step_number}: a group of {len(rollouts)} teaches nothing: left out"
            report.problems.append(line)
            self._report(line)
            return None
        rewards = self._rewards(rollouts)
        if self.replay is not None:
            filled = self.replay.fill(rollouts, rewards, self.step_number)
            for rollout in rollouts:
                self.replay.add(rollout)
            report.replayed += any(rollout.replayed for rollout in filled)
            rollouts = filled
            rewards = self._rewards(rollouts)
        advantages = group_advantage(torch.tensor(rewards, dtype=torch.float32))
        if not bool(advantages.any()):
            report.equal += 1
            return None
        report.groups += 1
        return _Group(rollouts, advantages)

    def _rewards(self, rollouts: Sequence[Rollout]) -> list[float]:
        weight = self.settings.format_weight
        return [reward(rollout.success, rollout.is_well_formed, weight) for rollout in rollouts]

    def _update(self, groups: Sequence[_Group]) -> float:
        """Take a step down the mean loss of the groups, and return it.

        The old policy is the one of this step (Algorithm 10, line 6), also for a replayed rollout,
        as in verl, which evaluates old probabilities anew for what it trains on.
        """
        rollouts = [rollout for group in groups for rollout in group.rollouts]
        turns = [turn for rollout in rollouts for turn in rollout.turns]
        owner = [i for i, rollout in enumerate(rollouts) for _ in rollout.turns]
        by_turn, is_token = self.policy.log_probs(turns)
        new, mask = _by_response(by_turn, is_token, owner, len(rollouts))
        losses = clipped_loss(
            new,
            new.detach(),
            torch.cat([group.advantages for group in groups]),
            mask,
            low=self.settings.clip_low,
            high=self.settings.clip_high,
        )
        shares = [1 / len(group.rollouts) for group in groups for _ in group.rollouts]
        # groups that teach nothing count as well, with a gradient of 0
        loss = (losses * torch.tensor(shares)).sum() / self.settings.batch
        self._check_finite(loss, groups)
        parameters = list(self.policy.network().parameters())
        self._optimiser.zero_grad()
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(parameters, self.settings.max_norm)
        self._check_finite(norm, groups)
        self._optimiser.step()
        return float(loss.detach())

    def _check_finite(self, number: torch.Tensor, groups: Sequence[_Group]) -> None:
        if bool(torch.isfinite(number)):
            return
        tasks = ", ".join(group.rollouts[0].request.group for group in groups)
        raise TrainError(
            f"step {self.step_number}: the loss or its gradient is {float(number.detach())} (tasks"
            f" {tasks}); no step was taken. Lower learning_rate or max_norm, and start again: a"
            " checkpoint goes on with the settings that it was made with"
        )


def _by_response(
    by_turn: torch.Tensor, is_token: torch.Tensor, owner: Sequence[int], count: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Join the turns of each rollout: float `[N, K]` becomes `[R, T * K]`, T the most turns."""
    max_turns = max(Counter(owner).values())
    width = by_turn.shape[1]
    row_indices = torch.zeros(len(owner), dtype=torch.long)
    turns_before: Counter[int] = Counter()
    for i, rollout in enumerate(owner):
        row_indices[i] = rollout * max_turns + turns_before[rollout]
        turns_before[rollout] += 1
    joined = torch.zeros(count * max_turns, width, dtype=by_turn.dtype).index_copy(
        0, row_indices, by_turn
    )
    mask = torch.zeros(count * max_turns, width, dtype=torch.bool).index_copy(
        0, row_indices, is_token
    )
    return joined.view(count, -1), mask.view(count, -1)
