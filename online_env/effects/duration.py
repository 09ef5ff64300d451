"""When an effect begins, and how long it lasts: its parameters `begins` and `lasts` in a plan."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from hijack_data.errors import ParameterError

BEGINS = "begins"  # a parameter: {"seconds": 20}
LASTS = "lasts"  # a parameter: {"steps": 3} or {"seconds": 20}
MAX_STEPS = 10_000
MAX_SECONDS = 3600.0


@dataclass(frozen=True)
class Duration:
    """How long an effect lasts; without `steps` and `seconds`, to the end of the episode.

    Args:
        steps: observations that show it, 1 to `MAX_STEPS`; it is undone before the next one.
        seconds: since it was applied, up to `MAX_SECONDS`; it is undone before the first action or
            observation after them.
    """

    steps: int | None = None
    seconds: float | None = None

    @classmethod
    def read(cls, params: Mapping[str, Any]) -> "Duration":
        """Read the duration in the parameters of an effect.

        Raises:
            ParameterError: `lasts` is neither `{"steps": n}` nor `{"seconds": s}`, or out of range.
        """
        if LASTS not in params:
            return cls()
        value = params[LASTS]
        entries = cast("Mapping[str, Any]", value) if isinstance(value, Mapping) else {}
        match dict(entries):
            case {"steps": int() as steps, **others} if not others and steps is not True:
                if 1 <= steps <= MAX_STEPS:
                    return cls(steps=steps)
            case {"seconds": seconds, **others} if not others and _are_seconds(seconds):
                return cls(seconds=float(seconds))
            case _:
                pass
        raise ParameterError(
            f'{LASTS} of an effect is {{"steps": 1 to {MAX_STEPS}}} or {{"seconds": more than 0, up'
            f" to {MAX_SECONDS:g}}}, got {value!r:.80}"
        )

    def is_over(self, steps: int, seconds: float) -> bool:
        """Return whether an effect is over that has lasted so many observations and seconds."""
        if self.steps is not None:
            return steps >= self.steps
        return self.seconds is not None and seconds >= self.seconds


def read_delay(params: Mapping[str, Any]) -> float:
    """Return how many seconds after the observation of its step an effect begins; 0 for at once.

    Raises:
        ParameterError: `begins` is not `{"seconds": s}`, or out of range.
    """
    if BEGINS not in params:
        return 0.0
    match params[BEGINS]:
        case {"seconds": seconds, **others} if not others and _are_seconds(seconds):
            return float(seconds)
        case value:
            raise ParameterError(
                f'{BEGINS} of an effect is {{"seconds": more than 0, up to {MAX_SECONDS:g}}}, got'
                f" {value!r:.80}"
            )


def _are_seconds(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value) and 0 < value <= MAX_SECONDS
