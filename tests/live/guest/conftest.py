"""A plain Xfce session with a guest server in it, for the tests of the guest: no network namespace,
no overlay.

It lives in a PID namespace of its own, so that ending its first process ends all of it.
"""

import os
import pwd
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from support import needs

pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

import httpx
from lxml import etree

from support.waiting import until

ROOT = Path(__file__).resolve().parents[3]
GOLDEN_HOME = ROOT / "online_env/embedded/home"
GUEST = ROOT / "online_env/embedded/guest"
NEEDED = ("Xvfb", "dbus-daemon", "xfwm4", "xfdesktop", "unshare", "setpriv")
SIZE = (1280, 800)

# The shell is the first process of the namespace: it collects what others leave behind.
SESSION = """
trap 'exit 0' TERM
as_user() { exec setpriv --reuid "$AH_UID" --regid "$AH_GID" --clear-groups "$@"; }
mkfifo "$AH_DIR/display"
as_user Xvfb -displayfd 3 -screen 0 "$AH_SCREEN" -dpi 96 -nolisten tcp -noreset 3>"$AH_DIR/number" &
echo $! > "$AH_DIR/xvfb.pid"
for i in $(seq 1200); do [ -s "$AH_DIR/number" ] && break; sleep 0.05; done
export DISPLAY=":$(cat "$AH_DIR/number")"
as_user dbus-daemon --session --nofork --print-address=3 3>"$AH_DIR/bus" &
for i in $(seq 1200); do [ -s "$AH_DIR/bus" ] && break; sleep 0.05; done
export DBUS_SESSION_BUS_ADDRESS="$(cat "$AH_DIR/bus")"
cd "$HOME"
as_user xfsettingsd --sm-client-disable --no-daemon --replace &
as_user xfwm4 --compositor=off --sm-client-disable &
as_user xfdesktop --sm-client-disable &
as_user xfce4-panel --sm-client-disable &
cd "$AH_ROOT"
"$AH_PYTHON" -m online_env.embedded.guest $AH_ARGUMENTS &
wait
while :; do sleep 1000 & wait $!; done
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(what: str, check: Callable[[], Any]) -> Any:
    """Poll `check` until it is true and return its value."""
    return until(check, what, pause=0.02)


ST = "{https://accessibility.ubuntu.example.org/ns/state}"
CP = "{https://accessibility.ubuntu.example.org/ns/component}"


class Session:
    """A desktop of `SIZE` with a guest server; `client` has the token."""

    def __init__(self, *arguments: str, screen: tuple[int, int] = SIZE) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="hijack-guest-"))
        self.home = self.folder / "home"
        self.account = pwd.getpwnam("nobody")
        self.port = free_port()
        self.token = secrets.token_hex(16)
        self.token_file = self.folder / "token"
        self.log = self.folder / "log"
        self.arguments = arguments
        self.screen = screen
        self.url = f"http://127.0.0.1:{self.port}"
        self.client = httpx.Client(
            base_url=self.url, headers={"Authorization": f"Bearer {self.token}"}, timeout=120
        )

    def __enter__(self) -> "Session":
        self._prepare()
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [
                    "unshare",
                    "--mount",
                    "--pid",
                    "--fork",
                    "--kill-child",
                    "--mount-proc",
                    "/bin/sh",
                    "-c",
                    SESSION,
                ],
                env=self._environment(),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        try:
            wait_for(f"the guest server (log: {self.log})", self._ready)
        except BaseException:
            print(self.log.read_text()[-4000:], file=sys.stderr)
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.client.close()
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        number = self._text("number")
        for leftover in (Path(f"/tmp/.X{number}-lock"), Path(f"/tmp/.X11-unix/X{number}")):
            if number:
                leftover.unlink(missing_ok=True)
        shutil.rmtree(self.folder, ignore_errors=True)

    def execute(self, command: list[str] | str, **more: Any) -> dict[str, Any]:
        """Run a command in the session; a string goes to the shell."""
        body = {"command": command, "shell": isinstance(command, str), **more}
        answer: dict[str, Any] = self.client.post("/execute", json=body).json()
        return answer

    def windows(self) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = self.client.get("/ah/windows").json()["windows"]
        return rows

    def input(self, *events: dict[str, Any]) -> None:
        """Play events."""
        answer = self.client.post("/ah/input", json={"events": list(events)})
        assert answer.status_code == 200, answer.text

    def tree(self) -> Any:
        """The accessibility tree, parsed."""
        return etree.fromstring(self.client.get("/accessibility").json()["AT"].encode())

    def shown(self, path: str) -> list[Any]:
        """The nodes of an XPath that are showing."""
        return [node for node in self.tree().xpath(path) if node.get(f"{ST}showing") == "true"]

    def click_on(self, path: str) -> None:
        """Click in the middle of the first showing node of an XPath."""
        node = wait_for(path, lambda: self.shown(path))[0]
        x, y = (int(v) for v in node.get(f"{CP}screencoord").strip("()").split(","))
        width, height = (int(v) for v in node.get(f"{CP}size").strip("()").split(","))
        self.input({"type": "click", "x": x + width // 2, "y": y + height // 2})

    def act(self, action: str, **fields: Any) -> None:
        """Do something to a window."""
        assert self.client.post("/ah/windows", json={"action": action, **fields}).status_code == 200

    def launch(self, *command: str, title: str) -> dict[str, Any]:
        """Launch a program and wait for a window whose title holds `title`; skips where it is not
        installed."""
        needs.apps(command[0])
        before = {row["id"] for row in self.windows()}
        assert self.client.post("/setup/launch", json={"command": list(command)}).status_code == 200

        def found() -> Any:
            fresh = [
                row for row in self.windows() if row["id"] not in before and title in row["title"]
            ]
            return fresh[0] if fresh and fresh[0]["mapped"] else None

        row: dict[str, Any] = wait_for(f"a window of {command[0]}", found)
        return row

    def close_windows(self) -> None:
        """End every application of the session."""
        for row in self.windows():
            if row["pid"] and row["type"] == "normal":
                self.execute(["kill", "-9", str(row["pid"])])
        wait_for(
            "all windows to be gone",
            lambda: not [r for r in self.windows() if r["type"] == "normal"],
        )

    def xvfb_pid(self) -> str:
        """Process id of Xvfb in the session's PID namespace."""
        return self._text("xvfb.pid")

    def _text(self, name: str) -> str:
        path = self.folder / name
        return path.read_text().strip() if path.is_file() else ""

    def _ready(self) -> bool:
        if self.process.poll() is not None:
            pytest.fail(f"the session ended: {self.log.read_text()[-2000:]}")
        try:
            answer = self.client.get("/ah/health")
            return bool(answer.status_code == 200 and answer.json()["ready"] and self.windows())
        except httpx.TransportError:
            return False

    def _prepare(self) -> None:
        shutil.copytree(GOLDEN_HOME, self.home)
        for name in ("Desktop", "Documents"):
            (self.home / name).mkdir(exist_ok=True)
        (self.home / "Desktop" / "readme.txt").write_text("hello\n")
        tools = self.folder / "tools"
        for name in ("bin", "shim"):
            shutil.copytree(
                GUEST / name, tools / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        subprocess.run(
            ["/usr/bin/python3", "-m", "compileall", "-q", str(tools / "shim")], check=True
        )
        (self.folder / "run").mkdir(mode=0o700)
        self.token_file.write_text(self.token + "\n")
        self.token_file.chmod(0o600)
        self.folder.chmod(0o711)
        for path in (self.home, *self.home.rglob("*"), self.folder / "run"):
            os.chown(path, self.account.pw_uid, self.account.pw_gid)

    def _environment(self) -> dict[str, str]:
        tools = self.folder / "tools" / "bin"
        arguments = (
            "--host",
            "127.0.0.1",
            "--port",
            str(self.port),
            "--token-file",
            str(self.token_file),
        )
        arguments += ("--user", self.account.pw_name, "--bin", str(tools), *self.arguments)
        return {
            "PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin",
            "HOME": str(self.home),
            "USER": "user",
            "LOGNAME": "user",
            "SHELL": "/bin/sh",
            "LANG": "C.UTF-8",
            "TZ": "UTC",
            "XDG_RUNTIME_DIR": str(self.folder / "run"),
            "XDG_CURRENT_DESKTOP": "XFCE",
            "XDG_SESSION_TYPE": "x11",
            "XDG_CONFIG_DIRS": "/etc/xdg",
            "XDG_DATA_DIRS": "/usr/local/share:/usr/share",
            "GSETTINGS_BACKEND": "keyfile",
            "GTK_MODULES": "gail:atk-bridge",
            "NO_AT_BRIDGE": "0",
            "QT_ACCESSIBILITY": "1",
            "ACCESSIBILITY_ENABLED": "1",
            "SAL_USE_VCLPLUGIN": "gtk3",
            "AH_DIR": str(self.folder),
            "AH_UID": str(self.account.pw_uid),
            "AH_GID": str(self.account.pw_gid),
            "AH_SCREEN": f"{self.screen[0]}x{self.screen[1]}x24",
            "AH_ROOT": str(ROOT),
            "AH_PYTHON": sys.executable,
            "AH_ARGUMENTS": " ".join(arguments),
        }


@pytest.fixture(scope="session")
def guest_session() -> type[Session]:
    """The class that starts a session with a guest server; skips where that can't be."""
    needs.root("a session in a PID namespace")
    needs.apps(*NEEDED)
    return Session


@pytest.fixture(scope="module")
def session(guest_session: type[Session]) -> Iterator[Session]:
    """One session for the tests of a module."""
    with guest_session() as session:
        yield session


@pytest.fixture
def clean(session: Session) -> Iterator[Session]:
    """The session with no application in it, before and after."""
    session.close_windows()
    yield session
    session.close_windows()


@pytest.fixture(scope="session")
def eventually() -> Callable[..., Any]:
    """`wait_for`."""
    return wait_for
