"""`HttpDesktop` against our guest, against its OSWorld mode, and against servers that misbehave."""

import http.server
import json
import threading

import numpy as np
import pytest

from online_env.desktops.http import HttpDesktop
from online_env.errors import GuestError, MissingCapabilityError


@pytest.fixture(scope="module")
def desktop(session):
    with HttpDesktop(session.url, session.token) as desktop:
        yield desktop


def test_health_and_size_of_a_screen_that_may_change(desktop, session):
    assert desktop.size == (session.screen[1], session.screen[0])
    assert desktop.health()["ready"]


def test_frame_and_png_are_the_same_picture_with_the_pointer(desktop, session):
    import io

    from PIL import Image

    desktop.input([{"type": "move", "x": 640, "y": 500}])
    frame = desktop.screenshot()
    assert frame.dtype == np.uint8
    assert frame.flags.writeable
    png = np.asarray(Image.open(io.BytesIO(session.client.get("/screenshot").content)))
    clock = session.screen[1] - 40  # the panel's clock may turn
    assert (frame[:clock] == png[:clock]).all()
    desktop.input([{"type": "move", "x": 900, "y": 600}])
    second_frame = desktop.screenshot()
    changed_pixels = np.argwhere((frame[:clock] != second_frame[:clock]).any(axis=2))
    near = [(abs(changed_pixels - point) < 40).all(axis=1) for point in ((500, 640), (600, 900))]
    assert near[0].any()
    assert near[1].any()
    assert (near[0] | near[1]).all()


def test_pointer_at_every_edge(desktop, session):
    width, height = session.screen
    for x, y in ((0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)):
        desktop.input([{"type": "move", "x": x, "y": y}])
        assert desktop.screenshot().shape == (height, width, 3)


def test_files_say_why_they_cannot_be_had(desktop):
    data = bytes(range(256)) * 5000 + b"\r\n--"
    desktop.write_file('~/Documents/ü & "x".bin', data)
    assert desktop.read_file('~/Documents/ü & "x".bin') == data
    with pytest.raises(GuestError, match="answered 404") as missing:
        desktop.read_file("~/none")
    assert missing.value.status == 404
    with pytest.raises(GuestError, match="may not use /etc/shadow"):
        desktop.read_file("/etc/shadow")


def test_a_button_that_is_not_there_is_a_failure(desktop):
    assert desktop.run("pyautogui.moveTo(77, 88)").ok
    assert desktop.run("pyautogui.click(1, 1, button='fourth')").returncode == 1


def test_windows_and_input(desktop, session, eventually):
    session.close_windows()
    desktop.launch(["mousepad"])
    row = eventually(
        "the window", lambda: [row for row in desktop.windows() if "Mousepad" in row["title"]]
    )[0]
    desktop.window("place", id=row["id"], box=[50, 60, 650, 460])

    def placed():
        return next(r["box"] for r in desktop.windows() if r["id"] == row["id"]) == [
            50,
            60,
            650,
            460,
        ]

    eventually("its place", placed)
    assert "Mousepad" in desktop.accessibility()
    with pytest.raises(GuestError, match=r"events\[0\]"):
        desktop.input([{"type": "nothing"}])
    session.close_windows()


def test_wrong_token_and_reset(session):
    with (
        HttpDesktop(session.url, "wrong") as wrong,
        pytest.raises(GuestError, match="refuses the token") as error,
    ):
        wrong.screenshot()
    assert error.value.status == 401
    with (
        HttpDesktop(session.url, session.token) as desktop,
        pytest.raises(MissingCapabilityError, match="resetter"),
    ):
        desktop.reset()
    requests = []
    with HttpDesktop(session.url, session.token, resetter=requests.append) as desktop:
        desktop.reset({"id": "t"})
        assert requests == [{"id": "t"}]
        assert desktop.screenshot().any()


def test_one_client_from_several_threads(desktop):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(4) as pool:
        results = list(
            pool.map(lambda n: desktop.execute(["echo", str(n)]).output.strip(), range(20))
        )
    assert results == [str(n) for n in range(20)]


@pytest.mark.parametrize("url", ["ftp://x", "", "http://"])
def test_bad_addresses(url):
    with pytest.raises(GuestError, match="address of a guest"):
        HttpDesktop(url)


def test_nobody_there():
    with (
        HttpDesktop("http://127.0.0.1:9", timeout=1) as desktop,
        pytest.raises(GuestError, match="does the guest server run"),
    ):
        desktop.screenshot()


class Odd(http.server.BaseHTTPRequestHandler):
    """A plain OSWorld guest that answers nonsense, or drops every second connection."""

    protocol_version = "HTTP/1.1"
    answers: dict[str, tuple[int, bytes]]
    dropped: list[str]
    drop_first = False

    def do_GET(self):
        if self.drop_first and self.path not in self.dropped:
            self.dropped.append(self.path)
            self.close_connection = True
            return
        status, body = self.answers.get(self.path, (404, b"{}"))
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        self.do_GET()

    def log_message(self, *_):
        pass


@pytest.fixture
def odd():
    handler = type("Handler", (Odd,), {"answers": {}, "dropped": []})
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with HttpDesktop(f"http://127.0.0.1:{server.server_port}", timeout=5) as desktop:
            yield desktop, handler
        server.shutdown()


@pytest.mark.parametrize(
    ("path", "answer", "act", "message"),
    [
        ("/screenshot", (200, b"not a png"), lambda d: d.screenshot(), "not a picture"),
        ("/screenshot", (500, b'{"message": "broken"}'), lambda d: d.screenshot(), "500: broken"),
        ("/accessibility", (200, b"[" * 50_000), lambda d: d.accessibility(), "without a tree"),
        ("/accessibility", (200, b'{"AT": 5}'), lambda d: d.accessibility(), "without a tree"),
        ("/screen_size", (200, b'{"width": "wide"}'), lambda d: d.size, "not a width and a height"),
        ("/execute", (500, b"<html>"), lambda d: d.execute(["ls"]), "500"),
    ],
)
def test_odd_answers(odd, path, answer, act, message):
    desktop, handler = odd
    handler.answers[path] = answer
    with pytest.raises(GuestError, match=message):
        act(desktop)


def test_plain_osworld_guest(odd):
    desktop, handler = odd
    listed = "0x02000007  0 123  10 20 300 200 thunar.Thunar  host usr - Thunar\n"
    answer = {"status": "success", "output": listed, "error": "", "returncode": 0}
    handler.answers["/execute"] = (200, json.dumps(answer).encode())
    assert desktop.windows() == [
        {
            "id": 0x2000007,
            "pid": 123,
            "class": "thunar.Thunar",
            "title": "usr - Thunar",
            "box": [10, 20, 310, 220],
        }
    ]
    with pytest.raises(MissingCapabilityError, match=r"run\(code\)"):
        desktop.input([])


def test_reading_is_repeated_when_a_connection_breaks_and_acting_is_not(odd):
    desktop, handler = odd
    handler.answers |= {
        "/accessibility": (200, b'{"AT": "<a/>"}'),
        "/execute": (200, b'{"status": "success"}'),
    }
    handler.drop_first = True
    assert desktop.accessibility() == "<a/>"
    with pytest.raises(GuestError, match="failed"):
        desktop.execute(["ls"])
    assert desktop.execute(["ls"]).status == "success"
