"""Plain data shared by every package: screens, actions and recordings.

Coordinates are integer pixels, origin top-left, x to the right, y down. Boxes are `xyxy`,
half-open: a box covers `x1 <= x < x2`, `y1 <= y < y2`. A `Size` is `(height, width)`, as in the
shapes of arrays, everywhere in Python and in plans; YAML files and the command line write the width
first (`1920x1080`, `[1920, 1080]`), as screens are named, and `size_text` prints it so.
"""

import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from .choices import Platform
from .errors import ParameterError, ParameterTypeError, short_repr

Size: TypeAlias = tuple[int, int]  # (height, width) in pixels
Box: TypeAlias = tuple[int, int, int, int]
Point: TypeAlias = tuple[int, int]
BoxArray: TypeAlias = npt.NDArray[np.int32]
Int32Array: TypeAlias = npt.NDArray[np.int32]
UInt8Array: TypeAlias = npt.NDArray[np.uint8]
BoxesLike: TypeAlias = npt.ArrayLike | Sequence[Sequence[float]] | None

# A target given as a point is judged by the square of this many pixels around it.
POINT_TARGET = 16
MAX_SIDE = 1 << 20
# A recorded point may lie outside the screen by this share of a side; a point farther away belongs
# to another coordinate space or another screen.
SLACK = 0.05

ACTION_TYPES = (
    "click",
    "double_click",
    "triple_click",
    "right_click",
    "middle_click",
    "move",
    "drag",
    "mouse_down",
    "mouse_up",
    "scroll",
    "type",
    "hotkey",
    "key_down",
    "key_up",
    "wait",
    "done",
    "fail",
    "other",
)
# Those that aim at a place; text and keys go where the focus is, and scrolling to what lies below.
AIMING = frozenset(
    [
        *("click", "double_click", "triple_click", "right_click", "middle_click"),
        *("move", "drag", "mouse_down", "mouse_up"),
    ]
)


def size_text(size: Size) -> str:
    """Return `(height, width)` as text with the width first: `1920x1080`."""
    return f"{size[1]}x{size[0]}"


def as_size(value: object, name: str = "size") -> Size:
    """Check a `(height, width)` pair of positive integers.

    Raises:
        ParameterError: a side is below 1 or beyond `MAX_SIDE`.
        ParameterTypeError: `value` is not a pair of integers.
    """
    try:
        height, width = (operator.index(v) for v in cast("Sequence[int]", value))
    except (TypeError, ValueError):
        expected = "(height, width), two integers"
        raise ParameterTypeError(f"{name} must be {expected}, got {value!r}") from None
    if height < 1 or width < 1:
        raise ParameterError(f"{name} must be at least (1, 1), got ({height}, {width})")
    if max(height, width) > MAX_SIDE:
        raise ParameterError(f"{name} ({height}, {width}) is beyond {MAX_SIDE} pixels a side")
    return height, width


def as_boxes(value: BoxesLike, name: str = "boxes") -> BoxArray:
    """Return boxes as an int32 array of shape `[N, 4]`, `xyxy`.

    `None` and empty input give shape `[0, 4]`. Fractional edges are rounded (halves up); a box with
    a positive area keeps at least one pixel.

    Raises:
        ParameterError: the shape is wrong, a number is not finite, the corners of a box are
            swapped, or a box is in fractions of the picture (0..1).
        ParameterTypeError: `value` does not hold numbers.
    """
    if value is None:
        return np.zeros((0, 4), np.int32)
    expected = f"{name} must be rows of x1, y1, x2, y2"
    try:
        is_mask = np.asarray(value).dtype == np.bool_
        raw = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ParameterTypeError(f"{expected}, got {short_repr(value)}") from None
    if is_mask:  # its values would be taken for tiny boxes
        raise ParameterTypeError(f"{expected}, got {short_repr(value)}")
    if raw.size == 0:
        return np.zeros((0, 4), np.int32)
    if raw.ndim != 2 or raw.shape[1] != 4:
        raise ParameterError(f"{name} must have shape [N, 4] (xyxy), got {list(raw.shape)}")
    if not np.isfinite(raw).all() or np.abs(raw).max() > 2**30:
        raise ParameterError(f"{name} hold a number that is not finite or is beyond 2**30")
    boxes = _whole_boxes(raw, name)
    swapped = (boxes[:, 2:] < boxes[:, :2]).any(axis=1)
    if swapped.any():
        bad = int(np.flatnonzero(swapped)[0])
        advice = "boxes are x1, y1, x2, y2 (not x, y, w, h)"
        raise ParameterError(
            f"{name}[{bad}] = {boxes[bad].tolist()} ends before it starts; {advice}"
        )
    return boxes


