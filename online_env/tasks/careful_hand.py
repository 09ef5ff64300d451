"""A hand that notices what got in its way and puts it right, as a careful user would.

It is told what a person knows: the applications of the task, how to start the first of them, and
the password. It is never told what was disturbed, and it acts with pointer and keyboard alone.
"""

import re
import time
from collections.abc import Callable, Iterable

from hijack_data.actions.allowed import REINIT

from ..desktops.protocol import Desktop
from ..errors import DesktopTimeoutError
from .hand import BUTTONS, ENTRIES, MENU_ROLES, PAUSE, TIMEOUT_S, Hand, title_click
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
_LEFT_OPEN = 3  # dialogs that one try may leave behind
_CHANGES = 60  # that are taken back before another try
LOST_S = 2.0  # seconds without what is wanted, until the hand looks for a reason
_PATIENT = 3  # looks for a reason before an Escape, which also stops a page that is loading
# An application whose tool bars keep the keyboard after a click: F6 takes it on to the next pane,
# from which Escape leads back to the document.
_KEEPS_KEYBOARD = "soffice"
_OFFLINE = re.compile("No internet|This site can.t be reached|Your connection was interrupted")


class CarefulHand(Hand):
    """Pointer and keyboard of a person who goes on after a disturbance.

    Args:
        desktop: Where to act.
        apps: The applications of the task, as `kit.apps.APPS` names them; windows of others are
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
        self._own = TaskWindows(apps, start)
        self._start = start
        self._password = password
        self._asked = False
        self._had_document = False  # whether a window of the document was ever there
        self._first = ""  # the application that had the keyboard when the task began
        self._programs: set[str] = set()  # how the titles of the own windows end
        self._lost = 0.0  # when to look for a reason, by `time.monotonic`
        self._missed = 0  # how often a reason was looked for since what is wanted is missing
        self._may_be_outside = False  # whether the pointer may be beside the own windows

    def look(self) -> list[TreeNode]:
        """Return the nodes of the tree as it is now, and keep the titles of the own windows."""
        seen = super().look()
        shown = self._own.shown(seen)
        self._programs |= {program_name(node.name) for node in shown if node.name}
        active = [node.app for node in self._own.frames(seen) if "active" in node.states]
        self._first = self._first or next(iter(active), "")
        self._had_document |= any(map(self._own.names_document, shown))
        return seen

    def wait(
        self,
        what: str,
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
        return super().wait(what, test, meanwhile)

    def _while_missing(self, seen: list[TreeNode], meanwhile: Callable[[], None] | None) -> bool:
        if time.monotonic() <= self._lost:
            return super()._while_missing(seen, meanwhile)
        self._missed += 1
        if self.recover(seen, escape=self._missed >= _PATIENT):
            raise DesktopTimeoutError(
                "the document was closed; it is open again, but without what was done in it"
            )
        self._lost = time.monotonic() + LOST_S
        return False

    def run(self, code: str) -> None:
        """Run pyautogui code, after what is plainly in the way was put right."""
        self._clear(self.look())
        super().run(code)

    def click(self, node: TreeNode) -> None:
        """Click in the middle of a node, after what is plainly in the way was put right.

        Raises:
            DesktopTimeoutError: The node is part of a menu, which closed meanwhile; the tree may
                still name it.
        """
        if self._clear(self.look()) and node.role in MENU_ROLES:
            raise DesktopTimeoutError(f"the menu with {node.name!r} was closed by a disturbance")
        self._click_at(node)  # `run` would look once more
        self._may_be_outside = False

    def replace(self, text: str) -> None:
        """Type a text in the place of what the focused field holds; do it again if it is wrong.

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
        return node.role in _FIELDS and "focused" in node.states and self._own.has(node)

    def recover(self, seen: list[TreeNode] | None = None, escape: bool = True) -> bool:
        """Look for a reason why things are not as expected, and do something about it.

        Args:
            seen: The nodes of the tree; it is read if omitted.
            escape: Whether to press Escape if there is no reason to be seen.

        Returns:
            Whether the task's document had to be opened again, as it was saved last.
        """
        present = self.look() if seen is None else seen
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

    def prepare_retry(self) -> None:
        """Put right what is in the way of another try: also what the last one left open or changed.

        A dialog, and a text being edited in it or under it, take an Escape each. A dialog may open
        another one when it is left: LibreOffice's question of the format opens the one to save.
        """
        self.recover()
        for _ in range(_LEFT_OPEN):
            time.sleep(LOST_S / 2)  # a dialog that follows another takes a moment
            seen = self.look()
            if not self._own.dialogs(seen):
                break
            self._escape(seen)  # the dialog
            super().run("pyautogui.press('escape')")  # what it was about
        self._leave_others()
        self._go_to_first()
        self._take_back()

    def _leave_others(self) -> None:
        """Press Escape in the own windows that do not have the keyboard.

        One may have a menu or a dialog that is not in the tree.
        """
        seen = self.look()
        for window in self._own.frames(seen):
            if "active" not in window.states and self._bring_to_front(window, seen):
                super().run("pyautogui.press('escape')")

    def _go_to_first(self) -> None:
        """Give the keyboard to the window that had it when the task began."""
        seen = self.look()
        for window in self._own.frames(seen):
            if window.app == self._first and "active" not in window.states:
                self._bring_to_front(window, seen)
                return

    def _bring_to_front(self, window: TreeNode, seen: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one."""
        button = panel_button(window, seen)
        if button is None or not window.name:
            return False
        self._click_plainly(button)
        time.sleep(LOST_S / 2)  # a panel takes a moment to bring a window to the front
        return True

    def _take_back(self) -> None:
        """Undo all that was done in the document, by an accident or by the last try."""
        for _ in range(_CHANGES):
            seen = self.look()
            if len(self._own.shown(seen)) != 1 or not any(self._is_undo(node) for node in seen):
                return
            super().run("pyautogui.hotkey('ctrl', 'z')")
            time.sleep(PAUSE)
            if not self._agree():
                return

    def _agree(self) -> bool:
        """Agree to delete what is taken back, if asked; return whether nothing else is asked."""
        seen = self.look()
        if not self._own.dialogs(seen):
            return True
        for node in seen:
            if node.role in BUTTONS and node.name == "Delete" and self._own.has(node) and node.box:
                self._click_at(node)
                time.sleep(PAUSE)
                return True
        return False

    def _is_undo(self, node: TreeNode) -> bool:
        """Return whether a node is a button to undo something, and there is something to undo."""
        is_button = node.role == "push-button" and node.name == "Undo"
        return is_button and self._own.has(node) and "sensitive" in node.states

    def _escape(self, seen: list[TreeNode]) -> None:
        """Leave the own dialog that shows, if any does, or else what has the keyboard."""
        for dialog in self._own.dialogs(seen)[-1:]:
            self._activate(dialog)
        if any(_has_tool(node) for node in seen):
            super().run("pyautogui.press('f6')")
        super().run("pyautogui.press('escape')")

    def _clear(self, seen: list[TreeNode]) -> bool:
        """Unlock the screen, restore the windows, close what is foreign.

        Returns whether there was something to do.
        """
        if any(node.app == LOCKER and node.role == "frame" and node.box for node in seen):
            self._unlock()
            return True
        minimised = [node for node in self._own.windows(seen) if "iconified" in node.states]
        if minimised and self._restore(minimised[0], seen):
            return True
        foreign = [node for node in seen if self._own.is_foreign(node)]
        if foreign:
            self._close(foreign[0])
            return True
        return False

    def _bring_back(self, seen: list[TreeNode]) -> bool:
        """Restore a window if none of the own ones shows; return whether there is one to restore.

        Applications on Qt neither say that they are minimised, nor keep the names of their windows
        then. The buttons of the panel have them.
        """
        if self._own.shown(seen):
            return False
        for node in reversed(seen):  # the button of a dialog comes after that of its window
            if node.app == PANEL and node.box and program_name(node.name) in self._programs:
                self._click_plainly(node)
                self._until(self._own.shown)
                return True
        return False

    def _go_to_document(self, seen: list[TreeNode]) -> bool:
        """Give the keyboard to the window of the task's document, if one beside it has it.

        A program that was started once more has another window, which belongs to the task's
        applications as well: only the titles tell the two apart.
        """
        frames = self._own.frames(seen)
        others = [node for node in frames if not self._own.names_document(node)]
        ours = [node for node in frames if self._own.names_document(node)]
        if not ours or not any("active" in node.states for node in others):
            return False
        return self._bring_to_front(ours[0], seen)

    def _has_no_window(self, seen: list[TreeNode]) -> bool:
        """Return whether no own window is open, now and a moment later.

        A program that is busy, as while it opens a document, has none in the tree until it answers.
        """
        if self._own.windows(seen):
            return False
        time.sleep(LOST_S)
        return not self._own.windows(self.look())

    def _is_closed(self, seen: list[TreeNode]) -> bool:
        """Return whether the task's document was closed, and its program shows without any."""
        frames = self._own.frames(seen)
        if any(self._own.names_document(node) for node in frames):
            return False
        bare = [node for node in frames if node.box and node.name == program_name(node.name) != ""]
        return self._had_document and bool(bare) and not self._own.dialogs(seen)

    def _unlock(self) -> None:
        super().run("pyautogui.press('shift')")  # the screen is black until a key is pressed
        time.sleep(LOST_S / 2)
        super().run(f"pyautogui.write({self._password + chr(10)!r})")
        self._until(lambda seen: not any(n.app == LOCKER and n.box for n in seen))

    def _restore(self, window: TreeNode, seen: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one.

        A second click would minimise the window again, so this waits until it is there.
        """
        button = panel_button(window, seen)
        if button is None:
            return False
        self._click_plainly(button)
        self._until(lambda later: not is_minimised(window, later))
        self._return_to_dialog()
        return True

    def _return_to_dialog(self) -> None:
        """Give the keyboard back to a dialog: its window was restored, and has it now."""
        for node in self.look():
            if self._own.has(node) and node.role in DIALOGS and node.box:
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
        self._until(lambda seen: not any(n.app == window.app and n.box for n in seen))

    def _start_again(self) -> None:
        super().run("pyautogui.hotkey('alt', 'f2')")
        self._until(lambda seen: any("appfinder" in node.app and node.box for node in seen))
        super().run(f"pyautogui.write({self._start!r})")
        time.sleep(LOST_S / 2)  # the finder takes a text over a moment after it was typed
        super().run("pyautogui.press('enter')")
        self._until(self._own.shown)

    def _is_offline(self, seen: list[TreeNode]) -> bool:
        return any(node.role == "heading" and _OFFLINE.match(node.name) for node in seen)

    def _ask_for_help(self) -> None:
        """Ask for the machine to be put right, once, and load the page again."""
        if not self._asked:
            self._asked = True
            super().run(REINIT)
        super().run("pyautogui.press('f5')")
        time.sleep(LOST_S)

    def _click_plainly(self, node: TreeNode) -> None:
        """Click on a button of the panel."""
        self._click_at(node)
        self._may_be_outside = True

    def _click_at(self, node: TreeNode) -> None:
        x, y = node.centre
        super().run(f"pyautogui.click({x}, {y})")

    def _scroll(self) -> None:
        """Turn the wheel over the page, not over the panel or what a closed window has left."""
        if self._may_be_outside:
            for window in self._own.shown(self.look())[-1:]:
                x, y = window.centre
                super().run(f"pyautogui.moveTo({x}, {y})")
                self._may_be_outside = False
        super()._scroll()

    def _until(self, test: Callable[[list[TreeNode]], object]) -> None:
        """Wait until a test of the tree passes, or for as long as the hand has timeout."""
        deadline = time.monotonic() + self._patience
        while time.monotonic() < deadline:
            if test(self.look()):
                return
            time.sleep(PAUSE)


def _same_field(field: TreeNode, seen: list[TreeNode]) -> TreeNode | None:
    """Return a field of an earlier look as it is now; `None` if it cannot be told which it is.

    Many fields have no name, so of several it is the one in the same place.
    """
    known = (field.app, field.role, field.name)
    found = [node for node in seen if (node.app, node.role, node.name) == known]
    if len(found) > 1:
        found = [node for node in found if node.box == field.box]
    return found[0] if len(found) == 1 else None


def _is_wrong(field: TreeNode, text: str) -> bool:
    """Return whether a field does not hold a text, or its completion.

    Some fields do not tell what they hold.
    """
    if field.box is None or field.text.startswith(text):
        return False
    return field.text != "" or "focused" not in field.states


def _has_tool(node: TreeNode) -> bool:
    """Return whether a node is a button that keeps the keyboard of its application."""
    is_focused = node.role == "push-button" and "focused" in node.states
    return is_focused and node.app == _KEEPS_KEYBOARD
