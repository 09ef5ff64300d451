"""A hand that notices disturbances and undoes them, as a careful user would.

An action that seems to have got lost it does again: nothing has changed on the screen, and what
should follow does not come.

It knows what a person knows: the applications of the task, how to start the first of them, and the
password. It does not know what was disturbed, and it acts with pointer and keyboard alone.
"""

import time
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

from hijack_data.actions.agent_actions import REINIT
from hijack_data.types import UInt8Array

from ..desktops.protocol import Desktop
from ..errors import DesktopTimeoutError
from .hand import BUTTONS, ENTRIES, MENU_ROLES, PAUSE, TIMEOUT_S, Hand, title_click
from .task_apps import PAGE_ERROR
from .task_windows import (
    DIALOGS,
    LOCKER,
    PANEL,
    TaskWindows,
    is_minimised,
    panel_button,
    program_name,
)
from .tree_nodes import TreeNode

PASSWORD = "password"
_FIELDS = (*ENTRIES, "combo-box")
_MAX_OPEN_DIALOGS = 3  # that one try may leave behind
_MAX_UNDOS = 60  # before another try
MAX_HANG_S = 60.0  # s in an episode for which applications that hang are waited for
NO_ANSWER = "did not answer within"  # in a comment of the tree, see embedded/guest/atspi/reader.py
LOST_S = 2.0  # without what is expected, until the hand looks for a reason
TYPED_S = 1.0  # s within which a typed text shows
_CURSOR_PIXELS = 4  # a cursor that blinks is narrower
_MAX_REPEATS = 2  # of one action that seems to have got lost
_Layout: TypeAlias = frozenset[tuple[Any, ...]]
_LOOKS_BEFORE_ESCAPE = (
    3  # looks for a reason before an Escape, which also stops a page that is loading
)
# An application whose tool bars keep the keyboard after a click: F6 takes it on to the next pane,
# from which Escape leads back to the document.
_KEEPS_KEYBOARD = "soffice"


