"""The replay buffer: successful rollouts of each task, for groups in which nothing succeeded."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import torch

from hijack_data.errors import UnknownNameError, suggest
from hijack_data.file_io import replace_atomic
from hijack_data.params import Parameter
from hijack_data.rng import Stream, as_seed

from .errors import TrainError
from .rollout_data import rollout_from_data, rollout_to_data
from .rollouts import Rollout

ReplayTrigger: TypeAlias = Literal["zero", "failed"]
REPLAY_TRIGGERS: tuple[str, ...] = get_args(ReplayTrigger)
FORMAT = "agenthijack-replay"
VERSION = 1
CAPACITY = Parameter("int", "Stored successes a task", low=1, high=1000)
SLOT = Parameter("int", "The rollout that is replaced", low=0, high=1023, optional=True)
_STREAM = "replay_buffer-v1"


class ReplayBuffer:
    """Keeps successful rollouts, and puts one into a group that has none.

    The paper (section 5) replaces "one of them" at random by a stored success of the same task
    "if an entire training batch consists solely of failed trajectories"; its Algorithm 10, line 9,
    asks for all rewards to be 0. The two differ for a group in which some answer had the wrong
    form: its rewards are -1 and 0, so it teaches something even without a success.

    Args:
        capacity: the most rollouts of a task; the oldest goes first. The paper names none.
        when: `"zero"`, all rewards are 0 (Algorithm 10), or `"failed"`, no rollout succeeded.
        slot: which rollout is replaced: `None` draws it; the authors' code always takes 0.
        seed: the seed of the draws, 0 to 2**64 - 1.

    Raises:
        ParameterError: `capacity` is below 1, or `slot` or `seed` below 0.
        ParameterTypeError: one of them is not a whole number.
        UnknownNameError: `when` is not one of the two.
    """

    def __init__(
        self, capacity: int = 4, *, when: str = "zero", slot: int | None = None, seed: int = 0
    ) -> None:
        if when not in REPLAY_TRIGGERS:
            raise UnknownNameError(f"replay: when: no {when!r}{suggest(when, REPLAY_TRIGGERS)}")
        self.capacity: int = CAPACITY.check("replay: capacity", capacity)
        self.when = when
        self.slot: int | None = SLOT.check("replay: slot", slot)
        self.seed = as_seed(seed)
        self._successes: dict[str, deque[Rollout]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._successes.values()))

    def to_data(self) -> dict[str, Any]:
        """Return the settings as JSON data."""
        return {"capacity": self.capacity, "when": self.when, "slot": self.slot, "seed": self.seed}

    def add(self, rollout: Rollout) -> bool:
        """Store a rollout if it succeeded in the right form; return whether it was stored."""
        is_positive = rollout.success > 0 and rollout.is_well_formed
        if not rollout.counts or rollout.replayed or not is_positive:
            return False
        group = rollout.request.group
        self._successes.setdefault(group, deque(maxlen=self.capacity)).append(rollout)
        return True

    def fill(
        self, rollouts: Sequence[Rollout], rewards: Sequence[float], step: int
    ) -> list[Rollout]:
        """Return the group, with one rollout replaced if none succeeded.

        The draws depend on the seed, the step and the task.

        Args:
            rollouts: of one task.
            rewards: the reward of each.
            step: step of the optimiser.
        """
        group = list(rollouts)
        if not group or not self._is_due(group, rewards):
            return group
        successes = self._successes.get(group[0].request.group)
        if not successes:
            return group
        stream = Stream(self.seed, _STREAM, group[0].request.group, step)
        slot = stream.integer(0, len(group) - 1) if self.slot is None else self.slot
        stored = successes[stream.integer(0, len(successes) - 1)]
        group[min(slot, len(group) - 1)] = replace(stored, replayed=True)
        return group

    def _is_due(self, group: Sequence[Rollout], rewards: Sequence[float]) -> bool:
        if self.when == "zero":
            return all(reward == 0 for reward in rewards)
        return all(rollout.success <= 0 for rollout in group)

    def state(self) -> list[Any]:
        """Return the stored rollouts as data for `torch.save`."""
        return [
            rollout_to_data(rollout)
            for successes in self._successes.values()
            for rollout in successes
        ]

    def restore(self, state: Sequence[Mapping[str, Any]]) -> None:
        """Restore the data that `state` returned."""
        self._successes = {}
        for data in state:
            self.add(rollout_from_data(data))

    def save(self, path: Path, *, run: str) -> None:
        """Write the buffer to a file.

        Args:
            path: the file.
            run: the fingerprint of the run, which `load` requires.
        """
        data = {"format": FORMAT, "version": VERSION, "run": run, "kept": self.state()}
        replace_atomic(path, lambda temporary_path: torch.save(data, temporary_path))

    def load(self, path: Path, *, run: str) -> None:
        """Read a buffer that `save` wrote.

        Raises:
            TrainError: the file cannot be read, or belongs to another run: its observations and
                rewards would be another policy's on other tasks.
        """
        data = read_tensors(path, FORMAT, VERSION, "a replay buffer")
        if data.get("run") != run:
            raise TrainError(
                f"{path}: the replay buffer of another run ({data.get('run')}, this one is {run});"
                " start without it, or resume the run that it belongs to"
            )
        self.restore(data["kept"])


def read_tensors(path: Path, format: str, version: int, description: str) -> dict[str, Any]:
    """Read a file of `torch.save` that names its format and version; no code in it is run.

    Raises:
        TrainError: the file is missing, damaged, or of another format.
    """
    try:
        data: Any = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise TrainError(f"{path}: there is no such file") from None
    except Exception as error:  # torch raises many kinds of exceptions for damaged files
        detail = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise TrainError(f"{path}: cannot be read as {description} ({detail})") from error
    if not isinstance(data, dict) or data.get("format") != format:
        raise TrainError(f"{path}: not {description} (field 'format' must be {format!r})")
    if data.get("version") != version:
        raise TrainError(
            f"{path}: version {data.get('version')} of {description}; this library reads {version}"
        )
    return data
