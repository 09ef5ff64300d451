"""Boxes of tables: the form of their numbers is decided for a whole table, never for a row.

A row excludes forms: with x1 > x2 its numbers are no two corners, with x + width beyond the picture
they are no width. Rows that fit no form are broken and exclude nothing. If several forms are left,
the published layout of the table decides, or the user.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias

from hijack_data.errors import ParameterError, short_repr
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Box, Size, are_fractions

from ..choices import BOXES, FRACTIONS, PIXELS, THOUSAND, XYWH
from . import fields
from .fields import FieldError, FieldTypeError
from .reader_options import ReaderOptions

Form: TypeAlias = tuple[str, str]  # the space and the order
Forms: TypeAlias = frozenset[Form]
SLACK = 0.01  # annotated boxes overshoot the edge a little; what is further out is in another space
_UNBOUNDED = (math.inf, math.inf)


def box_in(form: Form, value: object, size: Size, field: str) -> Box:
    """Return a box of a form in pixels of a picture of `size`, (height, width).

    Raises:
        FieldError: the numbers are not of this form, or outside the picture.
    """
    numbers = _numbers(value, field)
    space, order = form
    if not _fits(numbers, form, size):
        about = f"leaves the {size[1]}x{size[0]} picture, or is empty or in another space"
        if order != XYWH and _is_swapped(numbers):
            about = "ends before it starts"
        raise FieldError(field, f"{short_repr(numbers)} {about} (read as {order} in {space})")
    height, width = _frame(space, size)
    x1, y1, x2, y2 = _corners(numbers, order)
    scaled = [
        x1 * size[1] / width,
        y1 * size[0] / height,
        x2 * size[1] / width,
        y2 * size[0] / height,
    ]
    try:
        (box,) = fields.boxes([scaled], size, "target_box")
    except FieldError as error:
        raise FieldError(field, error.reason) from None
    return box


def box_center(box: Box) -> tuple[int, int]:
    """Return the pixel in the middle of a box."""
    x1, y1, x2, y2 = box
    return (x1 + x2) // 2, (y1 + y2) // 2


def detect_form(
    boxes: Sequence[object],
    size: Callable[[int], Size | None],
    choices: ReaderOptions,
    published_forms: Iterable[Form] = (),
    field: str = "bbox",
) -> Form:
    """Return the form of the boxes of a table.

    Args:
        boxes: the value of each row.
        size: returns the (height, width) of a row's picture, `None` if it cannot be read; it is
            called for as few rows as possible.
        choices: the choices of the user.
        published_forms: forms that the table may have as it was published, the likelier first.
        field: the name of the column.

    Raises:
        FieldError: rows contradict each other, or nothing decides.
    """
    spaces = (choices.coordinates,) if choices.coordinates else (FRACTIONS, PIXELS)
    orders = (choices.boxes,) if choices.boxes else BOXES
    candidates = frozenset(itertools.product(spaces, orders))
    try:
        forms = _narrowed(candidates, _unseen(boxes, candidates), field)
    except FieldError:  # one that leaves its picture may be at fault
        forms = _narrowed(
            candidates, _forms_on_pictures(boxes, size, candidates, candidates), field
        )
    else:
        may_be_corners = len(orders) > 1 and _are_widths(forms)
        if len(forms) > 1 or may_be_corners:
            forms = _narrowed(forms, _forms_on_pictures(boxes, size, candidates, forms), field)
    if len(forms) == 1:
        return next(iter(forms))
    for form in published_forms:
        if form in forms:
            return form
    possible = sorted(f"{order} in {space}" for space, order in forms)
    options = " or ".join(possible)
    raise FieldError(field, f"could be {options}: say which with --boxes and --coordinates")


def _are_widths(forms: Forms) -> bool:
    return all(order == XYWH for _, order in forms)


def _unseen(boxes: Sequence[object], among: Forms) -> Iterator[tuple[int, Forms]]:
    """Yield the forms that each row may have whatever its picture is."""
    for index, box in enumerate(boxes):
        yield index, _forms(box, _UNBOUNDED, among)


def _forms_on_pictures(
    boxes: Sequence[object], size: Callable[[int], Size | None], among: Forms, remaining: Forms
) -> Iterator[tuple[int, Forms]]:
    """Yield the forms that each row may have on its picture, until only two corners remain."""
    for index, box in enumerate(boxes):
        shape = size(index)
        if shape is None:
            continue
        forms = _forms(box, shape, among)
        yield index, forms
        if forms:
            remaining &= forms
        if len(remaining) == 1 and not _are_widths(remaining):
            return


def _narrowed(remaining: Forms, rows: Iterable[tuple[int, Forms]], field: str) -> Forms:
    for index, forms in rows:
        if not forms:
            continue
        if not remaining & forms:
            before = _listed(remaining)
            current = _listed(forms)
            raise FieldError(
                field,
                f"rows disagree: those before row {index} are {before}, this one can only be"
                f" {current}; split the table, or say which with --boxes and --coordinates",
            )
        remaining &= forms
    return remaining


def _listed(forms: Forms) -> str:
    return " or ".join(sorted(map(" ".join, forms)))


def _forms(value: object, size: tuple[float, float], among: Forms) -> Forms:
    try:
        numbers = _numbers(value, "")
    except FieldError:
        return frozenset()
    fitting = frozenset(form for form in among if _fits(numbers, form, size))
    if numbers[0] != numbers[2] and numbers[1] != numbers[3]:
        return fitting
    # Two corners without area, or a width that equals x: any order is possible.
    spaces = {space for space, _ in fitting}
    return frozenset((space, order) for space, order in among if space in spaces)


def _fits(numbers: Sequence[float], form: Form, size: tuple[float, float]) -> bool:
    space, order = form
    if space != FRACTIONS and are_fractions([abs(number) for number in numbers]):
        return False
    x1, y1, x2, y2 = _corners(numbers, order)
    height, width = _frame(space, size)
    return _is_within(x1, x2, width) and _is_within(y1, y2, height)


def _is_within(start: float, end: float, side: float) -> bool:
    lowest = -SLACK * min(side, 1e6)
    highest = (1 + SLACK) * side
    return lowest <= start < end <= highest


def _frame(space: str, size: tuple[float, float]) -> tuple[float, float]:
    """Return the (height, width) that the numbers of a space count on a picture of a size.

    Raises:
        FieldError: the model behind `resized` does not accept a picture of this size.
    """
    if space == FRACTIONS:
        return 1.0, 1.0
    if space == THOUSAND:
        return 1000.0, 1000.0
    if space == PIXELS or size == _UNBOUNDED:
        return size
    try:
        return smart_resize(int(size[0]), int(size[1]))
    except ParameterError as error:
        raise FieldError("image", str(error)) from None


def _corners(numbers: Sequence[float], order: str) -> tuple[float, float, float, float]:
    x1, y1, third, fourth = numbers
    if order == XYWH:
        return x1, y1, x1 + third, y1 + fourth
    return x1, y1, third, fourth


def _is_swapped(numbers: Sequence[float]) -> bool:
    x1, y1, x2, y2 = numbers
    return x2 < x1 or y2 < y1


def _numbers(value: object, field: str) -> list[float]:
    values = fields.items({field: value}, field)
    if len(values) != 4 or not all(map(_is_number, values)):
        raise FieldTypeError(field, "four numbers", values)
    return [float(number) for number in values]


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= fields.MAX_PIXEL
