"""The parts of every format of labels: move a label with the pixels, and find where it points."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ..actions import Scaling
from ..coords import CoordMap
from ..errors import LabelError
from ..types import SLACK, Size
from .nested_numbers import Numbers

LEAVE = "leave"  # the format of an entry that stays as it is


@dataclass(frozen=True)
class Move:
    """A change of size: a picture of `before` becomes one of `after`, both (height, width)."""

    before: Size
    after: Size

    @property
    def scaling(self) -> Scaling:
        """The scaling of recorded labels.

        It refuses a point that lies outside the picture by more than `SLACK` of a side.
        """
        return Scaling(self.before, self.after, bounded=True)

    @property
    def coords(self) -> CoordMap:
        """The map of coordinates from the picture after the change to the one before."""
        return CoordMap(observation=self.after, screen=self.before)


@dataclass(frozen=True)
class Location:
    """The place of a label, in pixels.

    Attributes:
        target: a point (x, y) or a box (x1, y1, x2, y2).
        end: the point where a drag from the target ends.
    """

    target: tuple[float, ...]
    end: tuple[float, ...] | None = None


Mapper: TypeAlias = Callable[[Any, Move], Any]
Locator: TypeAlias = Callable[[Any, Size], "list[Location]"]


@dataclass(frozen=True)
class RowFormat:
    """How many labels of one form are changed at once, one in each row of an array.

    Both functions check every row as if it were the only one.

    Attributes:
        width: how many numbers one label has.
        map_rows: returns rows `[N, width]`, int64 or float64, after a `Move`.
        locate_rows: returns where the rows point on a picture of a size (height, width).
    """

    width: int
    map_rows: Callable[[Numbers, Move], Numbers]
    locate_rows: Callable[[Numbers, Size], list[Location]]


@dataclass(frozen=True)
class Format:
    """One way to write a label.

    Both functions raise `LabelError`, and `ActionError` for actions that cannot be mapped.

    Attributes:
        name: the name under which it is declared.
        map_value: returns a value after a `Move`, without modifying the given value.
        locate: returns where a value points on a picture of a size (height, width).
        declaration: what is declared to get this format, if that is not its name.
        rows: how many labels are changed at once; `None` if only one at a time can be.
    """

    name: str
    map_value: Mapper
    locate: Locator = lambda value, size: []
    declaration: Any = None
    rows: RowFormat | None = None

    @property
    def name_or_declaration(self) -> Any:
        """What a user declares to get this format: its name, a function, or `chat(...)`."""
        return self.name if self.declaration is None else self.declaration


def with_unit(order: str, unit: int) -> str:
    """Return the name of a format; `unit` is 0 (pixels), 1 (fractions) or 1000 (thousandths)."""
    return order + {0: "", 1: "01", 1000: "1000"}[unit]


def check_unit(
    numbers: Numbers, unit: int, size: Size, anywhere: bool = False, all_inside: bool = False
) -> None:
    """Check that numbers `[N, 2 or 4]`, x before y, fit a coordinate space.

    `unit` is 0 for pixels of a picture of `size` (height, width), 1 for fractions, 1000 for
    thousandths. With `anywhere`, boxes may lie outside the picture; without it, at least one must
    lie inside, and with `all_inside` all must.

    Raises:
        LabelError: the numbers can only belong to another space.
    """
    example = numbers[0].tolist()
    if unit != 1 and numbers.dtype.kind == "f":
        in_range = ((numbers >= 0) & (numbers <= 1)).all(axis=1)
        fractions = numbers[in_range & (numbers != np.trunc(numbers)).any(axis=1)]
        if len(fractions):
            raise LabelError(
                f"holds {fractions[0].tolist()}, which are fractions of the picture; formats for"
                " those end in 01"
            )
    if unit:
        if numbers.min() < -SLACK * unit or numbers.max() > (1 + SLACK) * unit:
            raise LabelError(
                f"holds {example}, which leaves 0..{unit}; formats in pixels have no number at"
                " their end"
            )
        return
    height, width = size
    if numbers.shape[1] == 4 and not anywhere:
        starts_inside = (numbers[:, 0] < width) & (numbers[:, 1] < height)
        ends_inside = (numbers[:, 2:] > 0).all(axis=1)
        is_inside = starts_inside & ends_inside
        if not (is_inside.all() if all_inside else is_inside.any()):
            raise LabelError(
                f"holds {example}, which is outside the {width}x{height} picture; is it in its"
                " pixels?"
            )
