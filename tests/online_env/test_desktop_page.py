"""The page of a desktop, and its videos: real HTTP, on a guest that is a small server."""

import contextlib
import http.client
import io
import json
import os
import ssl
import stat
import threading
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import UnixStreamServer
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from PIL import Image

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded import recording, view
from online_env.errors import DesktopError, GuestError
from online_env.recording.person_recorder import _RecordingClient

SCREEN = np.arange(40 * 30 * 3, dtype=np.uint8).reshape(30, 40, 3) // 3 * 3


class _UnixServer(ThreadingHTTPServer):
    address_family = UnixStreamServer.address_family
    daemon_threads = True

    def server_bind(self):
        UnixStreamServer.server_bind(self)


class Guest:
    """Answers on a socket file.

    Attributes:
        answers: status and body by path; the screen, where there is none.
        asked: method, path, token and body of each request.
    """

    def __init__(self, folder):
        self.answers = {}
        self.asked = []
        door = str(folder / "door")
        (folder / "token").write_text("guest's secret", encoding="ascii")
        self.record = {
            "id": "d1",
            "screen": [40, 30],
            "guest": "http://127.0.0.1:9",  # nobody: only the door leads to it
            "door": door,
            "token_file": str(folder / "token"),
        }
        self.server = _UnixServer(door, self._handler())
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()

    def _handler(self):
        guest = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                token = self.headers.get("X-Token")
                guest.asked.append((self.command, self.path, token, body))
                status, data = guest.answers.get(self.path, (200, SCREEN.tobytes()))
                self.send_response(status)
                self.send_header("Content-Length", str(len(data)))
                self.send_header("X-Width", "40")
                self.send_header("X-Height", "30")
                self.end_headers()
                self.wfile.write(data)

            do_GET = do_POST

            def address_string(self):
                return "door"

            def log_message(self, *_):
                pass

        return Handler

    def close(self):
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture(autouse=True)
def no_certificates(monkeypatch):
    """None is looked at here, and to read all that there are takes 0.3 s for each client."""
    monkeypatch.setattr(ssl.SSLContext, "load_verify_locations", lambda *_, **__: None)


@pytest.fixture
def guest(tmp_path):
    result = Guest(tmp_path)
    yield result
    result.close()


@dataclass(frozen=True)
class Button:
    name: str
    on: bool = False


