"""The nodes of an accessibility tree in OSWorld's XML dialect.

The tag of a node is its role. States, places and sizes are attributes such as
`st:showing="true"`, `cp:screencoord="(10, 20)"` and `cp:size="(30, 40)"`, in the namespaces
`https://accessibility.<platform>.example.org/ns/state` and `.../ns/component`, where the platform
is `ubuntu`, `windows` or `macos`. The conventions of each platform follow OSWorld's guest server.

A tree comes from a guest and is not trusted. Expat reads it in one pass, without a document in
memory: a DOCTYPE ends the reading before any entity is declared, nothing outside the text is ever
fetched, and bytes, depth, the digits of numbers and the number of nodes returned are limited.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

from ..errors import ElementsError
from ..types import Box, Point
from .interactive_roles import INTERACTIVE_ENDINGS, INTERACTIVE_ROLES

MAX_BYTES = 50 * 2**20
# OSWorld's servers stop at 50 levels.
MAX_DEPTH = 10_000
# The desktop's own guest server stops at about 10,000 nodes.
MAX_NODES = 250_000

_PAIR = re.compile(r"\(\s*(-?[0-9]{1,10})\s*,\s*(-?[0-9]{1,10})\s*\)", re.ASCII)
_TOO_LARGE = "the accessibility tree is {} bytes long; at most {} are read"


class TreePlatform:
    """The attributes that one platform writes, as `namespace}name`, the way Expat reports them."""

    def __init__(
        self,
        name: str,
        *,
        visible_states: tuple[str, ...],
        enabled: str,
        labels: tuple[str, ...] = ("name",),
        role: str = "",
        passive: str = "",
    ) -> None:
        space = f"https://accessibility.{name}.example.org/ns/"
        self.state = f"{space}state}}"
        self.position = f"{space}component}}screencoord"
        self.size = f"{space}component}}size"
        self.visible_states = tuple(self.state + state for state in visible_states)
        self.enabled = self.state + enabled
        self.labels = tuple(space + label if "}" in label else label for label in labels)
        self.role = space + role if role else ""
        self.passive = passive


_UBUNTU = TreePlatform("ubuntu", visible_states=("showing", "visible"), enabled="enabled")
_WINDOWS = TreePlatform(
    "windows", visible_states=("visible",), enabled="enabled", role="class}friendly_class_name"
)
# macOS describes static text as "text"; on the other platforms that role is an editable text.
_MACOS = TreePlatform(
    "macos",
    visible_states=(),
    enabled="AXEnabled",
    labels=("name", "attributes}AXTitle", "attributes}AXDescription"),
    passive="text",
)


@dataclass(slots=True, eq=False, kw_only=True)
class AccessibleNode:
    """One node of an accessibility tree.

    Attributes:
        index: the position of the node in document order; the root has 0.
        parent: the node above, `None` for the root.
        depth: the number of nodes from the root to this one, both included; the root has 1.
        application: the name of the ancestor (or of the node itself) directly below the root,
            which stands for an application; `""` for the root.
        application_index: the `index` of that ancestor, which tells applications of the same name
            apart; `-1` for the root.
        tag: the tag as written; a tag in a namespace is `namespace}name`.
        attributes: every attribute; the key of an attribute in a namespace is `namespace}name`.
        text: the text before the first child; always `""` in nodes that `boxes_from_tree` reads.
        line: the line of the start tag, from 1.
        column: its column, from 1.
    """

    index: int
    parent: "AccessibleNode | None" = field(repr=False)
    depth: int
    application: str
    application_index: int
    tag: str
    attributes: dict[str, str]
    line: int
    column: int
    text: str = ""

    @property
    def role(self) -> str:
        """The role in lower case with `-` between words, such as `push-button`."""
        return role_names(self, detect_platform(self))[0]

    @property
    def name(self) -> str:
        """The name given by the application, as written; `""` without one."""
        for label in detect_platform(self).labels:
            if name := self.attributes.get(label):
                return name
        return ""

    @property
    def states(self) -> frozenset[str]:
        """The states that are true, such as `{"showing", "visible", "focused"}`."""
        prefix = detect_platform(self).state
        return frozenset(
            key.removeprefix(prefix)
            for key, value in self.attributes.items()
            if key.startswith(prefix) and value.lower() == "true"
        )

    @property
    def visible(self) -> bool:
        """Whether the node has all states that its platform gives to a node on the screen.

        These are `showing` and `visible` on Ubuntu, `visible` on Windows and none on macOS. An
        element behind another window may have them, too.
        """
        return is_shown(detect_platform(self), self.attributes)

    @property
    def enabled(self) -> bool:
        """Whether the node is not marked as disabled."""
        return self.attributes.get(detect_platform(self).enabled, "").lower() != "false"

    @property
    def interactive(self) -> bool:
        """Whether the role is one that a user can click, type into or drag."""
        platform = detect_platform(self)
        return is_interactive(platform, role_names(self, platform))

    @property
    def box(self) -> Box | None:
        """The box `xyxy` in pixels of the screen, whether the node is shown or not.

        It is not clipped to the screen. `None` if the node has no position or no size, if they are
        not two 32-bit integers each, or if the area is empty.
        """
        platform = detect_platform(self)
        position = parse_pair(self.attributes.get(platform.position, ""))
        size = parse_pair(self.attributes.get(platform.size, ""))
        if position is None or size is None or min(size) < 1:
            return None
        return box_from_position(position, size)

    @property
    def path(self) -> str:
        """The tags from the root to the node, joined by `/`; at most the last six."""
        tags: list[str] = []
        node: AccessibleNode | None = self
        while node is not None and len(tags) < 6:
            tags.append(node.tag)
            node = node.parent
        return "/".join(reversed(tags))


def nodes_from_tree(xml: str | bytes) -> list[AccessibleNode]:
    """Read all nodes of an accessibility tree, in document order.

    The first is the root; its children stand for applications. A malformed place does not raise
    here: such a node has no `box`.

    Args:
        xml: the tree, text or bytes (UTF-8, or UTF-16 with its mark), at most `MAX_BYTES`.

    Raises:
        ElementsError: the text is not XML, has a DOCTYPE, is too large or too deep, or has more
            than `MAX_NODES` nodes; the message names line and node.
    """
    nodes: list[AccessibleNode] = []

    def keep(node: AccessibleNode) -> None:
        if len(nodes) == MAX_NODES:
            refuse(node, f"has more than {MAX_NODES} nodes")
        nodes.append(node)

    read_nodes(xml, keep, with_text=True)
    return nodes


def read_nodes(
    xml: str | bytes, visit: Callable[[AccessibleNode], None], *, with_text: bool
) -> None:
    """Call `visit` with each node of a tree at its start tag; without `with_text`, texts stay "".

    Raises:
        ElementsError: see `nodes_from_tree`; the number of nodes is not limited.
    """
    parser = expat.ParserCreate("utf-8", "}")
    handlers = _Handlers(parser, visit)
    parser.StartElementHandler = handlers.start
    parser.EndElementHandler = handlers.end
    parser.StartDoctypeDeclHandler = handlers.refuse_doctype
    if with_text:
        parser.buffer_text = True
        parser.CharacterDataHandler = handlers.characters
    try:
        parser.Parse(_utf8(xml), True)
    except expat.ExpatError as error:
        raise ElementsError(
            f"the accessibility tree is not well-formed XML: line {error.lineno}, column"
            f" {error.offset + 1}: {expat.ErrorString(error.code)}; give the whole text of the"
            " tree, in UTF-8"
        ) from None


def _utf8(xml: str | bytes) -> bytes:
    # Returns the text in UTF-8, regardless of the encoding in the XML declaration.
    if not isinstance(xml, str | bytes):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ElementsError(
            f"the accessibility tree must be text or bytes, got {type(xml).__name__}"
        )
    if len(xml) > MAX_BYTES:
        raise ElementsError(_TOO_LARGE.format(len(xml), MAX_BYTES))
    if isinstance(xml, bytes) and not xml.startswith((b"\xff\xfe", b"\xfe\xff")):
        return xml
    try:
        text = xml if isinstance(xml, str) else xml.decode("utf-16")
        data = text.encode("utf-8")
    except UnicodeError as error:
        raise ElementsError(f"the accessibility tree is not valid text: {error}") from None
    if len(data) > MAX_BYTES:
        raise ElementsError(_TOO_LARGE.format(len(data), MAX_BYTES))
    return data


class _Handlers:
    """The callbacks of Expat, with the open node and the number of nodes so far."""

    def __init__(
        self, parser: expat.XMLParserType, visit: Callable[[AccessibleNode], None]
    ) -> None:
        self._parser = parser
        self._visit = visit
        self._open: AccessibleNode | None = None
        self._count = 0
        self._takes_text = False

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        parent = self._open
        depth = 1 if parent is None else parent.depth + 1
        application = ""
        application_index = -1
        if depth == 2:
            application = attributes.get("name", "")
            application_index = self._count
        elif parent is not None:
            application = parent.application
            application_index = parent.application_index
        node = AccessibleNode(
            index=self._count,
            parent=parent,
            depth=depth,
            application=application,
            application_index=application_index,
            tag=tag,
            attributes=attributes,
            line=self._parser.CurrentLineNumber,
            column=self._parser.CurrentColumnNumber + 1,
        )
        if depth > MAX_DEPTH:
            refuse(node, f"is more than {MAX_DEPTH} levels deep")
        self._visit(node)
        self._open = node
        self._count += 1
        self._takes_text = True

    def end(self, _: str) -> None:
        if self._open is not None:
            self._open = self._open.parent
        self._takes_text = False

    def characters(self, data: str) -> None:
        if self._takes_text and self._open is not None:
            self._open.text += data

    def refuse_doctype(self, *_: object) -> None:
        line = self._parser.CurrentLineNumber
        column = self._parser.CurrentColumnNumber + 1
        raise ElementsError(
            "the accessibility tree has a DOCTYPE, which is refused; remove it"
            f" (line {line}, column {column})"
        )


def refuse(node: AccessibleNode, problem: str) -> NoReturn:
    """Refuse a tree because of a problem with one of its nodes.

    Raises:
        ElementsError: always; the message names the line, the column and the path of the node.
    """
    raise ElementsError(
        f"the accessibility tree {problem}"
        f" (line {node.line}, column {node.column}, at {node.path[-200:]})"
    )


def detect_platform(node: AccessibleNode) -> TreePlatform:
    """Return the platform whose attribute for places a node has; Ubuntu if it has none."""
    if _UBUNTU.position in node.attributes:
        return _UBUNTU
    if _WINDOWS.position in node.attributes:
        return _WINDOWS
    if _MACOS.position in node.attributes:
        return _MACOS
    return _UBUNTU


def role_names(node: AccessibleNode, platform: TreePlatform) -> list[str]:
    """Return the names of a node's role: its description, if there is one, then the tag."""
    tag = _role(node.tag)
    friendly = node.attributes.get(platform.role)
    return [_role(friendly), tag] if friendly else [tag]


def _role(name: str) -> str:
    return name.rpartition("}")[2].lower().replace("_", "-").replace(" ", "-")


def is_interactive(platform: TreePlatform, roles: list[str]) -> bool:
    """Return whether one of the roles is one that a user can click, type into or drag."""
    for role in roles:
        is_known = role in INTERACTIVE_ROLES or role.endswith(INTERACTIVE_ENDINGS)
        if is_known and role != platform.passive:
            return True
    return False


def is_shown(platform: TreePlatform, attributes: dict[str, str]) -> bool:
    """Return whether a node has all states that the platform gives to a node on the screen."""
    return all(attributes.get(state, "").lower() == "true" for state in platform.visible_states)


def box_from_position(position: Point, size: Point) -> Box:
    """Return the box `xyxy` of a corner and a (width, height), in pixels."""
    x, y = position
    width, height = size
    return (x, y, x + width, y + height)


def parse_pair(text: str) -> Point | None:
    """Return the two 32-bit integers of `(10, 20)`, or `None`."""
    match = _PAIR.fullmatch(text)
    if not match:
        return None
    first = int(match[1])
    second = int(match[2])
    if min(first, second) < -(2**31) or max(first, second) >= 2**31:
        return None
    return first, second
