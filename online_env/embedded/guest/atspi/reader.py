"""Collects the nodes of all applications of a session."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from jeepney import DBusAddress, MessageType, new_method_call
from jeepney.io.blocking import open_dbus_connection

from ....errors import DesktopError
from . import methods as m
from .bus_client import BusClient, Reference
from .states import (
    DOCUMENT_WEB,
    EXTENDED,
    INVALID,
    INVALID_NAME,
    MANAGES_DESCENDANTS,
    SHOWING,
    TABLE,
)

# s of silence of one application: on a busy machine LibreOffice needs more than one for its cache
APP_TIMEOUT_S = 2.0
TREE_BUDGET_S = 8.0  # s for the whole tree
MAX_NODES = 10_000
MAX_CHILDREN = 1024  # of one node, as OSWorld's server
MAX_DEPTH = 50
_ASKED_FOR_ROLE = 3  # so many nodes of a role are asked for its name
SPAN = 64  # rows and columns of a huge table that are looked at


@dataclass(slots=True)
class AtspiNode:
    """One accessible object.

    Attributes:
        reference: where it is.
        place: its index among its siblings.
        box: `x, y, width, height` on the screen.
        note: a remark for the reader of the tree.
    """

    reference: Reference
    name: str = ""
    role: int = 0
    states: int = 0
    count: int = -1
    interfaces: frozenset[str] = frozenset()
    place: int = 0
    role_name: str = "unknown"
    children: list["AtspiNode"] = field(default_factory=list["AtspiNode"])
    box: tuple[int, int, int, int] | None = None
    text: str = ""
    attributes: dict[str, str] = field(default_factory=dict[str, str])
    actions: list[tuple[str, str, str]] = field(default_factory=list[tuple[str, str, str]])
    values: dict[str, Any] = field(default_factory=dict[str, Any])
    note: str = ""
    parent: "AtspiNode | None" = None

    def adopt(self, child: "AtspiNode") -> None:
        """Make `child` the last child, unless it is a node above (an application may say so)."""
        above: AtspiNode | None = self
        while above is not None:
            if above is child:
                return
            above = above.parent
        if child.parent is not None:
            child.parent.children = [
                sibling for sibling in child.parent.children if sibling is not child
            ]
        child.parent = self
        self.children.append(child)


@dataclass(slots=True)
class Application:
    """An application: its root node and its process (0 if it is not known)."""

    root: AtspiNode
    pid: int


def walk(node: AtspiNode) -> list[AtspiNode]:
    """Return a node and all below it, in order."""
    nodes: list[AtspiNode] = []
    stack = [node]
    while stack:
        node = stack.pop()
        nodes.append(node)
        stack += reversed(node.children)
    return nodes


class AtspiReader:
    """A connection to the accessibility bus of the session at `bus`.

    Raises:
        DesktopError: There is none.
    """

    def __init__(self, bus: str) -> None:
        try:
            address = _ask(bus, ("/org/a11y/bus", "org.a11y.Bus", "org.a11y.Bus", "GetAddress"))[0]
            self.wire = BusClient(address, APP_TIMEOUT_S, TREE_BUDGET_S)
            # Applications fill their caches only while somebody listens. Nobody sends this event.
            self._listener = open_dbus_connection(address)
            registry = DBusAddress(
                "/org/a11y/atspi/registry", "org.a11y.atspi.Registry", "org.a11y.atspi.Registry"
            )
            listen = new_method_call(registry, "RegisterEvent", "s", ("object:desktop",))
            self._listener.send_and_get_reply(listen, timeout=5)
        except (OSError, ValueError, RuntimeError, EOFError, TimeoutError) as error:
            raise DesktopError(
                f"the accessibility bus can't be reached through the session bus {bus!r}:"
                f" {error!r}; is at-spi2-core installed and the session alive?"
            ) from None
        self._role_names: dict[tuple[str, int], str] = {}
        self._asked_in: set[str] = set()  # applications that were asked for their own address

    def close(self) -> None:
        """Close the connections."""
        self.wire.close()
        self._listener.close()

    def read(self, accepts: Callable[[str], bool] | None = None) -> list[Application]:
        """Return all applications with their nodes: names, roles, states and order.

        A node without an answer from its application is left out; the root of a silent application
        has a note.

        Args:
            accepts: picks applications by name; all of them by default.
        """
        self.wire.begin()
        references: list[Reference] = self.wire.ask([(m.REGISTRY, m.CHILDREN)])[0] or []
        if accepts is not None:
            references = self._picked(references, accepts)
        caches = self.wire.ask([((reference[0], m.CACHE), m.ITEMS) for reference in references])
        self._connect(
            [item for item, items in zip(references, caches, strict=True) if items is not None]
        )
        pids = self.wire.ask([(m.BUS, m.process_id(name)) for name, _ in references])
        nodes: dict[Reference, AtspiNode] = {}
        roots: list[AtspiNode] = []
        for reference, items in zip(references, caches, strict=True):
            roots.append(self._plant(reference, items or [], nodes))
        self._complete(nodes, roots)
        self._name_roles(nodes.values())
        for root in roots:
            if root.reference[0] in self.wire.silent:
                root.note = (
                    f"did not answer within {APP_TIMEOUT_S:g} s; this part of the tree may be"
                    " incomplete"
                )
        return [Application(root, pid or 0) for root, pid in zip(roots, pids, strict=True)]

    def _connect(self, present: list[Reference]) -> None:
        """Ask the applications that answer for their own addresses, and let go of the others."""
        names = {name for name, _ in present}
        self.wire.keep(names)
        self._asked_in &= names
        new = [reference for reference in present if reference[0] not in self._asked_in]
        self._asked_in |= names
        addresses = self.wire.ask([(reference, m.DIRECT) for reference in new])
        for (name, _), address in zip(new, addresses, strict=True):
            if address:
                self.wire.connect(name, address)

    def _picked(
        self, references: list[Reference], accepts: Callable[[str], bool]
    ) -> list[Reference]:
        names = self.wire.ask([(reference, m.NAME) for reference in references])
        picked: list[Reference] = []
        for reference, name in zip(references, names, strict=True):
            if accepts(name or ""):
                picked.append(reference)
        return picked

    def _plant(
        self, reference: Reference, items: Iterable[m.CacheItem], nodes: dict[Reference, AtspiNode]
    ) -> AtspiNode:
        """Make the nodes of one application from its cache and hang them together."""
        parents: list[tuple[AtspiNode, Reference]] = []
        for item in items:
            if len(nodes) >= MAX_NODES or item.reference in nodes:
                continue
            node = AtspiNode(
                item.reference,
                item.name,
                item.role,
                item.states,
                item.count,
                item.interfaces,
                item.index,
            )
            nodes[item.reference] = node
            parents.append((node, item.parent))
        root = nodes.get(reference)
        if root is None:
            root = nodes[reference] = AtspiNode(reference, states=SHOWING, count=1)
            self._describe([root])
        for node, parent in parents:
            if node is not root and parent in nodes:
                nodes[parent].adopt(node)
        for node, _ in parents:
            node.children.sort(key=lambda child: child.place)
        return root

    def _complete(self, nodes: dict[Reference, AtspiNode], roots: list[AtspiNode]) -> None:
        """Ask for children that a cache leaves out.

        They are those of lists, tables and icon views, and of roots without one.
        """
        todo = [node for node in nodes.values() if _is_short(node)]
        todo += [root for root in roots if not root.children and root not in todo]
        self._grow(nodes, todo)
        self._grow(nodes, self._plugs(nodes, roots) + self._new_pages(nodes))
        if len(nodes) >= MAX_NODES:
            roots[0].note = f"the tree is cut at {MAX_NODES} nodes"

    def _grow(self, nodes: dict[Reference, AtspiNode], todo: list[AtspiNode]) -> None:
        """Ask for the children of `todo`, and for those below them that show."""
        for _ in range(MAX_DEPTH):
            if not todo or len(nodes) >= MAX_NODES:
                return
            fresh: list[AtspiNode] = []
            for node, children in zip(todo, self._children(todo), strict=True):
                for place, reference in enumerate(children):
                    child = nodes.get(reference)
                    if child is None and len(nodes) < MAX_NODES:
                        child = nodes[reference] = AtspiNode(reference, place=place)
                        fresh.append(child)
                    # also one whose own idea of its parent is another (LibreOffice)
                    if child is not None:
                        node.adopt(child)
            self._describe(fresh)
            todo = [node for node in fresh if node.states & SHOWING]

    def _plugs(self, nodes: dict[Reference, AtspiNode], roots: list[AtspiNode]) -> list[AtspiNode]:
        """Return the nodes that an application without a window shows in a window of another.

        That is a GtkPlug, such as the dialog of a locked screen. The window's side does not list
        it; it is found by climbing from the application's first object.
        """
        at = [(root.reference[0], m.FIRST) for root in roots if not root.children]
        fresh: list[AtspiNode] = []
        for _ in range(MAX_DEPTH):
            if not at:
                break
            above: list[Reference] = []
            parents: list[Reference | None] = self.wire.ask([(item, m.PARENT) for item in at])
            for reference, parent in zip(at, parents, strict=True):
                if parent is None:
                    continue
                socket = nodes.get(parent)
                is_own = parent[0] == reference[0]
                if socket is None and is_own:
                    above.append(parent)
                elif socket is not None and not is_own and reference not in nodes:
                    plug = nodes[reference] = AtspiNode(reference)
                    fresh.append(plug)
                    socket.adopt(plug)
            at = above
        self._describe(fresh)
        return fresh

    def _new_pages(self, nodes: dict[Reference, AtspiNode]) -> list[AtspiNode]:
        """Pages in the place of others.

        Chromium's cache holds on to the page that its error page has replaced.
        """
        pages = [node for node in nodes.values() if _is_shown_page(node)]
        page_references = [page.reference for page in pages]
        parents = {id(page.parent): page.parent for page in pages if page.parent is not None}
        holders = list(parents.values())
        fresh: list[AtspiNode] = []
        for holder, present in zip(holders, self._children(holders), strict=True):
            for reference in present:
                if reference not in nodes:
                    page = nodes[reference] = AtspiNode(reference)
                    fresh.append(page)
                    holder.adopt(page)
            old = {reference for reference in page_references if reference not in present}
            if present:  # otherwise it did not answer
                holder.children = [child for child in holder.children if child.reference not in old]
        self._describe(fresh)
        return fresh

    def _children(self, nodes: list[AtspiNode]) -> list[list[Reference]]:
        calls = [(node.reference, m.CHILD_COUNT) for node in nodes]
        counts = [count or 0 for count in self.wire.ask(calls)]
        small: list[AtspiNode] = []
        lists: dict[Reference, list[Reference]] = {}
        for node, count in zip(nodes, counts, strict=True):
            if 0 < count <= MAX_CHILDREN:
                small.append(node)
        answers = self.wire.ask([(node.reference, m.CHILDREN) for node in small])
        for node, answer in zip(small, answers, strict=True):
            lists[node.reference] = answer or []
        for node, count in zip(nodes, counts, strict=True):
            if count > MAX_CHILDREN:
                node.note = f"{count} children; those that are not in sight are left out"
                lists[node.reference] = self._in_sight(node)
        return [lists.get(node.reference, []) for node in nodes]

    def _in_sight(self, node: AtspiNode) -> list[Reference]:
        """The cells of a huge table between its corners on the screen; none of another node."""
        box = self.wire.ask([(node.reference, m.EXTENTS)])[0]
        if node.role != TABLE or "Table" not in node.interfaces or not box:
            return []
        x, y, width, height = box
        first = (node.reference, m.at_point(x + 2, y + 2))
        last = (node.reference, m.at_point(x + width - 3, y + height - 3))
        corners: list[Reference] = [corner for corner in self.wire.ask([first, last]) if corner]
        answers = self.wire.ask([(corner, m.INDEX) for corner in corners])
        indices: list[int] = [index for index in answers if index is not None]
        if len(indices) < 2:
            return []
        rows = self._span(node, "GetRowAtIndex", indices)
        columns = self._span(node, "GetColumnAtIndex", indices)
        calls = [(node.reference, m.cell_at(row, column)) for row in rows for column in columns]
        cells: list[Reference] = [cell for cell in self.wire.ask(calls) if cell]
        return cells[:MAX_CHILDREN]

    def _span(self, node: AtspiNode, method: str, indices: list[int]) -> range:
        """The rows or columns between two children of a table; none if it does not answer."""
        calls = [(node.reference, m.row_and_column(method, index)) for index in indices]
        places: list[int | None] = self.wire.ask(calls)
        first, last = places
        if first is None or last is None:
            return range(0)
        return range(first, min(last, first + SPAN) + 1)

    def _describe(self, nodes: list[AtspiNode]) -> None:
        """Ask for the facts that a cache would have given."""
        properties = (m.NAME, m.ROLE, m.STATES, m.INTERFACES)
        answers = self.wire.ask(
            [(node.reference, method) for node in nodes for method in properties]
        )
        for index, node in enumerate(nodes):
            start = len(properties) * index
            name, role, states, interfaces = answers[start : start + len(properties)]
            node.name = name or ""
            node.role = role or 0
            node.states = states or 0
            node.interfaces = interfaces or frozenset()

    def _name_roles(self, nodes: Iterable[AtspiNode]) -> None:
        """Give each node the name of its role.

        Names differ a little between toolkits: each application is asked once for each of its
        roles. An object that is destroyed meanwhile answers "invalid", whatever it was: another
        one of its role is asked then, and if there is none, the role is asked for at the next read.
        """
        nodes = list(nodes)
        unknown: dict[tuple[str, int], list[Reference]] = {}
        for node in nodes:
            key = (node.reference[0], node.role)
            if key not in self._role_names and node.role != EXTENDED:
                unknown.setdefault(key, []).append(node.reference)
        if len(self._role_names) > MAX_NODES:
            self._role_names.clear()
        for _ in range(_ASKED_FOR_ROLE):
            answers = self.wire.ask([(group[0], m.ROLE_NAME) for group in unknown.values()])
            for key, name in zip(unknown, answers, strict=True):
                if name and (name != INVALID_NAME or key[1] == INVALID):
                    self._role_names[key] = name
            unknown = {
                key: group[1:]
                for key, group in unknown.items()
                if key not in self._role_names and group[1:]
            }
            if not unknown:
                break
        special = [node for node in nodes if node.role == EXTENDED]
        answers = self.wire.ask([(node.reference, m.ROLE_NAME) for node in special])
        for node in nodes:
            node.role_name = self._role_names.get((node.reference[0], node.role), "unknown")
        for node, name in zip(special, answers, strict=True):
            node.role_name = name or "unknown"


def _is_shown_page(node: AtspiNode) -> bool:
    return node.role == DOCUMENT_WEB and bool(node.states & SHOWING)


def _is_short(node: AtspiNode) -> bool:
    """Return whether a visible node has more children than its cache contained."""
    if not node.states & SHOWING:
        return False
    return bool(node.states & MANAGES_DESCENDANTS) or node.count > len(node.children)


def _ask(bus: str, call: tuple[str, str, str, str]) -> Any:
    path, name, interface, method = call
    connection = open_dbus_connection(bus)
    try:
        reply = connection.send_and_get_reply(
            new_method_call(DBusAddress(path, name, interface), method), timeout=10
        )
    finally:
        connection.close()
    if reply.header.message_type != MessageType.method_return:
        raise RuntimeError(f"{name} answered {reply.body!r}")
    return reply.body
