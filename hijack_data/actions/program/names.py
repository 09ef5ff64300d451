"""Find the names of a program that refer to pyautogui, and those that may change unnoticed."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from .sharing import NEVER, changed_depths
from .signatures import (
    BARE,
    KEYBOARD,
    MODULES,
    POINTER,
    PYAUTOGUI,
    READERS,
    REFUSED,
    is_public,
    words,
)

_TELLING = frozenset({*POINTER, *READERS, *REFUSED})
# Builtins that return something new made from a list's items; `max` and `sum` may return an item
# itself.
_COPYING = words("""
    all any bool enumerate float int len list map print range reversed set sorted str tuple zip
""")


class Callee(NamedTuple):
    """The function that a call names: `Callee("pyautogui", "click")`."""

    module: str
    name: str


class Origin(NamedTuple):
    """What an import binds a name to: a module, or `name` of that module."""

    module: str
    name: str | None = None


class Names:
    """The bindings of all names of a program.

    A name that is bound to several things is treated as unknown, because the run decides which one
    a line sees. The surrounding program may have imported pyautogui before, so that counts as a
    binding, too.

    Attributes:
        bindings: how often each name is bound (assignments, parameters, imports, ...).
        volatile: names whose value cannot be followed: those of `global`, `nonlocal`, `:=`, those
            that `import *` may replace, and those that a class would mangle (`__x`).
        texts: names that never hold anything but text.
    """

    def __init__(self, tree: ast.Module) -> None:
        self.bindings: Counter[str] = Counter()
        self.volatile: set[str] = set()
        self._origins: defaultdict[str, set[Origin]] = defaultdict(set)
        self._own: set[str] = set()
        self._functions: Counter[str] = Counter()
        texts: Counter[str] = Counter()
        for node in ast.walk(tree):
            self._bind(node)
            self._note(node)
            texts.update(_text_names(node))
            self._functions.update(_function_names(node))
        self.texts = {name for name, count in texts.items() if count == self.bindings[name]}
        self._defined_before_use = _defined_before_use(tree)
        if self.bindings["*"]:
            self.volatile.update(filter(is_public, self.bindings))
        # In a class K, __x means _K__x.
        if any(isinstance(node, ast.ClassDef) for node in ast.walk(tree)):
            private = set(filter(_is_private, self.bindings))
            self.volatile |= private
            self._own |= private
        self._depths = changed_depths(tree, self._leaves_alone)

    def _bind(self, node: ast.AST) -> None:
        self.bindings.update(bound_names(node))
        match node:
            case ast.Import(names=aliases):
                for alias in aliases:
                    top = alias.name.split(".")[0]
                    module = alias.name if alias.asname else top
                    self._origins[alias.asname or top].add(Origin(_owner(module)))
            case ast.ImportFrom(module=module, names=aliases):
                for alias in aliases:
                    origin = Origin(_owner(module or "."), alias.name)
                    self._origins[alias.asname or alias.name].add(origin)
            case _:
                self._own.update(bound_names(node))

    def _note(self, node: ast.AST) -> None:
        match node:
            case ast.Global(names=names) | ast.Nonlocal(names=names):
                self.volatile.update(names)
            case ast.NamedExpr(target=ast.Name(id=name)):
                self.volatile.add(name)
            case _:
                pass

    def _leaves_alone(self, function: ast.expr) -> int:
        callee = self.callee(function)
        if callee is not None and (callee.name in POINTER or callee.name in KEYBOARD):
            return NEVER
        match function:
            case ast.Name(id=name) if name in _COPYING and self.is_builtin(name):
                return 1
            case _:
                return 0

    def changes_at(self, name: str) -> int:
        """Return the depth from which the lists in the value of `name` may be changed unnoticed."""
        return self._depths.get(name, NEVER)

    def origin(self, name: str) -> Origin | None:
        """Return what `name` refers to, if only imports bind it and they agree."""
        if name in self._own:
            return None
        origins = self._possible(name)
        return next(iter(origins)) if len(origins) == 1 else None

    def _possible(self, name: str) -> set[Origin]:
        origins = set(self._origins.get(name, ()))
        unbound = not self.bindings[name]
        if name in PYAUTOGUI or (name in MODULES and unbound):
            origins.add(Origin(_owner(name)))
        if name in _TELLING or (name in BARE and unbound):
            origins.add(Origin("pyautogui", name))
        return origins

    def module(self, name: str) -> str | None:
        """Return the module that `name` refers to, which for an unbound name is that name."""
        origin = self.origin(name)
        if origin is not None:
            return origin.module if origin.name is None else None
        return None if self.bindings[name] else name

    def may_be_pyautogui(self, name: str) -> bool:
        """Return whether `name` may refer to pyautogui (or AgentNet's `computer`) somewhere."""
        if name in self._own:  # other code may well use the name `computer`, but not `pyautogui`
            return name == "pyautogui" or Origin("pyautogui") in self._origins.get(name, ())
        return Origin("pyautogui") in self._possible(name)

    def imported(self, name: str) -> Origin | None:
        """Return the imported function to which `name` may refer; one of pyautogui comes first."""
        if name in self._own and name not in self._origins:
            return None
        found = [origin for origin in self._possible(name) if origin.name is not None]
        found.sort(key=lambda origin: (origin.module != "pyautogui", origin))
        return found[0] if found else None

    def is_own_function(self, name: str) -> bool:
        """Return whether `name` is a function or class of the program wherever it is used."""
        if not self.bindings[name] == self._functions[name] > 0:
            return False
        return name not in BARE or (name in self._defined_before_use and not self.bindings["*"])

    def is_builtin(self, name: str) -> bool:
        """Return whether `name` is a builtin that the program never rebinds."""
        return not self.bindings[name]

    def callee(self, function: ast.expr) -> Callee | None:
        """Return the function that an expression names, or `None` if it is unknown.

        An undefined bare name such as `click` is taken for the function of pyautogui.
        """
        match function:
            case ast.Attribute(value=ast.Name(id=owner), attr=attr):
                origin = self.origin(owner)
                if origin is None or origin.name is not None or origin.module not in MODULES:
                    return None
                return Callee(origin.module, attr)
            case ast.Name(id=name):
                origin = self.origin(name)
                if origin is None or origin.name is None or origin.module not in MODULES:
                    return None
                return Callee(origin.module, origin.name)
            case _:
                return None


def _owner(module: str) -> str:
    return "pyautogui" if module in PYAUTOGUI else module


def bound_names(node: ast.AST) -> Iterator[str]:
    """Return the names that this node itself binds or unbinds (not its children)."""
    match node:
        case ast.Name(id=name, ctx=ast.Store() | ast.Del()):
            yield name
        case (
            ast.arg(arg=name)
            | ast.FunctionDef(name=name)
            | ast.AsyncFunctionDef(name=name)
            | ast.ClassDef(name=name)
        ):
            yield name
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            yield from (a.asname or a.name.split(".")[0] for a in aliases)
        case (
            ast.ExceptHandler(name=str(name))
            | ast.MatchAs(name=str(name))
            | ast.MatchStar(name=str(name))
        ):
            yield name
        case ast.MatchMapping(rest=str(name)):
            yield name
        case _:
            pass


def all_bound(nodes: list[ast.stmt] | list[ast.expr] | list[ast.pattern]) -> set[str]:
    """Return every name bound anywhere inside `nodes`."""
    return {name for root in nodes for node in ast.walk(root) for name in bound_names(node)}


def _text_names(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Assign(targets=targets, value=ast.Constant(value=str()) | ast.JoinedStr()):
            yield from (target.id for target in targets if isinstance(target, ast.Name))
        case _:
            pass


def _function_names(node: ast.AST) -> Iterator[str]:
    """Yield the name of the function or class that a node defines without a decorator."""
    match node:
        case ast.FunctionDef(name=name, decorator_list=[]):
            yield name
        case ast.AsyncFunctionDef(name=name, decorator_list=[]):
            yield name
        case ast.ClassDef(name=name, decorator_list=[], keywords=[]):
            yield name
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Lambda()):
            yield name
        case _:
            pass


def _is_private(name: str) -> bool:
    return name.startswith("__") and not name.endswith("__")


def _defined_before_use(tree: ast.Module) -> set[str]:
    """Return the functions that the program defines at the top level before it uses their names."""
    first_use: dict[str, tuple[int, int]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            place = (node.lineno, node.col_offset)
            first_use[node.id] = min(place, first_use.get(node.id, place))
    shown: set[str] = set()
    for statement in tree.body:
        place = (statement.lineno, statement.col_offset)
        for name in _function_names(statement):
            if name not in first_use or place < first_use[name]:
                shown.add(name)
    return shown
