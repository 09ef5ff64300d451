"""The arguments of a call by parameter, with their values and their places in the source."""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .folding import Folder
from .values import Bindings, MaybeValue, Unknown, Value


@dataclass(frozen=True)
class Argument:
    """One argument: its value, or why that is not known.

    `node` is the expression to edit. An element of an unpacked variable (`*pos`) has no expression
    of its own: its `node` is the starred argument, `siblings` are all values of that argument and
    `index` is the element's place among them.
    """

    value: MaybeValue
    node: ast.expr
    siblings: tuple[Value, ...] | None = None
    index: int = 0


def arguments(
    call: ast.Call, parameters: Sequence[str], folder: Folder, env: Bindings
) -> dict[str, Argument]:
    """Return the arguments of `call` by parameter name, without those that are not passed.

    If an argument unpacks something unknown, every parameter that it may fill is `Unknown`.
    """
    found: dict[str, Argument] = {}
    lost: Argument | None = None
    for position, argument in enumerate(positional(call.args, folder, env)):
        if isinstance(argument.node, ast.Starred) and argument.siblings is None:
            lost = argument
            break
        if position < len(parameters):
            found[parameters[position]] = argument
    for keyword in call.keywords:
        argument = Argument(_value(keyword.value, folder, env), keyword.value)
        if keyword.arg is None:
            lost = Argument(Unknown("'**' unpacks a value that is not followed"), keyword.value)
        else:
            found[keyword.arg] = argument
    return found if lost is None else {**dict.fromkeys(parameters, lost), **found}


def positional(nodes: Sequence[ast.expr], folder: Folder, env: Bindings) -> Iterator[Argument]:
    """Yield the positional arguments in order, unpacked ones expanded.

    A starred `node` without `siblings` is unknown.
    """
    for node in nodes:
        if not isinstance(node, ast.Starred):
            yield Argument(_value(node, folder, env), node)
        elif isinstance(node.value, ast.Tuple | ast.List):
            yield from positional(node.value.elts, folder, env)
        else:
            yield from _unpacked(node, folder, env)


def _unpacked(node: ast.Starred, folder: Folder, env: Bindings) -> Iterator[Argument]:
    value = _value(node.value, folder, env)
    if isinstance(value, tuple):
        for index, item in enumerate(value):
            yield Argument(item, node, value, index)
    else:
        reason = (
            value.reason if isinstance(value, Unknown) else "the value after '*' is not a sequence"
        )
        yield Argument(Unknown(reason), node)


def _value(node: ast.expr, folder: Folder, env: Bindings) -> MaybeValue:
    try:
        # A list written in the call itself cannot have been changed before.
        if isinstance(node, ast.List):
            return folder.elements(node.elts, env)
        return folder.fold(node, env)
    except Unknown as unknown:
        return unknown
