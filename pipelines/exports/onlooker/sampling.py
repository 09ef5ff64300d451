"""Sample the frames of reminder pairs: all frames with a reminder, and some without.

The frames without a reminder are drawn from the same trajectory, so that the two differ by the
event and not by the task or the application, and so that every split is balanced. Frames that a
trajectory lacks, and fractions of a frame, are made up for by later trajectories.
"""

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any, TypeAlias

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.plan import CLEAN
from hijack_data.rng import Stream

from ..example import Row

# The columns that a choice depends on.
COLUMNS_READ = ["trajectory_id", "step", "corruption", "event", "reminder", "changed_pixels"]
WITH_REMINDER = "reminder"
# The kinds of frames without a reminder: the clean screen of the step of the event, another clean
# screen, a screen with something drawn over it, and one with an event that an agent can undo by
# itself. All kinds are equally likely.
SAME_STEP, OTHER_STEP, PICTURE, EVENT = KINDS = ("same_step", "clean", "picture", "event")
MAX_BALANCE = 1000
_PRECISION = 10**6
NumberedRow: TypeAlias = tuple[int, Row]


class OnlookerSampler:
    """Draws the frames of reminder pairs, shard by shard.

    Args:
        seed: seed of the draws.
        balance: number of frames without a reminder for each frame with one, 0 to 1000.

    Raises:
        ParameterError: `balance` is outside that range.
        ParameterTypeError: `balance` is not a number.
    """

    def __init__(self, seed: int, balance: float) -> None:
        self.seed = seed
        self.ratio = Fraction(_check_balance(balance)).limit_denominator(_PRECISION)
        self.missing_frames = Fraction(0)

    @property
    def short(self) -> int:
        """Number of frames without a reminder that are missing so far."""
        return int(self.missing_frames)

    def choose_rows(self, rows: Iterable[Row]) -> dict[int, str]:
        """Return the chosen rows of a shard by number, and why: `WITH_REMINDER` or one of `KINDS`.

        Args:
            rows: the rows of the shard, with at least the columns `COLUMNS_READ`.
        """
        choices: dict[int, str] = {}
        for trajectory, group in groupby(enumerate(rows), key=_trajectory_id):
            choices.update(self._of_trajectory(trajectory, list(group)))
        return choices

    def _of_trajectory(
        self, trajectory: str, rows: Sequence[NumberedRow]
    ) -> Iterator[tuple[int, str]]:
        steps: list[int] = []
        for number, row in rows:
            if row["reminder"] is not None:
                steps.append(row["step"])
                yield number, WITH_REMINDER
        self.missing_frames += self.ratio * len(steps)
        pools = _pools(rows, set(steps))
        stream = Stream(self.seed, "onlooker-v1", trajectory)
        available = sum(map(len, pools.values()))
        for _ in range(min(self.short, available)):
            kind = stream.choice([kind for kind in KINDS if pools[kind]])
            pool = pools[kind]
            index = stream.integer(0, len(pool) - 1)
            yield pool.pop(index), kind
            self.missing_frames -= 1


def _trajectory_id(item: NumberedRow) -> str:
    return str(item[1]["trajectory_id"])


def _pools(rows: Sequence[NumberedRow], steps: set[int]) -> dict[str, list[int]]:
    """Return the numbers of the rows without a reminder, by kind."""
    pools: dict[str, list[int]] = {kind: [] for kind in KINDS}
    for number, row in rows:
        # Rows of input faults have the picture of a clean row, and nothing on it is theirs.
        has_own_picture = row["corruption"] == CLEAN or row["changed_pixels"]
        if row["reminder"] is None and has_own_picture:
            pools[_kind(row, steps)].append(number)
    return pools


def _kind(row: Row, steps: set[int]) -> str:
    if row["event"] is not None:
        return EVENT
    if row["corruption"] != CLEAN:
        return PICTURE
    return SAME_STEP if row["step"] in steps else OTHER_STEP


def _check_balance(balance: Any) -> float:
    if isinstance(balance, bool) or not isinstance(balance, int | float):
        kind = type(balance).__name__
        raise ParameterTypeError(f"balance must be a number, got {balance!r} ({kind})")
    valid = f"balance must be in [0, {MAX_BALANCE}]"
    try:
        value = float(balance)
    except OverflowError:
        raise ParameterError(f"{valid}, got an integer beyond any float") from None
    if not 0 <= value <= MAX_BALANCE:
        raise ParameterError(f"{valid}, got {value!r}")
    return value
