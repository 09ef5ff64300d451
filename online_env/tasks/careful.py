"""A hand that notices what got in its way and puts it right, as a careful user would.

It is told what a person knows: the applications of the task, how to start the first of them, and
the password. It is never told what was disturbed, and it acts with pointer and keyboard alone.
"""

import re
import shlex
import time
from collections.abc import Callable, Iterable
from pathlib import PurePath

from hijack_data.runs.run_log import REINIT

from ..desktops.protocol import Desktop
from ..errors import DesktopTimeoutError
from .hand import BUTTONS, ENTRIES, MENU_ROLES, PATIENCE, PAUSE, Hand, title_click
from .kit.apps import APPS
from .tree import TreeNode

PASSWORD = "password"
_FIELDS = (*ENTRIES, "combo-box")
_LEFT_OPEN = 3  # dialogs that one try may leave behind
_CHANGES = 60  # that are taken back before another try
LOST = 2.0  # seconds without what is wanted, until the hand looks for a reason
_PATIENT = 3  # looks for a reason before an Escape, which also stops a page that is loading
_PANEL = "xfce4-panel"
_LOCKER = "mate-screensaver"
_FINDER = "xfce4-appfinder"  # what Alt+F2 opens: the hand may have done so
_SYSTEM = (
    _PANEL,
    _LOCKER,
    _FINDER,
    "xfdesktop",
    "xfsettingsd",
    "xfwm4",
    "wrapper",
    "xfce4-notifyd",
)
_DIALOGS = ("dialog", "file-chooser", "alert")
_WINDOWS = ("frame", *_DIALOGS)
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
        patience: Seconds to wait for something before `DesktopTimeoutError`.
    """

    def __init__(
        self,
        desktop: Desktop,
        apps: Iterable[str],
        start: str = "",
        password: str = PASSWORD,
        patience: float = PATIENCE,
    ) -> None:
        super().__init__(desktop, patience)
        known = [APPS[name] for name in apps if name in APPS]
        self._own = [name for app in known for name in (app.tree, app.helper) if name]
        self._start = start
        self._password = password
        self._asked = False
        self._documents = {PurePath(word).name for word in shlex.split(start)[1:] if "/" in word}
        self._had_document = False  # whether a window of the document was ever there
        self._first = ""  # the application that had the keyboard when the task began
        self._programs: set[str] = set()  # how the titles of the own windows end
        self._lost = 0.0  # when to look for a reason, by `time.monotonic`
        self._missed = 0  # how often a reason was looked for since what is wanted is missing
        self._may_be_outside = False  # whether the pointer may be beside the own windows

    def look(self) -> list[TreeNode]:
        """Return the nodes of the tree as it is now, and keep the titles of the own windows."""
        seen = super().look()
        titles = [node.name for node in seen if node.box and self._is_own_window(node)]
        self._programs |= {_program(title) for title in titles if title}
        active = [node.app for node in self._frames(seen) if "active" in node.states]
        self._first = self._first or next(iter(active), "")
        self._had_document |= any(name in title for name in self._documents for title in titles)
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
        self._lost = time.monotonic() + LOST
        self._missed = 0
        return super().wait(what, test, meanwhile)

    def _while_missing(
        self,
        seen: list[TreeNode],
        meanwhile: Callable[[], None] | None,
    ) -> bool:
        if time.monotonic() <= self._lost:
            return super()._while_missing(seen, meanwhile)
        self._missed += 1
        if self.put_right(seen, escape=self._missed >= _PATIENT):
            raise DesktopTimeoutError(
                "the document was closed; it is open again, but without what was done in it"
            )
        self._lost = time.monotonic() + LOST
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
        return node.role in _FIELDS and "focused" in node.states and self._is_own(node)

    def put_right(
        self,
        seen: list[TreeNode] | None = None,
        escape: bool = True,
    ) -> bool:
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

    def begin_again(self) -> None:
        """Put right what is in the way of another try: also what the last one left open or changed.

        A dialog, and a text being edited in it or under it, take an Escape each. A dialog may open
        another one when it is left: LibreOffice's question of the format opens the one to save.
        """
        self.put_right()
        for _ in range(_LEFT_OPEN):
            time.sleep(LOST / 2)  # a dialog that follows another takes a moment
            seen = self.look()
            if not self._dialogs(seen):
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
        for window in self._frames(seen):
            if "active" not in window.states and self._bring_to_front(window, seen):
                super().run("pyautogui.press('escape')")

    def _go_to_first(self) -> None:
        """Give the keyboard to the window that had it when the task began."""
        seen = self.look()
        for window in self._frames(seen):
            if window.app == self._first and "active" not in window.states:
                self._bring_to_front(window, seen)
                return

    def _bring_to_front(self, window: TreeNode, seen: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one."""
        button = _panel_button(window, seen)
        if button is None or not window.name:
            return False
        self._click_plainly(button)
        time.sleep(LOST / 2)  # a panel takes a moment to bring a window to the front
        return True

    def _take_back(self) -> None:
        """Undo all that was done in the document, by an accident or by the last try."""
        for _ in range(_CHANGES):
            seen = self.look()
            windows = [node for node in seen if self._is_own_window(node) and node.box]
            if len(windows) != 1 or not any(self._is_undo(node) for node in seen):
                return
            super().run("pyautogui.hotkey('ctrl', 'z')")
            time.sleep(PAUSE)
            if not self._agree():
                return

    def _agree(self) -> bool:
        """Agree to delete what is taken back, if asked; return whether nothing else is asked."""
        seen = self.look()
        if not self._dialogs(seen):
            return True
        for node in seen:
            if node.role in BUTTONS and node.name == "Delete" and self._is_own(node) and node.box:
                self._click_at(node)
                time.sleep(PAUSE)
                return True
        return False

    def _is_undo(self, node: TreeNode) -> bool:
        """Return whether a node is a button to undo something, and there is something to undo."""
        is_button = node.role == "push-button" and node.name == "Undo"
        return is_button and self._is_own(node) and "sensitive" in node.states

    def _escape(self, seen: list[TreeNode]) -> None:
        """Leave the own dialog that shows, if any does, or else what has the keyboard."""
        for dialog in self._dialogs(seen)[-1:]:
            self._activate(dialog)
        if any(_has_tool(node) for node in seen):
            super().run("pyautogui.press('f6')")
        super().run("pyautogui.press('escape')")

    def _dialogs(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return the own dialogs that show beside an own frame; some tasks have a dialog alone.

        A frame under a modal dialog may not say that it shows. An alert may be a part of a web
        page; one that is modal is a window.
        """
        own = [node for node in seen if self._is_own_window(node)]
        if not any(node.role == "frame" for node in own):
            return []
        shown = [node for node in own if node.role in _DIALOGS and node.box]
        return [node for node in shown if node.role != "alert" or "modal" in node.states]

    def _clear(self, seen: list[TreeNode]) -> bool:
        """Unlock the screen, restore the windows, close what is foreign.

        Returns whether there was something to do.
        """
        if any(node.app == _LOCKER and node.role == "frame" and node.box for node in seen):
            self._unlock()
            return True
        own = [node for node in seen if self._is_own_window(node)]
        minimised = [node for node in own if "iconified" in node.states]
        if minimised and self._restore(minimised[0], seen):
            return True
        foreign = [node for node in seen if self._is_foreign(node)]
        if foreign:
            self._close(foreign[0])
            return True
        return False

    def _bring_back(self, seen: list[TreeNode]) -> bool:
        """Restore a window if none of the own ones shows; return whether there is one to restore.

        Applications on Qt neither say that they are minimised, nor keep the names of their windows
        then. The buttons of the panel have them.
        """
        if any(node.box for node in seen if self._is_own_window(node)):
            return False
        for node in reversed(seen):  # the button of a dialog comes after that of its window
            if node.app == _PANEL and node.box and _program(node.name) in self._programs:
                self._click_plainly(node)
                self._until(self._shows)
                return True
        return False

    def _go_to_document(self, seen: list[TreeNode]) -> bool:
        """Give the keyboard to the window of the task's document, if one beside it has it.

        A program that was started once more has another window, which belongs to the task's
        applications as well: only the titles tell the two apart.
        """
        frames = self._frames(seen)
        others = [node for node in frames if not self._names_document(node)]
        ours = [node for node in frames if self._names_document(node)]
        if not ours or not any("active" in node.states for node in others):
            return False
        return self._bring_to_front(ours[0], seen)

    def _has_no_window(self, seen: list[TreeNode]) -> bool:
        """Return whether no own window is open, now and a moment later.

        A program that is busy, as while it opens a document, has none in the tree until it answers.
        """
        if any(self._is_own_window(node) for node in seen):
            return False
        time.sleep(LOST)
        return not any(self._is_own_window(node) for node in self.look())

    def _is_closed(self, seen: list[TreeNode]) -> bool:
        """Return whether the task's document was closed, and its program shows without any."""
        frames = self._frames(seen)
        if any(self._names_document(node) for node in frames):
            return False
        bare = [node for node in frames if node.box and node.name == _program(node.name) != ""]
        return self._had_document and bool(bare) and not self._dialogs(seen)

    def _frames(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return the own windows that are no dialogs."""
        return [node for node in seen if self._is_own_window(node) and node.role == "frame"]

    def _names_document(self, window: TreeNode) -> bool:
        return any(name in window.name for name in self._documents)

    def _shows(self, seen: list[TreeNode]) -> bool:
        return any(self._is_own_window(node) and node.box for node in seen)

    def _is_own_window(self, node: TreeNode) -> bool:
        return node.role in _WINDOWS and self._is_own(node)

    def _is_own(self, node: TreeNode) -> bool:
        return any(name in node.app.lower() for name in self._own)

    def _is_foreign(self, node: TreeNode) -> bool:
        if node.role not in _WINDOWS or node.box is None or self._is_own(node):
            return False
        return bool(self._own) and not node.app.lower().startswith(_SYSTEM)

    def _unlock(self) -> None:
        super().run("pyautogui.press('shift')")  # the screen is black until a key is pressed
        time.sleep(LOST / 2)
        super().run(f"pyautogui.write({self._password + chr(10)!r})")
        self._until(lambda seen: not any(n.app == _LOCKER and n.box for n in seen))

    def _restore(self, window: TreeNode, seen: list[TreeNode]) -> bool:
        """Click on the button of a window in the panel; return whether there is one.

        A second click would minimise the window again, so this waits until it is there.
        """
        button = _panel_button(window, seen)
        if button is None:
            return False
        self._click_plainly(button)
        self._until(lambda later: not _is_minimised(window, later))
        self._return_to_dialog()
        return True

    def _return_to_dialog(self) -> None:
        """Give the keyboard back to a dialog: its window was restored, and has it now."""
        for node in self.look():
            if self._is_own(node) and node.role in _DIALOGS and node.box:
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
        time.sleep(LOST / 2)  # the finder takes a text over a moment after it was typed
        super().run("pyautogui.press('enter')")
        self._until(lambda seen: any(self._is_own_window(node) and node.box for node in seen))

    def _is_offline(self, seen: list[TreeNode]) -> bool:
        return any(node.role == "heading" and _OFFLINE.match(node.name) for node in seen)

    def _ask_for_help(self) -> None:
        """Ask for the machine to be put right, once, and load the page again."""
        if not self._asked:
            self._asked = True
            super().run(REINIT)
        super().run("pyautogui.press('f5')")
        time.sleep(LOST)

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
            shown = [node for node in self.look() if self._is_own_window(node) and node.box]
            for window in shown[-1:]:
                x, y = window.centre
                super().run(f"pyautogui.moveTo({x}, {y})")
                self._may_be_outside = False
        super()._scroll()

    def _until(self, test: Callable[[list[TreeNode]], bool]) -> None:
        """Wait until a test of the tree passes, or for as long as the hand has patience."""
        deadline = time.monotonic() + self._patience
        while time.monotonic() < deadline:
            if test(self.look()):
                return
            time.sleep(PAUSE)


def _panel_button(window: TreeNode, seen: list[TreeNode]) -> TreeNode | None:
    """Return the button of the panel with the name of a window."""
    buttons = (node for node in seen if node.app == _PANEL and node.box)
    return next((node for node in buttons if node.name == window.name), None)


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


def _is_minimised(window: TreeNode, seen: list[TreeNode]) -> bool:
    """Return whether a window of that application and name is minimised."""
    return any(
        node.app == window.app and node.name == window.name and "iconified" in node.states
        for node in seen
    )


def _program(title: str) -> str:
    """Return what a title ends with: most windows name a document, then their program."""
    return title.rpartition(" - ")[2]
