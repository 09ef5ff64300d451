"""Find the missing packages that a task could use, before anything runs.

They are found in the bytecode of its evaluator and setup. A metric with a bare `except:` would
swallow even `MissingDependency`, and one that imports inside a function sees no stub; so a task is
refused beforehand. In doubt it is refused: a branch that is never taken counts as well.
"""

import dataclasses
import dis
import functools
import importlib.util
import inspect
import sys
import types
from collections.abc import Iterator
from typing import Any

from .stubs import absent, stub_root

_Names = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Imported:
    """The root package of an import inside a function."""

    root: str


OWN_PACKAGES = ("desktop_env", __name__.partition(".")[0])


@functools.cache
def imported_packages(function: Any) -> frozenset[str]:
    """Return the missing packages that a function refers to.

    Functions of `desktop_env` that it names are followed.
    """
    packages: set[str] = set()
    visited: set[int] = set()
    waiting = [function]
    while waiting:
        item = waiting.pop()
        if id(item) in visited:
            continue
        visited.add(id(item))
        for value in _referred(item):
            root = stub_root(value)
            if root:
                packages.add(root)
            elif isinstance(value, Imported):
                packages.update(absent([value.root]))
            elif _ours(value):
                waiting.append(value)
    return frozenset(packages)


def _ours(value: object) -> bool:
    if not isinstance(value, types.FunctionType | type):
        return False
    module = str(getattr(value, "__module__", ""))
    return module.partition(".")[0] in OWN_PACKAGES


def _referred(item: Any) -> Iterator[Any]:
    if isinstance(item, type):
        for member in vars(item).values():
            if isinstance(member, types.FunctionType):
                yield member
        return
    function = inspect.unwrap(item)
    if not isinstance(function, types.FunctionType):
        return
    if function is not item:
        yield function
    for code in _codes(function.__code__):
        yield from _named(code, function.__globals__)


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _named(code: types.CodeType, names: _Names) -> Iterator[Any]:
    """Yield what a piece of code names: globals, attributes of modules, and imports."""
    steps = list(dis.get_instructions(code))
    for index, step in enumerate(steps):
        if step.opname == "IMPORT_NAME":
            level = int(steps[index - 2].argval)
            names_imported = steps[index - 1].argval or ()
            yield from _imported(str(step.argval), level, names_imported, names)
        elif step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            value = names.get(str(step.argval))
            yield value
            if isinstance(value, types.ModuleType):
                yield from (vars(value).get(name) for name in code.co_names)


def _imported(
    name: str, level: int, names_imported: tuple[str, ...], names: _Names
) -> Iterator[Any]:
    """Yield functions of `desktop_env` that an import gives, or the root of another package."""
    package = str(names.get("__package__") or "")
    full = importlib.util.resolve_name("." * level + name, package)
    root = full.partition(".")[0]
    if root not in OWN_PACKAGES:
        yield Imported(root)
        return
    module = sys.modules.get(full)
    yield from (getattr(module, item, None) for item in names_imported)


def as_list(value: Any) -> list[Any]:
    """Return a list as it is, `None` as an empty one, and anything else as a list of one."""
    if value is None:
        return []
    return value if isinstance(value, list) else [value]


def task_functions(
    task: _Names, metrics: Any, getters: Any, setup: Any
) -> Iterator[tuple[str, Any]]:
    """Yield `(name, function or None)` for each metric, getter and setup step of a task."""
    evaluator = task.get("evaluator") or {}
    for name in as_list(evaluator.get("func")):
        if name != "infeasible":  # a word of OSWorld's, not a function that is called
            yield f"metric {name}", getattr(metrics, str(name), None)
    for part in ("result", "expected"):
        for source in as_list(evaluator.get(part)):
            if source:
                kind = source.get("type")
                yield f"getter {kind}", getattr(getters, f"get_{kind}", None)
    for step in [*(task.get("config") or []), *(evaluator.get("postconfig") or [])]:
        kind = step.get("type")
        yield f"setup {kind}", getattr(setup, f"_{kind}_setup", None)


def problems(task: _Names, metrics: Any, getters: Any, setup: Any) -> list[str]:
    """Return why a task cannot be evaluated here; nothing if it can.

    Named are functions that do not exist, and packages that are missing.
    """
    reasons: dict[str, None] = {}
    for name, function in task_functions(task, metrics, getters, setup):
        if function is None:
            reasons[f"no {name} in this desktop_env"] = None
            continue
        for root in sorted(imported_packages(function)):
            reasons[f"{name} needs the package {root!r}"] = None
    return list(reasons)
