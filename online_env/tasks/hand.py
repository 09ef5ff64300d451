"""A hand for oracles: it looks at the accessibility tree, waits, clicks and types."""

import re
import time
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import PurePosixPath
from typing import TypeAlias, TypeVar

from ..desktops.commands import home
from ..desktops.protocol import Desktop
from ..errors import DesktopError, DesktopTimeoutError
from .tree_nodes import TreeNode, read_tree

TIMEOUT_S = 20.0
PAUSE = 0.1  # s between two looks, at first
MAX_PAUSE_S = 0.5  # s; looking costs the machine time that what is waited for needs
BUTTONS = ("push-button", "button")
ENTRIES = ("entry", "text")
MENU_ROLES = ("menu", "menu-item", "check-menu-item", "radio-menu-item")
Roles: TypeAlias = str | Iterable[str]
Name: TypeAlias = "str | re.Pattern[str] | None"
T = TypeVar("T")


class GiveUpError(DesktopError):
    """The oracle of an infeasible task found that the task cannot be done."""


class Hand:
    """Pointer and keyboard of one desktop.

    Args:
        desktop: Where to act.
        timeout: Seconds to wait for something before `DesktopTimeoutError`.
    """

    def __init__(self, desktop: Desktop, timeout: float = TIMEOUT_S) -> None:
        self._desktop = desktop
        self._timeout = timeout

    def look(self) -> list[TreeNode]:
        """Return the nodes of the accessibility tree as it is now."""
        return read_tree(self.tree())

    def tree(self) -> str:
        """Return the accessibility tree as it is now, as XML."""
        return self._desktop.accessibility()

    def wait(
        self,
        description: str,
        test: Callable[[TreeNode], bool],
        meanwhile: Callable[[], None] | None = None,
    ) -> TreeNode:
        """Look until a node passes a test.

        Args:
            description: The node in the message of an error.
            test: Whether a node is the one.
            meanwhile: Called between two looks, for example to scroll.

        Raises:
            DesktopTimeoutError: No such node came in time.
        """
        deadline = time.monotonic() + self._timeout
        before: TreeNode | None = None
        has_scrolled = False
        pause = PAUSE
        while True:
            nodes = self.look()
            match = next((node for node in nodes if test(node)), None)
            # After scrolling, a node may still be sliding.
            if match is not None and (not has_scrolled or match == before):
                return match
            if time.monotonic() > deadline:
                raise DesktopTimeoutError(_timeout_message(description, self._timeout, nodes))
            if match is None:
                has_scrolled |= self._while_missing(nodes, meanwhile)
            before = match
            time.sleep(pause)
            pause = PAUSE if has_scrolled else _next_pause(pause)

    def _while_missing(self, nodes: list[TreeNode], meanwhile: Callable[[], None] | None) -> bool:
        """Do what is done between two looks; return whether that may have moved the nodes."""
        if meanwhile is None:
            return False
        meanwhile()
        return True

    def find(
        self,
        roles: Roles,
        name: Name = None,
        app: str = "",
        state: str = "",
        *,
        scroll: bool = False,
    ) -> TreeNode:
        """Wait for a visible node.

        Args:
            roles: Its role or the roles it may have, such as `"push-button"`.
            name: Its whole name, a pattern that its name begins with, or `None` for any.
            app: A part of the application's name, in any case.
            state: A state it must have, such as `"focused"`.
            scroll: Turn the wheel down, where the pointer is, until it comes into sight.
        """
        meanwhile = self._scroll if scroll else None
        return self.wait(
            _describe_search(roles, name, app, state), fits(roles, name, app, state), meanwhile
        )

    def see(
        self, roles: Roles, name: Name = None, app: str = "", state: str = ""
    ) -> TreeNode | None:
        """Return a visible node that is there now, without waiting; the arguments are `find`'s."""
        test = fits(roles, name, app, state)
        return next((node for node in self.look() if test(node)), None)

    def wait_until_gone(
        self, roles: Roles, name: Name = None, app: str = "", state: str = ""
    ) -> None:
        """Wait until no such node shows; the arguments are `find`'s.

        Raises:
            DesktopTimeoutError: One still shows.
        """
        deadline = time.monotonic() + self._timeout
        pause = PAUSE
        while self.see(roles, name, app, state) is not None:
            if time.monotonic() > deadline:
                description = _describe_search(roles, name, app, state)
                raise DesktopTimeoutError(f"{description} still shows after {self._timeout:g} s")
            time.sleep(pause)
            pause = _next_pause(pause)

    def wait_until_stable(self, description: str, read: Callable[[], T | None]) -> T:
        """Read a part of the screen again and again, until it is there and stays as it is.

        Args:
            description: The part in the message of an error.
            read: Returns it; `None` as long as it is not there.

        Raises:
            DesktopTimeoutError: It did not come in time, or goes on changing.
        """
        deadline = time.monotonic() + self._timeout
        before: T | None = None
        while True:
            current = read()
            if current is not None and current == before:
                return current
            if time.monotonic() > deadline:
                raise DesktopTimeoutError(f"no {description} at rest within {self._timeout:g} s")
            before = current
            time.sleep(2 * PAUSE)

    def run(self, code: str) -> None:
        """Run pyautogui code: one action.

        Raises:
            DesktopError: The code failed.
        """
        result = self._desktop.run(code)
        if not result.ok:
            problem = (result.error or result.output).strip()[-300:]
            raise DesktopError(f"pyautogui code failed on the desktop: {code!r}: {problem}")

    # Pointer

    def click(self, node: TreeNode) -> None:
        """Click in the middle of a node."""
        x, y = node.centre
        self.run(f"pyautogui.click({x}, {y})")

    def activate(self, window: TreeNode) -> None:
        """Give the keyboard to a window, unless it has it."""
        if "active" not in window.states:
            self.run(title_click(window))

    def double_click(self, node: TreeNode) -> None:
        """Click twice in the middle of a node."""
        x, y = node.centre
        self.run(f"pyautogui.doubleClick({x}, {y})")

    def right_click(self, node: TreeNode) -> None:
        """Open the context menu in the middle of a node."""
        x, y = node.centre
        self.run(f"pyautogui.rightClick({x}, {y})")

    def add_click(self, node: TreeNode) -> None:
        """Click with Ctrl held, to add a node to what is selected."""
        x, y = node.centre
        steps = (
            "pyautogui.keyDown('ctrl')",
            f"pyautogui.click({x}, {y})",
            "pyautogui.keyUp('ctrl')",
        )
        self.run("; ".join(steps))

    def drag(self, start: TreeNode, end: TreeNode) -> None:
        """Drag one node to another."""
        x1, y1 = start.centre
        x2, y2 = end.centre
        moves = (f"pyautogui.moveTo({x1}, {y1})", f"pyautogui.dragTo({x2}, {y2}, duration=0.5)")
        self.run("; ".join(moves))

    def click_on(
        self, roles: Roles, name: Name = None, app: str = "", *, scroll: bool = False
    ) -> TreeNode:
        """Wait for a node and click on it; the arguments are `find`'s."""
        node = self.find(roles, name, app, scroll=scroll)
        self.click(node)
        return node

    def button(self, name: Name, app: str = "") -> None:
        """Wait for a button that can be pressed, and click on it."""
        self.click(self.find(BUTTONS, name, app, "sensitive"))

    def menu(self, *names: Name, app: str = "") -> None:
        """Open a menu of the menu bar and go down to an item: `menu("File", "Save As...")`."""
        for name in names:
            self.click(self.find(MENU_ROLES, name, app))

    def context_menu(self, node: TreeNode, *names: Name, app: str = "") -> None:
        """Open a node's context menu and go down to an item."""
        self.right_click(node)
        self.menu(*names, app=app)

    def _scroll(self) -> None:
        self.run("pyautogui.scroll(-2)")

    # Keyboard

    def type(self, text: str) -> None:
        """Type any text where the cursor is; a line feed is the Enter key."""
        self.run(f"pyautogui.write({text!r})")

    def press(self, *keys: str) -> None:
        """Press keys together, such as `press("ctrl", "s")`."""
        self.run(f"pyautogui.hotkey({', '.join(map(repr, keys))})")

    def replace(self, text: str) -> None:
        """Replace what the focused field holds by a text."""
        self.press("ctrl", "a")
        self.type(text)

    def fill(
        self, name: Name, text: str, app: str = "", roles: Roles = ENTRIES, *, scroll: bool = False
    ) -> None:
        """Click on a field and replace what it holds by a text."""
        self.click(self.find(roles, name, app, scroll=scroll))
        self.find(roles, name, app, "focused")
        self.replace(text)

    def choose_file(self, path: str, button: Name, app: str = "") -> None:
        """Give a file dialog of GTK, which is open, a path, and press its button.

        Args:
            path: From the root, or relative to the home folder.
            button: The name of the button, such as `"Save"`.
            app: A part of the application's name.
        """
        self.find("file-chooser", app=app)
        self.press("alt", "n")  # the dialog shows before its field has the focus
        self.replace(self.path(path))
        # Until the button can be pressed, its key opens the dialog's search.
        self.find(BUTTONS, button, app, "sensitive")
        self.press("enter")
        self.wait_until_gone("file-chooser", app=app)

    # What a person knows

    @cached_property
    def home(self) -> str:
        """The home folder of the desktop's user."""
        return home(self._desktop)

    def path(self, path: str) -> str:
        """Return the path from the root of one that is relative to the home folder."""
        return str(PurePosixPath(self.home, path))

    def give_up(self, reason: str) -> None:
        """End the oracle of an infeasible task: it answers `FAIL`.

        Raises:
            GiveUpError: Always.
        """
        raise GiveUpError(reason)