class Panel:
    """Two buttons, of which one darkens the picture."""

    def __init__(self):
        self.on = False

    def all(self):
        return [Button("dark", self.on), Button("other")]

    def press(self, name):
        if name != "dark":
            raise DesktopError(f"no button {name!r}")
        self.on = not self.on
        return Button("dark", self.on)

    def frame(self, screen):
        return (screen // 2, "dark") if self.on else (screen, "")


@contextlib.contextmanager
def page(guest, panel=None):
    """A function that asks the page: method, path, headers (the token is sent if none), body."""
    with view.Viewer(guest.record, buttons=panel) as viewer:
        threading.Thread(target=viewer.serve_forever, args=(0.01,), daemon=True).start()

        def ask(method, path, headers=None, body=None):
            link = http.client.HTTPConnection(*viewer.server_address, timeout=30)
            options = {"X-Token": viewer.token} if headers is None else headers
            link.request(method, path, body, options)
            answer = link.getresponse()
            data = answer.read()
            link.close()
            return answer.status, data, answer.headers

        ask.viewer = viewer
        yield ask
        viewer.shutdown()


def test_the_page_is_given_to_who_has_its_address_only(guest):
    with page(guest) as ask:
        port = ask.viewer.server_address[1]
        token = ask.viewer.token
        assert ask.viewer.url == f"http://127.0.0.1:{port}/?token={token}"
        status, data, headers = ask("GET", f"/?token={token}", {})
        assert status == 200
        assert b"d1" in data
        for mark in (b"@NAME@", b"@WIDTH@", b"@HEIGHT@"):
            assert mark not in data
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cache-Control"] == "no-store"
        for options in (
            {},
            {"X-Token": "x"},
            {"X-Token": token, "Host": "evil.test"},
            {"X-Token": token, "Host": f"evil.test:{port}"},
            {"X-Token": token, "Host": "127.0.0.1"},
        ):
            assert ask("GET", "/frame", options)[0] == 401, options
            assert ask("POST", "/input", options, b"{}")[0] == 401, options
        assert ask("GET", "/frame", {"X-Token": token, "Host": f"localhost:{port}"})[0] == 200
        assert ask("GET", "/other")[:2] == (404, b"there is only / here")
    assert [requests[1] for requests in guest.asked] == ["/ah/frame"]
    assert guest.asked[0][2] == "guest's secret"


def test_a_picture_is_sent_once_until_it_changes(guest):
    panel = Panel()
    with page(guest, panel) as ask:
        status, data, headers = ask("GET", "/frame")
        result = np.asarray(Image.open(io.BytesIO(data)), int)
        assert (status, result.shape) == (200, SCREEN.shape)
        assert abs(result - SCREEN.astype(int)).mean() < 30
        entries = {"X-Token": ask.viewer.token, "X-Seen": headers["X-Frame"]}
        assert ask("GET", "/frame", entries)[:2] == (204, b"")
        panel.on = True
        status, darker, changed_name = ask("GET", "/frame", entries)
        assert status == 200
        assert np.asarray(Image.open(io.BytesIO(darker)), int).mean() < 0.7 * result.mean()
        assert changed_name["X-Frame"] != headers["X-Frame"]


def test_input_goes_to_the_guest_and_its_answer_comes_back(guest):
    guest.answers["/ah/input"] = (400, b'{"message": "events[0]: no"}')
    with page(guest) as ask:
        answer = ask("POST", "/input", body=b'{"events": []}')
        assert answer[:2] == (400, b'{"message": "events[0]: no"}')
        assert guest.asked[-1] == ("POST", "/ah/input", "guest's secret", b'{"events": []}')
        for length in (
            "-1",
            "x",
            "",
            "9" * 9,
            str(view.MOST_INPUT + 1),
            "²".encode().decode("latin1"),
        ):
            headers = {"X-Token": ask.viewer.token, "Content-Length": length}
            assert ask("POST", "/input", headers)[:2] == (413, b"too much input"), length
    assert len(guest.asked) == 1


# httpcore leaves a socket that it could not connect to the collector.
LEFT = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@LEFT
def test_a_desktop_that_does_not_answer_is_told_to_the_page(guest):
    guest.answers["/ah/frame"] = (500, b"")
    with page(guest) as ask:
        status, data, _ = ask("GET", "/frame")
        assert (status, data[:28]) == (502, b"the desktop does not answer:")
        guest.close()
        os.unlink(guest.record["door"])
        for method, path in (("GET", "/frame"), ("POST", "/input")):
            status, data, _ = ask(method, path, body=b"{}" if method == "POST" else None)
            assert (status, data[:28]) == (502, b"the desktop does not answer:")


def test_buttons_are_pressed_by_name(guest):
    with page(guest, Panel()) as ask:
        assert json.loads(ask("GET", "/buttons")[1]) == [
            {"name": "dark", "on": False},
            {"name": "other", "on": False},
        ]
        assert json.loads(ask("POST", "/press", body=b"dark")[1]) == {"name": "dark", "on": True}
        assert ask("POST", "/press", body=b"gone")[:2] == (400, b"no button 'gone'")
        assert ask("POST", "/press", {}, b"dark")[0] == 401
        assert json.loads(ask("GET", "/buttons")[1])[0]["on"]
    with page(guest) as ask:
        assert json.loads(ask("GET", "/buttons")[1]) == []
        assert ask("POST", "/press", body=b"dark")[:2] == (404, b"this page has no buttons")


def test_a_port_that_cannot_be_had_is_told(guest):
    with view.Viewer(guest.record) as first:
        for port in (first.server_address[1], 99999):
            with pytest.raises(DesktopError) as error:
                view.Viewer(guest.record, port)
            assert str(error.value).startswith(f"cannot listen on 127.0.0.1 port {port}: ")
            assert str(error.value).endswith("; give another --port")


@pytest.mark.parametrize(
    ("lasting", "end", "last"),
    [
        (True, "the page, not the desktop", "the page has ended; the desktop goes on"),
        (False, "the page and its desktop", "the page has ended, and the desktop ends with it"),
    ],
)
def test_ctrl_c_ends_the_page_and_says_what_goes_on(guest, monkeypatch, lasting, end, last):
    def interrupted(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(view.Viewer, "serve_forever", interrupted)
    output = []
    opened_paths = []

    def open_page(address):
        opened_paths.append(address)
        file = Path(unquote(urlsplit(address).path))
        assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
        opened_paths.append(file.read_text())

    monkeypatch.setattr(view.webbrowser, "open", open_page)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":7" if lasting else "")
    view.serve(guest.record, 0, output.append, lasting=lasting)
    assert output[0].startswith("watch desktop d1 at http://127.0.0.1:")
    assert bool(opened_paths) == lasting
    if opened_paths:  # the token is in the file, and in no argument
        assert ("token=" in opened_paths[0], "token=" in opened_paths[1]) == (False, True)
    assert output[0].endswith(f"  (Ctrl-C ends {end})")
    assert output[1:] == [last]


# Videos


def test_a_video_is_recorded_for_a_time_or_until_ctrl_c(guest, monkeypatch):
    guest.answers = {"/start_recording": (200, b"{}"), "/end_recording": (200, b"mp4")}
    waited = []

    def sleep(seconds):
        waited.append(seconds)
        raise KeyboardInterrupt

    monkeypatch.setattr(recording.time, "sleep", sleep)
    assert recording.record(guest.record, None) == b"mp4"
    assert recording.record(guest.record, 2.5) == b"mp4"
    assert waited == [86400.0, 2.5]
    assert [path for _, path, *_ in guest.asked] == ["/start_recording", "/end_recording"] * 2


@LEFT
def test_a_video_that_cannot_be_had_says_why(guest):
    guest.answers = {"/start_recording": (501, b"ffmpeg is not installed")}
    with pytest.raises(GuestError) as error:
        recording.record(guest.record, 0)
    assert str(error.value) == "/start_recording answered 501: ffmpeg is not installed"
    assert error.value.status == 501
    guest.close()
    os.unlink(guest.record["door"])
    with pytest.raises(GuestError, match=r"^desktop d1 does not answer: "):
        recording.record(guest.record, 0)


# What a person does on the page


class Client:
    """Passes nothing on, and refuses what is told."""

    def __init__(self, refused=()):
        self.posted = []
        self.refused = refused

    def post(self, path, content, **_):
        self.posted.append((path, content))
        kind = json.loads(content)["events"][0]["type"] if path == "/ah/input" else ""
        return type("Answer", (), {"status_code": 400 if kind in self.refused else 200})


class Actions:
    def __init__(self):
        self.seen = []

    def event(self, event):
        self.seen.append(event["type"])
        if event["type"] == "down":
            _ = event["x"]


def test_each_event_of_a_person_is_recorded_before_it_is_passed_on():
    client = Client(refused=("key",))
    actions = Actions()
    passing = _RecordingClient(client, actions)
    events = [{"type": "move"}, {"type": "down"}, {"type": "key"}, {"type": "up"}]
    answer = passing.post("/ah/input", json.dumps({"events": events}).encode())
    assert answer.status_code == 400
    assert actions.seen == ["move", "down", "key"], "nothing after one that was refused"
    assert [json.loads(content)["events"] for _, content in client.posted] == [
        [event] for event in events[:3]
    ]


@pytest.mark.parametrize("content", [b"{", b"[]", b'{"events": 5}', b'{"events": ["x"]}', b"\xff"])
def test_what_is_no_input_goes_to_the_guest_as_it_is(content):
    client = Client()
    client.post = lambda path, content, **_: (path, content)
    assert _RecordingClient(client, Actions()).post("/ah/input", content) == ("/ah/input", content)