def _whole_boxes(raw: npt.NDArray[np.float64], name: str) -> BoxArray:
    """Return boxes with their edges rounded, see `as_boxes`."""
    boxes = np.floor(raw + 0.5).astype(np.int32)
    fractional = (boxes != raw).any(axis=1)
    if not fractional.any():
        return boxes
    for row in raw[fractional]:
        _refuse_fractions(row.tolist(), name)
    thin = (raw[:, 2:] > raw[:, :2]) & (boxes[:, 2:] <= boxes[:, :2])
    low = np.floor(raw[:, :2]).astype(np.int32)
    boxes[:, :2][thin] = low[thin]
    boxes[:, 2:][thin] = low[thin] + 1
    return boxes


def as_target(value: object, size: Size | None = None) -> Box | None:
    """Return a target as a box.

    A box stays as it is; a point becomes the square of `POINT_TARGET` pixels around it.

    Args:
        value: a point (x, y) or a box (x1, y1, x2, y2) in pixels, or `None`.
        size: `(height, width)` of the screen: a point may lie outside it by `SLACK` of a side. A
            box may be off the screen, and is then invisible.

    Raises:
        ParameterError: the box is empty, the point is off the screen, or the numbers are fractions
            of the picture or not finite.
        ParameterTypeError: `value` is neither a point nor a box.
    """
    if value is None:
        return None
    expected = "target must be a point (x, y) or a box (x1, y1, x2, y2)"
    try:
        numbers = [float(v) for v in cast("Sequence[float]", value)]
    except (TypeError, ValueError, OverflowError):
        raise ParameterTypeError(f"{expected}, got {value!r:.80}") from None
    if len(numbers) == 2:
        return _around(numbers, size)
    if len(numbers) != 4:
        raise ParameterError(f"{expected}, got {len(numbers)} numbers")
    x1, y1, x2, y2 = as_boxes([numbers], "target")[0].tolist()
    if x1 >= x2 or y1 >= y2:
        raise ParameterError(f"target {numbers} is a box without area; give a point (x, y) instead")
    return x1, y1, x2, y2


def _around(point: list[float], size: Size | None) -> Box:
    """Return the square around a point target.

    Raises:
        ParameterError: the point is off the screen, not finite, or in fractions of the picture.
    """
    if not all(abs(v) <= 2**30 for v in point):
        raise ParameterError(f"target {point} holds a number that is not finite or is beyond 2**30")
    _refuse_fractions(point, "target")
    x, y = (int(np.floor(v + 0.5)) for v in point)
    if size is not None:
        height, width = size
        across = -SLACK * width <= x <= (1 + SLACK) * width
        down = -SLACK * height <= y <= (1 + SLACK) * height
        if not (across and down):
            location = f"outside the {width}x{height} screen"
            raise ParameterError(f"target ({x}, {y}) is {location}; give pixels of this screen")
        x = min(max(x, 0), width - 1)
        y = min(max(y, 0), height - 1)
    half = POINT_TARGET // 2
    return x - half, y - half, x + half, y + half


def are_fractions(numbers: Sequence[float]) -> bool:
    """Return whether numbers can only be fractions of the picture: in 0..1, and not all whole."""
    return all(0 <= v <= 1 for v in numbers) and any(v != int(v) for v in numbers)


def _refuse_fractions(numbers: Sequence[float], name: str) -> None:
    if are_fractions(numbers):
        raise ParameterError(
            f"{name} holds {list(numbers)}, which are fractions of the picture, not pixels;"
            " multiply x by its width and y by its height, or in a sample declare the entry, such"
            " as labels={'bbox': 'xyxy01', 'click': 'point01'}"
        )


