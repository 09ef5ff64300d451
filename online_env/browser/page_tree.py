"""The accessibility tree of a page in OSWorld's XML dialect, from two commands of DevTools.

`Accessibility.getFullAXTree` has roles, names and states, `DOMSnapshot.captureSnapshot` the places
of all nodes and which of them react to clicks. Neither runs code in the page, and both see into
closed shadow roots.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.sax.saxutils import quoteattr

APPLICATION = "chromium"
_NAMESPACES = " ".join(
    f'xmlns:{short}="https://accessibility.ubuntu.example.org/ns/{name}"'
    for short, name in (("st", "state"), ("cp", "component"), ("html", "html"))
)
# Roles of ARIA by their name in AT-SPI; others keep theirs, with "-" between words.
_ROLES = {
    "button": "push-button",
    "checkbox": "check-box",
    "combobox": "combo-box",
    "textbox": "entry",
    "searchbox": "entry",
    "radio": "radio-button",
    "menuitem": "menu-item",
    "menuitemcheckbox": "check-menu-item",
    "menuitemradio": "radio-menu-item",
    "option": "list-item",
    "listitem": "paragraph",  # of a text; an AT-SPI list item can be chosen
    "spinbutton": "spin-button",
    "switch": "toggle-button",
    "treeitem": "tree-item",
    "cell": "static-cell",
    "StaticText": "static",
    "text": "static",
}
_PASSIVE = frozenset(
    {"generic", "none", "static", "paragraph", "image", "label-text", "static-cell"}
)
_WORD = re.compile(r"(?<=[a-z])(?=[A-Z])")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass
class _Node:
    """One node of the page's documents."""

    backend: int
    parent: "_Node | None"
    tag: str
    attributes: dict[str, str]
    is_clickable: bool
    text: str = ""
    box: tuple[float, float, float, float] | None = None  # x, y, width, height
    is_visible: bool = True
    extra: dict[str, str] = field(default_factory=dict[str, str])


def page_tree(
    snapshot: Mapping[str, Any],
    ax_nodes: Sequence[Mapping[str, Any]],
    title: str,
    scale: float,
    view: tuple[float, float],
) -> str:
    """Return the tree of a page as XML: one application, a frame, the document, its nodes in a row.

    As in AT-SPI, what is scrolled out of sight is not `showing`.

    Args:
        snapshot: The result of `DOMSnapshot.captureSnapshot` with the computed style `visibility`.
        ax_nodes: The nodes of `Accessibility.getFullAXTree`, of all frames.
        title: The title of the page.
        scale: Pixels of the screen for each unit of the snapshot's places.
        view: `(height, width)` of what shows of the page, in units of the snapshot's places.
    """
    accessible = {node["backendDOMNodeId"]: node for node in ax_nodes if "backendDOMNodeId" in node}
    lines = [f"<desktop-frame {_NAMESPACES}><application name={quoteattr(APPLICATION)}>"]
    name = quoteattr(_clean(title))
    height, width = (round(side * scale) for side in view)
    attributes = (
        f'name={name} st:showing="true" st:visible="true" st:enabled="true"'
        f' cp:screencoord="(0, 0)" cp:size="({width}, {height})"'
    )
    lines += [f"<frame {attributes}>", f"<document-web {attributes} />"]
    for node in _read_nodes(snapshot):
        line = _element(node, accessible.get(node.backend, {}), scale, view)
        if line:
            lines.append(line)
    lines.append("</frame></application></desktop-frame>")
    return "\n".join(lines)


