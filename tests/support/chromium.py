"""Headless Chromium for tests, over its debugging pipe (the DevTools protocol): real pages, mouse
and keys."""

import base64
import contextlib
import io
import itertools
import json
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from . import needs

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run"
    " --disable-background-networking"
)
FLAGS += " --disable-component-update --disable-sync --remote-debugging-pipe"


@contextlib.contextmanager
def chromium(profile: Path, rules: str = "") -> Iterator["Browser"]:
    """A browser with its profile in a folder; skips where there is none. `rules` are
    `--host-resolver-rules`."""
    options = (f"--user-data-dir={profile}", f"--host-resolver-rules={rules}")
    browser = Browser([needs.browser(), *FLAGS.split(), *options, "about:blank"])
    try:
        browser.attach()
        yield browser
    finally:
        browser.close()


class Browser:
    """One page. `events` holds what it reported since its address was opened."""

    def __init__(self, command: list[str]) -> None:
        self._link, peer_end = socket.socketpair()
        self._link.settimeout(60)
        with peer_end:
            # Chromium reads from 3 and writes to 4: the shell makes both of one socket, whatever
            # its number is.
            end, null = peer_end.fileno(), subprocess.DEVNULL
            start = ["bash", "-c", f'exec "$@" 3<&{end} 4>&{end}', "sh", *command]
            self._process = subprocess.Popen(
                start, pass_fds=(end,), stdin=null, stdout=null, stderr=null
            )
        self._rest, self._ids, self._session = b"", itertools.count(1), dict[str, str]()
        self.events: list[dict[str, Any]] = []

    def attach(self) -> None:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {
            "sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)[
                "sessionId"
            ]
        }
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._link.close()

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            data = self._link.recv(1 << 20)
            assert data, "Chromium has ended"
            self._rest += data
        text, _, self._rest = self._rest.partition(b"\0")
        return json.loads(text)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command of the protocol and return its result."""
        number = next(self._ids)
        request = {"id": number, "method": method, "params": params, **self._session}
        self._link.sendall(json.dumps(request).encode() + b"\0")
        while (answer := self._message()).get("id") != number:
            self.events.append(answer)
        assert "error" not in answer, (method, answer)
        return answer["result"]

    def of(self, *methods: str) -> list[dict[str, Any]]:
        """The parameters of the events of these kinds."""
        return [event["params"] for event in self.events if event.get("method") in methods]

    def open(self, url: str, width: int = 1400, height: int = 1000, scheme: str = "light") -> None:
        """Open an address in a fresh page, and return when it is complete."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": scheme}],
        )
        # so that it is loaded anew where only what follows # differs
        for address in ("about:blank", url):
            self.events = []
            assert "errorText" not in self.call("Page.navigate", url=address), address
            # A page may drop the token that led to it.
            here = json.dumps(address.partition("#")[0].partition("?")[0])
            self.until(
                f"location.href.split(/[?#]/)[0] === {here} && document.readyState === 'complete'"
            )

    def js(self, expression: str) -> Any:
        """What an expression is in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def until(self, expression: str, wanted: Any = True) -> None:
        """Wait until an expression has a value."""
        end = time.monotonic() + 30
        while (outcome := self.js(expression)) != wanted:
            assert time.monotonic() < end, f"{expression} is {outcome!r}, not {wanted!r}"
            time.sleep(0.02)

    def mouse(self, kind: str, x: float, y: float) -> None:
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1
        )

    def key(self, name: str, code: int, shift: bool = False) -> None:
        entries = {"modifiers": 8 if shift else 0, "windowsVirtualKeyCode": code}
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, **entries)

    def pixels(self) -> np.ndarray:
        """What the window shows, int64 `[H, W, 3]`."""
        data = self.call("Page.captureScreenshot")["data"]
        return np.array(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")).astype(int)
