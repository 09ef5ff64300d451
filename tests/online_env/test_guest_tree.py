"""The tree that a guest writes, and which of its nodes a person would see on the screen."""

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from xml.etree import ElementTree

import pytest

from support import needs

pytest.importorskip("jeepney", reason=needs.ONLINE)
pytest.importorskip("Xlib", reason=needs.ONLINE)

from hijack_data.elements import boxes_from_tree
from online_env.embedded.guest import accessibility_tree
from online_env.embedded.guest.atspi import icons, states
from online_env.embedded.guest.atspi.libreoffice_boxes import correct_libreoffice_boxes
from online_env.embedded.guest.atspi.reader import Application, AtspiNode
from online_env.embedded.guest.atspi.visibility import VisibilityFilter, candidates

from support.processes import comm
from support.waiting import until

SPACE = "{https://accessibility.ubuntu.example.org/ns/%s}%s"
SHOWN = states.SHOWING | states.VISIBLE
BUTTON = 43
SCREEN = (400, 300)
BELOW_PANEL = (0, 24, 400, 300)


def node(name="", box=None, *children, role=BUTTON, **more):
    """A node that claims to be on the screen; `box` is xyxy."""
    atspi_node = AtspiNode(("app", name), name, role, **{"states": SHOWN, "role_name": "x", **more})
    if box is not None:
        x1, y1, x2, y2 = box
        atspi_node.box = (x1, y1, x2 - x1, y2 - y1)
    for child in children:
        atspi_node.adopt(child)
    return atspi_node


def parsed(*roots):
    """The applications of the tree, read back by a parser."""
    text = accessibility_tree.to_xml([Application(root, 0) for root in roots])
    return ElementTree.fromstring(text)


# What is written


def test_whatever_applications_say_the_tree_can_be_parsed():
    hostile = "\0\x1b\ud800\ufffe<&>\"'\u2028"
    root = node(
        hostile,
        (0, 0, 10, 10),
        role_name="push button",
        text=f"]]>{hostile}--",
        attributes={hostile: hostile, "": "lost", "2 d": "b"},
        actions=[("Do It", hostile, hostile), ("", "no name", "")],
        values={"CurrentValue": float("nan"), "MinimumValue": 1e300, "Other": 3},
        interfaces=frozenset({"Image", "Selection"}),
    )
    (value,) = parsed(root)
    clean = "<&>\"'\u2028"
    assert value.tag == "push-button"
    assert value.text == f"]]>{clean}--"
    assert value.attrib == {
        "name": clean,
        SPACE % ("state", "showing"): "true",
        SPACE % ("state", "visible"): "true",
        SPACE % ("attributes", "_2-d"): "b",
        SPACE % ("attributes", "_----------"): clean,
        SPACE % ("component", "screencoord"): "(0, 0)",
        SPACE % ("component", "size"): "(10, 10)",
        "image": "true",
        "selection": "true",
        SPACE % ("value", "value"): "nan",
        SPACE % ("value", "min"): "1e+300",
        SPACE % ("action", "do-It_desc"): clean,
        SPACE % ("action", "do-It_kb"): clean,
        SPACE % ("action", "__desc"): "no name",
        SPACE % ("action", "__kb"): "",
    }


@pytest.mark.parametrize(
    ("role", "tag"),
    [
        ("check menu item", "check-menu-item"),
        (" ", "unknown"),
        ("3d view", "role-3d-view"),
        ("-", "role--"),
        ("größe", "größe"),
        # Python takes these for letters or digits, XML does not.
        ("m²", "m-"),
        ("ªb", "role--b"),
        ("① step", "role---step"),
        ("\U00010400", "role--"),
    ],
)
def test_a_role_is_a_tag_that_xml_allows(role, tag):
    (value,) = parsed(node(role_name=role, attributes={role.strip() or "_": "kept"}))
    assert value.tag == tag
    assert [*value.attrib.values()].count("kept") == 1
    assert (
        boxes_from_tree(
            accessibility_tree.to_xml([Application(node(role_name=role), 0)]), (300, 400)
        )
        is not None
    )


