"""Applications on an accessibility bus, over real sockets: what they say is in tables of a test.

The messages are made and read by jeepney, so that our own reading of D-Bus is compared with it.
"""

import contextlib
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jeepney import HeaderFields, Message, new_error, new_method_return
from jeepney.low_level import Parser

from online_env.embedded.guest.atspi.states import SHOWING, VISIBLE

ROOT = "/org/a11y/atspi/accessible/root"
SHOWN = SHOWING | VISIBLE
ITEMS = "a((so)(so)(so)iiassusau)"
PID = 4321


@dataclass
class Thing:
    """An accessible object.

    Attributes:
        parent: its path, or the bus name and the path of one in another application.
        extents: x, y, width, height.
        index: its place among its siblings, as its cache has it.
        count: of its children, as its cache has it.
    """

    name: str = ""
    role: int = 43
    states: int = SHOWN
    children: tuple[str, ...] = ()
    parent: str | tuple[str, str] = ""
    interfaces: tuple[str, ...] = ("Accessible", "Component")
    extents: tuple[int, int, int, int] = (0, 0, 10, 10)
    text: str = ""
    index: int = 0
    count: int = -1
    attributes: dict[str, str] = field(default_factory=dict)
    actions: list[tuple[str, str, str]] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)


@dataclass
class App:
    """An application.

    Attributes:
        things: its objects, by path.
        cached: paths that its cache has; it answers without a cache where this is `None`.
        silent: members that it does not answer.
        odd: members that it answers with something else than is asked for.
        address: where it lets others in.
    """

    things: dict[str, Thing]
    cached: tuple[str, ...] | None = None
    silent: tuple[str, ...] = ()
    odd: tuple[str, ...] = ()
    address: str = ""
    role_names: dict[int, str] = field(default_factory=lambda: {43: "push button"})