class CarefulHand(Hand):
    """Pointer and keyboard of a person who goes on after a disturbance.

    Args:
        desktop: Where to act.
        apps: The applications of the task, as `task_apps.APPS` names them; windows of others are
            closed.
        start: What to type to start the task's first application again; "" if it has none.
        password: The user's password.
        timeout: Seconds to wait for something before `DesktopTimeoutError`.
    """

    def __init__(
        self,
        desktop: Desktop,
        apps: Iterable[str],
        start: str = "",
        password: str = PASSWORD,
        timeout: float = TIMEOUT_S,
    ) -> None:
        super().__init__(desktop, timeout)
        self._windows = TaskWindows(apps, start)
        self._start = start
        self._password = password
        self._asked = False
        self._had_document = False  # whether a window of the document was ever there
        self._first = ""  # the application that had the keyboard when the task began
        self._programs: set[str] = set()  # how the titles of the own windows end
        self._lost = 0.0  # when to look for a reason, by `time.monotonic`
        self._missed = 0  # how often a reason was looked for since what is wanted is missing
        self._may_be_outside = False  # whether the pointer may be beside the own windows
        self._layout: _Layout = frozenset()  # of the last look
        self._last = ""  # the last action of the task
        self._layout_before: _Layout = frozenset()  # when it was done
        self._repeats_left = 0  # how often it may be done again
        self._hang_s = MAX_HANG_S

    def tree(self) -> str:
        """Return the tree, once every application answers: one that hangs may go on."""
        while True:
            start = time.monotonic()
            xml = super().tree()
            if NO_ANSWER not in xml or self._hang_s <= 0:
                return xml
            time.sleep(PAUSE)
            self._hang_s -= time.monotonic() - start

    def look(self) -> list[TreeNode]:
        """Return the nodes of the tree as it is now, and keep the titles of the own windows."""
        nodes = super().look()
        self._layout = _layout(nodes)
        visible = self._windows.visible(nodes)
        self._programs |= {program_name(node.name) for node in visible if node.name}
        active = [node.app for node in self._windows.frames(nodes) if "active" in node.states]
        self._first = self._first or next(iter(active), "")
        self._had_document |= any(map(self._windows.names_document, visible))
        return nodes

    def wait(
        self,
        description: str,
        test: Callable[[TreeNode], bool],
        meanwhile: Callable[[], None] | None = None,
    ) -> TreeNode:
        """Look until a node passes a test, and look for obstacles if none does.

        Raises:
            DesktopTimeoutError: No such node came in time, or the document had to be opened again:
                what the oracle did in it is lost.
        """
        self._lost = time.monotonic() + LOST_S
        self._missed = 0
        return super().wait(description, test, meanwhile)

    def _while_missing(self, nodes: list[TreeNode], meanwhile: Callable[[], None] | None) -> bool:
        if time.monotonic() <= self._lost:
            return super()._while_missing(nodes, meanwhile)
        self._missed += 1
        is_late = self._missed >= _LOOKS_BEFORE_ESCAPE
        if is_late and self._repeat_lost_action():
            self._lost = time.monotonic() + LOST_S
            return True
        if self.recover(nodes, escape=is_late):
            raise DesktopTimeoutError(
                "the document was closed; it is open again, but without what was done in it"
            )
        self._lost = time.monotonic() + LOST_S
        return False

    def run(self, code: str) -> None:
        """Run pyautogui code, after obvious obstacles were removed."""
        self._prepare(code)
        super().run(code)

    def _prepare(self, code: str) -> bool:
        """Remove obvious obstacles, and note the next action; return whether there were any."""
        cleared = self._clear(self.look())
        if cleared:
            self.look()
        self._last = code
        self._layout_before = self._layout
        self._repeats_left = _MAX_REPEATS
        return cleared

    def _repeat_lost_action(self) -> bool:
        """Do the last action again if everything looks as before it; return whether it was."""
        if not self._repeats_left or not self._last or self._layout != self._layout_before:
            return False
        self._repeats_left -= 1
        super().run(self._last)
        return True

    def type(self, text: str) -> None:
        """Type any text where the cursor is, and again if nothing of it shows on the screen."""
        code = f"pyautogui.write({text!r})"
        self._prepare(code)
        before = self._desktop.screenshot()
        super().run(code)
        if text and not self._changes(before):
            super().run(code)
        self._last = ""  # it shows; the tree need not hold it

    def _changes(self, before: UInt8Array) -> bool:
        """Return whether the screen changes within `TYPED_S`, by more than a blinking cursor."""
        deadline = time.monotonic() + TYPED_S
        while True:
            after = self._desktop.screenshot()
            columns = (after != before).any(axis=(0, 2)).nonzero()[0]
            if len(columns) and columns[-1] - columns[0] >= _CURSOR_PIXELS:
                return True
            if time.monotonic() > deadline:
                return False
            time.sleep(PAUSE)

    def click(self, node: TreeNode) -> None:
        """Click in the middle of a node, after obvious obstacles were removed.

        Raises:
            DesktopTimeoutError: The node is part of a menu, which closed meanwhile; the tree may
                still name it.
        """
        x, y = node.centre
        if self._prepare(f"pyautogui.click({x}, {y})") and node.role in MENU_ROLES:
            raise DesktopTimeoutError(f"the menu with {node.name!r} was closed by a disturbance")
        self._click_at(node)  # `run` would look once more
        self._may_be_outside = False

    def replace(self, text: str) -> None:
        """Replace what the focused field holds by a text; do it again if it is wrong.

        A touch may have gone to another field meanwhile, or have put something else into this one.
        """
        before = [node for node in self.look() if self._is_focused_field(node)]
        super().replace(text)
        if not before or "\n" in text:  # the line feed may have left the field
            return
        field = _same_field(before[0], self.look())
        if field is None or not _is_wrong(field, text):
            return
        if "focused" not in field.states:
            self._click_at(field)
        super().replace(text)

    def _is_focused_field(self, node: TreeNode) -> bool:
        return node.role in _FIELDS and "focused" in node.states and self._windows.has(node)

    def recover(self, nodes: list[TreeNode] | None = None, escape: bool = True) -> bool:
        """Look for a reason why things are not as expected, and do something about it.

        Args:
            nodes: The nodes of the tree; it is read if omitted.
            escape: Whether to press Escape if there is no reason to be seen.

        Returns:
            Whether the task's document had to be opened again, as it was saved last.
        """
        present = self.look() if nodes is None else nodes
        if self._clear(present):
            return False
        if (self._start and self._has_no_window(present)) or self._is_closed(present):
            self._start_again()
            return self._had_document
        if self._bring_back(present) or self._go_to_document(present):
            return False
        if self._is_offline(present):
            self._ask_for_help()
        elif escape:
            self._escape(present)  # a menu or a dialog may be open
        return False

    def check_first_screen(self) -> None:
        """Ask for help before the first action if the task begins on a page that did not load."""
        if self._is_offline(self.look()):
            self._ask_for_help()

    def prepare_retry(self) -> None:
        """Remove what is in the way of another try: also what the last one left open or changed.

        A dialog, and a text being edited in it or under it, take an Escape each. A dialog may open
        another one when it is left: LibreOffice's question of the format opens the one to save.
        """
        self.recover()
        for _ in range(_MAX_OPEN_DIALOGS):
            time.sleep(LOST_S / 2)  # a dialog that follows another takes a moment
            nodes = self.look()
            if not self._windows.dialogs(nodes):
                break
            self._escape(nodes)  # the dialog
            super().run("pyautogui.press('escape')")  # what it was about
        self._escape_other_windows()
        self._go_to_first()
        self._undo_all()

    def _escape_other_windows(self) -> None:
        """Press Escape in the own windows that do not have the keyboard.

        One may have a menu or a dialog that is not in the tree.
        """
        nodes = self.look()
        for window in self._windows.frames(nodes):
            if "active" not in window.states and self._bring_to_front(window, nodes):
                super().run("pyautogui.press('escape')")

    def _go_to_first(self) -> None:
        """Give the keyboard to the window that had it when the task began."""
        nodes = self.look()
        for window in self._windows.frames(nodes):
            if window.app == self._first and "active" not in window.states:
                self._bring_to_front(window, nodes)
                return

    def _bring_to_front(self, window: TreeNode, nodes: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one."""
        button = panel_button(window, nodes)
        if button is None or not window.name:
            return False
        self._click_in_panel(button)
        time.sleep(LOST_S / 2)  # a panel takes a moment to bring a window to the front
        return True

    def _undo_all(self) -> None:
        """Undo all that was done in the document, by an accident or by the last try."""
        for _ in range(_MAX_UNDOS):
            nodes = self.look()
            if len(self._windows.visible(nodes)) != 1 or not any(
                self._is_undo(node) for node in nodes
            ):
                return
            super().run("pyautogui.hotkey('ctrl', 'z')")
            time.sleep(PAUSE)
            if not self._confirm_deletion():
                return

    def _confirm_deletion(self) -> bool:
        """Agree to delete what is taken back, if asked; return whether nothing else is asked."""
        nodes = self.look()
        if not self._windows.dialogs(nodes):
            return True
        for node in nodes:
            if (
                node.role in BUTTONS
                and node.name == "Delete"
                and self._windows.has(node)
                and node.box
            ):
                self._click_at(node)
                time.sleep(PAUSE)
                return True
        return False

    def _is_undo(self, node: TreeNode) -> bool:
        """Return whether a node is a button to undo something, and there is something to undo."""
        is_button = node.role == "push-button" and node.name == "Undo"
        return is_button and self._windows.has(node) and "sensitive" in node.states

    def _escape(self, nodes: list[TreeNode]) -> None:
        """Leave the own dialog that shows, if any does, or else what has the keyboard."""
        for dialog in self._windows.dialogs(nodes)[-1:]:
            self._activate(dialog)
        if any(_has_tool(node) for node in nodes):
            super().run("pyautogui.press('f6')")
        super().run("pyautogui.press('escape')")

    def _clear(self, nodes: list[TreeNode]) -> bool:
        """Unlock the screen, restore the windows, close what is foreign.

        Returns whether there was something to do.
        """
        if any(node.app == LOCKER and node.role == "frame" and node.box for node in nodes):
            self._unlock()
            return True
        minimised = [node for node in self._windows.windows(nodes) if "iconified" in node.states]
        if minimised and self._restore(minimised[0], nodes):
            return True
        foreign = [node for node in nodes if self._windows.is_foreign(node)]
        if foreign:
            self._close(foreign[0])
            return True
        return False

    def _bring_back(self, nodes: list[TreeNode]) -> bool:
        """Restore a window if none of the own ones shows; return whether there is one to restore.

        Applications on Qt neither say that they are minimised, nor keep the names of their windows
        then. The buttons of the panel have them.
        """
        if self._windows.visible(nodes):
            return False
        for node in reversed(nodes):  # the button of a dialog comes after that of its window
            if node.app == PANEL and node.box and program_name(node.name) in self._programs:
                self._click_in_panel(node)
                self._until(self._windows.visible)
                return True
        return False

    def _go_to_document(self, nodes: list[TreeNode]) -> bool:
        """Give the keyboard to the window of the task's document, if one beside it has it.

        A program that was started once more has another window, which belongs to the task's
        applications as well: only the titles tell the two apart.
        """
        frames = self._windows.frames(nodes)
        without_document = [node for node in frames if not self._windows.names_document(node)]
        with_document = [node for node in frames if self._windows.names_document(node)]
        if not with_document or not any("active" in node.states for node in without_document):
            return False
        return self._bring_to_front(with_document[0], nodes)

    def _has_no_window(self, nodes: list[TreeNode]) -> bool:
        """Return whether no own window is open, now and a moment later.

        A program that is busy, as while it opens a document, has none in the tree until it answers.
        """
        if self._windows.windows(nodes):
            return False
        time.sleep(LOST_S)
        return not self._windows.windows(self.look())

    def _is_closed(self, nodes: list[TreeNode]) -> bool:
        """Return whether the task's document was closed, and its program shows without any."""
        frames = self._windows.frames(nodes)
        if any(self._windows.names_document(node) for node in frames):
            return False
        without_document = [
            node for node in frames if node.box and node.name == program_name(node.name) != ""
        ]
        return self._had_document and bool(without_document) and not self._windows.dialogs(nodes)

    def _unlock(self) -> None:
        super().run("pyautogui.press('shift')")  # the screen is black until a key is pressed
        time.sleep(LOST_S / 2)
        super().run(f"pyautogui.write({self._password + chr(10)!r})")
        self._until(lambda nodes: not any(n.app == LOCKER and n.box for n in nodes))

    def _restore(self, window: TreeNode, nodes: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one.

        A second click would minimise the window again, so this waits until it is there.
        """
        button = panel_button(window, nodes)
        if button is None:
            return False
        self._click_in_panel(button)
        self._until(lambda later: not is_minimised(window, later))
        self._return_to_dialog()
        return True

    def _return_to_dialog(self) -> None:
        """Give the keyboard back to a dialog: its window was restored, and has it now."""
        for node in self.look():
            if self._windows.has(node) and node.role in DIALOGS and node.box:
                self._activate(node)
                return

    def _activate(self, window: TreeNode) -> None:
        """Give the keyboard to a window; unlike `activate`, this looks for no obstacle first."""
        if "active" not in window.states:
            super().run(title_click(window))

    def _close(self, window: TreeNode) -> None:
        self._activate(window)
        super().run("pyautogui.hotkey('alt', 'f4')")
        self._may_be_outside = (
            True  # a window of another program may have made the own ones smaller
        )
        self._until(lambda nodes: not any(n.app == window.app and n.box for n in nodes))

    def _start_again(self) -> None:
        super().run("pyautogui.hotkey('alt', 'f2')")
        self._until(lambda nodes: any("appfinder" in node.app and node.box for node in nodes))
        super().run(f"pyautogui.write({self._start!r})")
        time.sleep(LOST_S / 2)  # the finder takes a text over a moment after it was typed
        super().run("pyautogui.press('enter')")
        self._until(self._windows.visible)

    def _is_offline(self, nodes: list[TreeNode]) -> bool:
        return any(node.role == "static" and PAGE_ERROR.match(node.name) for node in nodes)

    def _ask_for_help(self) -> None:
        """Ask for the machine to be put right, once, and load the page again if it is as before."""
        if not self._asked:
            self._asked = True
            super().run(REINIT)
            if not self._is_offline(self.look()):
                return
        super().run("pyautogui.press('f5')")
        time.sleep(LOST_S)

    def _click_in_panel(self, node: TreeNode) -> None:
        """Click on a button of the panel."""
        self._click_at(node)
        self._may_be_outside = True

    def _click_at(self, node: TreeNode) -> None:
        x, y = node.centre
        super().run(f"pyautogui.click({x}, {y})")

    def _scroll(self) -> None:
        """Turn the wheel over the page, not over the panel or what a closed window has left."""
        if self._may_be_outside:
            for window in self._windows.visible(self.look())[-1:]:
                x, y = window.centre
                super().run(f"pyautogui.moveTo({x}, {y})")
                self._may_be_outside = False
        super()._scroll()

    def _until(self, test: Callable[[list[TreeNode]], object]) -> None:
        """Wait until a test of the tree passes, or the timeout is over."""
        deadline = time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            if test(self.look()):
                return
            time.sleep(PAUSE)


def _layout(nodes: list[TreeNode]) -> _Layout:
    """Return what shows, without the panel, whose clock goes on, and without states."""
    return frozenset(
        (node.app, node.role, node.name, node.text, node.box)
        for node in nodes
        if node.box and node.app != PANEL
    )


def _same_field(field: TreeNode, nodes: list[TreeNode]) -> TreeNode | None:
    """Return a field of an earlier look as it is now; `None` if it cannot be told which it is.

    Many fields have no name, so of several it is the one in the same place.
    """
    identity = (field.app, field.role, field.name)
    candidates = [node for node in nodes if (node.app, node.role, node.name) == identity]
    if len(candidates) > 1:
        candidates = [node for node in candidates if node.box == field.box]
    return candidates[0] if len(candidates) == 1 else None


def _is_wrong(field: TreeNode, text: str) -> bool:
    """Return whether a field does not hold a text, or its completion.

    Some fields do not tell what they hold.
    """
    is_doubled = text != "" and field.text.startswith(text + text)
    if field.box is None or (field.text.startswith(text) and not is_doubled):
        return False
    return field.text != "" or "focused" not in field.states


def _has_tool(node: TreeNode) -> bool:
    """Return whether a node is a button that keeps the keyboard of its application."""
    is_focused = node.role == "push-button" and "focused" in node.states
    return is_focused and node.app == _KEEPS_KEYBOARD
