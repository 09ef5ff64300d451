"""The interactive elements on the screen, from the accessibility tree, with their applications."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

from hijack_data.elements.accessibility_nodes import AccessibleNode, nodes_from_tree
from hijack_data.elements.interactive_nodes import interactive_elements
from hijack_data.errors import ElementsError, HijackError
from hijack_data.rng import Stream
from hijack_data.types import Box, Point, Size, as_boxes

from ..errors import DesktopError
from .base import EffectError

MAX_CLICKS = 5  # of an accidental touch

# Panels, docks and the icons on the desktop, where elements launch or bring up other applications.
LAUNCHERS = frozenset(
    {
        "xfce4-panel",
        "wrapper-1.0",
        "wrapper-2.0",
        "xfdesktop",
        "mate-panel",
        "lxpanel",
        "gnome-shell",
        "plasmashell",
        "cinnamon",
        "nemo-desktop",
        "caja-desktop",
        "tint2",
        "plank",
        "ding",
        "gjs",
        "desktop-icons",
    }
)
_ACTIONS = "/ns/action}"
_ENABLED = "/ns/state}enabled"
_PLACE = "/ns/component}screencoord"
_ORIGIN = "(0, 0)"
_TOP_LEVEL_DEPTH = 3  # root, application, window
_ORIGIN_PIXELS = 8  # pixels within which a window is at the corner of the screen
_MAX_OFFSET_PIXELS = 8  # by which an element may be away from the plan's box


@dataclass(frozen=True)
class Element:
    """One element: its application, role, name, and box `xyxy` in pixels of the screen."""

    app: str
    role: str
    name: str
    box: Box

    @property
    def centre(self) -> Point:
        """The middle of the box."""
        return (self.box[0] + self.box[2]) // 2, (self.box[1] + self.box[3]) // 2

    def to_data(self) -> dict[str, Any]:
        """The element as JSON."""
        return {**asdict(self), "box": list(self.box)}


def live_elements(xml: str, size: Size, windows: Sequence[Mapping[str, Any]] = ()) -> list[Element]:
    """Return the interactive elements of a tree, in its order; `size` is (H, W).

    If an application reports which of its elements are enabled or have actions, all others are left
    out. So are the elements of the windows whose places are not those of the screen: GTK 4 counts
    from the corner of the window.

    Args:
        xml: the tree.
        size: of the screen.
        windows: the windows of the X server, from the output of `xtool state`.

    Raises:
        DesktopError: the text is not an accessibility tree.
    """
    elements: list[Element] = []
    try:
        nodes = nodes_from_tree(xml.encode("utf-8", "replace"))[1:]
        elsewhere = {node.index for node in nodes if _is_placed_elsewhere(node, windows)}
        nodes = [node for node in nodes if _top_level(node).index not in elsewhere]
        for _, group in groupby(nodes, key=lambda node: node.application_index):
            elements += _read_elements(list(group), size)
    except ElementsError as error:
        raise DesktopError(
            f"the accessibility tree of the desktop cannot be read: {error}"
        ) from None
    return elements


def _is_placed_elsewhere(node: AccessibleNode, windows: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether a node is a window that claims the corner of the screen and is not there."""
    if node.depth != _TOP_LEVEL_DEPTH:
        return False
    if not any(key.endswith(_PLACE) and at == _ORIGIN for key, at in node.attributes.items()):
        return False
    corners = [
        box[:2] for w in windows if w["title"] == node.name for box in (w["frame"], w["box"])
    ]
    return bool(corners) and not any(max(map(abs, at)) <= _ORIGIN_PIXELS for at in corners)


def _top_level(node: AccessibleNode) -> AccessibleNode:
    while node.depth > _TOP_LEVEL_DEPTH and node.parent is not None:
        node = node.parent
    return node


def _read_elements(nodes: list[AccessibleNode], size: Size) -> list[Element]:
    """Return the interactive elements of one application."""
    able = nodes
    # Guests write states and actions only for nodes that have them. If no node of an application
    # has one, the application does not report them at all.
    for mark in (_ACTIONS, _ENABLED):
        marked = {node.index for node in nodes if any(mark in key for key in node.attributes)}
        if marked:
            able = [node for node in able if node.index in marked]
    elements = interactive_elements(able, size)
    app = nodes[0].application
    rows = zip(elements.roles, elements.names, elements.boxes.tolist(), strict=True)
    return [Element(app, role, name, tuple(box)) for role, name, box in rows]


def window_at(point: Point, state: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the topmost mapped window at a point, from the output of `xtool state`."""
    x, y = point
    for window in reversed(state["windows"]):
        x1, y1, x2, y2 = window["frame"]
        if window["mapped"] and x1 <= x < x2 and y1 <= y < y2:
            return window
    return None


def read_touch_boxes(params: Mapping[str, Any]) -> list[Box]:
    """Return the boxes in the parameters of an accidental touch.

    Raises:
        EffectError: They are no boxes.
    """
    try:
        rows = as_boxes(params.get("boxes", ())).tolist()
    except HijackError as error:
        raise EffectError(f"touch: {error}") from None
    return [(x1, y1, x2, y2) for x1, y1, x2, y2 in rows]


def draw_element(
    candidates: Sequence[Element], boxes: Sequence[Box], stream: Stream
) -> Element | None:
    """Return the element at the first of the plan's boxes that has one, otherwise a random one."""
    if not candidates:
        return None
    for box in boxes:
        distances = [_distance(element.box, box) for element in candidates]
        nearest = min(distances)
        if nearest <= _MAX_OFFSET_PIXELS:
            return candidates[distances.index(nearest)]
    return stream.choice(candidates)


def _distance(first: Box, second: Box) -> int:
    return max(abs(a - b) for a, b in zip(first, second, strict=True))
