"""Find where a pointer call points: its coordinates, scaled, and the arguments that hold them."""

import ast
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, NoReturn, TypeAlias

from ...errors import ActionError
from ..scaling import Scaling
from .arguments import Argument, arguments
from .folding import Folder
from .signatures import POINTER
from .source import ParsedSource
from .values import Bindings, MaybeValue, Unknown, Value

_FIX = "write the numbers into the call, such as pyautogui.click(100, 200)"
_Scale: TypeAlias = Callable[[float], int]


class CallCoordinates(NamedTuple):
    """The scaled coordinates (or offsets) of a call, each `None` if it is not given.

    `changes` lists the edits of the source.
    """

    x: int | None
    y: int | None
    changes: list[tuple[Argument, Value]]


class Pointing:
    """Reads the coordinates of the pointer calls of one program."""

    def __init__(self, source: ParsedSource, folder: Folder, scaling: Scaling) -> None:
        self._source = source
        self._folder = folder
        self._scaling = scaling

    def place(self, call: ast.Call, function: str, env: Bindings) -> CallCoordinates:
        """Return where `call` of a `function` in `POINTER` points.

        Raises `ActionError` if the place is not known before the code runs.
        """
        parameters = POINTER[function]
        given = arguments(call, parameters, self._folder, env)
        if "x" in parameters:
            names = ("x", "y")
            scales = (self._scaling.x, self._scaling.y)
        else:
            names = ("xOffset", "yOffset")
            scales = (self._scaling.dx, self._scaling.dy)
        x, y = (given.get(name) for name in names)
        if x is not None and isinstance(x.value, tuple):
            if y is not None and y.value is not None:
                self._refuse(
                    call,
                    names[0],
                    x,
                    "it holds both coordinates, and a second argument is given too",
                )
            return self._both(call, names[0], x, x.value, scales)
        if "x" in parameters:
            self._check_point(
                call, x, [argument.value for argument in (x, y) if argument is not None]
            )
        numbers = [self._scaled(call, *item) for item in zip(names, (x, y), scales, strict=True)]
        changes = [
            (a, n) for a, n in zip((x, y), numbers, strict=True) if a is not None and n is not None
        ]
        return CallCoordinates(numbers[0], numbers[1], [*changes])

    def _both(
        self,
        call: ast.Call,
        name: str,
        x: Argument,
        values: tuple[Value, ...],
        scales: tuple[_Scale, _Scale],
    ) -> CallCoordinates:
        parts = [replace(x, value=value) for value in _centre(values)]
        if len(parts) != 2 or any(part.value is None for part in parts):
            self._refuse(call, name, x, "a sequence must hold two numbers")
        if name == "x":
            self._check_point(call, x, [part.value for part in parts])
        numbers = [
            self._scaled(call, name, part, scale) for part, scale in zip(parts, scales, strict=True)
        ]
        written = _elements(x)
        if len(written) == 2:
            changes = [
                (Argument(None, node), number)
                for node, number in zip(written, numbers, strict=True)
            ]
            return CallCoordinates(numbers[0], numbers[1], [*changes])
        return CallCoordinates(numbers[0], numbers[1], [(x, tuple(numbers))])

    def _check_point(self, call: ast.Call, x: Argument | None, values: list[MaybeValue]) -> None:
        """Refuse a place in fractions of the picture, which mapping would turn into its corner."""
        numbers = [value for value in values if isinstance(value, int | float)]
        if x is None or len(numbers) != 2:
            return
        try:
            self._scaling.check_point(*numbers)
        except ActionError as error:
            self._refuse(call, "x", x, str(error))

    def _scaled(
        self, call: ast.Call, name: str, argument: Argument | None, scale: _Scale
    ) -> int | None:
        if argument is None or argument.value is None:
            return None
        match argument.value:
            case Unknown(reason=reason):
                self._refuse(call, name, argument, reason)
            case int() | float() as number:
                try:
                    return scale(number)
                except ActionError as error:
                    self._refuse(call, name, argument, str(error))
            case str():
                self._refuse(
                    call, name, argument, "it names a picture to look for on the real screen"
                )
            case _:
                self._refuse(call, name, argument, "it is not a number")

    def _refuse(self, call: ast.Call, name: str, argument: Argument, reason: str) -> NoReturn:
        function = self._source.text(call.func)
        written = self._source.text(argument.node)
        self._source.refuse(
            call, f"{function}(...): {name} = {written} cannot be mapped: {reason}", _FIX
        )


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


def _elements(argument: Argument) -> list[ast.expr]:
    """Return the elements of a sequence that is written out in the call."""
    node = argument.node
    if isinstance(node, ast.Tuple | ast.List) and not any(
        isinstance(e, ast.Starred) for e in node.elts
    ):
        return node.elts
    return []
