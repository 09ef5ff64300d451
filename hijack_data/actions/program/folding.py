"""Bounded constant folding: arithmetic on a program's constants, without running it."""

import ast
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

from ...types import Size
from .names import Names
from .values import Bindings, Listed, Number, ScreenSize, Unknown, Value, list_depths

# Larger integers are not coordinates, and arithmetic on them could fill the memory.
_BIGGEST = 2**53
_LONGEST_TEXT = 100_000
_LONGEST_SEQUENCE = 64
_BIGGEST_EXPONENT = 16

_BINARY: dict[type[ast.operator], Callable[[Number, Number], object]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.FloorDiv: lambda a, b: a // b,
    ast.Mod: lambda a, b: a % b,
    ast.Pow: lambda a, b: a**b,
}
_UNARY: dict[type[ast.unaryop], Callable[[Number], Number]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_FUNCTIONS: dict[str, Callable[..., object]] = {
    "int": int,
    "float": float,
    "round": round,
    "abs": abs,
    "min": min,
    "max": max,
}


@dataclass(frozen=True)
class Folder:
    """Computes the constants of expressions: numbers, text, `None`, and tuples of them.

    Lists count as tuples.

    Args:
        names: the names of the program.
        screen: the size for `pyautogui.size()`, (height, width); `None` if it is not known.
    """

    names: Names
    screen: Size | None

    def fold(self, node: ast.expr, env: Bindings) -> Value:
        """Return the value of `node`.

        Raises:
            Unknown: it is not a constant.
        """
        match node:
            case ast.Constant(value=value):
                return _checked(value)
            case ast.Name(id=name):
                return self._name(name, env)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                sign = _UNARY[type(op)]
                return _checked(sign(_number(self.fold(operand, env))))
            case ast.BinOp(left=left, op=op, right=right):
                return arithmetic(op, self.fold(left, env), self.fold(right, env))
            case ast.Tuple(elts=elements):
                return self.elements(elements, env)
            case ast.List(elts=elements):
                return Listed(self.elements(elements, env))
            case ast.Subscript(value=value, slice=index):
                return _item(self.fold(value, env), self.fold(index, env))
            case ast.Attribute(value=value, attr="width" | "height" as side):
                size = self.fold(value, env)
                if isinstance(size, ScreenSize):
                    return size.width if side == "width" else size.height
                raise Unknown(f"{ast.unparse(node)[:40]!r} is known only when the code runs")
            case ast.Call():
                return self._call(node, env)
            case _:
                raise Unknown("it is not a number that is known before the code runs")

    def elements(self, nodes: Sequence[ast.expr], env: Bindings) -> tuple[Value, ...]:
        """Return the values of `nodes` as one tuple.

        Raises:
            Unknown: one is not a constant.
        """
        values: list[Value] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                inner = self.fold(node.value, env)
                values += inner if isinstance(inner, tuple) else [_unpackable()]
            else:
                values.append(self.fold(node, env))
        if len(values) > _LONGEST_SEQUENCE or any(map(_is_deep, values)):
            raise Unknown("the sequence is too long or too deep")
        for value in values:
            if isinstance(value, float) and not math.isfinite(value):
                raise Unknown("a number in the sequence is not finite")
        return tuple(values)

    def _name(self, name: str, env: Bindings) -> Value:
        if name in self.names.volatile:
            ways = "global, nonlocal, ':=', import * or the private names of a class"
            raise Unknown(f"{name!r} may change through {ways}")
        value = env.get(name)
        if isinstance(value, Unknown):
            raise Unknown(value.reason)
        if any(depth >= self.names.changes_at(name) for depth in list_depths(value)):
            raise Unknown(f"the list may be changed before {name!r} is used")
        return value

    def _call(self, node: ast.Call, env: Bindings) -> Value:
        callee = self.names.callee(node.func)
        if callee == ("pyautogui", "size") and not node.args and self.screen is not None:
            return cast("Value", ScreenSize(self.screen[1], self.screen[0]))
        if callee == ("pyautogui", "position"):
            raise Unknown("position() depends on where the pointer is when the code runs")
        match node:
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                if name in _FUNCTIONS and self.names.is_builtin(name):
                    numbers = [_number(self.fold(argument, env)) for argument in args]
                    return _apply(name, numbers)
            case _:
                pass
        function = ast.unparse(node.func)[:40]
        raise Unknown(f"the result of {function}() is known only when the code runs")


def arithmetic(op: ast.operator, left: Value, right: Value) -> Value:
    """Return `left op right`, for numbers (and `+` for text).

    Raises:
        Unknown: it cannot be computed, or grows too large.
    """
    if isinstance(left, str) and isinstance(right, str) and isinstance(op, ast.Add):
        return _checked(left + right)
    a = _number(left)
    b = _number(right)
    compute = _BINARY.get(type(op))
    if compute is None or (isinstance(op, ast.Pow) and _is_big_power(a, b)):
        raise Unknown("this arithmetic is not followed")
    try:
        return _checked(compute(a, b))
    except ArithmeticError as error:
        raise Unknown(f"the arithmetic fails ({error})") from None


def _is_big_power(base: Number, exponent: Number) -> bool:
    digits = math.log2(abs(base) + 1)
    return max(abs(exponent), digits) > _BIGGEST_EXPONENT


def _is_deep(value: Value) -> bool:
    return isinstance(value, tuple) and any(isinstance(item, tuple) for item in value)


def _apply(name: str, args: list[Number]) -> Value:
    digits = args[1] if name == "round" and len(args) > 1 else 0
    if abs(digits) > _BIGGEST_EXPONENT:
        raise Unknown("round() is asked for too many digits")
    try:
        return _checked(_FUNCTIONS[name](*args))
    except (TypeError, ValueError, ArithmeticError) as error:
        raise Unknown(f"{name}() fails ({error})") from None


def _checked(value: object) -> Value:
    if isinstance(value, bool) or not isinstance(value, int | float | str | None):
        raise Unknown(f"a {type(value).__name__} is not a number")
    if isinstance(value, int) and abs(value) > _BIGGEST:
        raise Unknown("the number is too large")
    if isinstance(value, str) and len(value) > _LONGEST_TEXT:
        raise Unknown("the text is too long")
    return value


def _number(value: Value) -> Number:
    if isinstance(value, int | float):
        return value
    kind = "None" if value is None else type(value).__name__
    raise Unknown(f"{kind} is not a number")


def _item(values: Value, index: Value) -> Value:
    if isinstance(values, tuple) and isinstance(index, int):
        count = len(values)
        if -count <= index < count:
            return values[index]
    raise Unknown("the item is not known")


def _unpackable() -> Value:
    raise Unknown("the value unpacked with * is not a known sequence")
