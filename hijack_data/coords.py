"""Map coordinates between the picture that the agent sees and the real screen.

The *observation* is the picture that the agent is given; the *screen* is what the desktop really
shows. A whole number names a pixel, and the centre of the pixel is scaled (see `actions.scaling`
for the rule); results are clamped to the target. A pixel of the screen that is mapped to the
observation and back moves by half a pixel of the observation at most.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar, cast, overload

import numpy as np
import numpy.typing as npt

from .errors import ActionError, ParameterError, PlanError, short_repr
from .smart_resize import smart_resize
from .types import MAX_SIDE, Action, BoxArray, BoxesLike, Size, as_boxes, as_size

if TYPE_CHECKING:
    from .actions import Scaling

T = TypeVar("T")


@dataclass(frozen=True)
class CoordMap:
    """A map between an observation and the screen it shows.

    Args:
        observation: (height, width) of the picture that the agent sees.
        screen: (height, width) of the real screen.

    Points are x, y; sizes are (height, width). Wrong sizes raise `ParameterError` or
    `ParameterTypeError`.
    """

    observation: Size
    screen: Size

    def __post_init__(self) -> None:
        for name in ("observation", "screen"):
            object.__setattr__(self, name, as_size(getattr(self, name), name))

    @classmethod
    def identity(cls, size: Size) -> "CoordMap":
        """Return the map of a picture that was not resized."""
        return cls(size, size)

    @classmethod
    def model(cls, screen: Size, **limits: int) -> "CoordMap":
        """Return the map from a model's own space, the smart-resized picture, to the screen.

        `limits` are those of `smart_resize`. For a model that saw a resized observation, compose:
        the map `CoordMap.model(coords.observation).then(coords)` goes to the screen with a single
        rounding.
        """
        return cls(smart_resize(*as_size(screen, "screen"), **limits), screen)

    @property
    def is_identity(self) -> bool:
        """Whether observation and screen have the same size."""
        return self.observation == self.screen

    def inverse(self) -> "CoordMap":
        """Return the inverse map."""
        return CoordMap(self.screen, self.observation)

    def then(self, other: "CoordMap") -> "CoordMap":
        """Compose: this map first, then `other`, as one map with one rounding.

        Raises:
            ParameterError: the observation of `other` does not have the size of this map's screen.
        """
        if self.screen != other.observation:
            first = f"the first ends at (height, width) = {self.screen}"
            second = f"the second starts at {other.observation}"
            advice = "compose them in the order observation, then screen"
            raise ParameterError(f"maps do not meet: {first}, {second}; {advice}")
        return CoordMap(self.observation, other.screen)

    @overload
    def to_screen(self, points: tuple[float, float]) -> tuple[int, int]: ...
    @overload
    def to_screen(self, points: npt.ArrayLike) -> npt.NDArray[np.int32]: ...
    def to_screen(self, points: Any) -> Any:
        """Map points `[..., 2]` of x, y from the observation to the screen.

        A tuple or list of two numbers gives a tuple of two ints, anything else an int32 array of
        the same shape. Results lie in 0..width-1 and 0..height-1.

        Raises:
            ActionError: the points are not pairs of finite numbers.
        """
        return _points(points, self._forward)

    @overload
    def to_observation(self, points: tuple[float, float]) -> tuple[int, int]: ...
    @overload
    def to_observation(self, points: npt.ArrayLike) -> npt.NDArray[np.int32]: ...
    def to_observation(self, points: Any) -> Any:
        """Map points from the screen to the observation, as `to_screen`."""
        return _points(points, self._backward)

    def boxes_to_screen(self, boxes: BoxesLike) -> BoxArray:
        """Map boxes `[N, 4]` (xyxy) to int32 boxes of whole pixels.

        They are clipped to 0..width and 0..height. A box that overlaps the observation keeps at
        least one pixel, and every pixel in it maps into the mapped box.

        Raises:
            ParameterError: they are not boxes in pixels; see `types.as_boxes`.
        """
        return self._forward.boxes(as_boxes(boxes))

    def boxes_to_observation(self, boxes: BoxesLike) -> BoxArray:
        """Map boxes from the screen to the observation, as `boxes_to_screen`."""
        return self._backward.boxes(as_boxes(boxes))

    def vector_to_screen(self, dx: float, dy: float) -> tuple[int, int]:
        """Map a relative offset: scaled, rounded (halves away from zero), never clamped.

        Raises:
            ActionError: a number is not finite.
        """
        return _vector(dx, dy, self._forward)

    def vector_to_observation(self, dx: float, dy: float) -> tuple[int, int]:
        """Map a relative offset from the screen to the observation, as `vector_to_screen`."""
        return _vector(dx, dy, self._backward)

    def code_to_screen(self, code: str) -> str:
        """Map pyautogui code, given in observation pixels, to the screen.

        Only the numbers change: `hijack_data.actions.dialects.pyautogui_code` describes which code
        is understood and which is refused. WAIT, FAIL and DONE pass; under an identity map all code
        passes as it is.

        Raises:
            ActionError: something cannot be mapped; the message has its line and column.
        """
        return self._code(code, self._forward)

    def code_to_observation(self, code: str) -> str:
        """Map pyautogui code recorded on the screen to the observation, as `code_to_screen`."""
        return self._code(code, self._backward)

    def _code(self, code: str, scaling: "Scaling") -> str:
        from .actions import map_code

        return code if self.is_identity else map_code(code, scaling)

    def action_to_screen(self, action: Action) -> Action:
        """Map the points of an `Action`; text, keys and amounts stay unchanged."""
        return _action(action, self._forward)

    def action_to_observation(self, action: Action) -> Action:
        """Map an `Action` from the screen to the observation, as `action_to_screen`."""
        return _action(action, self._backward)

    def typed_to_screen(self, action: T, dialect: str) -> T:
        """Map an action in one of `hijack_data.actions.DIALECTS`, in its own form, to the screen.

        For `ui_tars_1.5` the observation of this map is the smart-resized picture: see
        `CoordMap.model`.

        Raises:
            UnknownNameError: there is no such dialect.
            ActionError: the action cannot be mapped.
        """
        return self._typed(action, dialect, self._forward)

    def typed_to_observation(self, action: T, dialect: str) -> T:
        """Map an action of a dialect from the screen to the observation, as `typed_to_screen`."""
        return self._typed(action, dialect, self._backward)

    def _typed(self, action: T, dialect: str, scaling: "Scaling") -> T:
        from .actions import map_typed

        if self.is_identity and dialect == "pyautogui":
            return action
        return cast("T", map_typed(action, dialect, scaling))

    def to_json(self) -> dict[str, list[int]]:
        """Return `{"observation": [height, width], "screen": [height, width]}`."""
        return {"observation": list(self.observation), "screen": list(self.screen)}

    @classmethod
    def from_json(cls, data: object) -> "CoordMap":
        """Read what `to_json` wrote.

        Raises:
            PlanError: the data are damaged.
        """
        sizes = cast("dict[str, Any]", data) if isinstance(data, dict) else {}
        if set(sizes) != {"observation", "screen"} or not all(_is_size(s) for s in sizes.values()):
            mapping = short_repr(cast("object", data))
            raise PlanError(
                f"coords must be {{'observation': [h, w], 'screen': [h, w]}}, got {mapping}"
            )
        return cls(tuple(sizes["observation"]), tuple(sizes["screen"]))

    @property
    def _forward(self) -> "Scaling":
        return _scaling(self.observation, self.screen)

    @property
    def _backward(self) -> "Scaling":
        return _scaling(self.screen, self.observation)


# `actions` is imported on first use: every plan has a `CoordMap`, and a program that only draws
# plans should not wait for the parsers of all dialects.


def _scaling(source: Size, target: Size) -> "Scaling":
    from .actions.scaling import Scaling

    return Scaling(source, target)


def _is_size(value: object) -> bool:
    pair = cast("list[Any]", value) if isinstance(value, list | tuple) else []
    return len(pair) == 2 and all(
        isinstance(v, int) and not isinstance(v, bool) and 0 < v <= MAX_SIDE for v in pair
    )


def _points(points: object, scaling: "Scaling") -> Any:
    try:
        raw: npt.NDArray[Any] = np.asarray(points)
    except (TypeError, ValueError, OverflowError, RecursionError):
        raw = np.zeros((), object)
    if raw.shape == (0,):
        return np.zeros((0, 2), np.int32)
    if raw.dtype.kind not in "iuf" or raw.ndim < 1 or raw.shape[-1] != 2:
        raise ActionError(
            f"points must be numbers of shape [..., 2] (x, y), got {short_repr(points)}"
        )
    values = raw.astype(np.float64)
    if not np.isfinite(values).all():
        raise ActionError(f"points must be finite, got {short_repr(points)}")
    mapped = scaling.points(values)
    if isinstance(points, list | tuple) and raw.ndim == 1:
        return int(mapped[0]), int(mapped[1])
    return mapped


def _vector(dx: float, dy: float, scaling: "Scaling") -> tuple[int, int]:
    from .actions.dialects.field_checks import number

    return scaling.dx(number(dx, "dx")), scaling.dy(number(dy, "dy"))


def _action(action: Action, scaling: "Scaling") -> Action:
    from .actions.dialects.field_checks import number

    def map_x(value: float | None) -> int | None:
        return None if value is None else scaling.x(number(value, "x of the action"))

    def map_y(value: float | None) -> int | None:
        return None if value is None else scaling.y(number(value, "y of the action"))

    x = map_x(action.x)
    x2 = map_x(action.x2)
    y = map_y(action.y)
    y2 = map_y(action.y2)
    return replace(action, x=x, y=y, x2=x2, y2=y2)
