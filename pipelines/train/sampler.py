"""Draw the corruption of each rollout.

The draws come from `hijack_data.rng` and depend only on the seed, the step, the group and the slot,
so a resumed run and another process draw the same.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

from hijack_data.compose import OneOf, Schedule
from hijack_data.errors import UnknownNameError, suggest
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner, as_planner
from hijack_data.rng import as_seed

DrawScope: TypeAlias = Literal["rollout", "group", "worker"]
SCOPES: tuple[str, ...] = get_args(DrawScope)


@dataclass(frozen=True, kw_only=True)
class Draw:
    """The corruption of one rollout.

    Args:
        label: its name; `"clean"` if there is none.
        planner: the corruption; `None` for a clean rollout.
        key: the key of the draw, for the record.
    """

    label: str
    planner: Planner | None
    key: str

    def to_data(self) -> dict[str, Any]:
        """Return the draw as JSON data, with every parameter of the corruption."""
        config = None if self.planner is None else self.planner.to_config()
        return {"corruption": self.label, "planner": config, "key": self.key}


class CorruptionSampler:
    """Draws a corruption for each rollout (paper, Algorithm 10, line 7).

    Args:
        planner: a corruption (every rollout gets it), a `OneOf` with its odds, a `Schedule` of
            those by epoch, or `None` for clean rollouts, which makes DA-GRPO the same as GRPO. A
            `OneOf` with `max_times` draws at the steps of an episode, so a rollout gets it whole.
        per: `"rollout"` draws for each rollout, as in the paper; `"group"` gives the rollouts of a
            group one corruption; `"worker"` gives every slot one for the whole run, as the authors'
            code does.
        seed: 0 to 2**64 - 1.
        conditions: those of the planners that a rollout gets whole, although they draw themselves.

    Raises:
        UnknownNameError: `per` is not one of the three.
        ParameterTypeError: `planner` plans nothing, or `seed` is not a whole number.
        ParameterError: `seed` is out of its range.
    """

    def __init__(
        self,
        planner: Planner | None,
        *,
        per: str = "rollout",
        seed: int = 0,
        conditions: Iterable[Planner] = (),
    ) -> None:
        if per not in SCOPES:
            raise UnknownNameError(f"per: no {per!r}{suggest(per, SCOPES)}")
        requirement = "CorruptionSampler takes a corruption, a OneOf or None"
        self.planner = None if planner is None else as_planner(planner, requirement)
        self.per = per
        self.seed = as_seed(seed)
        self._conditions = frozenset(map(id, conditions))

    def draw(self, *, step: int, group: str, slot: int, epoch: int = 0) -> Draw:
        """Return the corruption of a rollout.

        Args:
            step: step of the optimiser, from 0.
            group: the task of the group.
            slot: the rollout's number in its group, which is also its worker's.
            epoch: for a `Schedule`.
        """
        key, at = self._key(step, group, slot)
        planner = self.planner
        sample: str = key
        while isinstance(planner, OneOf | Schedule) and not self._is_whole(planner):
            choice = planner.choose(seed=self.seed, sample=sample, step=at, epoch=epoch)
            if choice is None:
                planner = None
                break
            planner, sample = choice
        label = CLEAN if planner is None else planner.label
        return Draw(label=label, planner=planner, key=f"{at}:{key}")

    def _is_whole(self, planner: Planner) -> bool:
        """Return whether a rollout gets a planner as it is, and not what it draws."""
        return id(planner) in self._conditions or getattr(planner, "max_times", None) is not None

    def _key(self, step: int, group: str, slot: int) -> tuple[str, int]:
        """Return the sample id and the step of the draw."""
        if self.per == "rollout":
            return f"slot {slot} of {group}", step
        if self.per == "group":
            return f"group {group}", step
        return f"worker {slot}", 0
