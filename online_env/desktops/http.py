"""A desktop behind HTTP: our own guest server, or any guest that speaks OSWorld's protocol."""

import io
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast
from urllib.parse import quote

import numpy as np
from PIL import Image, UnidentifiedImageError

from hijack_data.types import Size, UInt8Array

from ..errors import GuestError, MissingCapabilityError
from ..extra import require
from .capability_survey import is_container, survey
from .connection import GuestConnection, GuestResponse
from .guest_address import MAX_PIXELS
from .protocol import Capability, RunResult, TaskConfig

# For `<`, pyautogui's table names a key that types `>` with Shift; Shift and comma type `<`.
LESS_THAN = (
    "_keys = getattr(getattr(pyautogui, 'platformModule', None), 'keyboardMapping', {}); "
    "_keys.update([('<', _keys[','])] if ',' in _keys else []); "
)
# the code that OSWorld puts before an agent's code
PREFIX = f"import pyautogui; import time; pyautogui.FAILSAFE = False; {LESS_THAN}"
ANSWER_SLACK_S = 10.0  # s that the answer of a command may take beyond the command's own time-out
MAX_SIZE_DIGITS = 6  # of a width or a height
OK = 200
UNAUTHORIZED = 401
SERVER_ERROR = 500
GATEWAY_TIMEOUT = 504
JSON = "application/json"
FORM = "application/x-www-form-urlencoded"
CODE_TIMEOUT_S = 60
LIST_TIMEOUT_S = 15
_WMCTRL = re.compile(
    r"""
    (?P<id>0x[0-9a-f]+) \s+
    -?\d+ \s+
    (?P<pid>\d+) \s+
    (?P<x>-?\d+) \s+ (?P<y>-?\d+) \s+ (?P<width>\d+) \s+ (?P<height>\d+) \s+
    (?P<class>\S+) \s+
    \S+ \ ?
    (?P<title>.*)
    """,
    re.VERBOSE,
)


