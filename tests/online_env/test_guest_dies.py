"""A desktop that dies, hangs or lies in the middle of an answer: a real server on a real socket."""

import contextlib
import http.client
import io
import socket
import threading
import time

import pytest
from PIL import Image

pytest.importorskip("urllib3", reason="needs the extra [online]")

from online_env.desktops import client
from online_env.desktops.connection import MAX_TRIES, GuestConnection
from online_env.desktops.http import HttpDesktop
from online_env.desktops.osworld import OsworldDesktop
from online_env.errors import GuestError, MissingCapabilityError

OK = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}"


class Guest:
    """Answers each connection with the next of some bytes, and then closes it."""

    def __init__(self, *answers: bytes) -> None:
        self.answers = list(answers)
        self.asked: list[str] = []
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while self.answers:
                self._answer(self._socket.accept()[0])

    def _answer(self, found: socket.socket) -> None:
        # What is left unread when a socket is closed resets the connection, the answer with it.
        with found, found.makefile("rb") as request:
            line = request.readline()
            self.asked.append(line.decode().rpartition(" ")[0])
            length = http.client.parse_headers(request).get("Content-Length", "0")
            request.read(int(length))
            found.sendall(self.answers.pop(0) if len(self.answers) > 1 else self.answers[0])

    def close(self) -> None:
        self.answers.clear()
        self._socket.close()


@contextlib.contextmanager
def guest(*answers):
    server = Guest(*answers)
    try:
        yield server
    finally:
        server.close()


