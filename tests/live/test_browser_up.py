"""`hijack browser up`: any DevTools client drives a corrupted Chromium, and leaves nothing behind."""

import base64
import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Generator, Iterator
from typing import Any

import pytest

from online_env.browser.site import FolderSite

from support import needs

TIMEOUT_S = 20.0
PAGE = "<!doctype html><title>Shop</title><p style='height: 90vh'>Shop<script>document.cookie = 'a=b'; localStorage.a = 'b'</script>"

TOUCH = "<!doctype html><title>Shop</title><a href='#there'>There</a><script>clicks = 0; onclick = event => clicks += event.isTrusted</script>"
IS_HIDDEN = "document.visibilityState === 'hidden'"


class Client:
    """A DevTools client over a websocket, as Playwright's is."""

    def __init__(self, address: str) -> None:
        with urllib.request.urlopen(f"{address}/json/version", timeout=TIMEOUT_S) as answer:
            url = json.load(answer)["webSocketDebuggerUrl"]
        host, _, path = url.removeprefix("ws://").partition("/")
        name, _, port = host.partition(":")
        self.socket = socket.create_connection((name, int(port)), TIMEOUT_S)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET /{path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        self.file = self.socket.makefile("rb")
        while self.file.readline().strip():
            pass
        self.number = 0

    def call(self, method: str, session: str = "", **params: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode()
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self.socket.sendall(b"\x81\xfe" + struct.pack(">H", len(data)) + mask + masked)
        while True:
            answer = json.loads(self._receive())
            if answer.get("id") == self.number:
                assert "error" not in answer, answer
                return answer["result"]

    def _receive(self) -> bytes:
        parts = b""
        while True:
            first, second = self.file.read(2)
            size = second & 127
            if size >= 126:
                (size,) = struct.unpack(
                    ">H" if size == 126 else ">Q", self.file.read(2 if size == 126 else 8)
                )
            parts += self.file.read(size)
            if first & 128:
                return parts

    def targets(self) -> list[dict[str, Any]]:
        """Return what is known of all tabs."""
        return self.call("Target.getTargets")["targetInfos"]

    def open(self, url: str, **context: str) -> str:
        """Open a tab and return its session."""
        return self.attach(self.call("Target.createTarget", url=url, **context)["targetId"])

    def attach(self, target: str) -> str:
        """Return a session of a tab."""
        return self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    def evaluate(self, session: str, expression: str) -> Any:
        """Return the value of an expression."""
        result = self.call("Runtime.evaluate", session, expression=expression, returnByValue=True)
        return result["result"].get("value")

    def names(self, session: str) -> set[str]:
        """Return the names in the accessibility tree."""
        nodes = self.call("Accessibility.getFullAXTree", session)["nodes"]
        return {str(node.get("name", {}).get("value", "")) for node in nodes}

    def close(self) -> None:
        """Vanish, as a process that is killed does."""
        self.file.close()
        self.socket.close()


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a page."""
    needs.chromium()
    folder = tmp_path_factory.mktemp("site")
    (folder / "shop.html").write_text(PAGE)
    (folder / "touch.html").write_text(TOUCH)
    (folder / "picture.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" />')
    site = FolderSite("127.0.0.1", folder)
    port = site.arguments[0].rpartition(":")[2].split(",")[0]
    yield f"http://127.0.0.1:{port}/shop.html"
    site.close()


@contextlib.contextmanager
def browser_up(*words: str) -> Generator[tuple[str, "subprocess.Popen[str]"]]:
    """Yield the address that the command prints, and its process."""
    command = [sys.executable, "-m", "hijack_data.cli", "browser", "up", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().strip()
        try:
            assert address.startswith("http://127.0.0.1:"), process.stderr.read()
            yield address, process
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(TIMEOUT_S)


def wait_for(happens: Callable[[], object]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not happens():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def connect_after_restart(address: str) -> tuple[Client, list[Any]]:
    """Return a client of a Chromium without pages of the site, and its cookies."""
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        client = Client(address)
        try:
            targets = client.targets()
            cookies = client.call("Storage.getCookies")["cookies"]
            if not any("shop" in target["url"] for target in targets):
                return client, cookies
        except (ValueError, OSError):  # Chromium ended meanwhile
            pass
        client.close()
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_a_client_gets_nodes_in_every_page_and_leaves_nothing_when_it_vanishes(url: str) -> None:
    with browser_up("--corruption", "pop_ups") as (address, _):
        client = Client(address)
        session = client.open(url)
        wait_for(lambda: "OK" in client.names(session))
        assert client.evaluate(session, "document.querySelectorAll('*').length") == 6
        client.call("Page.navigate", session, url=f"{url}?again")
        wait_for(lambda: "OK" in client.names(session))
        assert client.evaluate(session, "document.cookie + localStorage.a") == "a=bb"
        client.close()
        second, cookies = connect_after_restart(address)
        assert cookies == []
        session = second.open(url)
        wait_for(lambda: "OK" in second.names(session))
        second.close()


@pytest.mark.parametrize("is_own_context", [False, True])
@pytest.mark.parametrize("corruption", ["multi_apps", "app_minimization"])
def test_a_page_in_front_hides_that_of_the_client_until_it_goes(
    corruption: str, is_own_context: bool, url: str
) -> None:
    with (
        browser_up("--corruption", corruption) as (address, process),
        contextlib.closing(Client(address)) as client,
    ):
        context = {}
        if is_own_context:
            context = client.call("Target.createBrowserContext")
        session = client.open(url, **context)

        def find_covers() -> list[str]:
            targets = client.targets()
            return [each["targetId"] for each in targets if each["url"].startswith("data:")]

        assert process.stderr is not None
        assert '"hidden": true' in process.stderr.readline()
        assert client.evaluate(session, IS_HIDDEN)
        (cover,) = find_covers()
        cover_session = client.attach(cover)
        client.evaluate(cover_session, "document.querySelector('#panel button:last-child').click()")
        wait_for(lambda: not client.evaluate(session, IS_HIDDEN))
        client.call("Page.navigate", session, url=f"{url}?again")  # it comes once
        time.sleep(0.5)
        assert not client.evaluate(session, IS_HIDDEN)


def test_a_touch_clicks_in_the_page_of_the_client(url: str) -> None:
    with (
        browser_up("--corruption", "accidental_touch") as (address, process),
        contextlib.closing(Client(address)) as client,
    ):
        session = client.open(url.replace("shop", "touch"))
        assert process.stderr is not None
        assert '"delivered": true' in process.stderr.readline()
        assert client.evaluate(session, "clicks + location.hash") == "1#there"


def test_the_session_of_a_site_ends_until_the_password(url: str) -> None:
    with (
        browser_up("--corruption", "verification") as (address, process),
        contextlib.closing(Client(address)) as client,
    ):
        session = client.open(url)
        assert process.stderr is not None
        assert '"form": true' in process.stderr.readline()
        second = client.open(f"{url}?again")
        wait_for(lambda: client.evaluate(second, "document.title") == "Sign in")
        script = "document.querySelector('[type=password]').value = 'password'; document.forms[0].submit()"
        client.evaluate(session, script)
        wait_for(lambda: client.evaluate(session, "document.title") == "Shop")


def test_pages_that_ask_or_hold_no_nodes_stop_no_other_page_and_a_client_may_end_chromium(
    url: str,
) -> None:
    with browser_up("--corruption", "pop_ups") as (address, process):
        assert process.stderr is not None
        socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2]))).close()
        client = Client(address)
        svg = client.open(url.replace("shop.html", "picture.svg"))
        assert "no body of HTML" in process.stderr.readline()
        client.call("Runtime.evaluate", svg, expression="setTimeout(() => alert(1))")
        session = client.open(url)
        wait_for(lambda: "OK" in client.names(session))
        assert "is drawn into" in process.stderr.readline()  # the line before came once
        client.call("Browser.close")
        client.close()
        second, _ = connect_after_restart(address)
        second.close()


def test_playwright_drives_it(url: str) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason=needs.PLAYWRIGHT)
    with browser_up("--corruption", "pop_ups") as (address, _), playwright.sync_playwright() as api:
        browser = api.chromium.connect_over_cdp(address)
        for context in (browser.contexts[0], browser.new_context()):
            page = context.new_page()
            page.goto(url)
            session = context.new_cdp_session(page)

            def find_button(session: Any = session) -> Any:
                nodes = session.send("Accessibility.getFullAXTree")["nodes"]
                buttons = [
                    node["backendDOMNodeId"]
                    for node in nodes
                    if node.get("name", {}).get("value") == "OK"
                    and node["role"]["value"] == "button"
                ]
                return buttons and buttons[0]

            wait_for(find_button)
            quad = session.send("DOM.getBoxModel", {"backendNodeId": find_button()})["model"][
                "content"
            ]
            with pytest.raises(playwright.TimeoutError, match="intercepts pointer events"):
                page.locator("p").click(timeout=800, position={"x": quad[0] + 9, "y": quad[1] - 40})
            page.mouse.click((quad[0] + quad[4]) / 2, (quad[1] + quad[5]) / 2)
            wait_for(lambda: not find_button())
        browser.close()


def test_a_command_that_is_killed_leaves_no_browser() -> None:
    needs.chromium()
    with browser_up() as (address, process):
        process.kill()
        port = int(address.rpartition(":")[2])

        def is_gone() -> bool:
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
            except OSError:
                return True
            return False

        wait_for(is_gone)
        wait_for(lambda: f"agenthijack-browser-{process.pid}-" not in list_processes())


def list_processes() -> str:
    return subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--corruption", "resolution"], "resizes the picture"),
        (["--corruption", "network_error"], "is not proved"),
        (["--corruption", "slow_network"], "slow_link needs a desktop"),
        (["--corruption", "missed_input"], "the client sends its own"),
        (["--corruption", "pop_upz"], "did you mean"),
        (["--set", "width=3"], "--set is for a corruption"),
        (["--size", "big"], "--size must be WIDTHxHEIGHT"),
        (["--headed"], "DISPLAY"),
    ],
)
def test_mistakes_are_named(words: list[str], problem: str) -> None:
    needs.chromium()
    command = [sys.executable, "-m", "hijack_data.cli", "browser", "up", *words]
    environment = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    process = subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment, timeout=60
    )
    assert process.returncode == 2
    assert problem in process.stderr
