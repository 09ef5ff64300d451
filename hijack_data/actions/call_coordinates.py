"""Where a pointer call points: its coordinates, scaled, and the expressions that state them."""

import ast
from collections.abc import Callable
from typing import NamedTuple, NoReturn, TypeAlias

from ..errors import ActionError
from .pyautogui_functions import POINTER
from .pyautogui_grammar import Argument, PyautoguiCall, Tween, Value
from .python_source import ParsedSource
from .scaling import Scaling

_FIX = "write the numbers into the call, such as pyautogui.click(100, 200)"
_Scale: TypeAlias = Callable[[float], int]


class CallCoordinates(NamedTuple):
    """The scaled coordinates (or offsets) of a call, each `None` if it is not given.

    `edits` lists the expressions to replace, each with its new value.
    """

    x: int | None
    y: int | None
    edits: list[tuple[ast.expr, Value]]


def read_coordinates(
    source: ParsedSource, call: PyautoguiCall, scaling: Scaling
) -> CallCoordinates:
    """Return where a call of one of `POINTER` points.

    Args:
        source: the code that holds the call.
        call: the call.
        scaling: maps from the space of the code to the target space.

    Raises:
        ActionError: a coordinate is not a number, or lies outside the space of the code.
    """
    return _CoordinateReader(source, call, scaling).read()


class _CoordinateReader:
    """Reads the coordinates of one call."""

    def __init__(self, source: ParsedSource, call: PyautoguiCall, scaling: Scaling) -> None:
        self._source = source
        self._call = call
        self._scaling = scaling
        self._absolute = "x" in POINTER[call.function]

    def read(self) -> CallCoordinates:
        names = ("x", "y") if self._absolute else ("xOffset", "yOffset")
        arguments = self._call.bind(POINTER[self._call.function])
        x, y = (arguments.get(name) for name in names)
        if x is not None and isinstance(x.value, tuple):
            if y is not None and y.value is not None:
                reason = "it holds both coordinates, and a second argument is given too"
                self._refuse(names[0], x, reason)
            return self._read_pair(names[0], x, x.value)
        self._check_point(x, [argument.value for argument in (x, y) if argument is not None])
        scale_x, scale_y = self._scales()
        new_x = self._scaled(names[0], x, scale_x)
        new_y = self._scaled(names[1], y, scale_y)
        edits = [
            (argument.node, number)
            for argument, number in ((x, new_x), (y, new_y))
            if argument is not None and number is not None
        ]
        return CallCoordinates(new_x, new_y, [*edits])

    def _scales(self) -> tuple[_Scale, _Scale]:
        if self._absolute:
            return self._scaling.x, self._scaling.y
        return self._scaling.dx, self._scaling.dy

    def _read_pair(self, name: str, x: Argument, values: tuple[Value, ...]) -> CallCoordinates:
        pair = _centre(values)
        if len(pair) != 2 or None in pair:
            self._refuse(name, x, "a sequence must hold two numbers")
        self._check_point(x, [*pair])
        new_x, new_y = (
            self._scaled(name, x._replace(value=value), scale)
            for value, scale in zip(pair, self._scales(), strict=True)
        )
        if isinstance(x.node, ast.Tuple | ast.List) and len(x.node.elts) == 2:
            edits: list[tuple[ast.expr, Value]] = [*zip(x.node.elts, (new_x, new_y), strict=True)]
            return CallCoordinates(new_x, new_y, edits)
        return CallCoordinates(new_x, new_y, [(x.node, (new_x, new_y))])

    def _check_point(self, x: Argument | None, values: list[Value]) -> None:
        """Refuse a place in fractions of the picture, which mapping would turn into its corner."""
        numbers = [value for value in values if isinstance(value, int | float)]
        if x is None or len(numbers) != 2 or not self._absolute:
            return
        try:
            self._scaling.check_point(*numbers)
        except ActionError as error:
            self._refuse("x", x, str(error))

    def _scaled(self, name: str, argument: Argument | None, scale: _Scale) -> int | None:
        if argument is None or argument.value is None:
            return None
        match argument.value:
            case bool() | tuple() | Tween():
                self._refuse(name, argument, "it is not a number")
            case str():
                self._refuse(name, argument, "it names a picture to look for on the real screen")
            case number:
                try:
                    return scale(number)
                except ActionError as error:
                    self._refuse(name, argument, str(error))

    def _refuse(self, name: str, argument: Argument, reason: str) -> NoReturn:
        function = self._source.text(self._call.node.func)
        text = self._source.text(argument.node)
        problem = f"{function}(...): {name} = {text} cannot be mapped: {reason}"
        self._source.refuse(self._call.node, problem, _FIX)


def _centre(values: tuple[Value, ...]) -> tuple[Value, ...]:
    """Return the centre of (left, top, width, height), at which pyautogui aims."""
    match values:
        case (
            int() | float() as left,
            int() | float() as top,
            int() | float() as width,
            int() | float() as height,
        ):
            return left + width / 2, top + height / 2
        case _:
            return values
