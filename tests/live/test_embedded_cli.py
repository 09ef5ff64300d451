"""`hijack desktop` from outside, and the page of `hijack desktop view`."""

import io
import json
import subprocess
import sys
import threading
from urllib.parse import parse_qs, urlsplit

import pytest

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)

import httpx
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from online_env import desktop_commands
from online_env.embedded import view
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.embedded.runtime import registry


def hijack(*arguments, code=0):
    """Run the command in a process of its own; returns what it printed."""
    command = [sys.executable, "-m", "hijack_data.cli", "desktop", *arguments]
    process = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    assert process.returncode == code, process.stderr + process.stdout
    return process.stdout if code == 0 else process.stderr


@pytest.fixture
def name(embedded_machine, leaves_nothing):
    """A desktop that `hijack desktop up` started, and that runs on after the command has ended."""
    desktop_name = f"{leaves_nothing}cli"
    record = json.loads(hijack("up", "--name", desktop_name, "--size", "1280x800", "--json"))
    assert (record["id"], record["screen"], record["state"]) == (desktop_name, [1280, 800], "ready")
    yield desktop_name
    assert f"desktop {desktop_name} is gone" in hijack("down", desktop_name)


def test_up_list_shot_run_down(name, tmp_path):
    assert name in {
        row["id"] for row in json.loads(hijack("list", "--json")) if row["state"] == "ready"
    }
    assert "ready" in hijack("list")
    assert "1280x800" in hijack("shot", name, "-o", str(tmp_path / "shot.png"))
    with Image.open(tmp_path / "shot.png") as picture:
        assert (picture.size, picture.mode) == ((1280, 800), "RGB")
    hijack("run", "--on", name, "pyautogui.moveTo(321, 123)")
    assert hijack("run", "--on", name, "--shell", "xdotool getmouselocation").startswith(
        "x:321 y:123"
    )
    assert hijack("run", "--on", name, "--shell", "exit 3", code=3) == ""
    hijack("record", name, "-o", str(tmp_path / "film.mp4"), "--seconds", "1")
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert "there already" in hijack("up", "--name", name, code=2)


def test_unknown_desktop_is_told(embedded_machine):
    assert "'nobody' is not one of them" in hijack("shot", "nobody", code=2)
    assert "did you mean 'editor'" in hijack("up", "--app", "editr", code=2)
    assert "WIDTHxHEIGHT" in hijack("up", "--size", "big", code=2)


def test_view_starts_a_desktop_where_none_runs(embedded_machine, monkeypatch):
    items = []

    def look(record, port, say, lasting, buttons):
        with EmbeddedDesktop.attach(record["id"]) as result:
            items.append(
                (record["id"], result.screenshot().shape, port, lasting, len(buttons.all()))
            )

    monkeypatch.setattr(registry, "running", list)  # other tests have theirs
    monkeypatch.setattr(view, "serve", look)
    value = CliRunner().invoke(
        desktop_commands.desktop, ["view", "--port", "7777"], catch_exceptions=False
    )
    assert "no desktop runs: starting one" in value.output
    [(name, *columns)] = items
    assert columns == [(1080, 1920, 3), 7777, False, 9]
    assert registry.load(name) is None


@pytest.fixture
def viewer(embedded_desktop):
    """The page of a desktop, served."""
    from online_env.corrupting.ledger import Ledger
    from online_env.corrupting.page_buttons import Buttons
    from online_env.embedded.view import Viewer

    buttons = Buttons(embedded_desktop, Ledger(registry.folder(embedded_desktop.id)))
    with Viewer(embedded_desktop.record, buttons=buttons) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_buttons_of_the_page_corrupt_the_desktop_and_take_it_back(viewer, embedded_desktop):
    parts = urlsplit(viewer.url)
    secret = {"X-Token": viewer.token}
    address = f"http://{parts.netloc}"
    with httpx.Client(base_url=address, headers=secret, trust_env=False, timeout=60) as client:

        def press(name):
            return client.post("/press", content=name).raise_for_status().json()

        def frame():
            with Image.open(io.BytesIO(client.get("/frame").content)) as picture:
                return picture.size

        assert [
            button["name"] for button in client.get("/buttons").json()
        ] == hj.corruption_names()[:9]
        assert press("marks")["on"]
        small = press("resolution")
        assert "sees 960x540" in small["message"]
        assert frame() == (960, 540)
        assert not press("resolution")["on"]
        assert not press("marks")["on"]
        assert frame() == (1920, 1080)

        locked = press("verification")
        assert (locked["on"], locked["ok"]) == (True, True), locked
        assert "covers the screen" in locked["message"]
        unlocked = press("verification")
        assert (unlocked["on"], unlocked["ok"]) == (False, True), unlocked
        assert all(not button["on"] for button in client.get("/buttons").json())

        assert client.post("/press", content="marcs").status_code == 400
        assert client.post("/press", content="marks", headers={"X-Token": "x"}).status_code == 401


def test_view_shows_and_controls(viewer, embedded_desktop):
    parts = urlsplit(viewer.url)
    token = parse_qs(parts.query)["token"][0]
    with httpx.Client(base_url=f"http://{parts.netloc}", trust_env=False) as client:
        page = client.get(viewer.url)
        assert embedded_desktop.id in page.text
        assert "@" not in page.text.replace("@media", "")
        secret = {"X-Token": token}
        # from elsewhere: this test may be tried again
        embedded_desktop.execute("xdotool mousemove 300 300")
        frame = client.get("/frame", headers=secret)
        with Image.open(io.BytesIO(frame.content)) as picture:
            assert picture.size == (1920, 1080)
        events = {"events": [{"type": "move", "x": 77, "y": 88}]}
        assert client.post("/input", json=events, headers=secret).status_code == 200
        assert "x:77 y:88" in embedded_desktop.execute("xdotool getmouselocation").output
        second_answer = client.get("/frame", headers={**secret, "X-Seen": frame.headers["X-Frame"]})
        assert second_answer.status_code == 200  # the pointer is in the picture, and has moved
        again = client.get("/frame", headers={**secret, "X-Seen": second_answer.headers["X-Frame"]})
        assert (again.status_code, again.content) == (204, b"")


@pytest.mark.parametrize("headers", [{}, {"X-Token": "wrong"}, {"X-Token": "é".encode()}])
def test_view_needs_the_token(viewer, headers):
    base = f"http://127.0.0.1:{viewer.server_address[1]}"
    with httpx.Client(base_url=base, trust_env=False, headers=headers) as client:
        assert client.get("/").status_code == 401
        assert client.get("/frame").status_code == 401
        assert client.post("/input", json={}).status_code == 401


def test_view_refuses_other_host_names_and_big_bodies(viewer):
    base = f"http://127.0.0.1:{viewer.server_address[1]}"
    with httpx.Client(base_url=base, trust_env=False, headers={"X-Token": viewer.token}) as client:
        assert client.get("/frame", headers={"Host": "evil.example:80"}).status_code == 401
        assert client.post("/input", content=b"x" * (2 << 20)).status_code == 413
        assert client.get("/nothing").status_code == 404
