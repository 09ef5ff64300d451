"""Tell the windows of a task's applications from other windows of the desktop."""

import shlex
from collections.abc import Iterable
from pathlib import PurePath

from .task_apps import APPS
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
        apps: The applications of the task, as `task_apps.APPS` names them.
        start: What to type to start the first of them again, with its documents; "" if unknown.
    """

    def __init__(self, apps: Iterable[str], start: str) -> None:
        task_apps = [APPS[name] for name in apps if name in APPS]
        self._names = [name for app in task_apps for name in (app.tree, app.helper) if name]
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

    def windows(self, nodes: list[TreeNode]) -> list[TreeNode]:
        """Return the windows and dialogs of the task, visible or not."""
        return [node for node in nodes if self.has_window(node)]

    def visible(self, nodes: list[TreeNode]) -> list[TreeNode]:
        """Return those that are visible."""
        return [node for node in self.windows(nodes) if node.box]

    def frames(self, nodes: list[TreeNode]) -> list[TreeNode]:
        """Return those that are not dialogs."""
        return [node for node in self.windows(nodes) if node.role == "frame"]

    def dialogs(self, nodes: list[TreeNode]) -> list[TreeNode]:
        """Return the visible dialogs beside a frame of the task; some tasks have a dialog alone.

        A frame under a modal dialog may not say that it shows. An alert may be a part of a web
        page; one that is modal is a window.
        """
        if not self.frames(nodes):
            return []
        candidates = [node for node in self.visible(nodes) if node.role in DIALOGS]
        return [node for node in candidates if node.role != "alert" or "modal" in node.states]

    def names_document(self, window: TreeNode) -> bool:
        """Return whether the title of a window names a document that the task opened."""
        return any(name in window.name for name in self._documents)


def panel_button(window: TreeNode, nodes: list[TreeNode]) -> TreeNode | None:
    """Return the button of the panel with the name of a window."""
    buttons = (node for node in nodes if node.app == PANEL and node.box)
    return next((node for node in buttons if node.name == window.name), None)


def is_minimised(window: TreeNode, nodes: list[TreeNode]) -> bool:
    """Return whether a window of that application and name is minimised."""
    return any(
        node.app == window.app and node.name == window.name and "iconified" in node.states
        for node in nodes
    )


def program_name(title: str) -> str:
    """Return the program in the title of a window, which most write after the document."""
    return title.rpartition(" - ")[2]
