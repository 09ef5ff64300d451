"""Short text files: written and read in the editor, and judged line by line."""

import re
from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath

from ..hand import Hand
from ..machine import Machine

_EDITOR = "mousepad"
_MARK = re.compile(r"^\s*([-*•]|\d+[.)])\s", re.MULTILINE)


def take_note(hand: Hand, path: str, text: str) -> None:
    """Write a text file with the editor, or write it anew where the editor has it open."""
    _start(hand)
    is_file = re.compile(r"\*?[^*]*" + re.escape(PurePosixPath(path).name))
    known = hand.see("frame", is_file, _EDITOR)
    hand.click_on("text", app=_EDITOR)
    hand.replace(text)
    hand.press("ctrl", "s")
    if known is None:
        hand.choose_file(path, "Save", _EDITOR)
    hand.find("frame", re.compile(r"[^*]*" + re.escape(PurePosixPath(path).name)), _EDITOR)


def read_file(hand: Hand, path: str) -> None:
    """Open a text file in the editor, and close it after a look."""
    name = re.escape(PurePosixPath(path).name)
    _start(hand)
    hand.click_on("text", app=_EDITOR)
    hand.press("ctrl", "o")
    hand.find("file-chooser", app=_EDITOR)
    hand.type(hand.path(path))  # the first slash opens the field for a path
    hand.press("enter")
    hand.find("frame", re.compile(f"[^*]*{name}"), _EDITOR)
    hand.press("ctrl", "q")
    hand.wait_until_gone("frame", app=_EDITOR)


def _start(hand: Hand) -> None:
    if hand.see("frame", app=_EDITOR) is None:
        hand.click_on("push-button", "Text Editor", "xfce4-panel")
    hand.find("text", app=_EDITOR)


def unlike(
    machine: Machine,
    path: str,
    lines: Sequence[str],
    *,
    in_any_order: bool = False,
    verbatim: bool = False,
) -> Iterator[str]:
    """Yield why a text file does not hold these lines; space and empty lines do not count.

    Args:
        machine: Where.
        path: Of the file.
        lines: What it should hold.
        in_any_order: Whether it is a list in any order, which may have a mark before each line.
        verbatim: Whether letter case, and a full stop at the end of a line, count.
    """
    text = machine.text(path)
    if text is None:
        yield f"there is no file {path}"
        return
    even = _unquoted if verbatim else plain
    if in_any_order:
        text = _MARK.sub("", text)
    found = [even(line) for line in text.splitlines() if even(line)]
    wanted = [even(line) for line in lines]
    if in_any_order:
        found.sort()
        wanted.sort()
    if found != wanted:
        yield f"{path} holds {text[:300]!r}, not {list(lines)!r}"


def plain(line: str) -> str:
    """Return a line in lower case without a full stop at its end, and quotation marks around it."""
    return _unquoted(line).removesuffix(".").casefold()


def _unquoted(line: str) -> str:
    return " ".join(line.split()).strip("\"'“”`")
