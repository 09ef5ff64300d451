"""What counts as the right step: the rules of docs/offline_scoring.md.

A step is right if all its parts are: the type of the action and, as far as the recorded action has
them, its place, its end, its text, its keys and the direction of scrolling.
"""

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field

from hijack_data.actions.dialects.field_checks import key_name
from hijack_data.errors import ParameterError
from hijack_data.types import AIMING, Action, Box, Point, Size, in_box

from ..choices import NEAR_PIXELS

HELP = "reinit"  # the type of an answer that asks for help; no action of a recording has it
UNSCORED = "other"  # a recorded action of no known type: nothing can be compared with it
MODIFIERS = frozenset({"ctrl", "shift", "alt", "win"})
_SIDE = re.compile("^(ctrl|shift|alt|win)(?:left|right)$")


@dataclass(frozen=True)
class Distance:
    """How far a point may be from the recorded one where no box is known.

    Args:
        value: pixels of the recorded screen, or a share.
        relative: `value` is a share of the picture, 0..1: x counts in widths and y in heights, as
            AITW's matching has it (0.14).
    """

    value: float = NEAR_PIXELS
    relative: bool = False

    @classmethod
    def parse(cls, text: str) -> "Distance":
        """Read `32` (pixels) or `14%` (of the picture's width and height).

        Raises:
            ParameterError: it is neither.
        """
        relative = text.strip().endswith("%")
        try:
            value = float(text.strip().removesuffix("%"))
        except ValueError:
            value = math.nan
        highest = 100 if relative else 10_000
        if not 0 < value <= highest:
            raise ParameterError(
                f"distance {text!r} must be pixels such as 32, or a share such as 14%"
            )
        return cls(value / 100 if relative else value, relative)

    def __str__(self) -> str:
        return f"{100 * self.value:g}%" if self.relative else f"{self.value:g}"

    def reaches(self, first: Point, second: Point, scale: tuple[float, float], size: Size) -> bool:
        """Return whether two points of a picture are near enough.

        Args:
            first: the first.
            second: the second.
            scale: width and height of the picture over those of the recorded screen.
            size: `(height, width)` of the picture.
        """
        across = first[0] - second[0]
        down = first[1] - second[1]
        if self.relative:
            return math.hypot(across / size[1], down / size[0]) <= self.value
        return math.hypot(across / scale[0], down / scale[1]) <= self.value


NEAR = Distance()


@dataclass(frozen=True, kw_only=True)
class ExpectedStep:
    """What a row asks for, in pixels of its picture.

    Args:
        action: the recorded action.
        size: `(height, width)` of the picture.
        box: the target, if one is known.
        polygon: its outline, if it is known better than by a box; positions, not pixels.
        scale: width and height of the picture over those of the recorded screen.
        helpless: whether the machine is in a state that no step of the agent can put right.
    """

    action: Action
    size: Size
    box: Box | None = None
    polygon: Sequence[tuple[float, float]] = ()
    scale: tuple[float, float] = (1.0, 1.0)
    helpless: bool = False


@dataclass(frozen=True)
class StepVerdict:
    """The outcome of one comparison.

    Args:
        parts: whether each part that counts is right: `type`, `place`, `end`, `text`, `keys`,
            `direction`.
        reason: the first part that is wrong, in words, or "".
        off: pixels between the two points, where both have one.
    """

    parts: dict[str, bool] = field(default_factory=dict[str, bool])
    reason: str = ""
    off: float | None = None

    @property
    def right(self) -> bool:
        """Whether the step counts."""
        return bool(self.parts) and all(self.parts.values())


def compare(expected: ExpectedStep, action: Action, near: Distance = NEAR) -> StepVerdict:
    """Compare an agent's action with the recorded one.

    Args:
        expected: what the row asks for; its type is not `UNSCORED`.
        action: the agent's action, in pixels of the same picture.
        near: how far points may be apart where no box is known.
    """
    want = expected.action
    parts = {"type": _same_type(expected, action)}
    if action.type == want.type:
        parts.update(_compare_details(expected, action, near))
    else:
        parts.update(dict.fromkeys(_counted_parts(expected), False))
    return StepVerdict(parts, _reason(parts, want, action), _distance(want.point, action.point))


def unanswered(expected: ExpectedStep, reason: str) -> StepVerdict:
    """Return the verdict on an answer that holds no action: all parts are wrong."""
    names = ("type", *_counted_parts(expected))
    return StepVerdict(dict.fromkeys(names, False), reason)