def test_an_answer_that_breaks_off_is_asked_for_again_and_never_taken_for_whole():
    half = b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\n{"
    with guest(half, half, OK) as server:
        reply = GuestConnection(server.url, None, 20.0).ask("GET", "/screenshot")
    assert (reply.status, bytes(reply.body)) == (200, b"{}")
    assert server.asked == ["GET /screenshot"] * MAX_TRIES


def test_what_changes_the_guest_is_sent_once():
    half = b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\n{"
    with guest(half) as server:
        with pytest.raises(GuestError, match=r"8 more expected.*; does the guest server run"):
            GuestConnection(server.url, None, 20.0).ask("POST", "/execute", b"{}")
        assert server.asked == ["POST /execute"], "a click must not be made twice"


def test_an_answer_of_any_length_does_not_fill_the_memory(monkeypatch):
    monkeypatch.setattr(client, "MAX_ANSWER_BYTES", 1000)
    head = b"HTTP/1.1 200 OK\r\nContent-Length: 1001\r\n\r\n"
    endless = b"HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n" + b"x" * 5000
    for answer in (head, endless):
        with guest(answer, answer) as server:
            with pytest.raises(GuestError, match=r"GET http.*/file: the answer has more than 1000"):
                GuestConnection(server.url, None, 20.0).ask("GET", "/file")
            assert server.asked == ["GET /file"], "it would be as long again"


def test_a_guest_that_is_started_again_is_waited_for():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(GuestError, match="Connection refused"):
        GuestConnection(f"http://127.0.0.1:{port}", None, 20.0).ask("POST", "/execute")
    begun = threading.Event()

    def serve() -> None:
        begun.wait()
        time.sleep(0.2)
        with socket.create_server(("127.0.0.1", port)) as again:
            value, _ = again.accept()
            with value:
                value.recv(65536)
                value.sendall(OK)

    server = threading.Thread(target=serve)
    server.start()
    begun.set()
    reply = GuestConnection(f"http://127.0.0.1:{port}", None, 20.0, restart_timeout=30.0).ask(
        "POST", "/x"
    )
    server.join()
    assert reply.status == 200


@pytest.mark.parametrize("noise", [b"SSH-2.0-OpenSSH_9.2\r\n", b"", b"\0" * 40])
def test_what_is_no_web_server_is_an_error_with_its_address(noise):
    with guest(noise) as server, pytest.raises(GuestError) as error:
        GuestConnection(server.url, None, 20.0).ask("POST", "/execute")
    assert f"POST {server.url}/execute failed" in str(error.value)
    assert "does the guest server run?" in str(error.value)


def test_an_address_that_is_none():
    wrong = ("file:///etc/passwd", "ftp://10.0.0.2", "http://", "http://10.0.0.2:5000x", "[::1")
    below = ("http://10.0.0.2:5000/desktop", "http://10.0.0.2/?guest=2", "10.0.0.2:99999")
    more = ("http://user:secret@10.0.0.2:5000", "user@10.0.0.2", "http://10.0.0.2#desktop")
    for url in (*wrong, *below, *more):
        with pytest.raises(GuestError, match="is not the address of a guest"):
            HttpDesktop(url)


def test_a_token_that_is_refused_is_named_as_that():
    reply = b"HTTP/1.1 401 No\r\nContent-Length: 24\r\n\r\n"
    with guest(reply + b'{"message": "bad token"}') as server:
        desktop = HttpDesktop(server.url, token="old")
        with pytest.raises(GuestError, match=r"refuses the token: bad token") as error:
            desktop.health()
    assert error.value.status == 401


def test_a_plain_osworld_guest_says_what_it_lacks():
    with guest(b"HTTP/1.1 404 No\r\nContent-Length: 0\r\n\r\n") as server:
        desktop = HttpDesktop(server.url)
        with pytest.raises(
            MissingCapabilityError, match="acting on windows needs our guest server"
        ):
            desktop.window("close", id=1)
        with pytest.raises(MissingCapabilityError, match="playing events needs our guest server"):
            desktop.input([{"type": "key"}])
        with pytest.raises(MissingCapabilityError, match="give HttpDesktop a resetter"):
            desktop.reset()


# OSWorld's environment, in the shape that it has


class Controller:
    """Gives what a machine in trouble gives."""

    def __init__(self, picture: object = None, tree: object = None, output: str = "") -> None:
        self.picture = picture
        self.tree = tree
        self.output = output

    def get_screenshot(self) -> object:
        return self.picture

    def get_accessibility_tree(self) -> object:
        return self.tree

    def execute_python_command(self, command: str) -> object:
        return {"status": "success", "output": self.output, "error": "", "returncode": 0}

    def get_file(self, path: str) -> object:
        return None


class Environment:
    action_history = ()

    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    def reset(self, task_config: object = None) -> None: ...

    def step(self, action: object, pause: float = 2) -> None: ...

    def evaluate(self) -> float:
        return 0.0


def on(**trouble):
    return OsworldDesktop(Environment(Controller(**trouble)))


def test_an_osworld_machine_without_a_picture():
    with pytest.raises(GuestError, match="the guest gave no screenshot"):
        on().screenshot()
    with pytest.raises(GuestError, match="the guest gave no screenshot"):
        _ = on(picture=b"").size
    buffer = io.BytesIO()
    Image.effect_noise((64, 48), 90).convert("RGB").save(buffer, "PNG")
    assert on(picture=buffer.getvalue()).size == (48, 64)
    with pytest.raises(GuestError, match="the guest's screenshot can't be read"):
        on(picture=buffer.getvalue()[:1000]).screenshot()
    with pytest.raises(GuestError, match="the guest's screenshot can't be read"):
        on(picture=b"<html>502 Bad Gateway</html>").screenshot()


def test_an_osworld_machine_without_a_tree():
    with pytest.raises(GuestError, match="gave no accessibility tree but NoneType"):
        OsworldDesktop(Environment(Controller()), capabilities=["accessibility"]).accessibility()


def test_an_environment_of_another_shape():
    class Half:
        action_history = ()
        controller = Controller()

        def reset(self) -> None: ...

    with pytest.raises(MissingCapabilityError, match=r"Half is not .*: no step, evaluate"):
        OsworldDesktop(Half())