def _element(
    node: _Node, accessible: Mapping[str, Any], scale: float, view: tuple[float, float]
) -> str:
    """Return a node as an XML element; "" for one that has no place or means nothing."""
    if node.box is None or node.tag.startswith(("#document", "::")):
        return ""
    ax_role = str(accessible.get("role", {}).get("value", "")) or "generic"
    role = _ROLES.get(ax_role, _WORD.sub("-", ax_role).lower()) or "generic"
    if node.tag == "#text":
        role = "static"
    elif role in _PASSIVE and node.is_clickable and node.tag not in ("html", "body"):
        role = "push-button"
    name = accessible.get("name", {}).get("value") or _text(node)
    states = {
        entry["name"]: entry["value"].get("value") for entry in accessible.get("properties", ())
    }
    left, top, *_ = node.box
    x, y, width, height = (round(value * scale) for value in node.box)
    is_in_view = left < view[1] and top < view[0] and x + width > 0 and y + height > 0
    values = {"name": str(name)}
    for state, is_true in (
        ("showing", node.is_visible and is_in_view),
        ("visible", node.is_visible),
        ("enabled", not states.get("disabled")),
        ("focused", states.get("focused")),
        ("checked", states.get("checked") in (True, "true")),
        ("selected", states.get("selected")),
    ):
        values[f"st:{state}"] = "true" if is_true else "false"
    values["cp:screencoord"] = f"({x}, {y})"
    values["cp:size"] = f"({width}, {height})"
    if node.tag != "#text":
        values["html:tag"] = node.tag
    for key in ("id", "class", "type", "value"):
        if key in node.attributes:
            values[f"html:{key}"] = node.attributes[key]
    if "value" in accessible:
        values["html:value"] = str(accessible["value"].get("value", ""))
    attributes = " ".join(f"{key}={quoteattr(_clean(value))}" for key, value in values.items())
    return f"<{re.sub('[^a-z0-9-]', '', role) or 'generic'} {attributes} />"


def _read_nodes(snapshot: Mapping[str, Any]) -> list[_Node]:
    """Return the nodes of all documents in document order, with their places on the page."""
    strings: list[str] = snapshot["strings"]
    offsets: dict[int, tuple[float, float]] = {0: (0.0, 0.0)}
    nodes: list[_Node] = []
    for number, document in enumerate(snapshot["documents"]):
        dx, dy = offsets.get(number, (0.0, 0.0))
        dx -= document.get("scrollOffsetX", 0)
        dy -= document.get("scrollOffsetY", 0)
        table, layout = document["nodes"], document["layout"]
        clickable = set(table.get("isClickable", {}).get("index", ()))
        document_nodes: list[_Node] = []
        for index, parent in enumerate(table["parentIndex"]):
            words = [strings[key] for key in table["attributes"][index]]
            node = _Node(
                backend=table["backendNodeId"][index],
                parent=document_nodes[parent] if parent >= 0 else None,
                tag=strings[table["nodeName"][index]].lower(),
                attributes=dict(zip(words[::2], words[1::2], strict=True)),
                is_clickable=index in clickable,
            )
            value = table["nodeValue"][index]
            if node.tag == "#text" and value >= 0:
                node.text = strings[value]
            document_nodes.append(node)
        for index, bounds, styles in zip(
            layout["nodeIndex"], layout["bounds"], layout["styles"], strict=True
        ):
            x, y, width, height = bounds
            if width > 0 and height > 0:
                document_nodes[index].box = (x + dx, y + dy, width, height)
            document_nodes[index].is_visible = not styles or strings[styles[0]] == "visible"
        frames = table.get("contentDocumentIndex", {"index": (), "value": ()})
        for index, inner in zip(frames["index"], frames["value"], strict=True):
            x, y, *_ = document_nodes[index].box or (0.0, 0.0)
            offsets[inner] = (x, y)
        nodes += document_nodes
    for node in nodes:  # an element's text is what the page draws inside, which no script is
        above = node.parent if node.text.strip() and node.box is not None else None
        while above is not None and len(above.text) < 200:
            above.text += f" {node.text}"
            above = above.parent
    return nodes


def _text(node: _Node) -> str:
    return " ".join(node.text.split())[:200]


def _clean(text: str) -> str:
    return _NO_XML.sub("\ufffd", text)