def same_text(first: str, second: str) -> bool:
    """Return whether two typed texts are equal but for white space and Unicode's spelling.

    NFC; every run of white space is one space, at the ends none, so an Enter at the end does not
    count either. Case counts.
    """
    return _plain_text(first) == _plain_text(second)


def same_keys(first: Sequence[str], second: Sequence[str]) -> bool:
    """Return whether two combinations of keys are the same.

    Names are compared without case and in one spelling (`control` is `ctrl`); the order of
    modifiers does not count.
    """
    return _plain_keys(first) == _plain_keys(second)


def inside(polygon: Sequence[tuple[float, float]], point: Point) -> bool:
    """Return whether the centre of a pixel lies in a polygon (even-odd rule)."""
    x = point[0] + 0.5
    y = point[1] + 0.5
    within = False
    previous = polygon[-1]
    for corner in polygon:
        crosses = (corner[1] > y) != (previous[1] > y)
        if crosses:
            share = (y - corner[1]) / (previous[1] - corner[1])
            if x < corner[0] + share * (previous[0] - corner[0]):
                within = not within
        previous = corner
    return within


def _same_type(expected: ExpectedStep, action: Action) -> bool:
    if expected.helpless and action.type == HELP:
        return True
    return action.type == expected.action.type


def _counted_parts(expected: ExpectedStep) -> list[str]:
    """Return the parts beside the type that the recorded action has.

    Text and keys have no place, whatever box stands beside them.
    """
    want = expected.action
    names: list[str] = []
    if want.type == "scroll":
        return ["direction"] if want.amount else []
    if want.type in AIMING and (want.point is not None or expected.box is not None):
        names.append("place")
    if want.end is not None:
        names.append("end")
    if want.type == "type":
        names.append("text")
    if want.keys:
        names.append("keys")
    return names


def _compare_details(expected: ExpectedStep, action: Action, near: Distance) -> dict[str, bool]:
    want = expected.action
    parts: dict[str, bool] = {}
    for name in _counted_parts(expected):
        if name == "place":
            parts[name] = _in_place(expected, action.point, near)
        elif name == "end":
            parts[name] = _is_near(expected, want.end, action.end, near)
        elif name == "text":
            parts[name] = same_text(want.text or "", action.text or "")
        elif name == "keys":
            parts[name] = same_keys(want.keys or (), action.keys or ())
        else:
            parts[name] = _sign(want.amount) == _sign(action.amount)
    if action.keys and not want.keys:
        parts["keys"] = False  # a click with Ctrl held is another action
    return parts


def _in_place(expected: ExpectedStep, point: Point | None, near: Distance) -> bool:
    if point is None:
        return False
    if expected.polygon:
        return inside(expected.polygon, point)
    if expected.box is None:
        return _is_near(expected, expected.action.point, point, near)
    return in_box(expected.box, point)


def _is_near(
    expected: ExpectedStep, first: Point | None, second: Point | None, near: Distance
) -> bool:
    if first is None or second is None:
        return False
    return near.reaches(first, second, expected.scale, expected.size)


def _reason(parts: dict[str, bool], want: Action, action: Action) -> str:
    part = next((name for name, is_right in parts.items() if not is_right), None)
    if part is None:
        return ""
    if part == "type":
        return f"{action.type} in the place of {want.type}"
    values = {
        "place": action.point,
        "end": action.end,
        "text": action.text,
        "keys": action.keys,
        "direction": action.amount,
    }
    return f"{part}: {values[part]!r:.120}"


def _distance(first: Point | None, second: Point | None) -> float | None:
    if first is None or second is None:
        return None
    return round(math.hypot(first[0] - second[0], first[1] - second[1]), 1)


def _sign(amount: float | None) -> int:
    if not amount:
        return 0
    return 1 if amount > 0 else -1


def _plain_text(text: str) -> str:
    return re.sub(r"\s+", " ", unicodedata.normalize("NFC", text)).strip()


def _plain_keys(keys: Sequence[str]) -> tuple[frozenset[str], tuple[str, ...]]:
    lower = [key.lower() for key in keys if key]  # an empty text names no key
    if not lower:
        return frozenset(), ()
    names = [_SIDE.sub(r"\1", name) for name in map(key_name, lower)]
    modifiers = frozenset(name for name in names if name in MODIFIERS)
    return modifiers, tuple(name for name in names if name not in MODIFIERS)
