"""Mapping of pyautogui code: the numbers of pointer calls change, every other byte stays.

The code is parsed by `pyautogui_grammar`, never run. Absolute coordinates (`moveTo`, `click`,
`dragTo`, `scroll(n, x, y)`, ...) scale and are clamped, relative ones (`moveRel`, `dragRel`, ...)
scale as vectors; scroll amounts, durations, keys and text are left alone. Positional, keyword,
sequence, negative and computed coordinates work, and so do names of constants: the number is
written into the call, and the assignment stays unchanged. Code beyond the grammar, and coordinates
that are no numbers (pictures to look for), raise `ActionError`.
"""

import ast
import contextlib
from dataclasses import dataclass, field

from ...errors import ActionError, ParameterTypeError
from ...types import Size, are_fractions, as_size
from ..call_coordinates import read_coordinates
from ..pyautogui_functions import POINTER, RECORDED_FUNCTIONS, SPECIAL_WORDS
from ..pyautogui_grammar import read_calls
from ..python_source import ParsedSource, TextEdit, refuse_deep_nesting
from ..scaling import Scaling


def map_code(code: str, scaling: Scaling) -> str:
    """Return `code` with its coordinates scaled.

    Args:
        code: pyautogui code, or WAIT, FAIL or DONE.
        scaling: maps from the space of the code to the target space.

    Raises:
        ActionError: the code cannot be mapped; the message names line and column.
    """
    check_text(code)
    if code.strip() in SPECIAL_WORDS:
        return code
    source = ParsedSource(code)
    edits = [
        TextEdit(*source.span(node), repr(value))
        for call in read_calls(source, RECORDED_FUNCTIONS)
        if call.function in POINTER
        for node, value in read_coordinates(source, call, scaling).edits
    ]
    return source.edited(edits)


def scale_normalized(code: str, size: Size) -> str:
    """Return code with fractions 0..1 (AgentNet) turned into pixels of a picture.

    `size` is (height, width) of the picture.

    Raises:
        ActionError: the code cannot be mapped, or a coordinate is not a fraction.
    """
    return map_code(code, Scaling.fractions(as_size(size)))


def count_points(code: str) -> tuple[int, int]:
    """Return how many points code names, and how many of them are fractions of the picture.

    Code beyond the grammar names none; a call that cannot be mapped ends the count.
    """
    noted = _PointNotes((1, 1), (1, 1), clamp=False)
    with contextlib.suppress(ActionError):
        map_code(code, noted)
    return len(noted.named), sum(are_fractions(point) for point in noted.named)


@dataclass(frozen=True)
class _PointNotes(Scaling):
    """A scaling that notes the points it is asked about."""

    named: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])

    def check_point(self, *numbers: float) -> None:
        self.named.append(numbers)


def calls_pyautogui(code: str, *, or_computer: bool = False) -> bool:
    """Return whether a text is code that calls pyautogui, or is WAIT, FAIL or DONE.

    Args:
        code: the text.
        or_computer: calls of AgentNet's `computer`, which recorded code may have, count as well.
    """
    if code.strip() in SPECIAL_WORDS:
        return True
    try:
        with refuse_deep_nesting():
            tree = ParsedSource(code).tree
    except ActionError:  # not Python
        return False
    return any(
        _names_pyautogui(node) or (or_computer and _names_computer(node)) for node in ast.walk(tree)
    )


def _names_pyautogui(node: ast.AST) -> bool:
    match node:
        case ast.Name(id=name) | ast.alias(name=name) | ast.ImportFrom(module=str(name)):
            return name.split(".")[0] == "pyautogui"
        case _:
            return False


def _names_computer(node: ast.AST) -> bool:
    match node:
        case ast.Attribute(value=ast.Name(id="computer")):
            return True
        case _:
            return False


def check_text(code: object) -> None:
    """Check that `code` is text.

    Raises:
        ParameterTypeError: it is not.
    """
    if not isinstance(code, str):
        raise ParameterTypeError(f"an action in pyautogui code must be a string, got {code!r:.60}")
