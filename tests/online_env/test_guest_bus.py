"""The tree of applications on a bus, whatever they answer, and whether they do: real sockets."""

import socket
from dataclasses import dataclass
from xml.etree import ElementTree

import pytest

from support import needs

pytest.importorskip("jeepney", reason=needs.ONLINE)
pytest.importorskip("Xlib", reason=needs.ONLINE)

from online_env.embedded.guest.accessibility_tree import AccessibilityTree
from online_env.embedded.guest.atspi import reader, states
from online_env.errors import DesktopError

from support.atspi import PID, ROOT, SHOWN, App, Session, Thing, session
from support.waiting import until

VALUE = "{https://accessibility.ubuntu.example.org/ns/value}"
SHOWING = "{https://accessibility.ubuntu.example.org/ns/state}showing"


@dataclass
class Window:
    frame: tuple = (0, 0, 400, 300)
    client: tuple = (0, 0, 400, 300)
    pid: int = PID
    popup: bool = False
    title: str = ""


class Windows:
    """One window as large as the screen."""

    def surfaces(self):
        return [Window()]

    def screen_size(self):
        return 400, 300

    def workarea(self):
        return 0, 0, 400, 300


@pytest.fixture
def tree_of():
    """Makes the tree of a session; its connections are closed after the test."""
    items: list[AccessibilityTree] = []

    def make(found: Session) -> AccessibilityTree:
        items.append(AccessibilityTree(found.bus, Windows()))
        return items[-1]

    yield make
    for item in items:
        if item._reader is not None:
            item._reader.close()


def read(tree: AccessibilityTree):
    """The applications by name, parsed."""
    return {item.get("name"): item for item in ElementTree.fromstring(tree.read())}


def names(root) -> list[str]:
    return [item.get("name") for item in root.iter()]


def editor(**more) -> App:
    """An application with a window, in which are a text and a slider."""
    nodes = {
        ROOT: Thing("editor", 75, children=("/w",)),
        "/w": Thing("window", states.FRAME, parent=ROOT, children=("/t", "/s")),
        "/t": Thing(
            "title",
            states.TEXT,
            parent="/w",
            interfaces=("Accessible", "Component", "Text", "Action"),
            text="Ünï ￼😀",
            attributes={"tag": "h1"},
            actions=[("Activate", "does it", "<Alt>a")],
        ),
        "/s": Thing(
            "slider",
            parent="/w",
            index=1,
            interfaces=("Component", "Value"),
            values={"CurrentValue": 0.5, "MaximumValue": 10.0, "Text": 3.0},
        ),
    }
    return App(nodes, **more)


CACHED = (ROOT, "/s", "/t", "/w")  # in whatever order


@pytest.mark.parametrize("cached", [None, CACHED])
@pytest.mark.parametrize("slices", [1 << 20, 7])
def test_a_tree_is_the_same_with_and_without_a_cache_and_in_any_pieces(tree_of, cached, slices):
    with session(editor=editor(cached=cached)) as result:
        result.slices = slices
        root = read(tree_of(result))["editor"]
    assert names(root) == ["editor", "window", "title", "slider"]
    title, slider = root[0]
    assert title.text == "Ünï 😀", "the place of an object inside a text is no letter"
    assert title.get("{https://accessibility.ubuntu.example.org/ns/attributes}tag") == "h1"
    assert title.get("{https://accessibility.ubuntu.example.org/ns/action}activate_kb") == "<Alt>a"
    assert {key: value for key, value in slider.items() if key.startswith(VALUE)} == {
        f"{VALUE}value": "0.5",
        f"{VALUE}max": "10.0",
    }
    assert {item.get(SHOWING) for item in root.iter()} == {"true"}


def test_an_application_that_is_silent_costs_its_own_part_only(tree_of, monkeypatch):
    monkeypatch.setattr(reader, "APP_TIMEOUT_S", 0.15)
    hung = App({}, silent=("GetItems", "GetApplicationBusAddress", "Get", "GetRole"))
    with session(hung=hung, editor=editor(cached=CACHED)) as result:
        tree = tree_of(result)
        text = tree.read()
        assert "did not answer within 0.15 s; this part of the tree may be incomplete" in text
        assert names(ElementTree.fromstring(text))[1:] == [
            "",
            "editor",
            "window",
            "title",
            "slider",
        ]
        requests = [member for destination, member, _ in result.asked if destination == ":hung"]
        assert requests == ["GetItems"], "it is left alone for the rest of the read"
        hung.things, hung.silent = editor().things, ()
        assert len(read(tree)["editor"]) == 1, "and asked again at the next one"
        assert "did not answer" not in tree.read()


def test_an_application_that_dies_or_answers_nonsense_is_left_out(tree_of):
    closed_app = App({})
    odd = editor(odd=("GetExtents", "GetText", "GetAttributes", "GetState", "GetRoleName"))
    with session(gone=closed_app, odd=odd, editor=editor()) as result:
        roots = ElementTree.fromstring(tree_of(result).read())
    paths = ["editor", "window", "title", "slider"]
    assert [names(root) for root in roots] == [[""], ["editor", "window"], paths]


def test_without_applications_the_tree_is_empty(tree_of):
    with session() as result:
        assert read(tree_of(result)) == {}
        assert tree_of(result).terminal_text() is None