def test_a_place_is_written_for_what_shows_only():
    hidden = node("hidden", (1, 2, 3, 4), states=states.VISIBLE)
    iconic = node("iconic", (1, 2, 3, 4), states=states.SHOWING)
    for item in parsed(hidden, iconic, node("no box")):
        assert not [key for key in item.attrib if "component" in key], item.get("name")


def test_a_node_that_is_its_own_grandchild_is_written_once():
    child = node("child")
    root = node("root", None, child)
    child.children.append(root)  # as an application may claim
    (value,) = parsed(root)
    assert [item.get("name") for item in value.iter()] == ["root", "child", "root"]
    deep = bottom = node("0")
    for number in range(1, 90):
        bottom.adopt(node(str(number)))
        bottom = bottom.children[0]
    assert len(list(parsed(deep).iter())) == 51, "50 levels, and the frame of the desktop"


def test_an_application_that_does_not_answer_has_a_remark():
    text = accessibility_tree.to_xml([Application(node("mute", note="did not -- answer"), 0)])
    assert "<!-- did not - - answer -->" in text


def test_chromium_is_called_as_it_was_started(tmp_path):
    def named(command):
        program = tmp_path / command
        program.symlink_to(shutil.which("sleep"))
        with subprocess.Popen([program, "60"]) as process:
            until(lambda: comm(process.pid) == command)
            text = accessibility_tree.to_xml([Application(node("Chromium"), process.pid)])
            process.kill()
        return ElementTree.fromstring(text)[0].get("name")

    assert named("chrome") == "Google Chrome"
    assert named("chromium") == "Chromium"


def test_the_terminal_that_is_meant_is_the_focused_one_in_front():
    def terminal(bits):
        return node("t", role=states.TERMINAL, states=bits)

    active = node("active", states=SHOWN | states.ACTIVE)
    behind = node("behind")
    table = [
        (terminal(states.FOCUSED | states.SHOWING), behind, 5),
        (terminal(states.SHOWING), active, 3),
        (terminal(states.SHOWING), behind, 1),
        (terminal(0), behind, 0),
        (node("no terminal", states=states.FOCUSED), active, 0),
    ]
    assert [accessibility_tree._rank(value, frame) for value, frame, _ in table] == [
        rank for *_, rank in table
    ]


# What is seen


@dataclass
class Surface:
    """A window as the X server has it."""

    frame: tuple
    client: tuple
    pid: int = 7
    popup: bool = False
    title: str = ""


@dataclass
class Screen:
    """Windows, topmost first; and what is seen of applications on them."""

    surfaces: list = field(default_factory=list)

    def shown(self, root, pid=7):
        """The boxes, xyxy, of the nodes that are seen, by name."""
        application = Application(root, pid)
        nodes = candidates(application)
        VisibilityFilter(self.surfaces, SCREEN).apply(application)
        entries = {}
        for item in nodes:
            if item.box is not None and item.states & states.SHOWING:
                x, y, width, height = item.box
                entries[item.name] = (x, y, x + width, y + height)
        return entries


def window(box, *children, name="w", role=states.FRAME):
    return node("app", None, node(name, box, *children, role=role))


LEFT = (0, 0, 200, 300)
WHOLE = (0, 0, 400, 300)


@pytest.mark.parametrize(("left", "seen"), [(205, {"free"}), (206, {"free", "half"})])
def test_what_another_window_covers_is_not_seen_by_its_middle(left, seen):
    covering = (left, 0, 400, 300)
    screen = Screen([Surface(covering, covering, pid=8), Surface(WHOLE, WHOLE)])
    half = node("half", (100, 10, 311, 20))
    free = node("free", (10, 10, 50, 20))
    assert set(screen.shown(window(WHOLE, half, free))) - {"w"} == seen


