"""The accessibility tree: OSWorld's dialect, what is really visible, and applications that do not
answer."""

import contextlib
import multiprocessing
import os
import socket
import threading
from multiprocessing.connection import Connection
from pathlib import Path

import pytest
from lxml import etree

from hijack_data.elements import boxes_from_tree
from online_env.embedded.guest.accessibility_tree import AccessibilityTree
from online_env.embedded.guest.atspi.bus_client import BusClient, _Channel
from online_env.embedded.guest.atspi.states import STATES
from online_env.embedded.guest.display import SharedDisplay
from online_env.embedded.guest.windows import Windows

ST = "{https://accessibility.ubuntu.example.org/ns/state}"
CP = "{https://accessibility.ubuntu.example.org/ns/component}"
VAL = "{https://accessibility.ubuntu.example.org/ns/value}"
ACT = "{https://accessibility.ubuntu.example.org/ns/action}"
ATTR = "{https://accessibility.ubuntu.example.org/ns/attributes}"


def pair(node, name):
    x, y = node.get(f"{CP}{name}")[1:-1].split(",")
    return int(x), int(y)


def elements(session):
    height, width = session.screen[1], session.screen[0]
    return boxes_from_tree(session.client.get("/accessibility").json()["AT"], (height, width))


def test_dialect(clean, eventually):
    clean.launch("mousepad", title="Mousepad")
    clean.click_on("//application[@name='mousepad']//text")
    clean.input({"type": "type", "text": 'some <text> & "more"'})
    eventually(
        "the text",
        lambda: clean.shown(
            "//application[@name='mousepad']//text[contains(., '<text> & \"more\"')]"
        ),
    )
    root = clean.tree()
    assert root.tag == "desktop-frame"
    assert set(root.nsmap) == {"st", "attr", "cp", "doc", "docattr", "txt", "val", "act"}
    frame = root.xpath("application[@name='mousepad']/frame")[0]
    assert (
        frame.get(f"{ST}active") == frame.get(f"{ST}showing") == frame.get(f"{ST}visible") == "true"
    )
    window = next(row for row in clean.windows() if "Mousepad" in row["title"])
    x, y = pair(frame, "screencoord")  # with the window manager's frame
    width, height = pair(frame, "size")
    box = (x, y, x + width, y + height)
    assert all(abs(a - b) <= 40 for a, b in zip(box, window["box"], strict=True)), (box, window)
    text = frame.xpath(".//text")[0]
    assert text.get(f"{ST}multi_line") == text.get(f"{ST}editable") == "true"
    assert text.get(f"{ATTR}toolkit") == "gtk"
    button = next(n for n in frame.iter("push-button") if n.get(f"{ST}showing"))
    assert button.get(f"{ACT}click_desc") is not None
    assert button.get(f"{ACT}click_kb") is not None
    bar = next(n for n in frame.iter("scroll-bar"))
    assert bar.get(f"{VAL}value") is None or float(bar.get(f"{VAL}max")) >= float(
        bar.get(f"{VAL}value")
    )
    names = {f"{ST}{name}" for name in STATES}
    assert {key for node in root.iter() for key in node.attrib if key.startswith(ST)} <= names


def test_elements_can_be_read_and_are_on_the_screen(clean):
    clean.launch("mousepad", title="Mousepad")
    result = elements(clean)
    assert {"File", "Edit"} <= set(result.names)
    width, height = clean.screen
    assert (result.boxes >= 0).all()
    assert (result.boxes[:, 2] <= width).all()
    assert (result.boxes[:, 3] <= height).all()
    assert "Applications" in result.names  # the panel


