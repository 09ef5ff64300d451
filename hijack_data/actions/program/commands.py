"""Find texts that a program may pass to a shell or to another interpreter."""

import ast
from collections.abc import Iterator

from .names import Names
from .signatures import REFUSED, words
from .vocabulary import names_pointer

# These functions never run the texts that they are given.
_SILENT = words("print len str repr")
_LOGGING = words("debug info warning error critical exception log")
_PURE = words("""
    abs all any bool chr dict enumerate filter float int isinstance len list map max min ord print
    range repr reversed round set sorted str sum tuple type zip
""")
_METHODS = frozenset(name for kind in (str, bytes, list, dict, set, tuple) for name in vars(kind))


class Commands:
    """Collects the texts that name a way to the pointer and may be run.

    A text that is typed, printed or unused does not count. All others count as soon as the program
    calls anything that could run a text.
    """

    def __init__(self, names: Names) -> None:
        self._names = names
        self._silent: set[int] = set()
        self._texts: list[ast.Constant] = []
        self._runs = False

    def note(self, node: ast.AST) -> None:
        """Examine one node of the program; parents must come before their children."""
        match node:
            case ast.Constant(value=str(text)):
                self._note_text(node, text)
            case ast.Constant(value=bytes(raw)):
                self._note_text(node, raw.decode("latin-1"))
            case ast.Expr(value=ast.Constant() as constant):
                self._silent.add(id(constant))
            case ast.Call():
                self._runs = self._runs or self._may_run(node.func)
                if self._is_silent(node.func):
                    self._silence(node)
            case ast.NamedExpr() | ast.Lambda():  # what is in them may be used elsewhere
                pass
            case _ if id(node) in self._silent:
                self._silence(node)
            case _:
                pass

    def problems(self) -> Iterator[tuple[ast.AST, str]]:
        """Yield the collected texts, each with the reason to refuse it."""
        for text in self._texts if self._runs else ():
            yield text, "this text may be run, and names a way to the pointer that cannot be mapped"

    def _note_text(self, node: ast.Constant, text: str) -> None:
        if id(node) not in self._silent and names_pointer(text):
            self._texts.append(node)

    def _silence(self, node: ast.AST) -> None:
        self._silent.update(id(child) for child in ast.iter_child_nodes(node))

    def _is_silent(self, function: ast.expr) -> bool:
        callee = self._names.callee(function)
        if callee is not None:
            return callee.name not in REFUSED
        match function:
            case ast.Name(id=name):
                return name in _SILENT and self._names.is_builtin(name)
            case ast.Attribute(attr=name):
                return name in _LOGGING
            case _:
                return False

    def _may_run(self, function: ast.expr) -> bool:
        if self._names.callee(function) is not None:
            return False
        match function:
            case ast.Name(id=name):
                pure = name in _PURE and self._names.is_builtin(name)
                return not pure and not self._names.is_own_function(name)
            case ast.Attribute(attr=name):
                return name not in _METHODS and name not in _LOGGING
            case _:
                return True