def test_boxes_are_cut_at_the_screen_and_at_what_scrolls():
    wide = node("wide", (-50, 10, 150, 20))
    below = node("below", (10, 290, 20, 320))
    out = node("out", (390, 10, 500, 20))
    closed_node = node("gone", (400, 10, 500, 20))
    tall = node("tall", (10, 50, 60, 900))
    pane = node("pane", (10, 100, 90, 200), tall, role=states.SCROLL_PANE)
    table = node("table", (300, 100, 310, 110), node("cell", (300, 105, 310, 190)))
    root = window(WHOLE, wide, below, out, closed_node, pane, table)
    assert Screen([Surface(WHOLE, WHOLE)]).shown(root) == {
        "w": WHOLE,
        "wide": (0, 10, 150, 20),
        "below": (10, 290, 20, 300),
        "out": (390, 10, 400, 20),
        "pane": (10, 100, 90, 200),
        "tall": (10, 100, 60, 200),
        "table": (300, 100, 310, 110),
        "cell": (300, 105, 310, 190),
    }


def office(late, bars=1):
    """A window of LibreOffice; its root pane comes `late` pixels too high."""
    field = node("field", (10, 270, 90, 290))  # the toolkit's own in LibreOffice's bar
    around = node("around", (10, 270 - late, 90, 290 - late), field)
    button = node("button", (100, 270 - late, 120, 290 - late))
    bar = node("tool bar", (0, 268 - late, 200, 292 - late), around, button)
    line = node("line", (20, 50 - late, 900, 400 - late))  # sticks out of what holds it
    second = node("second", (0, 30 - late, 400, 50 - late), node("File", role=states.MENU))
    second.role = states.MENU_BAR
    pane = node("pane", (0, 30 - late, 400, 300 - late), second, bar, line, role=states.ROOT_PANE)
    panel = node("panel", (0, 30, 400, 300), pane)
    value = [node("bar", (0, 10, 400, 30), role=states.MENU_BAR)] * bars
    return window(WHOLE, node("content", (0, 10, 400, 300), *value, panel))


def places(root):
    correct_libreoffice_boxes(Application(root, 7))
    return {item.name: item.box for item in accessibility_tree.walk(root)}


def test_what_a_root_pane_holds_is_where_the_pane_is_drawn():
    assert places(office(late=20)) == places(office(late=0))
    assert places(office(late=20))["button"] == (100, 270, 20, 20)
    assert places(office(late=20))["field"] == (10, 270, 80, 20)


def test_a_root_pane_of_another_size_than_its_parent_stays_where_it_is():
    root = office(late=20)
    (pane,) = [item for item in accessibility_tree.walk(root) if item.name == "pane"]
    pane.box = (0, 10, 400, 200)
    assert places(root)["button"] == (100, 250, 20, 20)


@pytest.mark.parametrize(("bars", "seen"), [(1, False), (0, True)])
def test_the_second_menu_bar_of_a_window_is_not_drawn(bars, seen):
    root = office(late=20, bars=bars)
    correct_libreoffice_boxes(Application(root, 7))
    names = {item.name for item in accessibility_tree.walk(root) if item.states & states.SHOWING}
    assert ({"second", "File"} <= names) == seen
    assert ("second" in names) == seen
    assert ("bar" in names) == bool(bars)


def test_two_windows_of_one_application_in_one_place_are_told_apart_by_title():
    screen = Screen([Surface(LEFT, LEFT, title="b"), Surface(LEFT, LEFT, title="a")])
    inside = (10, 10, 20, 20)
    result = node("a", LEFT, node("in a", inside), role=states.FRAME)
    second = node("b", LEFT, node("in b", inside), role=states.FRAME)
    assert set(screen.shown(node("app", None, result, second))) == {"b", "in b"}


@pytest.mark.parametrize(("off", "seen"), [(4, True), (5, False)])
def test_the_bus_and_x_may_differ_by_a_few_pixels(off, seen):
    second = (300, 0, 400, 300)
    screen = Screen([Surface((0, 0, 200, 300), (2, 20, 198, 298)), Surface(second, second)])
    moved_box = (off, off, 200, 300)
    root = node(
        "app",
        None,
        node("known", second, role=states.FRAME),
        node("", moved_box, node("inside", (50, 50, 60, 60)), role=states.FRAME),
    )
    # One without a name that is no window of the screen is kept in reserve.
    assert ("inside" in screen.shown(root)) == seen


