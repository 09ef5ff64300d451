"""Which frames reminder pairs are made of: all that have a reminder, and some that have none.

The frames without one are drawn from the same trajectory, so that what tells the two apart is the event and not the
task or the application, and a trajectory keeps its balance in whatever split it lands. What a trajectory cannot give,
or is owed of a fraction, is drawn from those after it.
"""

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.plan import CLEAN
from hijack_data.rng import Stream

from ..example import Row

# The columns that a choice depends on.
READ = ["trajectory_id", "step", "corruption", "event", "reminder"]
NEEDED = "reminder"
# Why a frame without a reminder was drawn: the clean screen where the event would have been, another clean screen, one
# with something drawn over it, one with an event that an agent can undo by itself. Each kind is as likely.
SAME_STEP, OTHER_STEP, PICTURE, EVENT = KINDS = ("same_step", "clean", "picture", "event")
MOST = 1000
_PRECISION = 10**6


class Chooser:
    """Draws, one shard after the other.

    Args:
        seed: seed of the draws.
        balance: frames without a reminder for each that has one, 0 to 1000.

    Raises `ParameterError` and `ParameterTypeError`.
    """

    def __init__(self, seed: int, balance: float) -> None:
        self.seed = seed
        self.ratio = Fraction(_checked(balance)).limit_denominator(_PRECISION)
        self.owed = Fraction(0)

    @property
    def short(self) -> int:
        """Frames without a reminder that are owed so far."""
        return int(self.owed)

    def chosen(self, rows: Iterable[Row]) -> dict[int, str]:
        """Return the rows of a shard to take, by number, and why: `NEEDED` or one of `KINDS`; `rows` hold `READ`."""
        found: dict[int, str] = {}
        for trajectory, group in groupby(enumerate(rows), key=lambda item: item[1]["trajectory_id"]):
            found.update(self._of_trajectory(str(trajectory), list(group)))
        return found

    def _of_trajectory(self, trajectory: str, rows: Sequence[tuple[int, Row]]) -> Iterator[tuple[int, str]]:
        needed = [(number, row) for number, row in rows if row["reminder"] is not None]
        yield from ((number, NEEDED) for number, _ in needed)
        self.owed += self.ratio * len(needed)
        steps = {row["step"] for _, row in needed}
        pools: dict[str, list[int]] = {kind: [] for kind in KINDS}
        for number, row in rows:
            if row["reminder"] is None:
                pools[_kind(row, steps)].append(number)
        stream = Stream(self.seed, "onlooker-v1", trajectory)
        for _ in range(min(self.short, sum(map(len, pools.values())))):
            kind = stream.choice([kind for kind in KINDS if pools[kind]])
            yield pools[kind].pop(stream.integer(0, len(pools[kind]) - 1)), kind
            self.owed -= 1


def _kind(row: Row, steps: set[int]) -> str:
    if row["event"] is not None:
        return EVENT
    if row["corruption"] != CLEAN:
        return PICTURE
    return SAME_STEP if row["step"] in steps else OTHER_STEP


def _checked(balance: Any) -> float:
    if isinstance(balance, bool) or not isinstance(balance, int | float):
        raise ParameterTypeError(f"balance must be a number, got {balance!r} ({type(balance).__name__})")
    try:
        value = float(balance)
    except OverflowError:
        raise ParameterError(f"balance must be in [0, {MOST}], got an integer beyond any float") from None
    if not 0 <= value <= MOST:
        raise ParameterError(f"balance must be in [0, {MOST}], got {value!r}")
    return value