class Session:
    """The bus of a session, and that of its accessibility.

    Attributes:
        apps: by bus name.
        asked: the destination and the member of each call, and the socket that it came by.
        slices: so many bytes of an answer are sent at once.
    """

    def __init__(self, folder: Path, apps: dict[str, App]) -> None:
        self.apps = apps
        self.asked: list[tuple[str, str, str]] = []
        self.slices = 1 << 20
        self.hangs_up: str = ""
        self._folder = folder
        self._sockets: list[socket.socket] = []
        self.bus = self.listen("bus")

    def listen(self, name: str) -> str:
        """Serve one more socket; returns its address."""
        path = str(self._folder / name)
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(path)
        listener.listen()
        self._sockets.append(listener)
        threading.Thread(target=self._accept, args=(listener, name), daemon=True).start()
        return f"unix:path={path}"

    def close(self) -> None:
        """End all connections."""
        for item in self._sockets:
            with contextlib.suppress(OSError):
                item.shutdown(socket.SHUT_RDWR)
            item.close()

    def _accept(self, listener: socket.socket, name: str) -> None:
        with contextlib.suppress(OSError):
            while True:
                caller, _ = listener.accept()
                self._sockets.append(caller)
                threading.Thread(target=self._attend, args=(caller, name), daemon=True).start()

    def _attend(self, caller: socket.socket, name: str) -> None:
        with contextlib.suppress(OSError):
            line = b""
            while not line.endswith(b"\r\n"):
                line += caller.recv(1)
            caller.sendall(b"OK 0123456789abcdef0123456789abcdef\r\n")
            while not line.endswith(b"BEGIN\r\n"):
                line += caller.recv(1)
            parser = Parser()
            while data := caller.recv(1 << 16):
                for message in parser.feed(data):
                    self._serve(caller, message, name)

    def _serve(self, caller: socket.socket, message: Message, name: str) -> None:
        fields = message.header.fields
        destination = fields.get(HeaderFields.destination, "")
        member = fields[HeaderFields.member]
        self.asked.append((destination, member, name))
        if name == self.hangs_up:
            caller.shutdown(socket.SHUT_RDWR)
            return
        reply = self._reply(message, destination, member)
        if reply is None:
            return
        data = reply.serialise(serial=1)
        for start in range(0, len(data), self.slices):
            caller.sendall(data[start : start + self.slices])
            if self.slices < len(data):
                time.sleep(0.001)

    def _reply(self, message: Message, destination: str, member: str) -> Message | None:
        common: dict[str, tuple[str, tuple[Any, ...]]] = {
            "Hello": ("s", (":1.0",)),
            "GetAddress": ("s", (self.bus,)),
            "RegisterEvent": ("", ()),
            "GetConnectionUnixProcessID": ("u", (PID,)),
        }
        if member in common:
            signature, body = common[member]
            return new_method_return(message, signature or None, body)
        if destination == "org.a11y.atspi.Registry":
            return new_method_return(message, "a(so)", ([(result, ROOT) for result in self.apps],))
        app = self.apps.get(destination)
        if app is not None and member in app.silent:
            return None
        if app is not None and member in app.odd:
            return new_method_return(message, "y", (7,))
        outcome = None if app is None else self._answer(app, destination, message)
        if outcome is None:
            return new_error(message, "org.freedesktop.DBus.Error.UnknownObject")
        return new_method_return(message, *outcome)

    def _answer(self, app: App, name: str, message: Message) -> tuple[str, tuple[Any, ...]] | None:
        path = message.header.fields[HeaderFields.path]
        member = message.header.fields[HeaderFields.member]
        if member == "GetItems":
            if app.cached is None:
                return None
            return ITEMS, ([_item(app, name, interface) for interface in app.cached],)
        node = app.things.get(path)
        if node is None:
            return None
        if member == "Get":
            return _property(node, name, message.body[1])
        bits = [node.states & 0xFFFFFFFF, node.states >> 32]
        interfaces = [f"org.a11y.atspi.{interface}" for interface in node.interfaces]
        answers: dict[str, tuple[str, Any]] = {
            "GetChildren": ("a(so)", [(name, child) for child in node.children]),
            "GetRole": ("u", node.role),
            "GetRoleName": ("s", app.role_names.get(node.role, "")),
            "GetState": ("au", bits),
            "GetInterfaces": ("as", interfaces),
            "GetAttributes": ("a{ss}", node.attributes),
            "GetIndexInParent": ("i", node.index),
            "GetExtents": ("(iiii)", node.extents),
            "GetText": ("s", node.text),
            "GetActions": ("a(sss)", node.actions),
            "GetApplicationBusAddress": ("s", app.address),
            "GetAll": ("a{sv}", {key: ("d", value) for key, value in node.values.items()}),
        }
        if member not in answers:
            return None
        signature, value = answers[member]
        return signature, (value,)


def _property(thing: Thing, name: str, key: str) -> tuple[str, tuple[Any, ...]] | None:
    entries: dict[str, tuple[str, Any]] = {
        "Name": ("s", thing.name),
        "ChildCount": ("i", len(thing.children)),
        "Parent": ("(so)", _parent(thing, name)),
    }
    entries |= {item: ("d", value) for item, value in thing.values.items()}
    return ("v", (entries[key],)) if key in entries else None


def _item(app: App, name: str, path: str) -> tuple[Any, ...]:
    node = app.things[path]
    bits = [node.states & 0xFFFFFFFF, node.states >> 32]
    interfaces = [f"org.a11y.atspi.{interface}" for interface in node.interfaces]
    about = (node.index, node.count, interfaces, node.name, node.role, "", bits)
    return ((name, path), (name, ROOT), _parent(node, name), *about)


def _parent(thing: Thing, name: str) -> tuple[str, str]:
    if isinstance(thing.parent, tuple):
        return thing.parent
    return name, thing.parent or "/org/a11y/atspi/null"


@contextlib.contextmanager
def session(**apps: App) -> Iterator[Session]:
    """A session of these applications; `one` has the bus name `:one`."""
    with tempfile.TemporaryDirectory(prefix="at-") as folder:
        result = Session(Path(folder), {f":{name}": app for name, app in apps.items()})
        try:
            yield result
        finally:
            result.close()