def title_click(window: TreeNode) -> str:
    """Return pyautogui code that clicks at the top of a window, where nothing is to be hit."""
    x1, y1, x2, _ = window.box or (0, 0, 0, 0)
    return f"pyautogui.click({(x1 + x2) // 2}, {y1 + 10})"


def fits(
    roles: Roles, name: Name = None, app: str = "", state: str = ""
) -> Callable[[TreeNode], bool]:
    """Return a test for visible nodes; the arguments are those of `Hand.find`."""
    allowed_roles = {roles} if isinstance(roles, str) else set(roles)

    def test(node: TreeNode) -> bool:
        if node.box is None or node.role not in allowed_roles:
            return False
        if isinstance(name, str) and node.name != name:
            return False
        if isinstance(name, re.Pattern) and not name.match(node.name):
            return False
        if app.lower() not in node.app.lower():
            return False
        return not state or state in node.states

    return test


def _next_pause(pause: float) -> float:
    """Return the pause after the next look in vain."""
    return min(1.5 * pause, MAX_PAUSE_S)


def _describe_search(roles: Roles, name: Name, app: str, state: str) -> str:
    """Return what `fits` looks for, for messages."""
    allowed_roles = [roles] if isinstance(roles, str) else sorted(set(roles))
    name_text = name.pattern if isinstance(name, re.Pattern) else name or ""
    description = f"{state} {' or '.join(allowed_roles)} {name_text}".strip()
    return f"{description} of {app or 'any application'}"


def _timeout_message(description: str, timeout: float, nodes: list[TreeNode]) -> str:
    """Return what was looked for in vain, and what was there instead."""
    elements = sorted({f"{node.role} {node.name!r}" for node in nodes if node.box and node.name})
    apps = ", ".join(sorted({node.app for node in nodes})) or "none"
    return (
        f"no {description} came up within {timeout:g} s; applications: {apps}; "
        f"{len(elements)} named elements show: {', '.join(elements[:30])}"
    )
