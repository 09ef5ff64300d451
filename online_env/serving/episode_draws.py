"""Decide what a reset plays: the task, its seed and the corruption, given or drawn.

All draws come from `hijack_data.rng`. A restarted server with the same seed draws the same for the
same calls.
"""

import importlib
import threading
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from hijack_data.compose import OneOf
from hijack_data.errors import ParameterError, ParameterTypeError, UnknownNameError, suggest
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.rng import Stream

from ..environment.runner import checked_seed
from .errors import HeldOutTaskError

MAX_COUNTED_GROUPS = 10_000  # number of groups whose rollouts are counted
TRAINING = "training"
HELD_OUT = "held_out"
_SEED = "serve-seed-v1"
_TASK = "serve-task-v1"


@dataclass(frozen=True, kw_only=True)
class EpisodeChoice:
    """The content of one episode.

    Args:
        task: The name of the task.
        seed: The seed of the task's variant and of all draws of the corruption.
        slot: The number of the rollout in its group, which are the resets of one task and seed.
        label: The name of the corruption; `"clean"` for none.
        planner: The corruption; `None` for none.
        key: The key by which the corruption was drawn; empty if the client named it.
    """

    task: str
    seed: int
    slot: int
    label: str
    planner: Planner | None
    key: str


class EpisodeDraws:
    """Decides what resets play; safe to call from several threads.

    Args:
        tasks: The names of the tasks that are served, at least one.
        planners: The corruptions by label, at least one; `None` is the clean condition.
        per: As in `CorruptionSampler`: `rollout`, `group` or `worker` (here a session).
        seed: The seed of all draws.
        clean: The share of clean episodes; by default each condition is as likely as the others.
        held_out: Tasks that are refused because results are reported on them.
        osworld_split: As in `sides`.

    Raises:
        ParameterError: There are no tasks, `clean` does not fit the corruptions, or `seed` is out
            of range (0 to 2**64 - 1).
        UnknownNameError: `per` is not one of the three.
    """

    def __init__(
        self,
        tasks: Iterable[str],
        planners: Mapping[str, Planner | None],
        *,
        per: str = "rollout",
        seed: int = 0,
        clean: float | None = None,
        held_out: Iterable[str] = (),
        osworld_split: str = "osworld",
    ) -> None:
        checked_seed(seed)
        self.tasks = tuple(tasks)
        self.sides = {
            side: names for side, names in sides(self.tasks, osworld_split).items() if names
        }
        self.planners = dict(planners)
        self.held_out = frozenset(held_out)
        if not self.tasks:
            raise ParameterError("no task is left to serve: name others with --tasks")
        # An exception to the rule that the two packages do not import each other: the sampler
        # decides which corruption a rollout meets, here as in training.
        sampler = importlib.import_module("pipelines.train.sampler")
        self._sampler: Any = sampler.CorruptionSampler(
            _drawn_from(self.planners, clean),
            per=per,
            seed=seed,
            conditions=_corrupting(self.planners),
        )
        self._seed = seed
        self._labels = {id(planner): label for label, planner in self.planners.items()}
        self._lock = threading.Lock()
        self._resets = 0
        self._slots: OrderedDict[tuple[str, int], int] = OrderedDict()

    def choose(
        self,
        *,
        session: int,
        seed: object = None,
        task: object = None,
        corruption: object = None,
        slot: object = None,
    ) -> EpisodeChoice:
        """Return the content of a reset's episode.

        Args:
            session: The number of the session, for `per="worker"`.
            seed: Drawn if it is `None`.
            task: A name; drawn from the seed if it is `None`.
            corruption: A label or name; drawn if it is `None`.
            slot: The rollout's number in its group; counted by the server if it is `None`.

        Raises:
            UnknownNameError: The task or the corruption is not served.
            HeldOutTaskError: The task is held out.
            ParameterTypeError: A value is of the wrong type.
            ParameterError: A number is out of its range.
        """
        with self._lock:
            self._resets += 1
            number = self._resets
        checked = checked_seed(seed)
        is_drawn = checked is None
        if checked is None:
            checked = Stream(self._seed, _SEED, number).integer(0, 2**32 - 1)
        name = self._task(task, checked)
        checked_slot = _checked_slot(slot)
        if checked_slot is None:
            checked_slot = 0 if is_drawn else self._next_slot(name, checked)
        if corruption is not None:
            label = self._label(corruption)
            return EpisodeChoice(
                task=name,
                seed=checked,
                slot=checked_slot,
                label=label,
                planner=self.planners[label],
                key="",
            )
        worker = session if self._sampler.per == "worker" else checked_slot
        draw = self._sampler.draw(step=0, group=f"{name} s{checked}", slot=worker)
        return EpisodeChoice(
            task=name,
            seed=checked,
            slot=checked_slot,
            # The sampler knows corruptions by their own names, the configuration may give others.
            label=CLEAN if draw.planner is None else self._labels[id(draw.planner)],
            planner=draw.planner,
            key=draw.key,
        )

    def _task(self, task: object, seed: int) -> str:
        if task is None:
            return Stream(seed, _TASK).choice(self.tasks)
        if not isinstance(task, str):
            raise ParameterTypeError(f"task must be the name of a task, got {task!r:.80}")
        if task in self.tasks:
            return task
        if task in self.held_out:
            raise HeldOutTaskError(
                f"task {task} is held out: results are reported on it, so nothing may be trained"
                " on it; `hijack serve --evaluation` serves it"
            )
        raise UnknownNameError(f"no task {task!r:.80} is served here{suggest(task, self.tasks)}")

    def _label(self, corruption: object) -> str:
        if not isinstance(corruption, str):
            raise ParameterTypeError(
                f"corruption must be a name, got {corruption!r:.80}; the server's configuration"
                " sets parameters"
            )
        if corruption not in self.planners:
            close = suggest(corruption, self.planners)
            raise UnknownNameError(f"no corruption {corruption!r:.80} is served here{close}")
        return corruption

    def _next_slot(self, task: str, seed: int) -> int:
        """Count the resets of a task and a seed; old groups are forgotten."""
        with self._lock:
            slot = self._slots.pop((task, seed), -1) + 1
            self._slots[task, seed] = slot
            if len(self._slots) > MAX_COUNTED_GROUPS:
                self._slots.popitem(last=False)
            return slot


