"""The accessibility tree of the session in OSWorld's XML dialect, clipped to what is visible."""

import functools
import re
import threading
from collections.abc import Callable
from xml.sax.saxutils import escape, quoteattr

from ...errors import DesktopError
from .atspi import methods as m
from .atspi.icons import add_icons
from .atspi.libreoffice_boxes import correct_libreoffice_boxes
from .atspi.reader import MAX_DEPTH, Application, AtspiNode, AtspiReader, walk
from .atspi.states import ACTIVE, FOCUSED, SHOWING, STATES, TERMINAL, VISIBLE, WRITTEN
from .atspi.visibility import VisibilityFilter, candidates
from .windows import Windows

_SPACES = {
    "st": "state",
    "attr": "attributes",
    "cp": "component",
    "doc": "document",
    "docattr": "document/attributes",
    "txt": "text",
    "val": "value",
    "act": "action",
}
NAMESPACES = {
    prefix: f"https://accessibility.ubuntu.example.org/ns/{path}"
    for prefix, path in _SPACES.items()
}
MAX_TEXT = 200_000  # characters of one node
CHROME = "chrome"
# What makes one terminal likelier to be meant than another.
RANK_FOCUSED = 4
RANK_ACTIVE = 2
RANK_SHOWING = 1
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# Of the letters of names, those that every edition of XML has: Expat knows no later ones, and to
# Python "²" and "ª" are letters and digits, too. Latin, Greek, Cyrillic, Kana, Chinese, Korean.
_LETTERS = "A-Za-zÀ-ÖØ-öø-ıΆΈ-ΊΌΎ-ΡΣ-ώЁ-ЌЎ-яё-ќў-ҁぁ-ゔァ-ヺ一-龥가-힣"
_NOT_NAME = re.compile(f"[^{_LETTERS}0-9_.-]")
_NOT_WRITTEN = str.maketrans("", "", "\ufffc\ufffd")  # objects inside a text, and broken letters
_VALUES = {
    "value": "CurrentValue",
    "min": "MinimumValue",
    "max": "MaximumValue",
    "step": "MinimumIncrement",
}


class AccessibilityTree:
    """Reads the tree anew at each call; one thread at a time, the others wait.

    An application that does not answer costs `reader.APP_TIMEOUT_S` seconds and is marked by a
    comment.
    """

    def __init__(self, bus: str, windows: Windows) -> None:
        self._bus = bus
        self._windows = windows
        self._lock = threading.Lock()
        self._reader: AtspiReader | None = None

    def read(self) -> str:
        """Return the tree of all applications.

        A session without an accessibility bus is a `DesktopError`.
        """
        with self._lock:
            applications = self._retried(lambda reader: self._applications(reader, None))
        return to_xml(applications)

    def terminal_text(self) -> str | None:
        """Return the text of the terminal that has the focus, or of one in front, or None.

        A session without an accessibility bus is a `DesktopError`.
        """
        with self._lock:
            applications = self._retried(
                lambda reader: self._applications(reader, _is_terminal_name)
            )
        best_rank = 0
        best: str | None = None
        for application in applications:
            for frame in application.root.children:
                for node in walk(frame):
                    rank = _rank(node, frame)
                    if rank > best_rank:
                        best_rank = rank
                        best = node.text
        return None if best is None else best.rstrip()

    def _retried(self, act: Callable[[AtspiReader], list[Application]]) -> list[Application]:
        """Run `act`; once more over a new connection if the old one has gone."""
        reader = self._reader or AtspiReader(self._bus)
        try:
            return self._kept(reader, act)
        except DesktopError:
            return self._kept(AtspiReader(self._bus), act)

    def _kept(
        self, reader: AtspiReader, act: Callable[[AtspiReader], list[Application]]
    ) -> list[Application]:
        """Run `act` and keep the connection, unless it fails.

        Raises:
            DesktopError: The reader's connection failed; it is closed.
        """
        self._reader = None
        try:
            result = act(reader)
        except DesktopError:
            reader.close()
            raise
        self._reader = reader
        return result

    def _applications(
        self, reader: AtspiReader, accepts: Callable[[str], bool] | None
    ) -> list[Application]:
        applications = reader.read(accepts)
        surfaces = self._windows.surfaces()
        size = self._windows.screen_size()
        nodes: list[AtspiNode] = []
        for application in applications:
            nodes += candidates(application)
        components = [node for node in nodes if "Component" in node.interfaces]
        boxes = reader.wire.ask([(node.reference, m.EXTENTS) for node in components])
        for node, box in zip(components, boxes, strict=True):
            node.box = box
        visible = VisibilityFilter(list(surfaces), size)
        for application in applications:
            correct_libreoffice_boxes(application)
            add_icons(application, self._windows.workarea())
            visible.apply(application)
        _fill(reader, nodes)
        return applications


def _is_terminal_name(name: str) -> bool:
    return "terminal" in name.lower()


