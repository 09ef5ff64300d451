"""Accessibility XML: what is kept, what is left out and why, and that a hostile tree only ever
raises ElementsError."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.elements import (
    AccessibleNode,
    boxes_from_tree,
    interactive_elements,
    nodes_from_tree,
)
from hijack_data.elements import accessibility_nodes as reading
from hijack_data.elements.accessibility_nodes import MAX_BYTES, MAX_DEPTH
from hijack_data.elements.interactive_roles import INTERACTIVE_ROLES
from hijack_data.errors import ElementsError, HijackError

SIZE = (1080, 1920)
SHOWN = 'st:showing="true" st:visible="true"'


def document(body: str, platform: str = "ubuntu", root: str = "desktop-frame") -> str:
    base = f"https://accessibility.{platform}.example.org/ns"
    spaces = {
        "st": "state",
        "attr": "attributes",
        "cp": "component",
        "doc": "document",
        "docattr": "document/attributes",
        "txt": "text",
        "val": "value",
        "act": "action",
        "class": "class",
        "role": "role",
    }
    declarations = " ".join(f'xmlns:{prefix}="{base}/{path}"' for prefix, path in spaces.items())
    return f"<{root} {declarations}>{body}</{root}>"


def node(
    role: str,
    place: object = (10, 20),
    size: object = (30, 40),
    name: str = "",
    states: str = SHOWN,
) -> str:
    return f'<{role} name="{name}" {states} cp:screencoord="{place}" cp:size="{size}"/>'


DESKTOP = document(f"""
  <application name="Thunar" {SHOWN}>
    <frame name="Documents" {SHOWN} st:active="true" cp:screencoord="(0, 27)" cp:size="(957, 1051)">
      <panel {SHOWN} cp:screencoord="(0, 27)" cp:size="(957, 40)">
        <push-button name="Back" {SHOWN} st:enabled="true" cp:screencoord="(8, 30)" cp:size="(32, 32)"
                     act:click_desc="clicks" act:click_kb="&lt;Alt&gt;Left"/>
        <entry name="Location &amp; path" {SHOWN} cp:screencoord="(50, 30)" cp:size="(600, 32)">/home/user</entry>
        <push-button name="Hidden" cp:screencoord="(700, 30)" cp:size="(32, 32)"/>
        <push-button name="Covered" st:visible="true" cp:screencoord="(740, 30)" cp:size="(32, 32)"/>
        <toggle-button name="Off" {SHOWN} st:enabled="false" cp:screencoord="(780, 30)" cp:size="(32, 32)"/>
      </panel>
      <label name="just text" {SHOWN} cp:screencoord="(8, 70)" cp:size="(90, 20)"/>
      <layered-pane {SHOWN} cp:screencoord="(0, 90)" cp:size="(957, 900)">
        <icon name="notes.txt" {SHOWN} cp:screencoord="(-20, 100)" cp:size="(96, 96)"/>
        <icon name="far right" {SHOWN} cp:screencoord="(1900, 1060)" cp:size="(96, 96)"/>
        <icon name="left of it" {SHOWN} cp:screencoord="(-96, 100)" cp:size="(96, 96)"/>
        <icon name="below" {SHOWN} cp:screencoord="(0, 1080)" cp:size="(96, 96)"/>
        <icon name="flat" {SHOWN} cp:screencoord="(300, 100)" cp:size="(96, 0)"/>
        <icon name="unsized" {SHOWN} cp:screencoord="(300, 100)" cp:size="(-1, -1)"/>
        <icon name="nowhere" {SHOWN} cp:screencoord="(-2147483648, -2147483648)" cp:size="(1, 1)"/>
        <icon name="no place" {SHOWN}/>
      </layered-pane>
    </frame>
  </application>
  <application name="Chromium" {SHOWN}><frame {SHOWN}><section {SHOWN}><link name="More" {SHOWN}
     cp:screencoord="(1000, 500)" cp:size="(80, 18)"><static name="More" {SHOWN}/></link></section></frame>
  </application>
