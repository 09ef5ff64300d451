"""The connection to a guest survives answers that a client can trip over."""

import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from online_env.desktops import connection as connection_module
from online_env.desktops.connection import GuestConnection
from online_env.desktops.http import HttpDesktop
from online_env.errors import GuestError


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self):
        body = b"" if self.path == "/empty" else b"full"
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


@pytest.fixture
def url():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_an_empty_answer_does_not_block_the_next_request(url):
    connection = GuestConnection(url, None, 5)
    assert [
        bytes(connection.ask("GET", path).body) for path in ("/empty", "/full", "/empty", "/empty")
    ] == [b"", b"full", b"", b""]
    connection.close()


def test_a_request_that_may_leave_from_one_address_only_never_leaves_from_another(url):
    connection = GuestConnection(url, "secret", 5, source="127.0.0.9")
    assert connection.ask("GET", "/full").body == b"full"
    connection.close()
    late_connection = GuestConnection(
        url, "secret", 5, source="10.199.63.253"
    )  # no cable of ours is that old
    with pytest.raises(GuestError, match="failed"):
        late_connection.ask("GET", "/full")
    late_connection.close()


class Posts(Handler):
    do_POST = Handler.do_GET


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_server_that_is_being_started_again_is_waited_for(method, monkeypatch):
    """It comes while the connection pauses after a refusal, the fifth one."""
    with socket.create_server(("127.0.0.1", 0)) as second:
        port = second.getsockname()[1]
    started, pauses = [], []

    def pause(seconds):
        pauses.append(seconds)
        if len(pauses) == 5:
            server = ThreadingHTTPServer(("127.0.0.1", port), Posts)
            threading.Thread(target=server.serve_forever).start()
            started.append(server)

    monkeypatch.setattr(connection_module.time, "sleep", pause)
    url = f"http://127.0.0.1:{port}"
    try:
        connection = GuestConnection(url, None, 60, restart_timeout=60)
        assert connection.ask(method, "/full").body == b"full"
        connection.close()
        assert len(pauses) == 5
    finally:
        for server in started:
            server.shutdown()
            server.server_close()
    pauses[:] = []
    with pytest.raises(GuestError, match=r"refused.*does the guest server run"):
        GuestConnection(url, None, 60).ask(method, "/full")
    assert len(pauses) == (2 if method == "GET" else 0)


def test_the_address_of_a_guest_may_change_with_a_reset(url):
    with HttpDesktop("http://127.0.0.1:9", resetter=lambda task: url, timeout=5) as desktop:
        desktop.reset()
        assert desktop.url == url
        assert desktop._connection.ask("GET", "/full").body == b"full"


class Hostile(Handler):
    def do_GET(self):
        answers = {
            "/elsewhere": b"HTTP/1.1 302 Found\r\nLocation: /full\r\nContent-Length: 0\r\n\r\n",
            "/huge": b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n",
            "/short": b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\nfull",
            "/zipped": b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 1\r\n\r\nx",
            "/rubbish": b"rubbish\r\n\r\n",
        }
        self.wfile.write(answers.get(self.path, answers["/elsewhere"].replace(b"302", b"200")))
        self.close_connection = self.path in ("/huge", "/short", "/rubbish")


@pytest.fixture
def hostile():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hostile)
    threading.Thread(target=server.serve_forever).start()
    connection = GuestConnection(f"http://127.0.0.1:{server.server_port}", None, 5)
    yield connection
    connection.close()
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize(
    ("path", "words"),
    [("/huge", ": the answer has more than"), ("/short", " failed"), ("/rubbish", " failed")],
)
def test_an_answer_that_lies_is_an_error_and_the_next_one_is_read_as_its_own(hostile, path, words):
    with pytest.raises(GuestError, match=f"GET .*{path}{words}"):
        hostile.ask("GET", path)
    assert hostile.ask("GET", "/fine").status == 200


def test_redirects_are_not_followed_and_content_is_not_unpacked(hostile):
    assert hostile.ask("GET", "/elsewhere").status == 302
    assert hostile.ask("GET", "/zipped").body == b"x"


def test_a_door_in_the_file_system_leads_to_the_guest(tmp_path):
    door = str(tmp_path / "door")
    connection = GuestConnection("http://desktop", None, 5, door=door)
    with pytest.raises(GuestError, match="No such file"):
        connection.ask("POST", "/full")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(door)
        listener.listen()

        def answer():
            caller, _ = listener.accept()
            with caller:
                caller.recv(65536)
                caller.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nfull")

        thread = threading.Thread(target=answer)
        thread.start()
        assert connection.ask("POST", "/full", b"{}").body == b"full"
        thread.join()
    connection.close()


def test_an_answer_that_does_not_come_names_the_limit():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(GuestError, match=r"was not answered within 0\.2 s"):
            GuestConnection(url, None, 5).ask("GET", "/full", timeout=0.2)


def guest_that(answers):
    """A handler that gives, for each path, one answer after the other; the last one for good."""

    class Guest(Handler):
        def do_GET(self):
            answer = answers[self.path]
            status, headers, body = answer.pop(0) if len(answer) > 1 else answer[0]
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    return Guest


@pytest.fixture
def desktop_of():
    servers = []

    def make(**answers):
        handler = guest_that({f"/ah/{name}": value for name, value in answers.items()})
        servers.append(ThreadingHTTPServer(("127.0.0.1", 0), handler))
        threading.Thread(target=servers[-1].serve_forever).start()
        return HttpDesktop(f"http://127.0.0.1:{servers[-1].server_port}", timeout=5)

    yield make
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize("status", [500, 502, 503])
def test_a_server_of_ours_that_fails_once_is_not_taken_for_a_plain_guest(desktop_of, status):
    desktop = desktop_of(health=[(status, {}, b"starting"), (200, {}, b"{}")])
    with pytest.raises(GuestError, match=f"/ah/health answered {status}: starting"):
        _ = desktop.is_ours
    assert desktop.is_ours


@pytest.mark.parametrize(
    ("width", "height"), [("abc", "1"), ("-2", "-1"), ("2", ""), ("9" * 5000, "1"), ("²", "1")]
)
def test_a_frame_whose_size_is_no_size_is_an_error_of_the_guest(desktop_of, width, height):
    sizes = {"X-Width": width, "X-Height": height}
    desktop = desktop_of(health=[(200, {}, b"{}")], frame=[(200, sizes, b"123456")])
    with pytest.raises(GuestError, match="/ah/frame sent 6 bytes for a frame of"):
        desktop.screenshot()


def test_an_answer_without_windows_is_an_error_of_the_guest(desktop_of):
    desktop = desktop_of(health=[(200, {}, b"{}")], windows=[(200, {}, b"{}")])
    with pytest.raises(GuestError, match="/ah/windows answered without windows"):
        desktop.windows()
