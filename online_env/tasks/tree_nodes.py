"""The accessibility tree as tasks and recordings see it: nodes with their application."""

from dataclasses import dataclass

from hijack_data.elements.accessibility_nodes import AccessibleNode, nodes_from_tree
from hijack_data.errors import ElementsError
from hijack_data.types import Box, Point

from ..errors import DesktopError


@dataclass(frozen=True, kw_only=True)
class TreeNode:
    """One node of the tree.

    Args:
        app: The name of its application.
        role: Its tag, such as `push-button`.
        name: Its name, or "".
        text: The text before its first child, or "".
        states: The states that are true, such as `focused`.
        box: `xyxy` in pixels of the screen, or `None` if it does not show there.
    """

    app: str
    role: str
    name: str
    text: str
    states: frozenset[str]
    box: Box | None

    @property
    def centre(self) -> Point:
        """The middle of the box.

        Raises:
            DesktopError: The node does not show on the screen.
        """
        if self.box is None:
            raise DesktopError(
                f"{self.role} {self.name!r} of {self.app!r} does not show on the screen"
            )
        x1, y1, x2, y2 = self.box
        return (x1 + x2) // 2, (y1 + y2) // 2


def read_tree(xml: str) -> list[TreeNode]:
    """Return all nodes of the applications, in document order.

    Raises:
        DesktopError: The text is not XML, or has a DOCTYPE.
    """
    try:
        elements = nodes_from_tree(xml.encode("utf-8", "replace"))
    except ElementsError as error:
        message = f"the accessibility tree of the desktop cannot be read: {error}"
        raise DesktopError(message) from None
    return [_node(node) for node in elements if node.parent is not None]


def _node(node: AccessibleNode) -> TreeNode:
    return TreeNode(
        app=node.application,
        role=node.tag,
        name=node.attributes.get("name", ""),
        text=node.text,
        states=node.states,
        box=node.box if node.visible else None,
    )
