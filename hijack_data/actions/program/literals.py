"""What the arguments of a call may contain, judged by the literals in the source."""

import ast
import re

from .names import Names

_NUMERIC = re.compile(r"[\s\d.,;:()\[\]-]*\d[\s\d.,;:()\[\]-]*")


def values(call: ast.Call) -> list[ast.expr]:
    """Return the argument expressions of a call, positional ones first."""
    return call.args + [keyword.value for keyword in call.keywords]


def is_text(node: ast.expr, names: Names) -> bool:
    """Return whether an expression is certainly a text other than a number in quotes."""
    match node:
        case ast.Constant(value=str(text)):
            return _NUMERIC.fullmatch(text) is None
        case ast.Constant(value=bytes()) | ast.JoinedStr():
            return True
        case ast.Name(id=name):
            return name in names.texts
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return is_text(left, names) and is_text(right, names)
        case ast.BinOp(left=left, op=ast.Mod()):
            return is_text(left, names)
        case ast.Call(func=ast.Name(id="str")):
            return names.is_builtin("str")
        case _:
            return False


def count_numbers(call: ast.Call, names: Names) -> int:
    """Return how many numbers may be passed to a call: one for each argument that is not a text.

    The items of a sequence count one by one; anything unpacked by `*` or `**` counts as two.
    """
    unpacked = sum(keyword.arg is None for keyword in call.keywords)
    return 2 * unpacked + _count_all(values(call), names)


def may_hold_place(call: ast.Call, names: Names) -> bool:
    """Return whether the two numbers of a place may be passed to a call, even in one variable."""
    for value in values(call):
        is_written = isinstance(value, ast.Constant | ast.UnaryOp)
        if not is_written and not is_text(value, names):
            return True
    return count_numbers(call, names) > 1


def _count_all(nodes: list[ast.expr], names: Names) -> int:
    return sum(_count(node, names) for node in nodes)


def _count(node: ast.expr, names: Names) -> int:
    if is_text(node, names):
        return 0
    match node:
        case ast.Starred():
            return 2
        case ast.Tuple(elts=items) | ast.List(elts=items) | ast.Set(elts=items):
            return _count_all(items, names)
        case ast.Dict(values=items):
            return _count_all(items, names)
        case _:
            return 1
