"""The server of `hijack view`: what it answers over HTTP, and to whom."""

import contextlib
import http.client
import json
import re
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hijack_data.errors import HijackError
from pipelines import open_dataset
from pipelines.viewer.opening import open_source
from pipelines.viewer.server import ViewServer

from support.viewing import read, served


@pytest.fixture
def serving() -> Iterator[Callable[[Path], Any]]:
    """Serve a folder and return a function that gets from it: `get(path, **headers)`."""
    with contextlib.ExitStack() as servers:
        yield lambda folder: partial(fetch, servers.enter_context(served(folder)))


def fetch(server: ViewServer, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    """The status, body and headers that a path is answered with; the cookie is sent."""
    link = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=30)
    headers = {"Cookie": f"{server.cookie}={server.token}"} | headers
    with contextlib.closing(link):
        link.request("GET", path, headers=headers)
        answer = link.getresponse()
        return answer.status, answer.read(), dict(answer.getheaders())


def test_answers_over_http(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    status, page, headers = get("/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "Access-Control-Allow-Origin" not in headers
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    for path in re.findall(rb'(?:src|href)="([a-z.]+)"', page):
        assert get(f"/{path.decode()}")[0] == 200
    assert json.loads(get("/api/about")[1])["rows"] == 30
    assert json.loads(get("/api/rows?corruption=marks&q=")[1])["found"] == 6
    assert json.loads(get("/api/row?row=t0%2F0001%2Fmarks")[1])["id"] == "t0/0001/marks"
    status, picture, headers = get("/picture/4")
    assert (status, headers["Content-Type"]) == (200, "image/png")
    assert np.array_equal(read(picture), np.array(open_dataset(dataset)[4]["screenshot"]))
    assert get("/thumb/4")[2]["Content-Type"] == "image/jpeg"
    assert np.array_equal(
        read(get("/before/4")[1]), np.array(open_dataset(dataset)[0]["screenshot"])
    )


def test_there_is_nothing_else(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    pictures = (
        "/thumb/30",
        "/thumb/-1",
        "/thumb/1x",
        "/thumb/",
        "/picture/9999999999",
        "/picture/../manifest.json",
    )
    files = (
        "/manifest.json",
        "/../manifest.json",
        "/%2e%2e/manifest.json",
        "//etc/passwd",
        "/view.html",
        "/api",
        "*",
    )
    for path in (*pictures, *files):
        status, body, _ = get(path)
        assert (status, body) == (404, b"there is nothing here"), path


def test_mistakes_are_answers(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    for path, words in (
        ("/api/row", b"no row"),
        ("/api/rows?x=1", b"no filter 'x'"),
        ("/api/row?row=%ff%00", b"no row"),
    ):
        status, body, headers = get(path)
        assert (status, headers["Content-Type"]) == (422, "text/plain; charset=utf-8")
        assert words in body


def test_only_our_own_names_are_answered(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    for host in ("127.0.0.1:1234", "localhost:99", "LOCALHOST"):
        assert get("/api/about", Host=host)[0] == 200, host
    for host in (
        "evil.example",
        "evil.example:80",
        "127.0.0.1.evil.example",
        "",
        "[::1]:80",
        "0.0.0.0:80",
    ):
        for path in ("/", "/api/about", "/picture/0", "/nothing"):
            assert get(path, Host=host)[0] == 403, host


def test_only_the_address_with_the_token_is_answered(dataset: Path) -> None:
    """Another user of the machine can connect, but has no token."""
    with served(dataset) as server, served(dataset) as second:
        for cookie in ("", f"{server.cookie}=", f"{server.cookie}={second.token}", "a=b; ;=\x00"):
            for path in ("/", "/api/about", "/picture/0", f"/?token={second.token}", "/?token="):
                assert fetch(server, path, Cookie=cookie)[0] == 401, (cookie, path)
        for path, target in (("/", "/"), ("//evil.example/x", "/evil.example/x")):
            status, _, headers = fetch(server, f"{path}?token={server.token}", Cookie="")
            assert (status, headers["Location"]) == (303, target)
            cookie = headers["Set-Cookie"]
            assert {"HttpOnly", "SameSite=Strict"} <= set(cookie.split("; "))
            assert fetch(server, "/api/about", Cookie=cookie.partition(";")[0])[0] == 200


def test_a_port_that_is_taken_is_an_error(dataset: Path) -> None:
    source = open_source(dataset)
    with ViewServer(source) as first, pytest.raises(HijackError, match="give another --port"):
        ViewServer(source, int(first.server_address[1]))
    with pytest.raises(HijackError, match="port 99999"):
        ViewServer(source, 99999)


def test_many_at_once_get_the_same(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    alone = [get(f"/picture/{number}")[1] for number in range(8)]
    again = serving(dataset)
    entries: dict[int, bytes] = {}
    threads = [
        threading.Thread(target=lambda n=n: entries.update({n: again(f"/picture/{n}")[1]}))
        for n in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert [entries[number] for number in range(8)] == alone
