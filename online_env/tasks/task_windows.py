"""Which windows of an accessibility tree belong to a task, and which only to the desktop."""

import shlex
from collections.abc import Iterable
from pathlib import PurePath

from .kit.apps import APPS
from .tree_nodes import TreeNode

PANEL = "xfce4-panel"
LOCKER = "mate-screensaver"
DIALOGS = ("dialog", "file-chooser", "alert")
_WINDOWS = ("frame", *DIALOGS)
_FINDER = "xfce4-appfinder"  # what Alt+F2 opens: the hand may have done so
_SYSTEM = (PANEL, LOCKER, _FINDER, "xfdesktop", "xfsettingsd", "xfwm4", "wrapper", "xfce4-notifyd")


class TaskWindows:
    """Tells the windows of a task's applications from those of others.

    Args:
        apps: The applications of the task, as `kit.apps.APPS` names them.
        start: What to type to start the first of them again, with its documents; "" if unknown.
    """

    def __init__(self, apps: Iterable[str], start: str) -> None:
        known = [APPS[name] for name in apps if name in APPS]
        self._names = [name for app in known for name in (app.tree, app.helper) if name]
        self._documents = {PurePath(word).name for word in shlex.split(start)[1:] if "/" in word}

    def has(self, node: TreeNode) -> bool:
        """Return whether a node belongs to one of the applications."""
        return any(name in node.app.lower() for name in self._names)

    def has_window(self, node: TreeNode) -> bool:
        """Return whether a node is a window or a dialog of one of the applications."""
        return node.role in _WINDOWS and self.has(node)

    def is_foreign(self, node: TreeNode) -> bool:
        """Return whether a node is a window that shows and belongs to another application.

        The parts of the desktop itself are not foreign.
        """
        if node.role not in _WINDOWS or node.box is None or self.has(node):
            return False
        return bool(self._names) and not node.app.lower().startswith(_SYSTEM)

    def windows(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return the own windows and dialogs, whether they show or not."""
        return [node for node in seen if self.has_window(node)]

    def shown(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return those that show."""
        return [node for node in self.windows(seen) if node.box]

    def frames(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return those that are no dialogs."""
        return [node for node in self.windows(seen) if node.role == "frame"]

    def dialogs(self, seen: list[TreeNode]) -> list[TreeNode]:
        """Return the own dialogs that show beside an own frame; some tasks have a dialog alone.

        A frame under a modal dialog may not say that it shows. An alert may be a part of a web
        page; one that is modal is a window.
        """
        if not self.frames(seen):
            return []
        found = [node for node in self.shown(seen) if node.role in DIALOGS]
        return [node for node in found if node.role != "alert" or "modal" in node.states]

    def names_document(self, window: TreeNode) -> bool:
        """Return whether the title of a window names a document that the task opened."""
        return any(name in window.name for name in self._documents)


def panel_button(window: TreeNode, seen: list[TreeNode]) -> TreeNode | None:
    """Return the button of the panel with the name of a window."""
    buttons = (node for node in seen if node.app == PANEL and node.box)
    return next((node for node in buttons if node.name == window.name), None)


def is_minimised(window: TreeNode, seen: list[TreeNode]) -> bool:
    """Return whether a window of that application and name is minimised."""
    return any(
        node.app == window.app and node.name == window.name and "iconified" in node.states
        for node in seen
    )


def program_name(title: str) -> str:
    """Return what a title ends with: most windows name a document, then their program."""
    return title.rpartition(" - ")[2]
