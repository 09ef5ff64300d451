"""The methods of AT-SPI 2.46 that a tree needs, and how to read their answers.

See xml/*.xml of at-spi2-core.
"""

import struct
from dataclasses import dataclass
from typing import Any

from .bus_client import Cursor, Method, Reference

NAMESPACE = "org.a11y.atspi."
REGISTRY: Reference = ("org.a11y.atspi.Registry", "/org/a11y/atspi/accessible/root")
BUS: Reference = ("org.freedesktop.DBus", "/org/freedesktop/DBus")
FIRST = "/org/a11y/atspi/accessible/1"
CACHE = "/org/a11y/atspi/cache"
STATE_BITS = 64
ON_SCREEN = struct.pack("<I", 0)
ALL_TEXT = struct.pack("<ii", 0, -1)
PROPERTIES = "org.freedesktop.DBus.Properties"


@dataclass(slots=True)
class CacheItem:
    """One row of an application's cache.

    Attributes:
        reference: the node.
        parent: its parent.
        index: its place among its siblings.
        count: of its children; -1 if it is not given.
        interfaces: short names, such as `Text`.
        name: of the node.
        role: number of its role.
        states: bits of its states.
    """

    reference: Reference
    parent: Reference
    index: int
    count: int
    interfaces: frozenset[str]
    name: str
    role: int
    states: int


def _states(cursor: Cursor) -> int:
    end = cursor.array(4)
    states = 0
    shift = 0
    while cursor.position < end and shift < STATE_BITS:
        states |= cursor.uint() << shift
        shift += 32
    cursor.position = end
    return states


def _names(cursor: Cursor) -> frozenset[str]:
    end = cursor.array(4)
    names: list[str] = []
    while cursor.position < end:
        names.append(cursor.text())
    return frozenset(name.removeprefix(NAMESPACE) for name in names)


def _items(cursor: Cursor) -> list[CacheItem]:
    end = cursor.array(8)
    items: list[CacheItem] = []
    while cursor.position < end:
        cursor.align(8)
        reference = cursor.reference()
        cursor.reference()  # the application
        parent = cursor.reference()
        index = cursor.sint()
        count = cursor.sint()
        interfaces = _names(cursor)
        name = cursor.text()
        role = cursor.uint()
        cursor.text()  # the description
        states = _states(cursor)
        items.append(CacheItem(reference, parent, index, count, interfaces, name, role, states))
    return items


def _references(cursor: Cursor) -> list[Reference]:
    end = cursor.array(8)
    references: list[Reference] = []
    while cursor.position < end:
        references.append(cursor.reference())
    return references


def _pairs(cursor: Cursor) -> dict[str, str]:
    end = cursor.array(8)
    pairs: dict[str, str] = {}
    while cursor.position < end:
        cursor.align(8)
        key = cursor.text()
        pairs[key] = cursor.text()
    return pairs


def _actions(cursor: Cursor) -> list[tuple[str, str, str]]:
    end = cursor.array(8)
    actions: list[tuple[str, str, str]] = []
    while cursor.position < end:
        cursor.align(8)
        actions.append((cursor.text(), cursor.text(), cursor.text()))
    return actions


def _place(cursor: Cursor) -> tuple[int, int, int, int]:
    cursor.align(8)
    return cursor.sint(), cursor.sint(), cursor.sint(), cursor.sint()


def _property(interface: str, name: str) -> Method:
    words = b""
    for word in (NAMESPACE + interface, name):
        words += b"\0" * (-len(words) % 4) + struct.pack("<I", len(word)) + word.encode() + b"\0"
    return Method(PROPERTIES, "Get", Cursor.variant, "ss", words)


def _values(cursor: Cursor) -> dict[str, Any]:
    end = cursor.array(8)
    values: dict[str, Any] = {}
    while cursor.position < end:
        cursor.align(8)
        name = cursor.text()
        values[name] = cursor.variant()
    return {name: values[name] for name in VALUES if values.get(name) is not None}


def _one_text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode() + b"\0"


def process_id(name: str) -> Method:
    """Return the process behind a bus name."""
    return Method(
        "org.freedesktop.DBus", "GetConnectionUnixProcessID", Cursor.uint, "s", _one_text(name)
    )


def cell_at(row: int, column: int) -> Method:
    """Return the cell of a table."""
    body = struct.pack("<ii", row, column)
    return Method(NAMESPACE + "Table", "GetAccessibleAt", Cursor.reference, "ii", body)


def at_point(x: int, y: int) -> Method:
    """Return the child at a point of the screen."""
    body = struct.pack("<iiI", x, y, 0)
    return Method(NAMESPACE + "Component", "GetAccessibleAtPoint", Cursor.reference, "iiu", body)


def row_and_column(method: str, index: int) -> Method:
    """`GetRowAtIndex` or `GetColumnAtIndex` of a table's child."""
    return Method(NAMESPACE + "Table", method, Cursor.sint, "i", struct.pack("<i", index))


ITEMS = Method(NAMESPACE + "Cache", "GetItems", _items)
CHILDREN = Method(NAMESPACE + "Accessible", "GetChildren", _references)
ROLE = Method(NAMESPACE + "Accessible", "GetRole", Cursor.uint)
ROLE_NAME = Method(NAMESPACE + "Accessible", "GetRoleName", Cursor.text)
STATES = Method(NAMESPACE + "Accessible", "GetState", _states)
INTERFACES = Method(NAMESPACE + "Accessible", "GetInterfaces", _names)
ATTRIBUTES = Method(NAMESPACE + "Accessible", "GetAttributes", _pairs)
INDEX = Method(NAMESPACE + "Accessible", "GetIndexInParent", Cursor.sint)
NAME = _property("Accessible", "Name")
PARENT = _property("Accessible", "Parent")
CHILD_COUNT = _property("Accessible", "ChildCount")
EXTENTS = Method(NAMESPACE + "Component", "GetExtents", _place, "u", ON_SCREEN)
TEXT = Method(NAMESPACE + "Text", "GetText", Cursor.text, "ii", ALL_TEXT)
ACTIONS = Method(NAMESPACE + "Action", "GetActions", _actions)
# Where an application lets us in: the empty address for one on Qt, and for root.
DIRECT = Method(NAMESPACE + "Application", "GetApplicationBusAddress", Cursor.text)
# All of them at once, from AT-SPI's bridge for ATK only.
ALL_VALUES = Method(PROPERTIES, "GetAll", _values, "s", _one_text(NAMESPACE + "Value"))
# One by one: Qt 5 reads a second argument of every call of `Properties`. `GetAll` has none, and an
# application on Qt dies of it.
VALUES = {
    name: _property("Value", name)
    for name in ("CurrentValue", "MinimumValue", "MaximumValue", "MinimumIncrement")
}