def sides(tasks: Iterable[str], osworld_split: str = "osworld") -> dict[str, tuple[str, ...]]:
    """Return tasks by their side of the split; tasks of your own count as training.

    Args:
        tasks: The names of tasks; the suite's tasks and OSWorld's are split.
        osworld_split: The split of OSWorld's tasks: `osworld`, or `agenthijack`, the authors'.
    """
    split = importlib.import_module("pipelines.train.split")  # as the sampler, an exception
    held_out = {*split.members(f"suite/{HELD_OUT}"), *split.members(f"{osworld_split}/{HELD_OUT}")}
    names = tuple(tasks)
    return {
        TRAINING: tuple(name for name in names if name not in held_out),
        HELD_OUT: tuple(name for name in names if name in held_out),
    }


def _drawn_from(planners: Mapping[str, Planner | None], clean: float | None) -> Planner | None:
    """Return the distribution for the sampler.

    Raises:
        ParameterError: `clean` does not fit the corruptions.
    """
    options = _corrupting(planners)
    if not planners:
        raise ParameterError("no corruption is left to draw: name some with --corruptions")
    if clean is not None and clean > 0 and CLEAN not in planners:
        raise ParameterError(f"clean {clean:g}: the clean condition is not among the corruptions")
    if not options:
        return None
    if clean is None:
        clean = 1 / len(planners) if CLEAN in planners else 0.0
    return OneOf(options, p_clean=clean)


def _corrupting(planners: Mapping[str, Planner | None]) -> list[Planner]:
    """Return the conditions without the clean one."""
    return [planner for planner in planners.values() if planner is not None]


def _checked_slot(slot: object) -> int | None:
    if slot is None:
        return None
    if isinstance(slot, bool) or not isinstance(slot, int) or slot < 0:
        raise ParameterTypeError(f"slot must be an integer of at least 0, got {slot!r:.80}")
    return slot
