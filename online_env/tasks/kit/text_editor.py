"""A text in Mousepad or Geany: the ways of a person who edits it, and the judgement of the result.

Both have the same keys for opening, going to a line and saving, and both give the accessibility
tree the whole text.
"""

import re
from collections.abc import Iterator
from pathlib import PurePosixPath

from ..hand import Hand
from ..machine import Machine
from ..tree_nodes import TreeNode

_UNDOS = 30


def text_problems(machine: Machine, path: str, expected_text: str) -> Iterator[str]:
    """Yield how a text file differs from what it should hold.

    Line ends and the line feed at the end of the last line do not matter.
    """
    actual = machine.text(path)
    if actual is None:
        yield f"there is no file {path}"
        return
    lines = actual.removesuffix("\n").split("\n")
    expected = expected_text.removesuffix("\n").split("\n")
    if len(lines) != len(expected):
        yield f"{path} has {len(lines)} lines, not {len(expected)}"
    for number, (line, expected_line) in enumerate(zip(lines, expected, strict=False), start=1):
        if line != expected_line:
            yield f"line {number} of {path} is {line[:80]!r}, not {expected_line[:80]!r}"
            return


def shown_text(hand: Hand, app: str) -> str:
    """Return the text that the editor shows."""
    return hand.find("text", app=app, state="multi_line").text


def bring(hand: Hand, path: str, app: str) -> None:
    """Make a file be the one that the editor shows; it is opened if it is not."""
    if hand.see("frame", title(path), app) is None:
        hand.press("ctrl", "o")
        choose_to_open(hand, path, app)
    _keyboard_at(hand, path, app)


def choose_to_open(hand: Hand, path: str, app: str) -> None:
    """Give the dialog for opening a file, which comes up, a path."""
    hand.find("file-chooser", app=app)
    hand.press("ctrl", "l")  # the field for a path
    hand.find("text", app=app, state="focused")
    hand.replace(hand.path(path))
    hand.press("enter")
    hand.wait_until_gone("file-chooser", app=app)


def begin(hand: Hand, path: str, text: str, app: str) -> None:
    """Make the editor show a file as it was at first, after whatever an earlier try left."""
    bring(hand, path, app)
    for _ in range(_UNDOS):
        if shown_text(hand, app) == text:
            return
        hand.press("ctrl", "z")
    hand.replace(text)
    wait_for_text(hand, text, app)


def wait_for_text(hand: Hand, text: str, app: str) -> None:
    """Wait until the editor shows a text."""
    hand.wait(
        f"text {text[-60:]!r} of {app}",
        # A dialog may cover it.
        lambda node: app in node.app.lower() and node.role == "text" and node.text == text,
    )


def _keyboard_at(hand: Hand, path: str, app: str) -> None:
    """Wait until the window of a file has the keyboard."""
    hand.find("frame", title(path), app, state="active")


def go_to_line(hand: Hand, path: str, number: int, app: str) -> None:
    """Put the cursor at the start of a line; the first line has the number 1.

    A dialog asks for the number, in Geany only if its window is too narrow for the field in the
    toolbar.
    """
    _keyboard_at(hand, path, app)
    hand.press("ctrl", "l")
    hand.wait(f"field for a line's number in {app}", lambda node: _is_focused_field(node, app))
    hand.replace(f"{number}\n")
    hand.wait_until_gone("dialog", re.compile("Go [Tt]o"), app)
    if app == "mousepad":
        hand.press("home")  # it goes to the column where the cursor was


def _is_focused_field(node: TreeNode, app: str) -> bool:
    if app not in node.app.lower() or node.role not in {"spin-button", "text"}:
        return False
    return "focused" in node.states and "multi_line" not in node.states


def rewrite_line(hand: Hand, path: str, number: int, line: str, app: str) -> None:
    """Replace a line by another."""
    go_to_line(hand, path, number, app)
    hand.press("end")
    hand.press("shift", "home")
    hand.type(line)


def save(hand: Hand, path: str, app: str) -> None:
    """Save the file that is shown; its title has no asterisk then."""
    hand.press("ctrl", "s")
    hand.find("frame", title(path, saved=True), app)


def title(path: str, *, saved: bool = False) -> re.Pattern[str]:
    """Return a pattern for the title of the window that shows a file.

    Mousepad begins with the path of the file, Geany with its name.
    """
    name = re.escape(PurePosixPath(path).name)
    star = "" if saved else r"\*? ?"
    return re.compile(rf"{star}([^ *][^*]*/)?{name} - ")
