"""Find the places where a program could move the pointer unnoticed, so that mapping refuses them.

A pointer call is mapped if it is written plainly: a function of pyautogui, called by its own name
or by the name of one import. Every other way to the pointer is refused: pyautogui or its functions
passed on, looked up by name, or imported from inner modules; code in texts; other libraries; calls
on unknown objects that look like pointer calls; commands that name a known tool.
"""

import ast
from collections.abc import Iterator

from .commands import Commands
from .foreign import foreign_call, foreign_module
from .literals import values
from .names import Callee, Names, Origin
from .signatures import (
    MODULES,
    POINTER,
    READER_OPTIONS,
    READERS,
    REFUSED,
    SETTINGS,
    is_harmless,
    is_public,
)
from .vocabulary import (
    OPEN_DUNDERS,
    REACHING,
    REFLECTIVE,
    SYS,
    is_place_attribute,
    is_pointer_attribute,
    is_verb,
)

_HIDES = "is used in a way that hides where the pointer goes"


def hidden_moves(tree: ast.Module, names: Names) -> Iterator[tuple[ast.AST, str]]:
    """Yield every node that could move the pointer unnoticed, with the reason."""
    guard = _Guard(names)
    commands = Commands(names)
    for node in ast.walk(tree):  # yields parents before their children
        commands.note(node)
        reason = guard.reason(node)
        if reason:
            yield node, reason
    yield from commands.problems()


class _Guard:
    """Judges nodes one by one; parents must come before their children."""

    def __init__(self, names: Names) -> None:
        self._names = names
        self._called: set[int] = set()
        self._owners: set[int] = set()  # of attributes
        self._interpolated: set[int] = set()  # inside f-strings
        self._in_class: set[int] = set()  # statements of class bodies

    def reason(self, node: ast.AST) -> str | None:
        """Return why `node` must be refused, or `None`."""
        self._note(node)
        match node:
            case ast.Import(names=aliases):
                return self._import(node, [alias.name for alias in aliases])
            case ast.ImportFrom():
                return self._import_from(node)
            case ast.Call():
                return self._call(node)
            case ast.Name(ctx=ast.Load()):
                return self._name(node)
            case ast.Attribute():
                return self._attribute(node)
            case _:
                return None

    def _note(self, node: ast.AST) -> None:
        kind = type(node).__name__
        if id(node) in self._interpolated or kind in ("JoinedStr", "TemplateStr"):
            self._interpolated.update(id(child) for child in ast.iter_child_nodes(node))
        match node:
            case ast.ClassDef(body=body):
                self._in_class.update(id(statement) for statement in body)
            case ast.Attribute(value=owner):
                self._owners.add(id(owner))
            case ast.Call(func=function):
                self._called.add(id(function))
            case _:
                pass

    def _import(self, node: ast.AST, modules: list[str]) -> str | None:
        for module in modules:
            top, _, inner = module.partition(".")
            if top in MODULES and (inner or id(node) in self._in_class):
                return f"{module!r}, imported in this way, {_HIDES}"
        return foreign_module(modules)

    def _import_from(self, node: ast.ImportFrom) -> str | None:
        module = node.module or "."
        found = {alias.name for alias in node.names}
        if id(node) in self._in_class:
            return f"what a class imports from {module!r} {_HIDES}"
        if "*" in found:
            if module in MODULES:
                return None
            return f"import * from {module!r} may replace any name, which hides where a call goes"
        reaching = _reaching(module, found)
        if reaching:
            return f"{module}.{min(reaching)} {_HIDES}"
        return foreign_module([module])

    def _call(self, node: ast.Call) -> str | None:
        callee = self._names.callee(node.func)
        if callee is None:
            return foreign_call(node, self._names) or _getattr(node)
        if callee.module != "pyautogui":
            return None
        if callee.name in POINTER and id(node) in self._interpolated:
            return "a pointer call inside an f-string cannot be edited"
        return _own_call(node, callee)

    def _name(self, node: ast.Name) -> str | None:
        if node.id in REFLECTIVE:
            return f"{node.id!r} may find or run code in ways that cannot be seen from here"
        if self._hides(node):
            return f"{node.id!r} {_HIDES}"
        return None

    def _hides(self, node: ast.Name) -> bool:
        name = node.id
        called = id(node) in self._called
        if _is_dunder(name) and name not in OPEN_DUNDERS:
            return True
        if name == "getattr":
            return not called
        if self._names.module(name) == "sys" or self._names.may_be_pyautogui(name):
            return id(node) not in self._owners
        if called:
            return False
        origin = self._names.imported(name)
        return origin is not None and self._moves(name, origin)

    def _moves(self, name: str, origin: Origin) -> bool:
        """Return whether the function behind an imported or bare name may move the pointer."""
        if origin.name is None or self._names.is_own_function(name):
            return False
        if origin.module == "pyautogui":
            return not is_harmless(origin.name)
        return is_verb(origin.name)

    def _attribute(self, node: ast.Attribute) -> str | None:
        name = node.attr
        match node.value:
            case ast.Name(id=owner) if self._names.may_be_pyautogui(owner):
                return self._own_attribute(node)
            case ast.Name(id=owner) if self._names.module(owner) == "sys":
                return None if name in SYS else f"sys.{name} {_HIDES}"
            case _:
                return self._other_attribute(node)

    def _other_attribute(self, node: ast.Attribute) -> str | None:
        name = node.attr
        if name in REACHING or (_is_dunder(name) and not _is_plain_dunder(node)):
            return f"{name!r} {_HIDES}"
        if isinstance(node.value, ast.Name) and node.value.id == "self":
            return None
        if not isinstance(node.ctx, ast.Load):
            if is_place_attribute(name):
                return f"setting {name!r} may move the pointer to a hidden place"
            return None
        is_used = id(node) in self._called or id(node) in self._owners
        if is_pointer_attribute(name) and not is_used:
            return f"{name!r} {_HIDES}"
        return None

    def _own_attribute(self, node: ast.Attribute) -> str | None:
        name = node.attr
        if not isinstance(node.ctx, ast.Load):
            if name in SETTINGS:
                return None
            return f"{name!r} is replaced, which hides where the pointer goes"
        is_inner = name.startswith("_") or name == "platformModule"
        is_known = id(node) in self._called or is_harmless(name)
        if is_inner or not is_known:
            return f"{name!r} {_HIDES}"
        return None


