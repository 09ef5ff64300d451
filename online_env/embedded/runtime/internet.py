"""The local internet of one desktop: its web sites and names, in a namespace of their own."""

import json
import os
import subprocess
import time
from typing import IO, cast

from . import kernel, limits, network, registry, session
from .desktop_config import DesktopConfig, SetupError
from .logs import BoundedLogs

# So often is a server that ended started again.
MAX_RESTARTS = 5
LOG = "sites"


class Internet:
    """`online_env.embedded.sites` on 10.77.0.1, the desktop's default route and name server.

    What is done on the sites is kept in `state`, a folder that the desktop cannot see. The server
    counts among the desktop's processes: what clients inside make it hold is within its limits.

    Args:
        order: of the desktop.
        name: of the desktop.
        logs: where the server's errors go.
    """

    def __init__(self, order: DesktopConfig, name: str, logs: BoundedLogs) -> None:
        self._order = order
        self._name = name
        self._logs = logs
        self.state = registry.folder(name) / "sites"
        self.state.mkdir(mode=0o700)
        self._namespace = str(network.NETNS / network.web_namespace(name))
        self._command = session.module_command(
            order.python,
            order.search_path,
            "online_env.embedded.sites",
            "--address",
            network.WEB_ADDRESS,
            "--state",
            str(self.state),
        )
        self._deadline = time.monotonic() + order.time_out
        self._left = MAX_RESTARTS
        self._process = self._start()
        self.serves = False

    @property
    def pid(self) -> int:
        """Its process."""
        return self._process.pid

    @property
    def reports(self) -> int:
        """The descriptor that can be read when it serves."""
        return cast("IO[bytes]", self._process.stdout).fileno()

    def look_after(self, has_reported: bool) -> None:
        """Note that it serves; start it again where it has ended, a few times.

        Args:
            has_reported: whether `reports` can be read.

        Raises:
            SetupError: It ends again and again, or does not serve in time: without it a desktop
                would seem to work.
        """
        if has_reported and not self.serves:
            line = cast("IO[bytes]", self._process.stdout).readline()
            self.serves = bool(line) and "http" in json.loads(line)
        has_ended = self._process.poll() is not None
        is_late = time.monotonic() > self._deadline
        if not self.serves and (has_reported or has_ended or is_late):
            raise SetupError(f"the local internet does not serve; {self._tail()}")
        if not has_ended:
            return
        if not self._left:
            raise SetupError(f"the local internet ended {MAX_RESTARTS + 1} times; {self._tail()}")
        self._left -= 1
        self.serves = False
        self._deadline = time.monotonic() + self._order.time_out
        cast("IO[bytes]", self._process.stdout).close()
        self._process = self._start()

    def _tail(self) -> str:
        return f"the end of {LOG}.log: {self._logs.tail(LOG) or '(empty)'}"

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        cast("IO[bytes]", self._process.stdout).close()

    def _start(self) -> "subprocess.Popen[bytes]":
        keeper = os.getpid()
        return subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._logs.writer(LOG),
            cwd="/",
            preexec_fn=lambda: self._enter(keeper),
            env={"PATH": os.environ.get("PATH", os.defpath), "LANG": "C.UTF-8"},
        )

    def _enter(self, keeper: int) -> None:
        kernel.die_with_parent(keeper)
        limits.join_groups(self._name, self._order)
        kernel.join_namespace(self._namespace, kernel.CLONE_NEWNET)
        # With forwarding on and no way out, other addresses are "unreachable" at once instead of
        # after minutes.
        with open("/proc/sys/net/ipv4/ip_forward", "w", encoding="ascii") as setting:
            setting.write("1")
