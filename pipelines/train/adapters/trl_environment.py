"""Our environments as tools of TRL's `GRPOTrainer` (its argument `environment_factory`).

TRL makes an object for each rollout of a generation batch, resets it with a row of the dataset, and
offers every public method to the model as a tool. So `TrlEnvironment` has one, `computer`, and
`CorruptedEnv` itself must not be handed over. Written for TRL 1.16; nothing of TRL is imported.
"""

import atexit
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from hijack_data.errors import ParameterError
from hijack_data.file_io import make_folder, unwritable
from hijack_data.rng import Stream

from ..errors import TrainError
from ..journal import ROLLOUTS
from ..rollouts import AgentObservation, RolloutRequest
from ..sampler import CorruptionSampler
from ..split import check_split
from .driven_episode import DrivenEpisode, MakeEnvironment, TokenRollout, screenshot_image

Content: TypeAlias = list[dict[str, Any]]
OVER = "The episode is over."


class BatchSettings(Protocol):
    """The values read from TRL's `GRPOConfig`."""

    num_generations: Any
    per_device_train_batch_size: int
    steps_per_generation: Any
    process_index: Any
    world_size: Any


class TrlEnvironment:
    """One rollout at a time, for TRL; made by `TrlEnvironments`.

    Args:
        number: the index of the environment in this process, from 0.
        owner: the `TrlEnvironments` that made it.
        make: makes the gymnasium environment, with the first `reset`.
    """

    def __init__(self, number: int, owner: "TrlEnvironments", make: MakeEnvironment) -> None:
        self._number = number
        self._owner = owner
        self._episode = DrivenEpisode(make)
        self._replayed: TokenRollout | None = None
        self._is_logged = False

    def reset(self, task: str, seed: int | None = None, **_row: Any) -> Content:
        """Begin a rollout under a drawn corruption, and return the end of the prompt.

        Args:
            task: the task, of the dataset's row.
            seed: of the environment; drawn for each group and batch if the row has none.
            **_row: the row's other columns.

        Raises:
            UnknownNameError: the environment does not know the task.
            TrainError: none of the last batch's rollouts could be played.
        """
        if self._number == 0:
            self._owner.begin_batch()
        self._replayed = None
        self._is_logged = False
        observation = self._episode.reset(self._owner.request(task, self._number, seed))
        if observation is None:
            return [{"type": "text", "text": OVER}]
        return [{"type": "text", "text": observation["instruction"]}, _image(observation)]

    def computer(self, action: str) -> Content:
        """Act on the computer, then look at its screen.

        Args:
            action: The next action, in the form that the task asks for.

        Returns:
            The next screenshot.
        """
        observation = self._episode.step(str(action))
        return [{"type": "text", "text": OVER}] if observation is None else [_image(observation)]

    def get_reward(self) -> float | None:
        """Return the success of the rollout, or `None` if it does not count.

        TRL leaves a reward of `None` out of its group.
        """
        rollout = self._outcome()
        return rollout.success if rollout.counts else None

    def _outcome(self, completion: Sequence[Any] | None = None) -> TokenRollout:
        """Return the judged rollout, or the stored one that replaces it.

        Args:
            completion: the messages of the rollout, which show whether its end had the right form.
        """
        if self._replayed is not None:
            return self._replayed
        return self._judged_rollout(completion)

    def _judged_rollout(self, completion: Sequence[Any] | None) -> TokenRollout:
        was_over = self._episode.is_over
        rollout = self._episode.finish()
        if self._is_logged:
            return rollout
        if completion is not None and not was_over:
            rollout.is_well_formed &= _ends_with_tool_call(completion)
        self._is_logged = True
        self._owner.log(rollout)
        return rollout