""")


def test_a_desktop_of_nested_applications() -> None:
    result = boxes_from_tree(DESKTOP, SIZE)
    assert result.source == "tree"
    assert result.boxes.dtype == np.int32
    assert result.names == ("Back", "Location & path", "notes.txt", "far right", "More")
    assert result.roles == ("push-button", "entry", "icon", "icon", "link")
    assert result.boxes.tolist() == [
        [8, 30, 40, 62],
        [50, 30, 650, 62],
        [0, 100, 76, 196],
        [1900, 1060, 1920, 1080],
        [1000, 500, 1080, 518],
    ]
    assert result.notes == (
        (
            "left out 9 of 14 interactive nodes: "
            "1 disabled, 2 hidden, 3 off the screen, 1 without a place or a size, 2 without an area"
        ),
        "clipped 2 boxes that reach over the edge of the screen",
    )


def test_without_a_size_boxes_stay_as_they_are() -> None:
    result = boxes_from_tree(DESKTOP)
    boxes = dict(zip(result.names, result.boxes.tolist(), strict=True))
    assert boxes["notes.txt"] == [-20, 100, 76, 196]
    assert boxes["below"] == [0, 1080, 96, 1176]
    assert "left of it" not in boxes
    assert "nowhere" not in boxes


def test_bytes_text_and_utf16_agree() -> None:
    expected = boxes_from_tree(DESKTOP, SIZE).boxes.tolist()
    document = '<?xml version="1.0" encoding="UTF-16"?>' + DESKTOP
    for xml in (
        DESKTOP.encode(),
        b"\xef\xbb\xbf" + DESKTOP.encode(),
        document,
        document.encode("utf-16"),
    ):
        assert boxes_from_tree(xml, SIZE).boxes.tolist() == expected


def test_windows_needs_no_showing_and_takes_the_friendly_class() -> None:
    visible = 'st:visible="true" st:enabled="True"'
    body = (
        node("netuiribbonbutton", name="Bold", states=visible)
        + node("pane", name="Tab", states=f'{visible} class:friendly_class_name="tabitem"')
        + node("button", name="gone", states='st:visible="false"')
        + node("pane", name="plain", states=visible)
    )
    result = boxes_from_tree(document(body, "windows", "desktop"), SIZE)
    assert result.names == ("Bold", "Tab")
    assert result.roles == ("netuiribbonbutton", "tabitem")


def test_macos_needs_no_state_and_has_titles() -> None:
    body = (
        node("close_button", states='attr:AXTitle="Close"')
        + node("text_field", states='attr:AXDescription="Search" st:AXEnabled="True"')
        + node("text", states='attr:AXTitle="static text"')
        + node("button", states='attr:AXTitle="grey" st:AXEnabled="False"')
    )
    result = boxes_from_tree(document(body, "macos", "desktop"), SIZE)
    assert result.names == ("Close", "Search")
    assert result.roles == ("close-button", "text-field")
    assert "1 disabled" in result.notes[0]


@pytest.mark.parametrize("role", sorted(INTERACTIVE_ROLES))
def test_every_interactive_role_is_kept(role: str) -> None:
    assert boxes_from_tree(document(node(role))).boxes.tolist() == [[10, 20, 40, 60]]


@pytest.mark.parametrize(
    "role", ["panel", "frame", "label", "heading", "section", "list", "static", "tool-bar"]
)
def test_other_roles_are_not(role: str) -> None:
    result = boxes_from_tree(document(node(role)))
    assert result.boxes.shape == (0, 4)
    assert result.notes == ("the accessibility tree has no interactive node",)


@pytest.mark.parametrize(
    "states", ["", 'st:showing="true"', 'st:visible="true"', 'st:showing="false" st:visible="true"']
)
def test_both_states_are_needed(states: str) -> None:
    assert not len(boxes_from_tree(document(node("entry", states=states))))


def test_states_of_a_foreign_namespace_do_not_count() -> None:
    xml = document(node("entry")).replace("accessibility.ubuntu", "accessibility.other")
    assert not len(boxes_from_tree(xml))


@pytest.mark.parametrize(
    "value",
    [
        "",
        "10, 20",
        "(10; 20)",
        "(10, 20, 30)",
        "(1.5, 2)",
        "(0x10, 2)",
        "(1e3, 2)",
        "(1_0, 2)",
        "(+1, 2)",
        "(, )",
        "(10, 20) ",
        "(2147483648, 0)",
        "(0, -2147483649)",
        f"({'9' * 5000}, 1)",
        "(١, ٢)",
        "(None, None)",
        "__import__('os')",
        "(nan, nan)",
    ],
)
@pytest.mark.parametrize("key", ["screencoord", "size"])
def test_malformed_numbers_name_line_node_and_value(key: str, value: str) -> None:
    position, size = (value, (1, 1)) if key == "screencoord" else ((1, 1), value)
    xml = document(
        "<panel><icon/></panel>\n<application"
        f' name="x">\n{node("entry", position, size)}</application>'
    )
    with pytest.raises(
        ElementsError, match=rf"{key}=.*line 3, column 1, at desktop-frame/application/entry"
    ) as caught:
        boxes_from_tree(xml)
    assert len(str(caught.value)) < 300
    assert "'(10, 20)'" in str(caught.value)


BOMB = '<!DOCTYPE b [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12)
)


@pytest.mark.parametrize(
    "prolog",
    [
        BOMB + "]>",
        '<!DOCTYPE b [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE b [<!ENTITY % x SYSTEM "http://127.0.0.1:9/x"> %x;]>',
        '<!DOCTYPE b SYSTEM "http://127.0.0.1:9/x.dtd">',
        "<!DOCTYPE html>",
    ],
)
def test_a_doctype_is_refused(prolog: str) -> None:
    start = time.process_time()
    with pytest.raises(ElementsError, match="DOCTYPE"):
        boxes_from_tree(prolog + document("<entry>&m;&x;</entry>"))
    assert time.process_time() - start < 1


def test_depth_is_limited_without_recursion() -> None:
    deepest = "<a>" * (MAX_DEPTH - 2) + node("entry") + "</a>" * (MAX_DEPTH - 2)
    assert len(boxes_from_tree(document(deepest))) == 1
    assert len(boxes_from_tree(document("<a/>" * MAX_DEPTH + node("entry")))) == 1
    with pytest.raises(ElementsError, match=f"more than {MAX_DEPTH} levels deep"):
        boxes_from_tree("<a>" * 100_000 + "</a>" * 100_000)
    with pytest.raises(ElementsError, match=f"more than {MAX_DEPTH} levels deep"):
        boxes_from_tree(document(f"<a>{deepest}</a>"))


@pytest.mark.parametrize(
    "xml",
    [
        "",
        b"",
        "   ",
        "/tmp/tree.xml",
        "<a>",
        "<a></b>",
        "<a/><b/>",
        DESKTOP[:-40],
        "{}",
        "<a>&undefined;</a>",
        "<a>&#0;</a>",
        '<a b="1" b="2"/>',
        "<x:a/>",
    ],
)
def test_what_is_not_xml_says_where(xml: str | bytes) -> None:
    with pytest.raises(ElementsError, match=r"not well-formed XML: line \d+, column \d+"):
        boxes_from_tree(xml)


@pytest.mark.parametrize(
    "xml", [b"<a>\xff\xfe</a>", '<a b="é"/>'.encode("latin-1"), b"\xff\xfe<\x00a", "<a>\ud800</a>"]
)
def test_wrong_encodings(xml: str | bytes) -> None:
    with pytest.raises(ElementsError):
        boxes_from_tree(xml)


@pytest.mark.parametrize("xml", [None, 3, ["<a/>"], bytearray(b"<a/>")])
def test_wrong_types(xml: object) -> None:
    with pytest.raises(ElementsError, match="must be text or bytes"):
        boxes_from_tree(xml)  # type: ignore[arg-type]


def test_too_large() -> None:
    with pytest.raises(ElementsError, match=str(MAX_BYTES)):
        boxes_from_tree(b" " * (MAX_BYTES + 1))


@pytest.mark.parametrize(
    "xml", ["<a>" + "é" * 60 + "</a>", ("<a>" + "€" * 42 + "</a>").encode("utf-16")]
)
def test_the_limit_counts_bytes_of_utf8(monkeypatch: pytest.MonkeyPatch, xml: str | bytes) -> None:
    monkeypatch.setattr(reading, "MAX_BYTES", 133)
    boxes_from_tree(xml)
    monkeypatch.setattr(reading, "MAX_BYTES", 126)
    with pytest.raises(ElementsError, match="bytes long; at most 126"):
        boxes_from_tree(xml)


def test_a_bad_size_is_refused() -> None:
    with pytest.raises(HijackError):
        boxes_from_tree(DESKTOP, (0, 5))


def test_a_large_tree_is_quick() -> None:
    xml = document("".join(node("link", (i, i), (9, 9), f"n{i}") for i in range(3300)))
    start = time.process_time()
    assert len(boxes_from_tree(xml, (5000, 5000))) == 3300
    assert time.process_time() - start < 1


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_random_input_raises_nothing_else(xml: str | bytes) -> None:
    with pytest.raises(ElementsError):
        boxes_from_tree(xml, SIZE)


@settings(max_examples=200)
@given(st.integers(0, len(DESKTOP)), st.text(max_size=8), st.integers(0, 60))
def test_a_damaged_tree_raises_nothing_else(at: int, patch: str, cut: int) -> None:
    xml = DESKTOP[:at] + patch + DESKTOP[at + cut :]
    try:
        result = boxes_from_tree(xml, SIZE)
    except ElementsError:
        return
    assert len(result) <= 15


integers = st.integers(-(2**31), 2**31 - 1)


@given(
    st.lists(
        st.tuples(integers, integers, integers, integers) | st.tuples(*[st.integers(-50, 150)] * 4),
        max_size=8,
    )
)
def test_kept_boxes_lie_on_the_screen_and_all_nodes_are_counted(
    places: list[tuple[int, int, int, int]],
) -> None:
    xml = document("".join(node("link", p[:2], p[2:], f"{i}") for i, p in enumerate(places)))
    result = boxes_from_tree(xml, (90, 100))
    for box, name in zip(result.boxes.tolist(), result.names, strict=True):
        x, y, w, h = places[int(name)]
        assert box == [max(x, 0), max(y, 0), min(x + w, 100), min(y + h, 90)]
        assert box[0] < box[2]
        assert box[1] < box[3]
    missing_count = len(places) - len(result)
    assert missing_count == 0 or result.notes[0].startswith(
        f"left out {missing_count} of {len(places)} "
    )
    assert boxes_from_tree(xml, (90, 100)).boxes.tolist() == result.boxes.tolist()


def by_name(xml: str) -> dict[str, AccessibleNode]:
    return {item.name: item for item in nodes_from_tree(xml)}


def test_all_nodes_come_in_document_order_with_their_application() -> None:
    nodes = nodes_from_tree(DESKTOP)
    assert [item.index for item in nodes] == list(range(len(nodes)))
    root = nodes[0]
    assert (root.role, root.depth, root.parent, root.application) == ("desktop-frame", 1, None, "")
    assert root.application_index == -1
    more = nodes[-1]
    assert (more.role, more.depth, more.application) == ("static", 6, "Chromium")
    assert more.parent is nodes[-2]
    assert nodes[more.application_index].name == "Chromium"
    assert {item.application for item in nodes[1:]} == {"Thunar", "Chromium"}


def test_applications_of_one_name_are_told_apart() -> None:
    nodes = nodes_from_tree(document(2 * f"<application name='a'>{node('entry')}</application>"))
    assert [item.application for item in nodes[1:]] == ["a"] * 4
    assert [item.application_index for item in nodes] == [-1, 1, 1, 3, 3]


def test_a_node_has_text_states_and_a_box() -> None:
    nodes = by_name(DESKTOP)
    node = nodes["Location & path"]
    assert node.text == "/home/user"
    assert node.states == {"showing", "visible"}
    assert (node.box, node.visible, node.enabled, node.interactive) == (
        (50, 30, 650, 62),
        True,
        True,
        True,
    )
    assert node.path == "desktop-frame/application/frame/panel/entry"
    assert nodes["Off"].enabled is False
    assert nodes["Hidden"].visible is False
    assert nodes["Hidden"].box == (700, 30, 732, 62)
    assert nodes["just text"].interactive is False
    assert nodes["notes.txt"].box == (-20, 100, 76, 196)
    for name in ("flat", "unsized", "no place"):
        assert nodes[name].box is None


def test_text_is_what_comes_before_the_first_child() -> None:
    root, child = nodes_from_tree("<a>one &amp; two<b>three</b>four</a>")
    assert (root.text, child.text) == ("one & two", "three")


def test_a_malformed_place_is_no_box_and_an_error_only_for_an_element() -> None:
    nodes = nodes_from_tree(document(node("label", "(1, x)") + node("entry", (2**31, 0))))
    assert [item.box for item in nodes] == [None, None, None]
    assert not len(interactive_elements(nodes[:2]))
    with pytest.raises(ElementsError, match=r"screencoord=.*at desktop-frame/entry"):
        interactive_elements(nodes)


def test_windows_and_macos_nodes_have_their_own_roles_names_and_states() -> None:
    states = 'st:visible="True" class:friendly_class_name="TabItem"'
    windows = nodes_from_tree(document(node("pane", states=states), "windows"))[1]
    assert (windows.role, windows.states, windows.visible) == ("tabitem", {"visible"}, True)
    mac = nodes_from_tree(document(node("text", states='attr:AXTitle=" t"'), "macos"))[1]
    assert (mac.role, mac.name, mac.visible, mac.interactive) == ("text", " t", True, False)


def test_the_interactive_elements_of_all_nodes_are_those_of_the_tree() -> None:
    result = interactive_elements(nodes_from_tree(DESKTOP), SIZE)
    expected = boxes_from_tree(DESKTOP, SIZE)
    assert result.boxes.tolist() == expected.boxes.tolist()
    assert (result.names, result.roles) == (expected.names, expected.roles)
    assert (result.source, result.notes) == (expected.source, expected.notes)


def test_the_number_of_nodes_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MAX_NODES", 3)
    assert len(nodes_from_tree("<a><b/><b/></a>")) == 3
    with pytest.raises(ElementsError, match=r"more than 3 nodes \(line 1, column 12, at a/b\)"):
        nodes_from_tree("<a><b/><b/><b/></a>")


@pytest.mark.parametrize("xml", ["<a>", BOMB + "]><a/>", "<a>" * 20_000, None])
def test_reading_nodes_refuses_what_reading_boxes_refuses(xml: str) -> None:
    with pytest.raises(ElementsError):
        nodes_from_tree(xml)