def test_the_text_of_the_terminal_is_that_of_a_terminal_only(tree_of):
    def terminal(text, bits):
        terminal_node = Thing(
            "t", states.TERMINAL, bits, interfaces=("Text",), text=text, parent="/w"
        )
        return {
            "/w": Thing("window", states.FRAME, children=("/t",), parent=ROOT),
            "/t": terminal_node,
        }

    def app(name, text, bits=SHOWN):
        return App({ROOT: Thing(name, 75, children=("/w",)), **terminal(text, bits)})

    apps = {
        "one": app("xfce4-terminal", "$ one\n\n"),
        "two": app("Terminal", "$ two\n \n", SHOWN | states.FOCUSED),
        "other": app("editor", "$ three", SHOWN | states.FOCUSED),
    }
    with session(**apps) as result:
        assert tree_of(result).terminal_text() == "$ two"
        assert (":other", "GetItems", "bus") not in result.asked, "others are not read for it"


def test_children_that_a_cache_leaves_out_are_asked_for(tree_of):
    short = editor(cached=(ROOT, "/w", "/t"))
    short.things["/w"].count = 2
    listing = editor(cached=(ROOT, "/w", "/t"))
    listing.things["/w"].states |= states.MANAGES_DESCENDANTS
    hidden = editor(cached=(ROOT, "/w", "/t"))
    hidden.things["/w"].count = 2
    hidden.things["/w"].states = 0
    with session(short=short, listing=listing, hidden=hidden) as result:
        roots = list(ElementTree.fromstring(tree_of(result).read()))
    calls = ["editor", "window", "title", "slider"]
    assert [names(root) for root in roots] == [calls, calls, calls[:3]]


def test_an_application_that_goes_round_in_circles_ends(tree_of):
    nodes = editor().things
    nodes["/s"].children = ("/w", "/s", ROOT)
    with session(round=App(nodes)) as result:
        root = read(tree_of(result))["editor"]
    assert names(root) == ["editor", "window", "title", "slider"]


def test_a_node_with_too_many_children_says_how_many_there_are(tree_of):
    nodes = editor().things
    nodes["/w"].children = tuple(f"/many/{number}" for number in range(reader.MAX_CHILDREN + 1))
    with session(many=App(nodes)) as result:
        text = tree_of(result).read()
    assert "<!-- 1025 children; those that are not in sight are left out -->" in text
    assert names(ElementTree.fromstring(text)) == ["main", "editor", "window"]


def test_a_tree_that_is_too_large_is_cut(tree_of, monkeypatch):
    monkeypatch.setattr(reader, "MAX_NODES", 3)
    with session(editor=editor()) as result:
        text = tree_of(result).read()
    assert "<!-- the tree is cut at 3 nodes -->" in text
    assert names(ElementTree.fromstring(text))[1:] == ["editor", "window", "title"]


def test_a_dialog_of_another_process_is_shown_where_it_is_plugged_in(tree_of):
    """As the dialog of a locked screen is, whose own root lists nothing."""
    socket_side = editor(cached=CACHED)
    first = "/org/a11y/atspi/accessible/1"
    plug = App(
        {
            ROOT: Thing("dialog", 75),
            first: Thing("Password", parent="/between"),
            "/between": Thing("between", children=(first,), parent="/plug"),
            "/plug": Thing("plug", children=("/between",), parent=(":locker", "/s")),
        }
    )
    with session(locker=socket_side, dialog=plug) as result:
        roots = ElementTree.fromstring(tree_of(result).read())
    assert names(roots[0]) == ["editor", "window", "title", "slider", "plug", "between", "Password"]
    assert names(roots[1]) == ["dialog"]


# Asked directly


def test_an_application_that_lets_us_in_is_asked_directly_until_it_hangs_up(tree_of):
    app = editor(cached=CACHED)
    with session(editor=app) as result:
        app.address = result.listen("own")
        tree = tree_of(result)
        over_the_bus = tree.read()
        result.asked.clear()
        assert tree.read() == over_the_bus
        ways = {way for destination, _, way in result.asked if destination == ":editor"}
        assert ways == {"own"}
        result.hangs_up = "own"
        result.asked.clear()
        assert tree.read() == over_the_bus, "what was under way is asked again over the bus"
        assert (":editor", "GetItems", "bus") in result.asked


# jeepney leaves a socket that it could not connect to the collector.
LEFT = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@LEFT
@pytest.mark.parametrize("address", ["unix:path=/nowhere/at/all", "nonsense", "tcp:host=x"])
def test_an_address_that_leads_nowhere_is_no_harm(tree_of, address):
    with session(editor=editor(address=address)) as result:
        tree = tree_of(result)
        assert names(read(tree)["editor"]) == ["editor", "window", "title", "slider"]
        assert len(read(tree)) == 1


@LEFT
def test_a_bus_that_is_gone_is_told_and_a_new_one_is_found(tree_of):
    with session(editor=editor()) as result:
        tree = tree_of(result)
        tree.read()
        for item in result._sockets[1:]:
            item.shutdown(socket.SHUT_RDWR)
        assert len(read(tree)) == 1, "the bus was only started again"
    until(lambda: _is_gone(tree), "the end of the session")
    with pytest.raises(DesktopError, match=r"the accessibility bus can't be reached through the "):
        tree.read()


def _is_gone(tree):
    try:
        tree.read()
    except DesktopError:
        return True
    return False


@LEFT
@pytest.mark.parametrize("address", ["", "unix:path=/nowhere", "nonsense"])
def test_a_session_without_a_bus_is_told(address):
    with pytest.raises(DesktopError) as error:
        AccessibilityTree(address, Windows()).read()
    assert f"through the session bus {address!r}" in str(error.value)
    assert str(error.value).endswith("; is at-spi2-core installed and the session alive?")
