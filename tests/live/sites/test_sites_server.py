"""The web server: hosts, paths, methods, bodies, ports."""

import os
import socket
from collections.abc import Callable
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from online_env.embedded.sites import HOSTS
from online_env.embedded.sites.hosts_and_dates import host_name
from online_env.embedded.sites.server import bind


def test_connectivity_probe(web: Any) -> None:
    reply = web.get("http://search.test/generate_204")
    assert (reply.status_code, reply.content) == (204, b"")


@pytest.mark.parametrize("host", ["example.com", "test", "127.0.0.1", "search.test.evil", ""])
def test_unknown_hosts_are_refused(web: Any, host: str) -> None:
    assert web.ask("GET", "http://search.test/", headers={"Host": host}).status_code == 421


@pytest.mark.parametrize("host", ["SHOP.test", "shop.test:80", "shop.test."])
def test_hosts_are_known_however_they_are_spelled(web: Any, host: str) -> None:
    assert "Alder" in web.ask("GET", "http://shop.test/", headers={"Host": host}).text


@given(st.text(max_size=40))
def test_host_names_never_fail(text: str) -> None:
    assert host_name(text) == host_name(text).lower()


@pytest.mark.parametrize("host", HOSTS)
def test_missing_pages_look_like_the_site(web: Any, host: str, parse: Callable[[str], Any]) -> None:
    reply = web.get(f"http://{host}/no/such/page")
    assert reply.status_code == 404
    assert f"/static/{host.split('.')[0]}.css" in reply.text
    assert parse(reply.text).problems == []


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/..%2fapp.py",
        "/static/%2e%2e/app.py",
        "/static/%2e%2e%2f%2e%2e%2f%2e%2e%2fetc/passwd",
        "/static//etc/passwd",
        "/static/%00",
        "/static/base.css/../../app.py",
        "/static/",
        "/../../etc/passwd",
        "/static/pictures",
    ],
)
def test_paths_cannot_leave_the_static_folder(web: Any, path: str) -> None:
    with socket.create_connection(
        ("127.0.0.1", web.http), timeout=5
    ) as link:  # no client tidies up the path on the way
        link.sendall(
            f"GET {path} HTTP/1.1\r\nHost: shop.test\r\nConnection: close\r\n\r\n".encode()
        )
        reply = b"".join(iter(lambda: link.recv(65536), b""))
    assert reply.startswith(b"HTTP/1.1 404 ")
    assert b"root:" not in reply
    assert b"import " not in reply


def test_head_has_the_headers_of_get_and_no_body(web: Any) -> None:
    get, head = (web.ask(m, "http://news.test/") for m in ("GET", "HEAD"))
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-length"] == str(len(get.content))
    assert web.ask("HEAD", "http://news.test/nope").status_code == 404
    assert web.ask("HEAD", "http://shop.test/static/base.css").status_code == 200


@pytest.mark.parametrize(
    ("method", "url"),
    [
        ("POST", "http://search.test/"),
        ("GET", "http://shop.test/cart/add"),
        ("DELETE", "http://shop.test/cart"),
        ("PUT", "http://wiki.test/edit/Tea"),
        ("GET", "http://mail.test/send"),
        ("OPTIONS", "http://docs.test/faq"),
    ],
)
def test_wrong_methods_are_refused_and_the_right_ones_named(
    web: Any, method: str, url: str
) -> None:
    reply = web.ask(method, url)
    assert reply.status_code == 405
    assert reply.headers["allow"]
    assert method not in reply.headers["allow"].split(", ")


def test_large_bodies_are_refused_whether_or_not_they_say_their_size(fresh: Any) -> None:
    url = "http://forms.test/register"
    kind = {"Content-Type": "application/x-www-form-urlencoded"}
    assert (
        fresh.ask("POST", url, content=b"name=" + b"x" * 300_000, headers=kind).status_code == 413
    )
    chunks = (b"x" * 10_000 for _ in range(60))
    assert fresh.ask("POST", url, content=chunks, headers=kind).status_code == 413
    assert fresh.state.read("forms") == {}
    assert fresh.get(url).status_code == 200


@pytest.mark.parametrize("size", ["9999999999", "-1", "99999999999999999999999999"])
def test_a_size_that_is_too_large_is_refused_before_the_body_comes(web: Any, size: str) -> None:
    with socket.create_connection(("127.0.0.1", web.http), timeout=5) as link:
        link.sendall(
            f"POST /register HTTP/1.1\r\nHost: forms.test\r\nContent-Length: {size}\r\n\r\n".encode()
        )
        assert link.recv(100).startswith((b"HTTP/1.1 413 ", b"HTTP/1.1 400 "))


@pytest.mark.parametrize(
    ("kind", "body", "status"),
    [
        ("multipart/form-data; boundary=x", b"--x--", 415),
        ("application/json", b"{}", 415),
        ("", b"name=x", 415),
        ("application/x-www-form-urlencoded", b"&".join(b"a=b" for _ in range(500)), 400),
        ("application/x-www-form-urlencoded", b"\xff\xfe\x00=%ff%00", 422),
    ],
)
def test_bodies_that_are_no_form_are_refused(web: Any, kind: str, body: bytes, status: int) -> None:
    reply = web.ask(
        "POST", "http://forms.test/register", content=body, headers={"Content-Type": kind}
    )
    assert reply.status_code == status


def test_garbage_on_the_socket_does_not_end_the_server(web: Any) -> None:
    for garbage in (
        b"\0" * 100,
        b"GET\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"\x16\x03\x01" + os.urandom(200),
    ):
        with socket.create_connection(("127.0.0.1", web.http), timeout=5) as link:
            link.sendall(garbage)
    assert web.get("http://search.test/generate_204").status_code == 204


def test_ports_that_are_taken_and_bad_arguments_are_reported(
    web: Any, tmp_path: Path, server: Callable[..., Any]
) -> None:
    for options, words in (
        (["--dns-port", "0", "--http-port", str(web.http)], "cannot listen on 127.0.0.1 port"),
        (
            ["--dns-port", str(web.dns), "--http-port", "0"],
            "DNS of the local internet cannot listen",
        ),
        (["--dns-port", "99999"], "no port"),
        (["--address", "here"], "no IPv4 address"),
        (["--dns-port", "0", "--http-port", "0", "--state", "/proc/nope"], "cannot be made"),
    ):
        process = server(tmp_path, *options)
        out, complaint = process.communicate(timeout=20)
        assert process.returncode == 2
        assert out == ""
        assert words in complaint
        assert "Traceback" not in complaint


def test_the_web_socket_is_known_to_be_tcp() -> None:
    """Else asyncio leaves out TCP_NODELAY and every page waits 40 ms for an acknowledgement."""
    bound = bind(IPv4Address("127.0.0.1"), 0, 0)
    try:
        assert bound.http.proto == socket.IPPROTO_TCP
        assert all(port > 0 for port in bound.ports)
    finally:
        bound.http.close()
        bound.dns.close()
