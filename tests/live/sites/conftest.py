"""The local internet on loopback ports, and what its pages are checked with."""

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import urljoin, urlsplit

import pytest

from support import needs

httpx = pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites import HOSTS, SiteState  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
OURS = "10.77.0.1"
GOOD = {
    "name": "Zoë O'Neill",
    "email": "zoe@mail.test",
    "birth_date": "1990-05-17",
    "country": "Norway",
    "course": "chess",
    "level": "some",
    "interests": ["volunteer", "carpool"],
    "notes": "Ω < ω\nsecond line",
    "agree": "yes",
}


@dataclass
class Internet:
    """A running server."""

    process: "subprocess.Popen[str]"
    dns: int
    http: int
    folder: Path
    client: Any

    def ask(self, method: str, url: str, **options: Any) -> Any:
        parts = urlsplit(url)
        path = parts.path + (f"?{parts.query}" if parts.query else "")
        headers = {"Host": parts.netloc, **options.pop("headers", {})}
        return self.client.request(
            method, f"http://127.0.0.1:{self.http}{path}", headers=headers, **options
        )

    def get(self, url: str) -> Any:
        return self.ask("GET", url)

    def post(self, url: str, **data: Any) -> Any:
        return self.ask("POST", url, data=data)

    @property
    def state(self) -> SiteState:
        return SiteState(self.folder)


def start(folder: Path, *options: str) -> "subprocess.Popen[str]":
    command = [
        sys.executable,
        "-m",
        "online_env.embedded.sites",
        "--address",
        "127.0.0.1",
        "--state",
        str(folder),
        *options,
    ]
    return subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def serve(folder: Path) -> Iterator[Internet]:
    process = start(folder, "--dns-port", "0", "--http-port", "0", "--answer", OURS)
    assert process.stdout is not None
    assert process.stderr is not None
    ready = json.loads(process.stdout.readline())
    try:
        with httpx.Client(trust_env=False, verify=False, timeout=10) as client:
            yield Internet(process, ready["dns"], ready["http"], folder, client)
    finally:
        process.terminate()
        complaints = process.communicate(timeout=10)[1]
    assert process.returncode == 0
    assert "Traceback" not in complaints


@pytest.fixture(scope="session")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Internet]:
    """One server for the tests that change nothing, or only what nobody else looks at."""
    yield from serve(tmp_path_factory.mktemp("sites"))


@pytest.fixture
def fresh(tmp_path: Path) -> Iterator[Internet]:
    """A server with nothing done on it."""
    yield from serve(tmp_path / "state")


VOID = {"meta", "link", "img", "input", "br", "hr", "source"}
SVG_VOID = {"path", "circle", "rect", "ellipse"}


class Page(HTMLParser):
    """Checks that tags are closed in order, and collects what a page refers to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.problems: list[str] = []
        self.links: set[str] = set()
        self.ids: Counter[str] = Counter()
        self.labels: set[str] = set()
        self.controls: list[dict[str, str | None]] = []
        self.seen: Counter[str] = Counter()
        self.feed(text)
        self.close()
        self.problems += [f"<{tag}> is not closed" for tag in self.open]
        self.problems += [f"id {name} occurs {n} times" for name, n in self.ids.items() if n > 1]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        entries = dict(attrs)
        self.seen[tag] += 1
        if len(entries) < len(attrs):
            self.problems.append(f"<{tag}> has an attribute twice: {attrs}")
        self.links |= {v for k in ("href", "src", "action") if (v := entries.get(k))}
        self.ids.update([entries["id"]] if entries.get("id") else [])
        if tag == "img" and "alt" not in entries:
            self.problems.append(f"picture without alt: {entries.get('src')}")
        if tag == "label" and entries.get("for"):
            self.labels.add(str(entries["for"]))
        if tag in ("input", "select", "textarea") and entries.get("type") != "hidden":
            self.controls.append({**entries, "inside": "label" if "label" in self.open else None})
        if any(k.startswith("on") for k in entries):
            self.problems.append(f"<{tag}> has a script inside, which the security policy forbids")
        if tag not in VOID and tag not in SVG_VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID and tag not in SVG_VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID or tag in SVG_VOID:
            return
        if not self.open or self.open[-1] != tag:
            self.problems.append(f"</{tag}> closes {self.open[-1:]}")
        else:
            self.open.pop()

    def unlabelled(self) -> list[dict[str, str | None]]:
        return [
            c
            for c in self.controls
            if c.get("id") not in self.labels and not c.get("aria-label") and not c["inside"]
        ]


def crawl(web: Internet) -> dict[str, Any]:
    """Every page and file that can be reached from the front pages, by address."""
    waiting, entries = [f"http://{host}/" for host in HOSTS], {}
    while waiting:
        url = waiting.pop()
        if url in entries:
            continue
        entries[url] = reply = web.get(url)
        if reply.headers.get("content-type", "").startswith("text/html"):
            links = {urljoin(url, link).split("#")[0] for link in Page(reply.text).links}
            # Where a form is posted to is no page; what it leads to is tested with the forms.
            waiting += [
                u
                for u in links
                if urlsplit(u).path not in ("/cart/add", "/cart/update", "/send")
                and not re.search(r"/message/\w+/\w+$", u)
            ]
    return entries


@pytest.fixture(scope="session")
def everything(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """All replies of a crawl on a server of its own, with a cart, so that the checkout is linked
    too."""
    servers = serve(tmp_path_factory.mktemp("crawl"))
    web = next(servers)
    web.post("http://shop.test/cart/add", product="kettle", quantity="1")
    result = crawl(web)
    assert next(servers, None) is None
    return result


@pytest.fixture(scope="session")
def parse() -> Callable[[str], Page]:
    """Reads a page; its `problems` are what is wrong with it."""
    return Page


@pytest.fixture(scope="session")
def server() -> Callable[..., "subprocess.Popen[str]"]:
    """Starts the server in a folder with options; whoever calls it ends it."""
    return start


@pytest.fixture
def registration() -> dict[str, Any]:
    """A registration that forms.test accepts."""
    return dict(GOOD)