class TrlEnvironments:
    """Makes the environments of a `GRPOTrainer`: pass it as `environment_factory`.

    Give `format_reward` as `reward_funcs`, and rows with a column `task` (`training_rows`).

    Args:
        make: makes a gymnasium environment with the interface of `CorruptedEnv`; called once for
            each rollout of a generation batch, with its first `reset`.
        args: the trainer's `GRPOConfig`.
        sampler: draws the corruption of each rollout; `None` plays clean rollouts.
        seed: of the environments' seeds, 0 to 2**64 - 1.
        folder: where `rollouts.jsonl` goes (`rollouts-RANK.jsonl` of several processes): the
            corruption and the result of each rollout; `None` writes none.
        report: called with a line on each rollout that is left out.
    """

    def __init__(
        self,
        make: MakeEnvironment,
        args: BatchSettings,
        *,
        sampler: CorruptionSampler | None = None,
        seed: int = 0,
        folder: Path | None = None,
        report: Callable[[str], object] = print,
    ) -> None:
        self.rollouts = int(args.num_generations)
        self.per_process = int(args.per_device_train_batch_size) * int(args.steps_per_generation)
        self.sampler = sampler or CorruptionSampler(None)
        self.seed = seed
        self._make = make
        self._report = report
        self._rank = int(args.process_index)
        self._log = _log_path(folder, self._rank, int(args.world_size))
        self._environments: list[TrlEnvironment] = []
        self._batch = -1
        self._epoch = 0
        self._is_set = False
        self._failed: list[str] = []
        self._finished_count = 0
        atexit.register(self.close)  # TRL never closes an environment

    def __call__(self) -> TrlEnvironment:
        """Make the next environment; no machine starts before its first `reset`."""
        environment = TrlEnvironment(len(self._environments), self, self._make)
        self._environments.append(environment)
        return environment

    def set_batch(self, number: int, epoch: int = 0) -> None:
        """Set the number of the next generation batch, so that a resumed run makes the same draws.

        Without it the batches of this process are counted from 0.

        Args:
            number: from 0, over the whole run.
            epoch: for a `Schedule`.
        """
        self._batch = number
        self._epoch = epoch
        self._is_set = True

    def begin_batch(self) -> None:
        """Begin the next generation batch; the first environment's `reset` calls this.

        Raises:
            TrainError: none of the last batch's rollouts could be played: TRL would continue
                forever without a gradient.
        """
        if not self._is_set:
            self._batch += 1
        self._is_set = False
        self.check_played()

    def check_played(self) -> None:
        """Check the finished batch, if it was not checked yet.

        Raises:
            TrainError: none of its rollouts could be played.
        """
        failed, count = self._failed, self._finished_count
        self._failed, self._finished_count = [], 0
        if count and len(failed) == count:
            raise TrainError(f"none of {count} rollouts could be played; the first: {failed[0]}")

    def request(self, task: str, number: int, seed: int | None) -> RolloutRequest:
        """Return the request for an environment in the current batch."""
        rollout_index = self._rank * self.per_process + number
        slot = rollout_index % self.rollouts
        if seed is None:
            stream = Stream(self.seed, "environment_seed-v1", task, self._batch)
            seed = stream.integer(0, 2**32 - 1)
        draw = self.sampler.draw(step=self._batch, group=task, slot=slot, epoch=self._epoch)
        return RolloutRequest(step=self._batch, group=task, slot=slot, seed=seed, draw=draw)

    def log(self, rollout: TokenRollout) -> None:
        """Write the line of a finished rollout.

        Raises:
            StorageError: the disk is full or fails.
            HijackError: the file cannot be written for another reason.
        """
        self._finished_count += 1
        if not rollout.counts:
            request = rollout.request
            line = (
                f"batch {request.step}: {request.group}, rollout {request.slot} is left out:"
                f" {rollout.status}, {rollout.problem}"
            )
            self._failed.append(line)
            self._report(line)
        if self._log is None:
            return
        try:
            with self._log.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(rollout.to_data()) + "\n")
        except OSError as cause:
            error = unwritable(self._log, cause)
            raise error from None

    def close(self) -> None:
        """Close all environments; may be called again."""
        for environment in self._environments:
            environment._episode.close()


def format_reward(
    completions: Sequence[Sequence[Any]], environments: Sequence[TrlEnvironment], **_: Any
) -> list[float | None]:
    """Return -1 for each rollout with an answer in the wrong form, else 0 (paper, section 5).

    A reward function for `GRPOTrainer(reward_funcs=[format_reward])`; TRL adds it to the success
    that `TrlEnvironment.get_reward` gives. Wrong are actions that the environment refuses, and a
    rollout that ends with an answer that calls no tool, before the episode is over.
    `GRPOConfig(reward_weights=[0.5])` halves the penalty.
    """
    outcomes = [
        environment._outcome(completion)
        for environment, completion in zip(environments, completions, strict=True)
    ]
    penalties: list[float | None] = []
    for outcome in outcomes:
        penalty = 0.0 if outcome.is_well_formed else -1.0
        penalties.append(penalty if outcome.counts else None)
    return penalties


def training_rows(
    tasks: Iterable[str],
    answer_form: str,
    *,
    evaluation: Iterable[str] = (),
    osworld_split: str = "osworld",
) -> list[dict[str, Any]]:
    """Return a row for each training task: `prompt` (how to answer) and `task`.

    `datasets.Dataset.from_list` makes a dataset of them. The instruction and the first screenshot
    come with `reset`.

    Args:
        tasks: names of training tasks.
        answer_form: what the model is told before the instruction, such as the form of an action.
        evaluation: names of the tasks that are reported.
        osworld_split: as in `check_split`; give it to `DAGRPOTrainer`, too.

    Raises:
        LeakError: a task is held out or reported.
        ParameterError: there are no tasks.
    """
    names = list(dict.fromkeys(tasks))
    if not names:
        raise ParameterError("training_rows: there are no tasks")
    check_split(names, evaluation, source="training_rows", osworld_split=osworld_split)
    return [
        {"prompt": [{"role": "user", "content": f"{answer_form}\n"}], "task": name}
        for name in names
    ]


def _ends_with_tool_call(completion: Sequence[Any]) -> bool:
    """Return whether the last answer called a tool, whose result TRL may have dropped."""
    answers = [message for message in completion if message.get("role") == "assistant"]
    return bool(answers) and bool(answers[-1].get("tool_calls"))


def _image(observation: AgentObservation) -> dict[str, Any]:
    return {"type": "image", "image": screenshot_image(observation)}


def _log_path(folder: Path | None, rank: int, processes: int) -> Path | None:
    if folder is None:
        return None
    make_folder(folder)
    stem, _, ending = ROLLOUTS.partition(".")
    return folder / (ROLLOUTS if processes == 1 else f"{stem}-{rank}.{ending}")