class HttpDesktop:
    """A desktop whose guest server is at `url`, such as `http://10.0.0.2:5000`.

    Args:
        url: address of the server; the default port is 5000.
        token: the token for our own server; a plain OSWorld guest needs none.
        timeout: seconds that an answer may take.
        resetter: restores the pristine state of the machine (reverts a snapshot ...) and carries
            out the task's `config`; it returns the guest's address if that has changed. Without it
            `reset` raises `MissingCapabilityError`.
        size: `(height, width)` of the screen if it is known and does not change; otherwise the
            guest is asked each time.
        password: of the guest's user, for sudo; with `None` only a sudo that does not ask is tried.
        source: the local address from which requests are sent. If the way to the guest has gone
            (its cable was removed), they are then refused here instead of leaving by the default
            route, token and all.
        restart_timeout: seconds that connections may be refused, if the server is started again
            whenever it ends.
        door: path of a socket in the file system that leads to the guest, instead of the network.

    All methods raise `GuestError` where the guest refuses or does not answer.
    """

    def __init__(
        self,
        url: str,
        token: str | None = None,
        timeout: float = 30.0,
        resetter: Callable[[TaskConfig | None], str | None] | None = None,
        size: Size | None = None,
        password: str | None = "password",
        source: str | None = None,
        restart_timeout: float = 0.0,
        door: str | None = None,
    ) -> None:
        self._connection = GuestConnection(url, token, timeout, source, restart_timeout, door)
        self._settings = (token, timeout, source, restart_timeout)
        self._password = password
        self._size = size
        self._token = token
        self._resetter = resetter
        self._ours: bool | None = None
        self._capabilities: frozenset[Capability] | None = None

    def __enter__(self) -> "HttpDesktop":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Address of the guest server."""
        return self._connection.url

    @property
    def is_ours(self) -> bool:
        """Whether the guest has our fast routes; asked once.

        Raises:
            GuestError: The guest refuses the token, fails, or does not answer.
        """
        if self._ours is None:
            reply = self._connection.ask("GET", "/ah/health")
            if reply.status == UNAUTHORIZED and self._token:
                raise GuestError(f"{self.url} refuses the token: {reply.complaint}", UNAUTHORIZED)
            # A server, or what stands before it, that fails now says nothing of its routes.
            if reply.status >= SERVER_ERROR:
                self._check("GET", "/ah/health", reply)
            self._ours = reply.status == OK
        return self._ours

    def health(self) -> dict[str, Any]:
        """Return which parts of the session answer: `{"ready": ...}`.

        For a plain OSWorld guest, only whether it answers.
        """
        if self.is_ours:
            return self._get("/ah/health").json()
        reply = self._connection.ask("GET", "/platform")
        return {"ready": reply.status == OK}

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Capabilities of the guest, asked once; `firewall` needs sudo, with the given password."""
        if self._capabilities is None:
            capabilities: set[Capability] = {"files", "apps", "accessibility"}
            if self.is_ours:
                capabilities.add("windows")
            self._capabilities = survey(self.execute, self._password) | capabilities
        return self._capabilities

    @property
    def is_container(self) -> bool:
        """Whether the guest is a container of Docker's or Podman's."""
        return is_container(self.execute)

    @property
    def size(self) -> Size:
        """`(height, width)` of the screen in pixels.

        Raises:
            GuestError: The guest does not return them.
        """
        if self._size is not None:
            return self._size
        fields = self._post("/screen_size", b"").json()
        height = fields.get("height")
        width = fields.get("width")
        if not isinstance(height, int) or not isinstance(width, int):
            raise GuestError(
                f"{self.url}/screen_size answered {fields!r:.200}, not a width and a height"
            )
        return height, width

    def screenshot(self) -> UInt8Array:
        """The screen with the pointer.

        Returns:
            uint8 RGB `[H, W, 3]`.

        Raises:
            GuestError: The guest does not send a picture.
        """
        if not self.is_ours:
            return _decode(self._get("/screenshot").body, self.url)
        reply = self._get("/ah/frame")
        width = _length(reply.headers.get("x-width", ""))
        height = _length(reply.headers.get("x-height", ""))
        body = reply.body
        if width * height * 3 != len(body) or not body:
            raise GuestError(
                f"{self.url}/ah/frame sent {len(body)} bytes for a frame of {width}x{height}"
            )
        if isinstance(body, bytes):
            body = bytearray(body)  # a copy, so that the picture is writable
        return np.frombuffer(body, np.uint8).reshape(height, width, 3)

    def accessibility(self) -> str:
        """The accessibility tree in OSWorld's XML dialect, read now.

        Raises:
            GuestError: The guest sends no tree.
        """
        path = "/accessibility"
        field = "AT"
        if self.is_ours:
            path = "/ah/tree"
            field = "xml"
        tree = self._get(path).json().get(field)
        if not isinstance(tree, str):
            raise GuestError(f"{self.url}{path} answered without a tree")
        return tree

    def run(self, code: str) -> RunResult:
        """Run pyautogui `code`, after the code that OSWorld puts before it."""
        return self.execute(["python", "-c", PREFIX + code], CODE_TIMEOUT_S)

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command; a string goes to the shell.

        A plain OSWorld guest has a limit of 120 s of its own.
        """
        body = {**_command(argv), "timeout": timeout}
        reply = self._ask_json("/execute", body, timeout + ANSWER_SLACK_S)
        fields = reply.json()
        if reply.status in (SERVER_ERROR, GATEWAY_TIMEOUT) and fields.get("status") == "error":
            return RunResult("error", "", reply.complaint)
        self._check("POST", "/execute", reply)
        code = fields.get("returncode")
        return RunResult(
            str(fields.get("status") or ""),
            str(fields.get("output") or ""),
            str(fields.get("error") or ""),
            code if isinstance(code, int) else None,
        )

    def launch(self, argv: Sequence[str] | str) -> None:
        """Start a program without waiting for its end; a string goes to the shell."""
        self._post("/setup/launch", _json(_command(argv)))

    def read_file(self, path: str) -> bytes:
        """The content of a file that the guest's user may read."""
        form = f"file_path={quote(path, safe='')}".encode()
        return bytes(self._post("/file", form, FORM).body)

    def write_file(self, path: str, data: bytes) -> None:
        """Write a file as the guest's user."""
        require("sending a file", ("urllib3",))
        from urllib3.filepost import encode_multipart_formdata  # urllib3 comes with the extra

        file = ("data", data, "application/octet-stream")
        body, kind = encode_multipart_formdata([("file_path", path), ("file_data", file)])
        self._post("/setup/upload", body, kind)

    def tool(
        self, name: str, operation: str, fields: Mapping[str, Any], timeout: float = 60
    ) -> dict[str, Any]:
        """Run an operation for effects in the process of our own guest server.

        Args:
            name: name of a tool in `online_env.embedded.guest.inside`.
            operation: of it.
            fields: its arguments.
            timeout: in seconds.

        Raises:
            MissingCapabilityError: The guest is a plain OSWorld guest.
            GuestError: The operation fails, or the guest does not answer.
        """
        self._need_ours("what effects look at")
        body = {"tool": name, "operation": operation, "fields": dict(fields)}
        try:
            reply = self._ask_json("/ah/tool", body, timeout + ANSWER_SLACK_S)
        except GuestError as error:
            raise GuestError(f"{name} {operation}: {error}", error.status) from None
        return self._check("POST", "/ah/tool", reply).json()

    def windows(self) -> list[dict[str, Any]]:
        """The windows: `id`, `pid`, `class`, `title`, `box` (xyxy).

        Our own server also gives `type`, `mapped` and `active`.

        Raises:
            MissingCapabilityError: A plain OSWorld guest has no wmctrl.
            GuestError: The guest sends none.
        """
        if self.is_ours:
            rows = self._get("/ah/windows").json().get("windows")
            if not isinstance(rows, list):
                raise GuestError(f"{self.url}/ah/windows answered without windows")
            return cast("list[dict[str, Any]]", rows)
        listed = self.execute(["wmctrl", "-lpGx"], LIST_TIMEOUT_S)
        if not listed.ok:
            raise MissingCapabilityError(
                f"{self.url} can't list its windows: {listed.error.strip()}; install wmctrl there"
            )
        matches = [_WMCTRL.fullmatch(line) for line in listed.output.split("\n")]
        return [_window(match) for match in matches if match is not None]

    def window(self, action: str, **fields: Any) -> None:
        """Act on a window of our own guest.

        Args:
            action: `activate`, `close`, `minimise` (id), `place` (id, box) or `show_desktop` (on).
            fields: the arguments in brackets.

        Raises:
            MissingCapabilityError: The guest is a plain OSWorld guest.
        """
        self._need_ours("acting on windows")
        self._post("/ah/windows", _json({"action": action, **fields}))

    def input(self, events: Sequence[Mapping[str, Any]]) -> None:
        """Play mouse and keyboard events on our own guest.

        Args:
            events: as `online_env.embedded.guest.events.Input.play` takes them.

        Raises:
            MissingCapabilityError: The guest is a plain OSWorld guest.
        """
        self._need_ours("playing events")
        self._post("/ah/input", _json({"events": list(events)}))

    def reset(self, task: TaskConfig | None = None) -> None:
        """Restore the pristine state of the machine with the given `resetter`.

        Raises:
            MissingCapabilityError: There is no `resetter`.
        """
        if self._resetter is None:
            raise MissingCapabilityError(
                f"{self.url} can't be reset over HTTP: give HttpDesktop a resetter that reverts its"
                " snapshot"
            )
        url = self._resetter(task)
        self.close()
        if url is not None:
            self._connection = GuestConnection(url, *self._settings)
            self._ours = None
            self._capabilities = None

    def close(self) -> None:
        """Close the connection; the desktop itself keeps running."""
        self._connection.close()

    def _need_ours(self, purpose: str) -> None:
        if not self.is_ours:
            raise MissingCapabilityError(
                f"{self.url} is a plain OSWorld guest: {purpose} needs our guest server; use"
                " run(code)"
            )

    def _get(self, path: str) -> GuestResponse:
        return self._check("GET", path, self._connection.ask("GET", path))

    def _post(self, path: str, body: bytes, kind: str = JSON) -> GuestResponse:
        return self._check("POST", path, self._connection.ask("POST", path, body, kind))

    def _ask_json(self, path: str, fields: Mapping[str, Any], timeout: float) -> GuestResponse:
        return self._connection.ask("POST", path, _json(fields), JSON, timeout)

    def _check(self, method: str, path: str, reply: GuestResponse) -> GuestResponse:
        if reply.status != OK:
            raise GuestError(
                f"{method} {self.url}{path} answered {reply.status}: {reply.complaint}",
                reply.status,
            )
        return reply


