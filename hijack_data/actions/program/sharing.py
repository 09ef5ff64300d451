"""Find the lists of a program that nothing can change unnoticed.

A list that the program only indexes, unpacks, iterates over or passes to pyautogui stays unchanged.
A list that is put anywhere else (into another name, a call, a method, an item) may be changed from
there in countless ways.
"""

import ast
from collections.abc import Callable

NEVER = 1_000_000  # deeper than any value

# The depth from which a function may change its arguments: with 0 it may change the argument
# itself, with 1 only its items, with NEVER nothing.
LeavesAlone = Callable[[ast.expr], int]


def changed_depths(tree: ast.Module, leaves_alone: LeavesAlone) -> dict[str, int]:
    """Return for each name the depth from which on the lists in its value may be changed.

    Depth 0 is the value itself, 1 its items, and so on; names that are never used are missing.
    """
    parents: dict[int, ast.AST] = {}
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            parents[id(child)] = node
    depths: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            depth = _escapes_at(node, parents, leaves_alone)
            depths[node.id] = min(depth, depths.get(node.id, NEVER))
    return depths


def _escapes_at(name: ast.Name, parents: dict[int, ast.AST], leaves_alone: LeavesAlone) -> int:
    node: ast.AST = name
    depth = 0
    while True:
        match parents[id(node)]:
            case ast.Subscript(value=value, ctx=ast.Load()) as parent if value is node:
                node = parent
                depth += 1
            case ast.keyword() as parent:
                node = parent
            case ast.Call(func=function) if function is not node:
                return depth + leaves_alone(function)
            case ast.Starred() | ast.For() | ast.AsyncFor() | ast.comprehension():
                return depth + 1
            case ast.Assign(targets=targets) if all(map(_unpacks, targets)):
                return depth + 1
            case ast.FormattedValue() | ast.Expr() | ast.If() | ast.While() | ast.Assert():
                return NEVER
            case _:
                return depth


def _unpacks(target: ast.expr) -> bool:
    return isinstance(target, ast.Tuple | ast.List)
