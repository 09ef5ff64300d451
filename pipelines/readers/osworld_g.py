"""OSWorld-G as it is published: boxes, polygons, and requests that should be refused."""

import math
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.errors import short_repr
from hijack_data.types import Action, Size

from ..choices import PIXELS, XYWH, XYXY
from . import fields
from .base import register
from .box_forms import box_in
from .fields import FieldError, JsonObject
from .published_set import GroundingTarget, PublishedSet, click_at

KINDS = ("bbox", "polygon", "refusal")
OUTLINE = "target_polygon"  # in `extra`; `hijack score` knows it, too
Corners: TypeAlias = list[tuple[float, float]]
_TABLE = re.compile(r"OSWorld-G(_refined)?\.json")
_WHERE = "box_coordinates"


@register
class OSWorldG(PublishedSet):
    """Reads OSWorld-G, in its first and in its refined wording.

    Coordinates: pixels of the picture. `box_type` says what `box_coordinates` are: x, y, width,
    height of a `bbox`; x1, y1, x2, y2, x3, y3 ... of a `polygon`, whose target is the box around it
    with the outline in `extra`; of a `refusal` nothing, and the action is `fail`. `image_size` must
    be that of the picture. `id`, `GUI_types` and `box_type` are kept in `extra`.
    """

    name = "osworld_g"
    layout = "OSWorld-G.json or OSWorld-G_refined.json beside the folder images"
    picture = "image_path"
    folder = "images"
    size_field = "image_size"
    extra_fields = ("id", "GUI_types", "box_type")

    def is_table(self, file: Path) -> bool:
        """Return whether the name is that of one of the two tables."""
        return bool(_TABLE.fullmatch(file.name))

    def target(self, record: JsonObject, size: Size) -> GroundingTarget:
        """Return what a row asks for; see `PublishedSet.target`.

        Raises:
            FieldError: its kind is not known.
        """
        kind = fields.text(record, "box_type")
        if kind == "bbox":
            return click_at(record, _WHERE, (PIXELS, XYWH), size)
        if kind == "polygon":
            return _polygon(record, size)
        if kind == "refusal":
            return GroundingTarget(action=Action("fail"))
        raise FieldError("box_type", f"{short_repr(kind)} is none of {', '.join(KINDS)}")


def _polygon(record: JsonObject, size: Size) -> GroundingTarget:
    corners = _corners(fields.items(record, _WHERE))
    across = [x for x, _ in corners]
    down = [y for _, y in corners]
    edges = [min(across), min(down), max(across), max(down)]
    box = box_in((PIXELS, XYXY), edges, size, _WHERE)
    x, y = _inner(corners)
    action = Action("click", min(x, size[1] - 1), min(y, size[0] - 1))
    extra = {OUTLINE: [list(corner) for corner in corners]}
    return GroundingTarget(action=action, box=box, extra=extra)


def _corners(values: Sequence[Any]) -> Corners:
    """Return the corners of a list of numbers x1, y1, x2, y2 ...

    Raises:
        FieldError: it holds something else, or fewer than three corners.
    """
    numbers = [float(value) for value in values if _is_number(value)]
    if len(numbers) < len(values):
        raise FieldError(_WHERE, f"a polygon is numbers, got {short_repr(values)}")
    if len(numbers) < 6 or len(numbers) % 2:
        reason = f"a polygon is x, y of three corners or more, got {len(numbers)} numbers"
        raise FieldError(_WHERE, reason)
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def _inner(corners: Corners) -> tuple[int, int]:
    """Return a pixel well inside: the middle of the widest span at half the height.

    Raises:
        FieldError: the polygon has no area there.
    """
    down = [y for _, y in corners]
    y = math.floor((min(down) + max(down)) / 2)
    level = y + 0.5
    crossings: list[float] = []
    for (x1, y1), (x2, y2) in pairwise([*corners, corners[0]]):
        if (y1 > level) != (y2 > level):
            crossings.append(x1 + (x2 - x1) * (level - y1) / (y2 - y1))
    crossings.sort()
    spans = list(zip(crossings[::2], crossings[1::2], strict=True))
    if not spans:
        raise FieldError(_WHERE, "the polygon has no area")
    left, right = max(spans, key=lambda span: span[1] - span[0])
    return math.floor((left + right) / 2), y


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)