def _rank(node: AtspiNode, frame: AtspiNode) -> int:
    """Return how likely a node is the terminal in front; 0 if it is not one."""
    if node.role != TERMINAL:
        return 0
    rank = 0
    if frame.states & ACTIVE:
        rank += RANK_ACTIVE
    if node.states & FOCUSED:
        rank += RANK_FOCUSED
    if node.states & SHOWING:
        rank += RANK_SHOWING
    return rank


def _fill(reader: AtspiReader, nodes: list[AtspiNode]) -> None:
    """Ask for texts, attributes, values and actions of the nodes that are seen."""
    showing = [node for node in nodes if node.states & SHOWING]
    with_text = [node for node in nodes if _has_text(node)]
    valued = [node for node in showing if "Value" in node.interfaces]
    at_once = [node for node in valued if reader.wire.is_direct(node.reference[0])]
    one_by_one = [node for node in valued if not reader.wire.is_direct(node.reference[0])]
    acting = [node for node in showing if "Action" in node.interfaces]
    calls = [(node.reference, m.ATTRIBUTES) for node in showing]
    calls += [(node.reference, m.TEXT) for node in with_text]
    calls += [(node.reference, m.ALL_VALUES) for node in at_once]
    calls += [(node.reference, method) for node in one_by_one for method in m.VALUES.values()]
    calls += [(node.reference, m.ACTIONS) for node in acting]
    answers = iter(reader.wire.ask(calls))
    for node in showing:
        node.attributes = next(answers) or {}
    for node in with_text:
        text: str = next(answers) or ""
        node.text = text[:MAX_TEXT].translate(_NOT_WRITTEN)
    for node in at_once:
        node.values = next(answers) or {}
    for node in one_by_one:
        values = {name: next(answers) for name in m.VALUES}
        node.values = {name: value for name, value in values.items() if value is not None}
    for node in acting:
        node.actions = next(answers) or []


def _has_text(node: AtspiNode) -> bool:
    if "Text" not in node.interfaces:
        return False
    return bool(node.states & SHOWING) or node.role in WRITTEN


def to_xml(applications: list[Application]) -> str:
    """Return the tree in OSWorld's dialect.

    A tag is a role, everything else is an attribute in one of `NAMESPACES`.
    """
    spaces = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in NAMESPACES.items())
    parts = [f'<desktop-frame {spaces} name="main">']
    for application in applications:
        if application.root.name == "Chromium" and _command(application.pid) == CHROME:
            # it was started under that name, see bin/google-chrome
            application.root.name = "Google Chrome"
        _write(application.root, parts, set(), 1)
    parts.append("</desktop-frame>")
    return "".join(parts)


def _write(node: AtspiNode, parts: list[str], path: set[int], depth: int) -> None:
    tag = _NOT_NAME.sub("-", node.role_name.strip()) or "unknown"
    if not _begins_name(tag):
        tag = f"role-{tag}"
    parts.append(f"<{tag}{_attributes(node)}>")
    if node.note:
        note = _clean(node.note).replace("--", "- -")
        parts.append(f"<!-- {note} -->")
    if node.text:
        parts.append(escape(_clean(node.text)))
    # an application may name a node as its own grandchild
    if depth < MAX_DEPTH and id(node) not in path:
        path.add(id(node))
        for child in node.children:
            _write(child, parts, path, depth + 1)
        path.discard(id(node))
    parts.append(f"</{tag}>")


def _begins_name(text: str) -> bool:
    """Return whether an XML name may begin like this."""
    return text[0].isalpha() or text[0] == "_"


def _attributes(node: AtspiNode) -> str:
    pairs = {f"attr:{_key(name)}": value for name, value in node.attributes.items() if name}
    if node.box is not None and node.states & SHOWING and node.states & VISIBLE:
        x, y, width, height = node.box
        pairs["cp:screencoord"] = f"({x}, {y})"
        pairs["cp:size"] = f"({width}, {height})"
    if "Image" in node.interfaces:
        pairs["image"] = "true"
    if "Selection" in node.interfaces:
        pairs["selection"] = "true"
    for key, name in _VALUES.items():
        if name in node.values:
            pairs[f"val:{key}"] = str(node.values[name])
    for name, description, keys in node.actions:
        # GTK gives the name for people ("Click"); OSWorld's tree has the one for programs
        # ("click").
        key = _key(name[:1].lower() + name[1:].replace(" ", "-"))
        pairs[f"act:{key}_desc"] = description
        pairs[f"act:{key}_kb"] = keys
    extra = "".join(f" {key}={quoteattr(_clean(value))}" for key, value in pairs.items())
    return f" name={quoteattr(_clean(node.name))}{_states(node.states)}{extra}"


@functools.lru_cache(4096)
def _states(states: int) -> str:
    return "".join(f' st:{name}="true"' for bit, name in enumerate(STATES) if states >> bit & 1)


@functools.lru_cache(4096)
def _key(name: str) -> str:
    key = _NOT_NAME.sub("-", name) or "_"
    return key if _begins_name(key) else f"_{key}"


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("", text)


def _command(pid: int) -> str:
    try:
        with open(f"/proc/{pid}/comm") as file:
            return file.read().strip()
    except OSError:
        return ""
