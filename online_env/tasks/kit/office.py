"""Tasks on one document of LibreOffice, and how a person handles LibreOffice with the keyboard."""

import io
import re
import time
import zipfile
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, ClassVar, Protocol

from ... import extra
from ...errors import DesktopTimeoutError
from ..base import Outcome, Task
from ..hand import MENU_ROLES, PAUSE, Hand
from ..machine import Machine
from ..tree_nodes import TreeNode
from .word_lists import straight

APP = "soffice"
OWN_FORMAT = re.compile("Use (?!ODF)")
_MODIFIED = "Save All"  # the menu item can be used while a document has unsaved changes
_TRIES = 3  # so many times the timeout of a hand, for what LibreOffice has to load first
_NOTICED = 3.0  # seconds, until the menu follows a change


class Saved(Protocol):
    """A document of one of the libraries that write office files."""

    def save(self, stream: Any, /) -> object:
        """Write the document."""
        ...


class OfficeTask(Task):
    """A task on one document, which is open at the start.

    `draw` of a subclass returns `path`, the place of the document, among other things. A subclass
    gives `made` and `judge`, and a class for each kind of document gives `load` and `content`.

    Attributes:
        library: The module that reads and writes such documents.
        added: The keys of `draw` that hold paths of files which the task adds.
    """

    library: ClassVar[str]
    added: ClassVar[tuple[str, ...]] = ()

    def made(self) -> Any:
        """Return the document as it is at first, as an object of its library."""
        raise NotImplementedError

    def load(self, data: bytes) -> Any:
        """Return a document as an object of its library."""
        raise NotImplementedError

    def content(self, data: bytes) -> Any:
        """Return what a document holds, to be compared."""
        raise NotImplementedError

    @cached_property
    def before(self) -> Any:
        """The content of the document as it was made."""
        return self.content(dump(self.made()))

    def judge(self, now: Any, before: Any) -> Iterator[str]:
        """Yield what is wrong with the content of the document.

        Args:
            now: What `content` returned of it.
            before: The same of the document as it was made.
        """
        raise NotImplementedError

    def prepare(self, machine: Machine) -> object:
        """Write the document."""
        extra.require(f"the task {self.name}", (self.library,))
        machine.write(self.values.path, dump(self.made()))

    def initial_app(self, machine: Machine) -> Sequence[str]:
        """Open the document in the first application."""
        return self.apps[0], machine.path(self.values.path)

    def problems(self, machine: Machine) -> Iterator[str]:
        """Yield other files that changed, and what `judge` yields."""
        new = [getattr(self.values, key) for key in self.added]
        yield from machine.unexpected_changes(self.values.path, *new)
        now = self.read(machine, self.values.path)
        if now is None:
            yield f"{self.values.path} is gone, or in another format than its name says"
            return
        yield from self.judge(now, self.before)

    def read(self, machine: Machine, path: str) -> Any:
        """Return the content of a document; `None` if there is none that can be read."""
        data = machine.read(path)
        if data is None or not zipfile.is_zipfile(io.BytesIO(data)):
            return None
        try:
            self.load(data)
        except Exception:  # noqa: BLE001  (the libraries stumble over damage in many ways)
            return None
        try:
            return self.content(data)
        except (KeyError, ValueError, SyntaxError, zipfile.BadZipFile):  # lxml's is a SyntaxError
            return None

    def edited(self, change: Callable[[Any], object]) -> Outcome:
        """Return what changes the document behind the screen.

        Args:
            change: Changes the document, an object of its library.
        """

        def outcome(machine: Machine) -> None:
            document = self.load(machine.read(self.values.path) or b"")
            change(document)
            machine.write(self.values.path, dump(document))

        return outcome


def dump(document: Saved) -> bytes:
    """Return the file of a document."""
    stream = io.BytesIO()
    document.save(stream)
    return stream.getvalue()


def plain(text: str) -> str:
    """Return a text as it was typed: with straight quotation marks, and no space at line ends.

    LibreOffice makes quotation marks and apostrophes round when they are typed.
    """
    lines = straight(text).split("\n")
    return "\n".join(line.rstrip() for line in lines)