def test_what_another_window_covers_is_not_showing(clean, eventually):
    lower = clean.launch("mousepad", title="Mousepad")
    upper = clean.launch("thunar", "/usr", title="Thunar")
    width, _ = clean.screen
    clean.act("place", id=lower["id"], box=[100, 100, 700, 600])
    clean.act("place", id=upper["id"], box=[100, 100, 700, 600])
    clean.act("activate", id=upper["id"])
    mousepad, thunar = (
        "//application[@name='mousepad']//*",
        "//application[@name='Thunar' or @name='thunar']//*",
    )
    eventually("Thunar only", lambda: not clean.shown(mousepad) and clean.shown(thunar))
    assert clean.tree().xpath("//application[@name='mousepad']/frame")  # it is still in the tree
    clean.act("activate", id=lower["id"])
    eventually("Mousepad only", lambda: clean.shown(mousepad) and not clean.shown(thunar))
    clean.act("place", id=upper["id"], box=[width // 2 + 80, 100, width - 10, 600])
    eventually("both", lambda: clean.shown(mousepad) and clean.shown(thunar))


def test_two_windows_of_one_application_are_told_apart(clean, eventually):
    first = clean.launch("thunar", "/usr", title="usr")
    second = clean.launch("thunar", "/etc", title="etc")
    for window in (first, second):
        clean.act("place", id=window["id"], box=[100, 100, 800, 600])
    clean.act("activate", id=first["id"])
    frames = "//application[@name='Thunar' or @name='thunar']/frame"

    def only(name):
        return [node.get("name") for node in clean.shown(frames)] == [name]

    eventually("the first in front", lambda: only(first["title"]))
    clean.act("activate", id=second["id"])
    eventually("the second", lambda: only(second["title"]))


def test_minimised_windows_are_not_showing(clean, eventually):
    window = clean.launch("mousepad", title="Mousepad")
    nodes = "//application[@name='mousepad']//*"
    eventually("Mousepad", lambda: clean.shown(nodes))
    clean.act("minimise", id=window["id"])
    eventually("nothing of it", lambda: not clean.shown(nodes))
    clean.act("activate", id=window["id"])
    eventually("it again", lambda: clean.shown(nodes))
    clean.act("show_desktop")
    eventually(
        "the desktop",
        lambda: not clean.shown(nodes) and clean.client.get("/ah/windows").json()["desktop_shown"],
    )
    clean.act("show_desktop", on=False)
    eventually("it again", lambda: clean.shown(nodes))


def test_menus_cover_what_is_below_and_show_their_items(clean, eventually):
    clean.launch("mousepad", title="Mousepad")
    items = "//application[@name='mousepad']//menu[@name='File']//menu-item"
    assert not clean.shown(items)
    clean.click_on("//application[@name='mousepad']//menu[@name='File']")
    result = eventually("the items", lambda: clean.shown(items))
    names = [node.get("name") for node in result]
    assert any("Save" in name for name in names)
    assert clean.shown("//application[@name='mousepad']//menu[@name='File']")
    new = next(node for node in result if node.get("name").startswith("New"))
    assert pair(new, "size")[1] > 10
    clean.input({"type": "key", "key": "esc"})
    eventually("no items", lambda: not clean.shown(items))


def test_items_of_a_file_manager(clean, eventually):
    # Thunar's icon view has no accessible items, its list has.
    clean.execute(
        [
            "xfconf-query",
            "-c",
            "thunar",
            "-p",
            "/last-view",
            "-n",
            "-t",
            "string",
            "-s",
            "ThunarDetailsView",
        ]
    )
    clean.execute("mkdir -p ~/shelf && touch ~/shelf/apple.txt ~/shelf/pear.txt")
    clean.launch("thunar", str(clean.home / "shelf"), title="shelf")
    result = eventually(
        "the files", lambda: {"apple.txt", "pear.txt"} <= set(elements(clean).names)
    )
    assert result


def test_icons_of_the_desktop_are_where_they_look(clean, eventually):
    icons = "//application[@name='xfdesktop']//icon"
    names = eventually("the icons", lambda: [node.get("name") for node in clean.shown(icons)])
    assert {"Trash", "Home", "readme.txt"} <= set(names)
    node = next(node for node in clean.shown(icons) if node.get("name") == "readme.txt")
    (x, y), (width, height) = pair(node, "screencoord"), pair(node, "size")
    clean.input({"type": "click", "x": x + width // 2, "y": y + height // 2, "clicks": 2})
    eventually(
        "the file opened", lambda: any("readme.txt" in row["title"] for row in clean.windows())
    )
    window = next(row for row in clean.windows() if "readme.txt" in row["title"])
    clean.act("place", id=window["id"], box=[0, 30, 600, 700])
    eventually("the icons covered", lambda: not clean.shown(icons))


def test_huge_folder_is_cut(clean, eventually):
    clean.execute("mkdir -p ~/many && cd ~/many && seq -f 'f%05g' 3000 | xargs touch")
    clean.launch("thunar", str(clean.home / "many"), title="many")
    nodes = "//application[@name='Thunar' or @name='thunar']//*"
    eventually("the folder", lambda: len(clean.tree().xpath(nodes)) > 50)
    text = clean.client.get("/accessibility").json()["AT"]
    assert sum(1 for _ in etree.fromstring(text.encode()).iter()) < 10_500


def test_stopped_application_does_not_hold_up_the_others(clean, eventually):
    stopped = clean.launch("mousepad", title="Mousepad")
    second = clean.launch("thunar", "/usr", title="Thunar")
    # Side by side: both remember the size that they had in another test, and one would cover the
    # other.
    clean.act("place", id=stopped["id"], box=[20, 60, 620, 560])
    clean.act("place", id=second["id"], box=[660, 60, 1260, 560])

    def told():
        """The applications that have something to show; and what is said of those that do not
        answer."""
        root = clean.tree()
        names = {app.get("name").lower() for app in root.iter("application") if app.xpath("*")}
        return names, [str(node) for node in root.iter(etree.Comment)]

    eventually("both", lambda: {"mousepad", "thunar"} <= told()[0])
    clean.execute(["kill", "-STOP", str(stopped["pid"])])
    try:
        # On a busy machine others may not answer in time once, either.
        _, notes = eventually("the other", lambda: (now := told())[0] >= {"thunar"} and now)
        assert any("did not answer" in note for note in notes), notes
        assert (
            clean.execute(["ps", "-o", "state=", "-p", str(stopped["pid"])])["output"].strip()
            == "T"
        )
    finally:
        clean.execute(["kill", "-CONT", str(stopped["pid"])])
    eventually("Mousepad again", lambda: clean.shown("//application[@name='mousepad']//*"))
    eventually("nothing to complain of", lambda: not told()[1])


def lose_when_asked(wire: BusClient) -> None:
    """Have applications end their own sockets with calls under way.

    One that ended its socket before is found out by the first question to anybody.
    """

    def lose(connection: socket.socket) -> None:
        connection.recv(1)
        connection.close()

    for name, channel in list(wire._direct.items()):
        channel.socket.close()
        ours, peer_end = socket.socketpair()
        wire._direct[name] = _Channel(ours, name)
        threading.Thread(target=lose, args=(peer_end,), daemon=True).start()


def read_twice(bus: str, display: str, uid: int, answers: Connection) -> None:
    """Read the tree as the session's user: directly where applications allow it, then not at all.

    Sends how many were asked directly, and the trees: directly, as the sockets are lost, by bus.
    """
    os.setuid(uid)  # the bus lets in its user only
    windows = Windows(SharedDisplay(display))
    directly = AccessibilityTree(bus, windows)
    directly.read()
    first = directly.read()
    requests = sum(map(directly._reader.wire.is_direct, directly._reader._asked_in))
    lose_when_asked(directly._reader.wire)
    after_a_loss = directly.read()
    BusClient.connect = lambda *arguments: None
    over_the_bus = AccessibilityTree(bus, windows)
    over_the_bus.read()
    answers.send((requests, first, after_a_loss, over_the_bus.read()))


def test_the_tree_is_the_same_directly_and_over_the_bus(clean, eventually):
    clean.launch("mousepad", title="Mousepad")
    eventually("Mousepad", lambda: clean.shown("//application[@name='mousepad']//text"))
    clean.launch("thunar", "/usr", title="Thunar")
    eventually("Thunar", lambda: clean.shown("//application[contains(@name, 'hunar')]//*"))
    bus, display = clean.execute("echo $DBUS_SESSION_BUS_ADDRESS $DISPLAY")["output"].split()
    here, value = multiprocessing.Pipe(duplex=False)
    arguments = (bus, display, clean.account.pw_uid, value)
    reader = multiprocessing.get_context("fork").Process(target=read_twice, args=arguments)
    reader.start()
    value.close()
    requests, directly, after_a_loss, over_the_bus = here.recv()
    reader.join()
    assert requests >= 3  # Mousepad and Thunar, the panel ...

    def subtrees(text):
        root = etree.fromstring(text.encode())
        entries = {app.get("name").lower(): etree.tostring(app) for app in root.iter("application")}
        return {name: entries[name] for name in ("mousepad", "thunar")}

    assert subtrees(directly) == subtrees(after_a_loss) == subtrees(over_the_bus)


def test_the_connection_to_an_application_that_ends_is_closed(clean, eventually):
    """Otherwise the server keeps a socket of each application that ever was."""

    def sockets():
        result = 0
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if str(clean.token_file).encode() in (process / "cmdline").read_bytes():
                    targets = [os.readlink(file) for file in (process / "fd").iterdir()]
                    result += sum(target.startswith("socket:") for target in targets)
        return result

    clean.tree()
    clean.tree()
    before = sockets()
    assert before > 1
    for _ in range(3):
        clean.launch("mousepad", title="Mousepad")
        eventually("it", lambda: clean.shown("//application[@name='mousepad']//text"))
        clean.close_windows()
        eventually("its end", lambda: not clean.tree().xpath("application[@name='mousepad']"))
    assert sockets() <= before + 1


def test_killed_application_leaves_the_tree(clean, eventually):
    window = clean.launch("mousepad", title="Mousepad")
    clean.execute(["kill", "-9", str(window["pid"])])
    eventually("its end", lambda: not clean.tree().xpath("application[@name='mousepad']"))


def test_tree_is_newer_than_the_frame_it_names(session):
    frame = session.client.get("/ah/frame")
    tree = session.client.get("/ah/tree").json()
    assert tree["frame_id"] == int(frame.headers["X-Frame-Id"])
    assert int(session.client.get("/screenshot").headers["X-Frame-Id"]) == tree["frame_id"] + 1
    etree.fromstring(tree["xml"].encode())


def test_terminal(clean, eventually):
    assert clean.client.get("/terminal").json() == {"output": None, "status": "success"}
    clean.launch("xfce4-terminal", title="Terminal")
    eventually("a terminal", lambda: clean.client.get("/terminal").json()["output"] is not None)
    clean.input({"type": "type", "text": "echo $((6*7)) wörld\n"})
    eventually(
        "the answer", lambda: "\n42 wörld" in (clean.client.get("/terminal").json()["output"] or "")
    )


def test_chromium_page(clean, eventually):
    clean.execute(
        "mkdir -p ~/site && cd ~/site && printf '<title>Shop</title><h1>Hats</h1><button>Buy"
        " now</button><input aria-label=Code>' > i.html"
    )
    clean.launch(
        "chromium",
        "--force-renderer-accessibility",
        "--no-first-run",
        "--password-store=basic",
        f"file://{clean.home}/site/i.html",
        title="Shop",
    )
    result = eventually(
        "the page",
        lambda: clean.shown("//application[@name='Chromium']//push-button[@name='Buy now']"),
    )
    assert pair(result[0], "size")[0] > 20
    clean.click_on("//application[@name='Chromium']//entry[@name='Code']")
    clean.input({"type": "type", "text": "ä<€>你😀"})
    eventually(
        "the text",
        lambda: clean.shown(
            "//application[@name='Chromium']//entry[@name='Code' and contains(., 'ä<€>你😀')]"
        ),
    )


@pytest.mark.parametrize("name", ["Nothing", "mousepad"])
def test_window_routes(clean, eventually, name):
    if name == "Nothing":
        # OSWorld's server does not look at what wmctrl says
        for route in ("activate_window", "close_window"):
            answer = clean.client.post(f"/setup/{route}", json={"window_name": "Nothing like it"})
            assert (answer.status_code, "nothing was done" in answer.text) == (200, True)
        assert clean.client.post("/setup/close_window", json={"window_name": ""}).status_code == 400
        return
    first = clean.launch("mousepad", title="Mousepad")
    clean.launch("thunar", "/usr", title="Thunar")
    ask = {"window_name": "mousepad.Mousepad", "strict": True, "by_class": True}
    assert clean.client.post("/setup/activate_window", json=ask).status_code == 200
    eventually(
        "it in front",
        lambda: [row["id"] for row in clean.windows() if row["active"]] == [first["id"]],
    )
    clean.client.post("/setup/activate_window", json={"window_name": "thunar"})
    eventually(
        "the other",
        lambda: any(row["active"] and "Thunar" in row["title"] for row in clean.windows()),
    )
    assert (
        clean.client.post("/setup/close_window", json={"window_name": "Untitled"}).status_code
        == 200
    )
    eventually("it closed", lambda: all(row["id"] != first["id"] for row in clean.windows()))


@pytest.mark.parametrize(
    "body",
    [
        {"action": "fly", "id": 1},
        {"action": "close", "id": 1},
        {"action": "place"},
        {"id": 3},
        {"action": "show_desktop", "on": 1},
    ],
)
def test_bad_window_actions(session, body):
    answer = session.client.post("/ah/windows", json=body)
    assert answer.status_code in (400, 500)
    assert answer.json()["message"]


def test_open_file_waits_for_its_window(clean):
    clean.execute("echo hello > ~/Documents/letter.txt")
    answer = clean.client.post(
        "/setup/open_file", json={"path": "~/Documents/letter.txt", "timeout": 20}
    )
    assert answer.status_code == 200, answer.text
    assert any("letter.txt" in row["title"] and row["mapped"] for row in clean.windows())
    assert clean.client.post("/setup/open_file", json={"path": "~/none.txt"}).status_code == 404