def clip_boxes(boxes: BoxArray, size: Size) -> BoxArray:
    """Clip boxes to a screen of `size`, (height, width).

    Rows keep their order; boxes off the screen become empty.
    """
    height, width = size
    limit = np.array([width, height, width, height], np.int32)
    return np.clip(boxes, 0, limit)


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known about one screen before it is corrupted.

    Args:
        size: `(height, width)` of the screenshot in pixels.
        boxes: `[N, 4]` integer `xyxy` boxes of interactive elements; may be empty, may leave the
            screen.
        apps: normalised names of the applications that the task uses.
        target: the box or point that the step's action aims at, if known; see `as_target`.

    Raises:
        ParameterError: the size, the boxes or the target cannot be right: fractions of the picture
            instead of pixels, a target box without area, a point off the screen.
        ParameterTypeError: one of them has the wrong type.
    """

    size: Size
    boxes: BoxArray = field(default_factory=lambda: as_boxes(None))
    apps: tuple[str, ...] = ()
    target: Box | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", as_size(self.size))
        object.__setattr__(self, "boxes", as_boxes(self.boxes))
        object.__setattr__(self, "apps", _as_apps(self.apps))
        object.__setattr__(self, "target", as_target(self.target, self.size))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return NotImplemented
        fields_equal = (self.size, self.apps, self.target) == (other.size, other.apps, other.target)
        return fields_equal and np.array_equal(self.boxes, other.boxes)

    __hash__ = None  # type: ignore[assignment]

    @property
    def obstacles(self) -> BoxArray:
        """Boxes clipped to the screen, without the empty ones: int32 `[M, 4]`."""
        if not len(self.boxes):
            return self.boxes
        boxes = clip_boxes(self.boxes, self.size)
        return boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the boxes for the reader of the plan."""
        count = len(self.boxes)
        ignored = count - len(self.obstacles)
        if not ignored:
            return ()
        return (f"{ignored} of {count} boxes are empty or off the screen and were ignored",)


def _as_apps(apps: object) -> tuple[str, ...]:
    if isinstance(apps, str):
        return (apps,)
    if apps is None:
        return ()
    if not isinstance(apps, Iterable):
        raise ParameterTypeError(f"apps must be names of applications, got {apps!r}")
    return tuple(str(app) for app in cast("Iterable[object]", apps))


@dataclass(frozen=True)
class Action:
    """One action, in pixels of its screenshot.

    `type` is one of `ACTION_TYPES`; `x, y` is the point (the start of a drag), `x2, y2` the end of
    a drag, `text` what is typed, `keys` the keys held together, `amount` scroll clicks (positive is
    up) or seconds to wait.
    """

    type: str
    x: int | None = None
    y: int | None = None
    x2: int | None = None
    y2: int | None = None
    text: str | None = None
    keys: tuple[str, ...] | None = None
    amount: float | None = None

    @property
    def point(self) -> Point | None:
        """The point that the action aims at, or `None`."""
        return None if self.x is None or self.y is None else (self.x, self.y)

    @property
    def end(self) -> Point | None:
        """The point at which a drag ends, or `None`."""
        return None if self.x2 is None or self.y2 is None else (self.x2, self.y2)


def in_box(box: Box, point: Point) -> bool:
    """Return whether a pixel lies in a box; boxes are half-open."""
    x1, y1, x2, y2 = box
    return x1 <= point[0] < x2 and y1 <= point[1] < y2


def check_aim(action: Action, box: Box | None) -> None:
    """Check that a recorded action lies in its own target, if it aims at a point.

    Raises:
        ParameterError: it lies outside, so one of the two is wrong.
    """
    point = action.point
    if box is None or point is None or action.type not in AIMING or in_box(box, point):
        return
    raise ParameterError(
        f"the recorded {action.type} at {point} is outside its own target_box {list(box)} (x1, y1,"
        " x2, y2; the pixel at x2 is outside): correct the one that is wrong"
    )


@dataclass(frozen=True)
class Step:
    """One recorded step: the screen before the action, and the action.

    `image` is the path of the screenshot; `elements` are known boxes of interactive elements
    (`xyxy`), `target_box` the box of the element that the action aims at. `extra` holds everything
    else that was recorded, as a JSON object, or is empty.
    """

    index: int
    image: str
    action: Action
    action_code: str = ""
    target_box: Box | None = None
    elements: tuple[Box, ...] = ()
    id: str | None = None
    extra: str = ""


# `linux` is any desktop other than Xfce, or an unknown one; `web` is a page without the screen
# around it.


@dataclass(frozen=True)
class Trajectory:
    """A recorded episode. `source` names the format it was read from, `steps` may be lazy.

    `sample` is the key of the random draws if that is not the `id`: recordings of one task
    share their plans. `apps` are the applications that show, as the source names them; `platform`
    is the machine's, one of `Platform`, or `None` if the source does not name it.
    """

    id: str
    source: str
    instruction: str
    steps: Sequence[Step]
    domain: str = ""
    apps: tuple[str, ...] = ()
    sample: str | None = None
    platform: Platform | None = None

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)


Fidelity: TypeAlias = Literal["exact", "recorded", "composited", "foreign"]
