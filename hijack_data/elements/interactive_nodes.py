"""Interactive elements and their boxes from an accessibility tree in OSWorld's XML dialect.

* `nodes_from_tree` (in `accessibility_nodes`) returns every node, for callers that look for a label
  or a certain window.
* `boxes_from_tree` returns the boxes of all interactive elements, for planning.
* `interactive_elements` does the same for nodes that the caller has already filtered.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..types import Box, Point, Size, as_size
from .accessibility_nodes import (
    AccessibleNode,
    TreePlatform,
    box_from_position,
    detect_platform,
    is_interactive,
    is_shown,
    parse_pair,
    read_nodes,
    refuse,
    role_names,
)
from .base import Elements

# AT-SPI places an element without a position at -2**31.
MAX_COORDINATE = 2**30


def boxes_from_tree(xml: str | bytes, size: Size | None = None) -> Elements:
    """Read the interactive elements of an accessibility tree.

    Args:
        xml: the tree, text or bytes (UTF-8, or UTF-16 with its mark), at most `MAX_BYTES`.
        size: `(height, width)` of the screen in pixels; boxes are clipped to it. Without it they
            stay as they are.

    Returns:
        The same as `interactive_elements` for all nodes of the tree.

    Raises:
        ElementsError: the text is not XML, has a DOCTYPE, is too large or too deep, or has a place
            or size that is not two 32-bit integers; the message names line and node.
    """
    collector = _Collector(size)
    read_nodes(xml, collector.add, with_text=False)
    return collector.elements()


def interactive_elements(nodes: Iterable[AccessibleNode], size: Size | None = None) -> Elements:
    """Choose the nodes that a user can act on.

    A node is kept if its role is in `INTERACTIVE_ROLES` (or ends like `INTERACTIVE_ENDINGS`), it is
    marked as shown (Ubuntu: `showing` and `visible`; Windows: `visible`), it is not marked as
    disabled, and it has a place and a size. An element behind another window may still be marked as
    shown; only the guest can detect that.

    Args:
        nodes: nodes of one tree or several, for example of one application.
        size: `(height, width)` of the screen in pixels; boxes are clipped to it. Without it they
            stay as they are.

    Returns:
        One box for each node kept, in the order of `nodes`, with its name and role. The notes
        count the nodes left out, by reason.

    Raises:
        ElementsError: a place or size is not two 32-bit integers; the message names line and node.
    """
    collector = _Collector(size)
    for node in nodes:
        collector.add(node)
    return collector.elements()


@dataclass
class _Collector:
    """The interactive elements found so far, and the reasons why others were left out."""

    size: Size | None
    boxes: list[Box] = field(default_factory=list[Box])
    names: list[str] = field(default_factory=list[str])
    roles: list[str] = field(default_factory=list[str])
    left_out: Counter[str] = field(default_factory=Counter[str])
    clipped: int = 0

    def __post_init__(self) -> None:
        if self.size is not None:
            self.size = as_size(self.size)

    def add(self, node: AccessibleNode) -> None:
        platform = detect_platform(node)
        roles = role_names(node, platform)
        if not is_interactive(platform, roles):
            return
        box_or_reason = self._locate(node, platform)
        if isinstance(box_or_reason, str):
            self.left_out[box_or_reason] += 1
            return
        self.boxes.append(box_or_reason)
        self.names.append(node.name.strip())
        self.roles.append(roles[0])

    def _locate(self, node: AccessibleNode, platform: TreePlatform) -> Box | str:
        """Return the box of a node, clipped to the screen, or the reason why it has none."""
        attributes = node.attributes
        if not is_shown(platform, attributes):
            return "hidden"
        if not node.enabled:
            return "disabled"
        if platform.position not in attributes or platform.size not in attributes:
            return "without a place or a size"
        position = _read_pair(node, platform.position)
        size = _read_pair(node, platform.size)
        if min(size) < 1:
            return "without an area"
        box = box_from_position(position, size)
        if self._is_off_screen(box):
            return "off the screen"
        return self._clip(box)

    def _is_off_screen(self, box: Box) -> bool:
        bottom, right = self.size or (MAX_COORDINATE, MAX_COORDINATE)
        x1, y1, x2, y2 = box
        if x2 <= 0 or y2 <= 0 or x1 >= right or y1 >= bottom:
            return True
        return min(box) < -MAX_COORDINATE or max(box) > MAX_COORDINATE

    def _clip(self, box: Box) -> Box:
        if self.size is None:
            return box
        height, width = self.size
        x1, y1, x2, y2 = box
        inside = (max(x1, 0), max(y1, 0), min(x2, width), min(y2, height))
        if inside != box:
            self.clipped += 1
        return inside

    def elements(self) -> Elements:
        boxes = np.array(self.boxes, np.int32).reshape(-1, 4)
        notes = tuple(self._notes())
        return Elements(boxes, tuple(self.names), tuple(self.roles), "tree", notes)

    def _notes(self) -> list[str]:
        left_out = self.left_out.total()
        total = len(self.boxes) + left_out
        if not total:
            return ["the accessibility tree has no interactive node"]
        notes: list[str] = []
        if left_out:
            reasons = [f"{count} {reason}" for reason, count in sorted(self.left_out.items())]
            notes.append(f"left out {left_out} of {total} interactive nodes: {', '.join(reasons)}")
        if self.clipped:
            notes.append(f"clipped {self.clipped} boxes that reach over the edge of the screen")
        return notes


def _read_pair(node: AccessibleNode, key: str) -> Point:
    value = node.attributes[key]
    pair = parse_pair(value)
    if pair is None:
        refuse(
            node,
            f"has {key.rpartition('}')[2]}={value[:40]!r}: it must be two 32-bit integers, such"
            " as '(10, 20)'",
        )
    return pair
