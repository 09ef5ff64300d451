"""Which nodes of a tree are really on the screen.

Applications do not know about stacking and minimised windows.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hijack_data.types import Box

from .reader import Application, AtspiNode
from .states import CLIPPING, MENUS, SHOWING, TOP_LEVEL, VISIBLE

SLACK = 4  # pixels by which a window's box on the bus may differ from that in X


class SurfaceLike(Protocol):
    """A top-level window on the screen (see `online_env.embedded.guest.windows.Surface`)."""

    @property
    def frame(self) -> Box:
        """Its place with its decoration."""
        ...

    @property
    def client(self) -> Box:
        """Its place without it."""
        ...

    @property
    def pid(self) -> int:
        """The process that opened it."""
        ...

    @property
    def popup(self) -> bool:
        """Whether it is a menu or the like."""
        ...

    @property
    def title(self) -> str:
        """Its title."""
        ...


@dataclass(frozen=True)
class _Nowhere:
    """The window of nodes that have none; it is never on top."""

    frame: Box = (0, 0, 0, 0)
    client: Box = (0, 0, 0, 0)
    pid: int = 0
    popup: bool = False
    title: str = ""


_NOWHERE = _Nowhere()


@dataclass(frozen=True, slots=True)
class _Visit:
    """A node to look at.

    Attributes:
        node: the node.
        surface: the window that it is in, if it was recognised.
        in_menu: whether it is in a menu.
        clip: the part of the screen that its parents leave to it.
    """

    node: AtspiNode
    surface: SurfaceLike | None
    in_menu: bool
    clip: Box


class VisibilityFilter:
    """Takes `showing` from the nodes that nobody sees and clips the boxes of the others.

    A node is seen if the topmost window at its middle is its own: the window whose box it or a
    parent of it has, or a popup if it is in a menu; if no window is recognised, any window of its
    process.

    Args:
        surfaces: the windows on the screen, topmost first.
        size: `(width, height)` of the screen in pixels.
    """

    def __init__(self, surfaces: list[SurfaceLike], size: tuple[int, int]) -> None:
        self._surfaces = surfaces
        self._screen: Box = (0, 0, *size)

    def apply(self, application: Application) -> None:
        """Go through the tree of an application; its nodes have their boxes."""
        owners = {application.pid, _parent_pid(application.pid)} - {0}
        app_surfaces = [surface for surface in self._surfaces if surface.pid in owners]
        is_told = _has_known_window(application, app_surfaces)
        stack = [_Visit(application.root, None, False, self._screen)]
        while stack:
            visit = stack.pop()
            node = visit.node
            surface = visit.surface
            part = visit.clip
            if node.box is not None:
                if node.role in TOP_LEVEL:
                    surface = _find_window(node, app_surfaces, surface, is_told)
                part = _common(corners(node), visit.clip)
                self._mark(node, part, surface, visit.in_menu, app_surfaces)
            below = self._clip_below(node, part, visit.clip)
            in_menu = visit.in_menu or node.role in MENUS
            stack += [_Visit(child, surface, in_menu, below) for child in node.children]

    def _mark(
        self,
        node: AtspiNode,
        part: Box,
        surface: SurfaceLike | None,
        in_menu: bool,
        app_surfaces: list[SurfaceLike],
    ) -> None:
        """Note which part of a node is seen."""
        if not self._is_seen(part, surface, in_menu, app_surfaces):
            node.states &= ~SHOWING
        elif part != corners(node):
            x1, y1, x2, y2 = part
            node.box = (x1, y1, x2 - x1, y2 - y1)

    def _clip_below(self, node: AtspiNode, part: Box, clip: Box) -> Box:
        """Return the part of the screen that a node leaves to its children."""
        if node.role in CLIPPING:
            return part
        if node.role in MENUS:
            return self._screen
        return clip

    def _is_seen(
        self, box: Box, surface: SurfaceLike | None, in_menu: bool, app_surfaces: list[SurfaceLike]
    ) -> bool:
        x1, y1, x2, y2 = box
        if x2 <= x1 or y2 <= y1:
            return False
        top = self._top((x1 + x2) // 2, (y1 + y2) // 2)
        if top is None or not any(top is item for item in app_surfaces):
            return False
        if in_menu:
            return top.popup
        return surface is None or top is surface

    def _top(self, x: int, y: int) -> SurfaceLike | None:
        for surface in self._surfaces:
            x1, y1, x2, y2 = surface.frame
            if x1 <= x < x2 and y1 <= y < y2:
                return surface
        return None


def candidates(application: Application) -> list[AtspiNode]:
    """Return the nodes that claim to be on the screen."""
    nodes: list[AtspiNode] = []
    stack = [application.root]
    while stack:
        node = stack.pop()
        if node.states & SHOWING and node.states & VISIBLE:
            nodes.append(node)
        stack += node.children
    return nodes


def _has_known_window(application: Application, app_surfaces: list[SurfaceLike]) -> bool:
    """Return whether one of an application's top nodes is a window on the screen."""
    for node in application.root.children:
        if node.box is not None and _matching(app_surfaces, corners(node), node.name):
            return True
    return False


def _find_window(
    node: AtspiNode, app_surfaces: list[SurfaceLike], above: SurfaceLike | None, is_told: bool
) -> SurfaceLike | None:
    """Return the window that a top-level node is."""
    window = _matching(app_surfaces, corners(node), node.name) or above
    if window is None and is_told and not node.name:
        # Chromium keeps windows for suggestions ready and does not show them
        return _NOWHERE
    return window


def corners(node: AtspiNode) -> Box:
    """Return the box of a node as xyxy; an empty one at the origin if it has none."""
    x, y, width, height = node.box or (0, 0, 0, 0)
    return x, y, x + width, y + height


def _matching(surfaces: list[SurfaceLike], box: Box, name: str) -> SurfaceLike | None:
    """Return the window with a node's box; if several lie on one another, the one with its name."""
    matches = [surface for surface in surfaces if _fits(surface, box)]
    for surface in matches:
        if surface.title == name:
            return surface
    return matches[0] if matches else None


def _fits(surface: SurfaceLike, box: Box) -> bool:
    return _is_close(surface.client, box) or _is_close(surface.frame, box)


def _is_close(box: Box, measured: Box) -> bool:
    return all(abs(a - b) <= SLACK for a, b in zip(box, measured, strict=True))


def _common(a: Box, b: Box) -> Box:
    x1 = max(a[0], b[0])
    y1 = max(a[1], b[1])
    x2 = min(a[2], b[2])
    y2 = min(a[3], b[3])
    return x1, y1, x2, y2


def _parent_pid(pid: int) -> int:
    """The process that started `pid`: a panel shows the windows of its plug-ins as its own."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
        fields = text.rpartition(")")[2].split()
        return int(fields[1])
    except (OSError, ValueError, IndexError):
        return 0