def _reaching(module: str, found: set[str]) -> set[str]:
    """Return the imported names that may reach the pointer."""
    if module in ("pyautogui", "computer"):
        return {name for name in found if not is_public(name)}
    if module == "sys":
        return found - SYS
    top, dot, _ = module.partition(".")
    if dot and top in MODULES:
        return found
    return found & (REACHING | REFLECTIVE)


def _own_call(node: ast.Call, callee: Callee) -> str | None:
    name = callee.name
    if name in REFUSED:
        return f"{name}() works on the screen at a place that cannot be mapped"
    if name in READERS and _reads_part(node, READERS[name]):
        return f"{name}(region=...) reads a part of the screen that cannot be mapped"
    if is_public(name) or not values(node) or _is_scalar(node):
        return None
    return f"pyautogui is not known to have {name}(), so where it points is unknown"


def _reads_part(call: ast.Call, pictures: int) -> bool:
    """Return whether a call that reads the screen may name a region, by keyword or position."""
    for value in call.args[:pictures]:
        if isinstance(value, ast.Starred | ast.Tuple | ast.List):
            return True
    for value in call.args[pictures:]:
        if not isinstance(value, ast.Constant):
            return True
    return not all(_is_option(keyword) for keyword in call.keywords)


def _is_option(keyword: ast.keyword) -> bool:
    if keyword.arg == "region":
        return isinstance(keyword.value, ast.Constant) and keyword.value.value is None
    return keyword.arg in READER_OPTIONS


def _is_scalar(call: ast.Call) -> bool:
    """Return whether the arguments are texts and at most one number, too few for a place."""
    if any(keyword.arg in ("x", "y", None) for keyword in call.keywords):
        return False
    numbers = [value for value in values(call) if not _is_string(value)]
    if not numbers:
        return True
    return len(numbers) == 1 and isinstance(numbers[0], ast.Constant)


def _is_string(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _getattr(node: ast.Call) -> str | None:
    """Return why `getattr` must be refused: it may look up a name that the program must not use."""
    match node:
        case ast.Call(func=ast.Name(id="getattr"), args=[_, ast.Constant(value=str(name)), *_]):
            if name in REACHING | REFLECTIVE or _is_dunder(name) or is_pointer_attribute(name):
                return f"getattr(..., {name!r}) {_HIDES}"
            return None
        case ast.Call(func=ast.Name(id="getattr")):
            return f"getattr() {_HIDES}"
        case _:
            return None


def _is_dunder(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


def _is_plain_dunder(node: ast.Attribute) -> bool:
    """Return whether __name__ or the like is read for its text, or super().__init__ is meant."""
    match node:
        case ast.Attribute(value=ast.Call(func=ast.Name(id="super")), attr="__init__"):
            return True
        case _:
            return node.attr in OPEN_DUNDERS
