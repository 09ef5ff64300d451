"""Mapping of pyautogui code: the numbers of pointer calls change, every other byte stays.

The code is parsed, never run. Absolute coordinates (`moveTo`, `click`, `dragTo`, `scroll(n, x, y)`,
...) scale and are clamped, relative ones (`moveRel`, `dragRel`, ...) scale as vectors; scroll
amounts, durations, keys and text are left alone. Positional, keyword, tuple, starred, negative and
computed coordinates work, and so do variables that hold constants: the number is written into the
call, and the variable stays unchanged. `pyautogui.size()` counts as the size of the space for which
the code was written. What cannot be mapped raises `ActionError`: coordinates that are known only
when the code runs (`position()`, loop variables, parameters, results of functions, pictures to look
for, lists that may have been changed), functions that read a place on the screen (`pixel`,
`pixelMatchesColor`, `onScreen`, `screenshot(region=...)`), calls that do not run where they are
written (annotations), and code that may reach the pointer in any other way: see `guard`.
"""

import ast
import contextlib
from dataclasses import dataclass, field

from ...errors import ActionError, ParameterTypeError
from ...types import Size, are_fractions, as_size
from ..program.flow import Flow
from ..program.folding import Folder
from ..program.guard import hidden_moves
from ..program.names import Names
from ..program.pointing import Pointing
from ..program.values import Bindings, Value
from ..pyautogui_functions import POINTER, SPECIAL_WORDS
from ..python_source import ParsedSource, TextEdit, refuse_deep_nesting
from ..scaling import Scaling


def map_code(code: str, scaling: Scaling, screen: Size | None) -> str:
    """Return `code` with its coordinates scaled.

    Args:
        code: pyautogui code, or WAIT, FAIL or DONE.
        scaling: maps from the space of the code to the target space.
        screen: the size that `pyautogui.size()` returns, as (height, width); with `None`,
            coordinates computed from it are refused.

    Raises `ActionError`, with line and column, for what cannot be mapped.
    """
    check_text(code)
    if code.strip() in SPECIAL_WORDS:
        return code
    with refuse_deep_nesting():
        return _Mapper(ParsedSource(code), scaling, screen).run()


def scale_normalized(code: str, size: Size) -> str:
    """Return code with fractions 0..1 (AgentNet) turned into pixels of a picture.

    `size` is (height, width) of the picture.

    Raises `ActionError` where `map_code` does, and for a coordinate that is not a fraction.
    """
    return map_code(code, Scaling.fractions(as_size(size)), None)


def count_points(code: str) -> tuple[int, int]:
    """Return how many points code names, and how many of them are fractions of the picture.

    Code that cannot be read counts as far as it can be.
    """
    noted = _PointNotes((1, 1), (1, 1), clamp=False)
    with contextlib.suppress(ActionError):
        map_code(code, noted, (1, 1))
    return len(noted.named), sum(are_fractions(point) for point in noted.named)


@dataclass(frozen=True)
class _PointNotes(Scaling):
    """A scaling that notes the points it is asked about."""

    named: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])

    def check_point(self, *numbers: float) -> None:
        self.named.append(numbers)


def calls_pyautogui(code: str) -> bool:
    """Return whether a text is code that calls pyautogui, or is WAIT, FAIL or DONE."""
    if code.strip() in SPECIAL_WORDS:
        return True
    try:
        with refuse_deep_nesting():
            tree = ParsedSource(code).tree
    except ActionError:  # not Python
        return False
    return any(_names_pyautogui(node) for node in ast.walk(tree))


def _names_pyautogui(node: ast.AST) -> bool:
    match node:
        case ast.Name(id=name) | ast.alias(name=name) | ast.ImportFrom(module=str(name)):
            return name.split(".")[0] == "pyautogui"
        case _:
            return False


def check_text(code: object) -> None:
    """Check that `code` is text.

    Raises:
        ParameterTypeError: it is not.
    """
    if not isinstance(code, str):
        raise ParameterTypeError(f"an action in pyautogui code must be a string, got {code!r:.60}")


class _Mapper:
    def __init__(self, source: ParsedSource, scaling: Scaling, screen: Size | None) -> None:
        self._source = source
        self._names = Names(source.tree)
        self._folder = Folder(self._names, screen)
        self._pointing = Pointing(source, self._folder, scaling)
        self._edits: list[TextEdit] = []

    def run(self) -> str:
        for node, reason in hidden_moves(self._source.tree, self._names):
            self._source.refuse(node, reason, "call pyautogui's functions directly, with numbers")
        lost = Flow(self._folder, self._call).run(self._source.tree)
        for call in filter(self._points, lost):
            reason = "when this call runs cannot be followed"
            self._source.refuse(call, reason, "put it on a line of its own")
        return self._source.edited(self._edits)

    def _call(self, call: ast.Call, env: Bindings) -> None:
        function = self._points(call)
        if function is None:
            return
        unpacked: dict[ast.expr, list[Value]] = {}
        for argument, value in self._pointing.place(call, function, env).changes:
            if argument.siblings is None:
                self._edits.append(TextEdit(*self._source.span(argument.node), repr(value)))
            else:
                unpacked.setdefault(argument.node, list(argument.siblings))[argument.index] = value
        for node, values in unpacked.items():
            self._edits.append(TextEdit(*self._source.span(node), ", ".join(map(repr, values))))

    def _points(self, call: ast.Call) -> str | None:
        """Return the name of the called function if it moves the pointer, or `None`."""
        callee = self._names.callee(call.func)
        if callee is None or callee.module != "pyautogui" or callee.name not in POINTER:
            return None
        return callee.name
