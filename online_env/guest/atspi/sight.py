"""What of a tree is really on the screen: stacking and minimised windows, which applications do not tell."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hijack_data.types import Box

from .reader import Application, Node
from .states import CLIPPING, MENUS, SHOWING, TOP_LEVEL, VISIBLE

SLACK = 4  # pixels by which a window's box on the bus may differ from that in X


class Surface(Protocol):
    """A top-level window on the screen (see `online_env.guest.windows.Surface`)."""

    @property
    def frame(self) -> Box: ...
    @property
    def client(self) -> Box: ...
    @property
    def pid(self) -> int: ...
    @property
    def popup(self) -> bool: ...
    @property
    def title(self) -> str: ...


@dataclass(frozen=True)
class _Nowhere:
    """The window of what has none; it is never on top."""

    frame: Box = (0, 0, 0, 0)
    client: Box = (0, 0, 0, 0)
    pid: int = 0
    popup: bool = False
    title: str = ""


_NOWHERE = _Nowhere()


class Sight:
    """Takes `showing` from the nodes that nobody sees and clips the boxes of the others.

    A node is seen if the topmost window at its middle is its own: the window whose box it or a parent of it has, or a
    popup for what is in a menu; where a window is not recognised, any window of its process.
    """

    def __init__(self, surfaces: list[Surface], size: tuple[int, int]) -> None:
        self._surfaces = surfaces
        self._screen: Box = (0, 0, *size)

    def apply(self, application: Application) -> None:
        """Go through the tree of an application; its nodes have their boxes."""
        owners = {application.pid, _parent_of(application.pid)} - {0}
        mine = [surface for surface in self._surfaces if surface.pid in owners]
        told = any(_matching(mine, _box(node), node.name) for node in application.root.children if node.box is not None)
        stack: list[tuple[Node, Surface | None, bool, Box]] = [(application.root, None, False, self._screen)]
        while stack:
            node, surface, in_menu, clip = stack.pop()
            part = clip
            if node.box is not None:
                box = _box(node)
                if node.role in TOP_LEVEL:
                    surface = _matching(mine, box, node.name) or surface
                    if surface is None and told and not node.name:
                        surface = _NOWHERE  # Chromium keeps windows for suggestions ready and does not show them
                part = _common(box, clip)
                if not self._seen(part, surface, in_menu, mine):
                    node.states &= ~SHOWING
                elif part != box:
                    node.box = (part[0], part[1], part[2] - part[0], part[3] - part[1])
            below = part if node.role in CLIPPING else self._screen if node.role in MENUS else clip
            in_menu = in_menu or node.role in MENUS
            stack += [(child, surface, in_menu, below) for child in node.children]

    def _seen(self, box: Box, surface: Surface | None, in_menu: bool, mine: list[Surface]) -> bool:
        if box[2] <= box[0] or box[3] <= box[1]:
            return False
        top = self._top((box[0] + box[2]) // 2, (box[1] + box[3]) // 2)
        if top is None or not any(top is one for one in mine):
            return False
        if in_menu:
            return top.popup
        return surface is None or top is surface

    def _top(self, x: int, y: int) -> Surface | None:
        for surface in self._surfaces:
            x1, y1, x2, y2 = surface.frame
            if x1 <= x < x2 and y1 <= y < y2:
                return surface
        return None


def _box(node: Node) -> Box:
    x, y, width, height = node.box or (0, 0, 0, 0)
    return x, y, x + width, y + height


def candidates(application: Application) -> list[Node]:
    """The nodes that say of themselves that they are on the screen."""
    found: list[Node] = []
    stack = [application.root]
    while stack:
        node = stack.pop()
        if node.states & SHOWING and node.states & VISIBLE:
            found.append(node)
        stack += node.children
    return found


def _matching(surfaces: list[Surface], box: Box, name: str) -> Surface | None:
    """The window with a node's box; where several lie on one another, that with its name."""
    found = [surface for surface in surfaces if _is_close(surface.client, box) or _is_close(surface.frame, box)]
    named = [surface for surface in found if surface.title == name]
    return next(iter(named or found), None)


def _is_close(one: Box, other: Box) -> bool:
    return all(abs(a - b) <= SLACK for a, b in zip(one, other, strict=True))


def _common(one: Box, other: Box) -> Box:
    return max(one[0], other[0]), max(one[1], other[1]), min(one[2], other[2]), min(one[3], other[3])


def _parent_of(pid: int) -> int:
    """The process that started `pid`: a panel shows the windows of its plug-ins as its own."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return int(fields[1])
    except (OSError, ValueError, IndexError):
        return 0
