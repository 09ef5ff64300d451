"""A desktop behind a plain OSWorld guest: a real HTTP server on loopback, without our routes."""

import email
import email.policy
import io
import json
import struct
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs
from zlib import crc32

import numpy as np
import pytest
from PIL import Image

from support import needs

pytest.importorskip("urllib3", reason=needs.ONLINE)

from online_env.desktops.http import PREFIX, HttpDesktop
from online_env.errors import GuestError, MissingCapabilityError


class PlainGuest:
    """What the server answers by path, as (status, body), and what it was asked."""

    def __init__(self) -> None:
        self.answers: dict[str, tuple[int, bytes]] = {"/platform": (200, b"Linux")}
        self.headers: dict[str, str] = {}
        self.asked: list[tuple[str, str, str, bytes]] = []

    def says(self, path: str, answer: object, status: int = 200) -> None:
        body = answer if isinstance(answer, bytes) else json.dumps(answer).encode()
        self.answers[path] = status, body

    def last(self) -> dict[str, Any]:
        """Return the JSON that came last."""
        return json.loads(self.asked[-1][3])


@pytest.fixture
def guest() -> PlainGuest:
    return PlainGuest()


@pytest.fixture
def desktop(guest: PlainGuest) -> Iterator[HttpDesktop]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            kind = self.headers.get("Content-Type", "")
            guest.asked.append((self.command, self.path, kind, self.rfile.read(length)))
            status, body = guest.answers.get(self.path, (404, b"no such route"))
            self.send_response(status)
            for name, value in {**guest.headers, "Content-Length": str(len(body))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    with HttpDesktop(f"http://127.0.0.1:{server.server_port}", timeout=5) as http_desktop:
        yield http_desktop
    server.shutdown()
    thread.join()
    server.server_close()


def png(picture: Image.Image) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def test_a_guest_without_our_routes_is_asked_once_whether_it_is_ours(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    assert not desktop.is_ours
    assert not desktop.is_ours
    assert [path for _, path, _, _ in guest.asked] == ["/ah/health"]
    assert desktop.health() == {"ready": True}
    guest.says("/platform", b"", 503)
    assert desktop.health() == {"ready": False}


def test_a_picture_of_any_mode_is_a_screen_in_colours(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    picture = Image.new("RGBA", (3, 2), (10, 20, 30, 0))
    guest.says("/screenshot", png(picture))
    screen = desktop.screenshot()
    assert (screen.shape, screen.dtype, screen.flags.writeable) == ((2, 3, 3), np.uint8, True)
    assert screen[0, 0].tolist() == [10, 20, 30]
    guest.says("/screenshot", png(picture.convert("1")))
    assert desktop.screenshot().shape == (2, 3, 3)


@pytest.mark.parametrize("data", [b"", b"<html>", b"\x89PNG\r\n\x1a\n", "cut off"])
def test_what_is_no_picture_is_an_error_of_the_guest(
    desktop: HttpDesktop, guest: PlainGuest, data: bytes | str
) -> None:
    if data == "cut off":
        data = png(Image.effect_noise((99, 99), 50))[:2000]
    guest.says("/screenshot", data)
    with pytest.raises(GuestError, match="/screenshot sent something that is not a picture: "):
        desktop.screenshot()


def test_a_picture_that_would_fill_the_memory_is_not_read(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    header = b"IHDR" + struct.pack(">2I5B", 70_000, 1000, 8, 0, 0, 0, 0)
    chunks = [header, b"IDAT"]
    parts = [struct.pack(">I", len(c) - 4) + c + struct.pack(">I", crc32(c)) for c in chunks]
    guest.says("/screenshot", b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    with pytest.raises(GuestError, match="70000x1000 pixels are more than 67108864"):
        desktop.screenshot()


@pytest.mark.parametrize(
    "answer",
    [{}, {"width": 10}, {"width": "10", "height": "20"}, {"width": 1.5, "height": 2}, [], b"?"],
)
def test_a_size_that_is_none_is_an_error_of_the_guest(
    desktop: HttpDesktop, guest: PlainGuest, answer: object
) -> None:
    guest.says("/screen_size", answer)
    with pytest.raises(GuestError, match=r"/screen_size answered .*, not a width and a height"):
        _ = desktop.size


def test_a_size_may_change_and_one_that_is_given_is_not_asked_for(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    guest.says("/screen_size", {"width": 1920, "height": 1080})
    assert desktop.size == (1080, 1920)
    guest.says("/screen_size", {"width": 800, "height": 600})
    assert desktop.size == (600, 800)
    requests = len(guest.asked)
    assert HttpDesktop(desktop.url, size=(1, 2)).size == (1, 2)
    assert len(guest.asked) == requests


def test_a_tree_is_a_text(desktop: HttpDesktop, guest: PlainGuest) -> None:
    guest.says("/accessibility", {"AT": "<desktop-frame name='Ä'/>"})
    assert desktop.accessibility() == "<desktop-frame name='Ä'/>"
    for nothing in ({"AT": None}, {}, b"<desktop-frame/>"):
        guest.says("/accessibility", nothing)
        with pytest.raises(GuestError, match="/accessibility answered without a tree"):
            desktop.accessibility()


def test_code_runs_after_what_osworld_puts_before_it(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    entries = {"status": "success", "output": "ü\n", "error": "", "returncode": 0}
    guest.says("/execute", entries)
    assert vars(desktop.run("print('ü')")) == entries
    command = ["python", "-c", f"{PREFIX}print('ü')"]
    assert guest.last() == {"command": command, "shell": False, "timeout": 60}
    desktop.execute("ls | wc", timeout=3)
    assert guest.last() == {"command": "ls | wc", "shell": True, "timeout": 3}
    guest.says("/execute", {"status": "success", "output": None, "returncode": "0"})
    result = desktop.execute(["true"])
    assert (result.output, result.error, result.returncode) == ("", "", None)


@pytest.mark.parametrize("status", [500, 504])
def test_a_command_that_fails_in_the_guest_is_a_result(
    desktop: HttpDesktop, guest: PlainGuest, status: int
) -> None:
    guest.says("/execute", {"status": "error", "message": "Command timed out"}, status)
    result = desktop.execute(["sleep", "99"])
    assert (result.status, result.error, result.returncode) == ("error", "Command timed out", None)


@pytest.mark.parametrize(
    ("status", "body"), [(500, b"<h1>broken</h1>"), (400, b'{"status": "error"}'), (404, b"none")]
)
def test_a_server_that_refuses_a_command_is_an_error(
    desktop: HttpDesktop, guest: PlainGuest, status: int, body: bytes
) -> None:
    guest.says("/execute", body, status)
    with pytest.raises(GuestError) as caught:
        desktop.execute(["true"])
    words = body.decode()
    assert str(caught.value) == f"POST {desktop.url}/execute answered {status}: {words}"
    assert caught.value.status == status


@pytest.mark.parametrize("path", ["/home/user/a b.txt", "/tmp/50% & more=?.txt", "/tmp/ü/設定"])
def test_a_file_is_asked_for_by_its_whole_path(
    desktop: HttpDesktop, guest: PlainGuest, path: str
) -> None:
    guest.says("/file", b"\x00\xff")
    assert desktop.read_file(path) == b"\x00\xff"
    method, _, kind, body = guest.asked[-1]
    assert (method, kind) == ("POST", "application/x-www-form-urlencoded")
    assert parse_qs(body.decode("ascii"), strict_parsing=True) == {"file_path": [path]}
    guest.says("/file", {"error": "File not found"}, 404)
    with pytest.raises(GuestError, match=r"/file answered 404: File not found$"):
        desktop.read_file(path)


def test_a_file_arrives_as_it_was_sent(desktop: HttpDesktop, guest: PlainGuest) -> None:
    guest.says("/setup/upload", b"")
    data = bytes(range(256)) + b"\r\n--boundary\r\n"
    desktop.write_file("/tmp/ü.bin", data)
    _, _, kind, body = guest.asked[-1]
    message = email.message_from_bytes(
        f"Content-Type: {kind}\r\n\r\n".encode() + body, policy=email.policy.HTTP
    )
    path, file = message.iter_parts()
    assert path.get_payload(decode=True).decode() == "/tmp/ü.bin"
    assert file.get_payload(decode=True) == data


def test_windows_are_read_from_what_wmctrl_lists(desktop: HttpDesktop, guest: PlainGuest) -> None:
    listed = (
        "0x01600007 -1 812    0    1040 1920 40   xfce4-panel.Xfce4-panel  host xfce4-panel\n"
        "0x0220000a  0 901    -5   -30  800  600  thunar.Thunar         host Ä - Thunar\n"
        "0x02400003  0 0      10   20   30   40   xmessage.Xmessage     N/A \n"
        "Cannot read the class of a window\n"
    )
    guest.says("/execute", {"status": "success", "output": listed, "returncode": 0})
    result = desktop.windows()
    assert [list(window.values()) for window in result] == [
        [0x1600007, 812, "xfce4-panel.Xfce4-panel", "xfce4-panel", [0, 1040, 1920, 1080]],
        [0x220000A, 901, "thunar.Thunar", "Ä - Thunar", [-5, -30, 795, 570]],
        [0x2400003, 0, "xmessage.Xmessage", "", [10, 20, 40, 60]],
    ]
    assert list(result[0]) == ["id", "pid", "class", "title", "box"]
    guest.says("/execute", {"status": "success", "error": "not found\n", "returncode": 127})
    with pytest.raises(MissingCapabilityError, match="windows: not found; install wmctrl there"):
        desktop.windows()


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda desktop: desktop.tool("xtool", "state", {}), "what effects look at needs our"),
        (lambda desktop: desktop.window("close", id=1), "acting on windows needs our guest server"),
        (lambda desktop: desktop.input([]), "playing events needs our guest server; use run"),
        (lambda desktop: desktop.reset(), "can't be reset over HTTP: give HttpDesktop a resetter"),
    ],
)
def test_what_a_plain_guest_cannot_do_is_said(desktop: HttpDesktop, act: Any, words: str) -> None:
    with pytest.raises(MissingCapabilityError, match=words):
        act(desktop)


def test_what_is_known_of_a_guest_is_asked_again_where_a_reset_gave_another(
    desktop: HttpDesktop, guest: PlainGuest
) -> None:
    tasks: list[Any] = []

    def reset(task: Any) -> str | None:
        tasks.append(task)
        return desktop.url if task else None

    guest.says("/ah/health", {"ready": True})
    with HttpDesktop(desktop.url, resetter=reset) as http_desktop:
        assert http_desktop.is_ours
        guest.answers.pop("/ah/health")
        http_desktop.reset()
        assert http_desktop.is_ours, "the same guest as before"
        http_desktop.reset({"id": "a"})
        assert not http_desktop.is_ours
    assert tasks == [None, {"id": "a"}]


def test_an_empty_frame_is_no_picture(desktop: HttpDesktop, guest: PlainGuest) -> None:
    guest.says("/ah/health", {"ready": True})  # our own server, then
    guest.says("/ah/frame", b"")
    guest.headers = {"X-Width": "10", "X-Height": "0"}
    with pytest.raises(GuestError, match="/ah/frame sent 0 bytes for a frame of 10x0"):
        desktop.screenshot()