def test_items_of_a_menu_are_seen_in_a_popup_only():
    def shown(*surfaces):
        item = node("item", (110, 10, 290, 30))
        menu = node("menu", (10, 0, 50, 20), item, role=states.MENU)
        below = node("below", (110, 40, 190, 50))
        return Screen([*surfaces, Surface(LEFT, LEFT)]).shown(window(LEFT, menu, below))

    box = (100, 0, 300, 100)
    assert set(shown()) == {"w", "menu", "below"}
    assert set(shown(Surface(box, box, popup=True))) == {"w", "menu", "item"}
    # It reaches beyond the window that it belongs to.
    assert shown(Surface(box, box, popup=True))["item"] == (110, 10, 290, 30)
    assert set(shown(Surface(box, box, popup=True, pid=8))) == {"w", "menu"}
    assert set(shown(Surface(box, box))) == {"w", "menu"}


def test_a_plug_in_is_seen_in_the_panel_of_the_process_that_started_it():
    panel = Surface(LEFT, LEFT, pid=os.getppid())
    root = window(LEFT, node("clock", (10, 10, 20, 20)))
    assert set(Screen([panel]).shown(root, os.getpid())) == {"w", "clock"}
    assert Screen([panel]).shown(window(LEFT), pid=1 << 30) == {}


# Icons of the desktop


RC = """[xfdesktop-version-4.10.3+-rcfile_format]
4.10.3+=true

[/]
row=0
col=1

[Trash]
row=1
col=0

[{home}]
row=0
col=0

[{home}/Desktop/a file.txt]
row=2
col=3

[{home}/Desktop/gone.txt]
row=3
col=3

[{home}/Desktop/half]
row=4
"""


@pytest.fixture
def desktop(tmp_path, monkeypatch):
    """A home with icons, of which one's file is gone, and one has half a place."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for path in (icons.PLACES, icons.SETTINGS):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / icons.PLACES).write_text(RC.format(home=tmp_path))
    (tmp_path / icons.SETTINGS).write_text('<property name="icon-size" type="uint" value="32"/>')
    (tmp_path / "Desktop").mkdir()
    for name in ("a file.txt", "half"):
        (tmp_path / "Desktop" / name).touch()
    return tmp_path


def found_icons(name="xfdesktop"):
    root = node(name, None, node("Desktop", (0, 0, 1280, 800), role=states.FRAME))
    icons.add_icons(Application(root, 0), (0, 24, 1280, 800))
    return {child.name: child for child in root.children[0].children}


def test_icons_have_the_names_that_a_person_reads(desktop):
    result = found_icons()
    assert set(result) == {"File System", "Trash", "Home", "a file.txt"}
    assert all(
        item.role_name == "icon" and item.states & SHOWN == SHOWN for item in result.values()
    )
    assert found_icons("xfce4-panel") == {}
    (desktop / icons.PLACES).write_text("row=1\n")
    assert found_icons() == {}
    (desktop / icons.PLACES).unlink()
    assert found_icons() == {}


def test_icons_are_as_large_as_the_settings_say_and_do_not_overlap(desktop):
    home, system, trash = (found_icons()[name].box for name in ("Home", "File System", "Trash"))
    assert home[2:] == (round(32 * 1.9), 32 + 26)
    assert home[0] >= 16 + 6
    assert home[1] >= 24 + 16 + 6
    assert (system[1], trash[0]) == (home[1], home[0])
    assert system[0] >= home[0] + home[2]
    assert trash[1] >= home[1] + home[3]
    (desktop / icons.SETTINGS).write_text("<channel/>")
    assert found_icons()["Home"].box[2:] == (round(48 * 1.9), 48 + 26)