def _json(fields: Mapping[str, Any]) -> bytes:
    return json.dumps(fields).encode()


def _command(argv: Sequence[str] | str) -> dict[str, Any]:
    """Return a command in the form that the guest's routes accept."""
    if isinstance(argv, str):
        return {"command": argv, "shell": True}
    return {"command": list(argv), "shell": False}


def _length(text: str) -> int:
    """Return a number of pixels as a header has it; 0 if it is none."""
    is_number = text.isascii() and text.isdigit() and len(text) <= MAX_SIZE_DIGITS
    return int(text) if is_number else 0


def _decode(data: bytes | bytearray, url: str) -> UInt8Array:
    try:
        image = Image.open(io.BytesIO(data))
        width, height = image.size
        if width * height > MAX_PIXELS:
            raise ValueError(f"{width}x{height} pixels are more than {MAX_PIXELS}")
        return np.array(image.convert("RGB"), np.uint8)
    except (
        UnidentifiedImageError,
        OSError,
        ValueError,
        SyntaxError,
        Image.DecompressionBombError,
    ) as error:
        raise GuestError(
            f"{url}/screenshot sent something that is not a picture: {error}"
        ) from None


def _window(match: re.Match[str]) -> dict[str, Any]:
    left = int(match["x"])
    top = int(match["y"])
    right = left + int(match["width"])
    bottom = top + int(match["height"])
    return {
        "id": int(match["id"], 16),
        "pid": int(match["pid"]),
        "class": match["class"],
        "title": match["title"],
        "box": [left, top, right, bottom],
    }
