"""Headless Chromium over its debugging pipe: opens a page, returns its controls and its picture."""

import base64
import fcntl
import io
import json
import os
import select
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from PIL import Image

PATIENCE = 60  # seconds that Chromium may take for an answer
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--remote-debugging-pipe",
    "--hide-scrollbars",
    "--disable-lcd-text",
    "--font-render-hinting=none",
    "--force-color-profile=srgb",
)


class BrowserError(RuntimeError):
    """Chromium ended, does not answer, or refuses a command."""


def _pipe() -> tuple[int, int]:
    """A pipe whose ends are clear of 3 and 4, where the browser's own must be."""
    ends = os.pipe()
    high = tuple(fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in ends)
    for end in ends:
        os.close(end)
    return high[0], high[1]


class Browser:
    """One page of a headless Chromium.

    Args:
        profile: folder for its profile.
        size: height and width of the window in CSS pixels.
        density: pixels of the picture a CSS pixel.
        rules: host names and where they lead to, as `--host-resolver-rules` has them.
    """

    def __init__(
        self, profile: Path, size: tuple[int, int], density: float = 1.0, rules: str = ""
    ) -> None:
        ours_in, theirs_out = _pipe()
        theirs_in, ours_out = _pipe()
        flags = [
            *FLAGS,
            f"--user-data-dir={profile}",
            *([f"--host-resolver-rules={rules}"] if rules else []),
        ]
        # The shell puts the two ends where Chromium looks for them.
        line = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self._process = subprocess.Popen(
            ["bash", "-c", line, "sh", "chromium", *flags, "about:blank"],
            pass_fds=(theirs_in, theirs_out),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._in = ours_in
        self._out = ours_out
        self._rest = b""
        self._count = 0
        self._session = {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {
            "sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)[
                "sessionId"
            ]
        }
        height, width = size
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=density,
            mobile=False,
        )

    def __enter__(self) -> "Browser":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol and return its result. Raises `BrowserError`."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": params, **self._session}
        try:
            os.write(self._out, json.dumps(message).encode() + b"\0")
        except BrokenPipeError:
            raise BrowserError(
                f"Chromium has ended before {method}; does `chromium --version` work here?"
            ) from None
        while (reply := self._message(method)).get("id") != self._count:
            pass
        if "error" in reply:
            raise BrowserError(f"Chromium refuses {method}: {reply['error'].get('message')}")
        return reply["result"]

    def _message(self, method: str) -> dict[str, Any]:
        while b"\0" not in self._rest:
            if not select.select([self._in], [], [], PATIENCE)[0]:
                raise BrowserError(f"Chromium has not answered {method} within {PATIENCE} s")
            data = os.read(self._in, 1 << 20)
            if not data:
                raise BrowserError(
                    f"Chromium has ended during {method}; does `chromium --version` work here?"
                )
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\0")
        return json.loads(line)

    def value(self, expression: str) -> Any:
        """Return what an expression is in the page; promises are awaited."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in result:
            raise BrowserError(
                "the page failed:"
                f" {result['exceptionDetails'].get('exception', {}).get('description')}"
            )
        return result["result"].get("value")

    def open(self, url: str) -> None:
        """Load an address, and return when pictures and fonts are there."""
        failed = self.call("Page.navigate", url=url).get("errorText")
        if failed:
            raise BrowserError(f"{url[:80]} does not load: {failed}")
        here = f"location.href.split('#')[0] === {json.dumps(url.split('#')[0])}"
        while not self.value(f"{here} && document.readyState === 'complete'"):
            self.value("new Promise(done => setTimeout(done, 5))")
        self.value("document.fonts.ready.then(() => 1)")

    def show(self, html: str) -> None:
        """Show a page that is given as text."""
        frame = self.call("Page.getFrameTree")["frameTree"]["frame"]["id"]
        self.call("Page.setDocumentContent", frameId=frame, html=html)
        self.value("document.fonts.ready.then(() => 1)")

    def picture(self) -> np.ndarray:
        """Return what the window shows, uint8 `[H, W, 3]`."""
        data = self.call("Page.captureScreenshot", format="png", optimizeForSpeed=True)["data"]
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
