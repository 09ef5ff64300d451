"""Parse Python source without running it, and edit it at given nodes only."""

import ast
import re
import warnings
from bisect import bisect_right
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from itertools import accumulate
from typing import NamedTuple, NoReturn

from ..errors import ActionError

# Line ends as Python's tokenizer counts them; str.splitlines splits at more characters.
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)?")
_SHOWN = 60


class TextEdit(NamedTuple):
    """Replaces the characters from `start` to `end` by `text`."""

    start: int
    end: int
    text: str


def apply_edits(text: str, edits: Iterable[TextEdit]) -> str:
    """Return `text` with `edits` made, which must not overlap; every other byte stays."""
    pieces: list[str] = []
    position = 0
    for edit in sorted(edits):
        pieces.append(text[position : edit.start])
        pieces.append(edit.text)
        position = edit.end
    pieces.append(text[position:])
    return "".join(pieces)


@contextmanager
def refuse_deep_nesting() -> Generator[None]:
    """Turn a `RecursionError` into an `ActionError`: code nested so deeply is not an action.

    Raises:
        ActionError: the code is nested too deeply.
    """
    try:
        yield
    except RecursionError:
        raise ActionError(
            "the code is nested too deeply to be read; write one plain call a line"
        ) from None


class ParsedSource:
    """Parsed code, and the position of each node.

    Spaces before the first statement are tolerated, as `python -c "...; <code>"` tolerates them.
    The positions come from a table of line starts, because `ast.get_source_segment` splits the
    whole source again for every node.

    Raises:
        ActionError: the code is not Python.
    """

    def __init__(self, code: str) -> None:
        self._code = code.lstrip(" \t\r\n")
        self._prefix = code[: len(code) - len(self._code)]
        lines_before = _LINE.findall(self._prefix)
        self._lines_before = sum(line.endswith(("\r", "\n")) for line in lines_before)
        self._indent = len(self._prefix) - len(self._prefix.rstrip(" \t"))
        self._lines: list[str] = _LINE.findall(self._code)
        starts = [0]
        for line in self._lines:
            starts.append(starts[-1] + len(line))
        self._starts = starts
        self._columns: dict[int, list[int]] = {}  # for lines with more bytes than characters
        self.tree = self._parse()

    def _parse(self) -> ast.Module:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # "\d" in a typed text is up to the agent
                return ast.parse(self._code)
        except SyntaxError as error:
            location = self._location(error.lineno or 1, error.offset or 1)
            reason = error.msg
        except (ValueError, RecursionError, MemoryError, OverflowError) as error:
            location = "the code"
            first_line = str(error).split("\n")[0]
            reason = first_line[:_SHOWN] or "nested too deeply"
        excerpt = self._code[:_SHOWN]
        raise ActionError(
            f"{location}: not Python ({reason}): {excerpt!r}; give pyautogui calls such as"
            " pyautogui.click(100, 200), or WAIT, FAIL or DONE"
        )

    def _offset(self, line: int, column: int) -> int:
        """Return the offset in characters of a position in lines and UTF-8 bytes."""
        text = self._lines[line - 1]
        start = self._starts[line - 1]
        if text.isascii():
            return start + column
        if line not in self._columns:
            sizes = [len(character.encode()) for character in text]
            self._columns[line] = list(accumulate(sizes))
        return start + bisect_right(self._columns[line], column)

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Return start and end of a node, in characters of the parsed part."""
        end_line = node.end_lineno or node.lineno
        end_column = node.end_col_offset or node.col_offset
        start = self._offset(node.lineno, node.col_offset)
        return start, self._offset(end_line, end_column)

    def text(self, node: ast.expr) -> str:
        """Return the source of a node, shortened for error messages."""
        start, end = self.span(node)
        text = " ".join(self._code[start:end].split())
        if len(text) <= _SHOWN:
            return text
        return text[: _SHOWN - 3] + "..."

    def refuse(self, node: ast.AST, problem: str, fix: str) -> NoReturn:
        """Raise an error that points at `node`.

        Raises:
            ActionError: always; the message names line and column.
        """
        line = getattr(node, "lineno", 1)
        column = getattr(node, "col_offset", 0)
        characters = self._offset(line, column) - self._starts[line - 1]
        raise ActionError(f"{self._location(line, characters + 1)}: {problem}; {fix}")

    def _location(self, line: int, column: int) -> str:
        if line == 1:
            column += self._indent
        return f"line {line + self._lines_before}, column {column}"

    def edited(self, edits: Iterable[TextEdit]) -> str:
        """Return the code with `edits` made."""
        return self._prefix + apply_edits(self._code, edits)
