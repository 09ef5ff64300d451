"""DA-GRPO in TRL: `GRPOTrainer` with our environments, replay buffer and checks.

`GRPOTrainer` itself also accepts `TrlEnvironments`; this subclass adds a stored success for a group
without one, repeatable draws in a resumed run, and the end of a run whose loss is not finite. It
overrides two private methods of TRL 1.16.
"""

from dataclasses import dataclass
from typing import Any

import torch

from hijack_data import extras
from hijack_data.errors import ParameterError

from ..errors import TrainError
from ..replay import ReplayBuffer
from ..split import check_split
from .finite_callback import FiniteCallback
from .trl_environment import TrlEnvironment, TrlEnvironments, format_reward

GRPOTrainer: Any = extras.load("trl", "DAGRPOTrainer", "trl").GRPOTrainer


@dataclass(kw_only=True)
class _TrlRollout:
    """A rollout in TRL's form; see `GRPOTrainer._generate`."""

    prompt_ids: list[int]
    completion_ids: list[int]
    tool_mask: list[int]
    completion: list[Any]
    images: list[Any] | None
    tool_images: list[Any]


class DAGRPOTrainer(GRPOTrainer):
    """TRL's trainer with the reward success + format, and replay.

    Args:
        *args: as `GRPOTrainer`.
        environment_factory: the environments.
        replay: the replay buffer; it is not part of TRL's checkpoints, so a resumed run begins
            with an empty one.
        reward_funcs: rewards in addition to the success; `format_reward` by default.
        osworld_split: as in `check_split`.
        **kwargs: as `GRPOTrainer`.

    Raises:
        ParameterError: `replay` is given, and groups are spread over processes.
        LeakError: a training task is held out.
    """

    def __init__(
        self,
        *args: Any,
        environment_factory: TrlEnvironments,
        replay: ReplayBuffer | None = None,
        reward_funcs: Any = None,
        osworld_split: str = "osworld",
        **kwargs: Any,
    ) -> None:
        environments = environment_factory
        if replay is not None and environments.per_process % environments.rollouts:
            raise ParameterError(
                f"replay needs whole groups in each process: per_device_train_batch_size x"
                f" steps_per_generation is {environments.per_process}, and a group has"
                f" {environments.rollouts} rollouts; make one a multiple of the other"
            )
        _check_tasks(kwargs.get("train_dataset"), osworld_split)
        super().__init__(
            *args,
            reward_funcs=[format_reward] if reward_funcs is None else reward_funcs,
            environment_factory=environment_factory,
            **kwargs,
        )
        self.replay = replay
        self._hijack_environments = environments
        self._at = (-1, 0)  # the optimiser's step, and the generation batches within it
        self.add_callback(FiniteCallback())

    def _generate_and_score_completions(self, inputs: list[Any]) -> Any:
        if self.model.training:
            self._hijack_environments.set_batch(self._next_batch(), int(self.state.epoch or 0))
        return super()._generate_and_score_completions(inputs)

    def _next_batch(self) -> int:
        """Return the number of the generation batch, which is the same in a resumed run."""
        step = int(self.state.global_step)
        before, within = self._at
        self._at = (step, within + 1 if step == before else 0)
        steps_per_batch = self.args.steps_per_generation * self.num_iterations
        return step * max(1, self.args.gradient_accumulation_steps // steps_per_batch) + self._at[1]

    def _generate(self, prompts: list[Any]) -> Any:
        """Play the rollouts, then put stored successes into groups that have none."""
        generation = super()._generate(prompts)
        if not self.model.training:
            return generation
        environments: list[TrlEnvironment] = self.environments or []
        prompt_ids, completion_ids, tool_mask, completions, logprobs, extra, images, tool_images = (
            generation
        )
        rollouts = [
            environment._outcome(completion)
            for environment, completion in zip(environments, completions, strict=True)
        ]
        self._hijack_environments.check_played()
        if self.replay is None:
            return generation
        for i, rollout in enumerate(rollouts):
            rollout.tokens = _TrlRollout(
                prompt_ids=prompt_ids[i],
                completion_ids=completion_ids[i],
                tool_mask=tool_mask[i],
                completion=completions[i],
                images=None if images is None else images[i],
                tool_images=tool_images[i] if tool_images else [],
            )
        for i, rollout in self._replacements(rollouts):
            stored: _TrlRollout = rollout.tokens
            environments[i]._replayed = rollout
            prompt_ids[i] = stored.prompt_ids
            completion_ids[i] = stored.completion_ids
            tool_mask[i] = stored.tool_mask
            completions[i] = stored.completion
            if images is not None:
                images[i] = stored.images
            if tool_images:
                tool_images[i] = stored.tool_images
            # Log-probabilities of the policy that played it; NaN counts as on-policy.
            if logprobs is not None:
                logprobs[i] = [float("nan")] * len(stored.completion_ids)
        return (
            prompt_ids,
            completion_ids,
            tool_mask,
            completions,
            logprobs,
            extra,
            images,
            tool_images,
        )

    def _replacements(self, rollouts: list[Any]) -> list[tuple[int, Any]]:
        """Return the stored rollouts to insert, with their places; store the groups' successes."""
        replacements: list[tuple[int, Any]] = []
        if self.replay is None:
            return replacements
        size = self.num_generations
        for first in range(0, len(rollouts), size):
            places = [i for i in range(first, first + size) if rollouts[i].counts]
            group = [rollouts[i] for i in places]
            filled = self.replay.fill(
                group,
                [rollout.reward() for rollout in group],
                group[0].request.step if group else 0,
            )
            replacements += [
                (i, new)
                for i, old, new in zip(places, group, filled, strict=True)
                if new is not old
            ]
            for rollout in group:
                self.replay.add(rollout)
        return replacements

    def _compute_loss(self, model: Any, inputs: Any) -> Any:
        loss = super()._compute_loss(model, inputs)
        if not bool(torch.isfinite(loss)):
            raise TrainError(
                f"step {self.state.global_step}: the loss is {float(loss.detach())}; no step was"
                " taken. Lower learning_rate, and go on from the last checkpoint"
            )
        return loss


def _check_tasks(dataset: Any, osworld_split: str) -> None:
    """Refuse held-out tasks, and a dataset without tasks.

    Raises:
        ParameterError: the dataset has no column `task`.
        LeakError: a task is held out.
    """
    columns = getattr(dataset, "column_names", None)
    if columns is None or "task" not in columns:
        raise ParameterError(
            f"train_dataset needs a column 'task', has {columns}; training_rows(...) makes the rows"
        )
    check_split(dataset["task"], source="train_dataset", osworld_split=osworld_split)