def save(hand: Hand) -> None:
    """Save the open document in the format of its name, and wait until that is done."""
    _await_change(hand)
    hand.press("ctrl", "s")
    what = "question of the format, or saved document"
    asked = patiently(lambda: hand.wait(what, _is_asked_or_saved))
    if asked.role == "alert":
        keep_format(hand)
    patiently(lambda: hand.wait("saved document", _is_saved))


def keep_format(hand: Hand) -> None:
    """Answer the question in which format to save: in that of the file's name."""
    hand.button(OWN_FORMAT, app=APP)
    hand.wait_until_gone("alert", "Question", app=APP)


def find_text(hand: Hand, text: str) -> None:
    """Select a text of the open document by the find bar."""
    hand.press("ctrl", "f")
    hand.find("text", app=APP, state="focused")
    hand.replace(f"{text}\n")
    hand.press("escape")
    hand.wait_until_gone("push-button", "Close Find Bar", app=APP)


def replace_all(hand: Hand, old: str, new: str) -> None:
    """Replace a text everywhere by the dialog for it."""
    hand.press("ctrl", "h")
    patiently(lambda: hand.find("dialog", "Find and Replace", app=APP))
    hand.replace(old)
    hand.click_on("panel", "Replace With", app=APP)
    hand.replace(new)
    hand.button("Replace All", app=APP)
    patiently(lambda: hand.wait("changed document", _is_changed))  # Impress says nothing
    hand.button("Close", app=APP)
    hand.wait_until_gone("dialog", "Find and Replace", app=APP)


def patiently(look: Callable[[], TreeNode]) -> TreeNode:
    """Return what a look finds; LibreOffice may not answer for a minute when it loads a part.

    Raises:
        DesktopTimeoutError: It found nothing in several times the timeout of its hand.
    """
    for _ in range(_TRIES - 1):
        try:
            return look()
        except DesktopTimeoutError:
            continue
    return look()


def open_document(hand: Hand, path: str, role: str, name: str) -> None:
    """Open another document by the file dialog, unless it is open; that may take a minute.

    Args:
        hand: The hand.
        path: The document.
        role: The role of a node that it has, such as `table`.
        name: The name of this node.
    """
    if hand.see(role, name, APP) is not None:
        return
    hand.press("ctrl", "o")
    hand.choose_file(path, "Open", app=APP)
    patiently(lambda: hand.find(role, name, app=APP))


def menu(hand: Hand, *names: str) -> None:
    """Choose from the menu bar, and wait until the menu is closed."""
    hand.click(hand.wait(f"menu {names[0]}", lambda node: _is_in_bar(node, names[0])))
    hand.menu(*names[1:], app=APP)
    hand.wait_until_gone(MENU_ROLES, names[-1], app=APP)


def _is_in_bar(node: TreeNode, name: str) -> bool:
    # On a guest that is not ours, a second image of the menu bar, with texts, has boxes as well.
    is_menu = node.role == "menu" and node.name == name and APP in node.app
    return is_menu and node.box is not None and not node.text


def _await_change(hand: Hand) -> None:
    """Wait until the menu has noticed a change, or for some seconds."""
    deadline = time.monotonic() + _NOTICED
    while any(_is_saved(node) for node in hand.look()) and time.monotonic() < deadline:
        time.sleep(PAUSE)


def _is_asked_or_saved(node: TreeNode) -> bool:
    is_asked = node.role == "alert" and APP in node.app and node.box is not None
    return is_asked or _is_saved(node)


def _is_saved(node: TreeNode) -> bool:
    return _is_modified_item(node) and "sensitive" not in node.states


def _is_changed(node: TreeNode) -> bool:
    return _is_modified_item(node) and "sensitive" in node.states


def _is_modified_item(node: TreeNode) -> bool:
    # Of the menu's two images in the tree, only one is kept up to date while the menu is closed.
    return node.role == "menu-item" and node.name == _MODIFIED and "opaque" in node.states
