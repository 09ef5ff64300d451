"""Find calls of functions outside pyautogui that may move the pointer.

Such a call is refused if the function's name suggests it and its arguments are numbers. A function
that the program picks at run time has no telling name, so its arguments must not hold anything that
may be a place.
"""

import ast
from collections.abc import Iterable

from .literals import count_numbers, is_text, may_hold_place
from .names import Names
from .vocabulary import (
    DEVICES,
    HARMLESS_MODULES,
    PLACES,
    POINTER_MODULES,
    REFLECTIVE_MODULES,
    is_verb,
    is_weak_verb,
)

_HIDES = "which hides where the pointer goes"
_LITERAL = ast.Constant | ast.JoinedStr | ast.List | ast.Tuple | ast.Dict | ast.Set


def foreign_module(modules: Iterable[str]) -> str | None:
    """Return why one of `modules` must not be imported, or `None`."""
    for module in modules:
        top = module.split(".")[0]
        if top in POINTER_MODULES:
            return f"module {top!r} may move the pointer in ways that cannot be mapped"
        if top in REFLECTIVE_MODULES or (top.startswith("_") and top != "__future__"):
            return f"module {top!r} may find or run code in ways that cannot be seen from here"
    return None


def foreign_call(call: ast.Call, names: Names) -> str | None:
    """Return why a call of a function outside pyautogui must be refused, or `None`."""
    match call.func:
        case ast.Lambda():
            return None
        case ast.Name(id=name):
            return _named_call(name, call, names)
        case ast.Attribute(value=owner, attr=name):
            if _is_harmless(owner, names):
                return None
            return _method_call(name, owner, call, names)
        case _ if may_hold_place(call, names):
            return f"a function is picked while the code runs, {_HIDES}"
        case _:
            return None


def _named_call(name: str, call: ast.Call, names: Names) -> str | None:
    if names.is_own_function(name):
        return None
    origin = names.imported(name)
    if origin is not None and origin.module.split(".")[0] in HARMLESS_MODULES:
        return None
    written = name if origin is None or origin.name is None else origin.name
    if _moves(written, call, names):
        return f"{name}() is not known to be pyautogui's, {_HIDES}"
    is_variable = origin is None and not names.is_builtin(name)
    if is_variable and may_hold_place(call, names):
        return f"{name!r} may be any function, {_HIDES}"
    return None


def _method_call(name: str, owner: ast.expr, call: ast.Call, names: Names) -> str | None:
    is_device = _last_word(owner, names) in DEVICES
    moves_device = is_device and count_numbers(call, names) > 0
    if moves_device or _moves(name, call, names):
        return f"{name}() belongs to an object that is not known to be pyautogui, {_HIDES}"
    return None


def _moves(name: str, call: ast.Call, names: Names) -> bool:
    numbers = count_numbers(call, names)
    if is_verb(name):
        return numbers > 0
    if is_weak_verb(name) and numbers > 1:
        return True
    if name == "dict":
        return False
    keywords = {k.arg for k in call.keywords if k.arg is not None and not is_text(k.value, names)}
    return {"x", "y"} <= keywords or not keywords.isdisjoint(PLACES)


def _is_harmless(owner: ast.expr, names: Names) -> bool:
    while isinstance(owner, ast.Attribute):
        owner = owner.value
    if isinstance(owner, ast.Name):
        module = names.module(owner.id)
        return module is not None and module.split(".")[0] in HARMLESS_MODULES
    return isinstance(owner, _LITERAL)


def _last_word(owner: ast.expr, names: Names) -> str:
    match owner:
        case ast.Name(id=name):
            return (names.module(name) or name).rpartition(".")[2].lower()
        case ast.Attribute(attr=name):
            return name.lower()
        case _:
            return ""
