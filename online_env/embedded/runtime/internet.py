"""The local internet of one desktop: its web sites and names, in a namespace of their own."""

import json
import os
import select
import subprocess
import time
from typing import IO, cast

from .. import registry
from . import kernel, network, session
from .plain import DesktopConfig, SetupError

# So often is a server that ended started again.
RESTARTS = 5


class Internet:
    """`online_env.embedded.sites` on 10.77.0.1, the desktop's default route and name server.

    What is done on the sites is kept in `state`, a folder that the desktop cannot see.
    """

    def __init__(self, order: DesktopConfig, name: str) -> None:
        self.state = registry.folder(name) / "sites"
        self.state.mkdir(mode=0o700)
        self._log = registry.folder(name) / "logs/sites.log"
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
        self._left = RESTARTS
        self._process = self._start()

    def wait(self) -> None:
        """Wait until it serves.

        Raises:
            SetupError: It does not.
        """
        output = cast("IO[bytes]", self._process.stdout)
        ready, _, _ = select.select([output], [], [], max(0.0, self._deadline - time.monotonic()))
        line = output.readline() if ready else b""
        if not line or "http" not in json.loads(line):
            raise SetupError(f"the local internet does not serve; {self._tail()}")

    def look_after(self) -> None:
        """Start it again where it has ended, a few times.

        Raises:
            SetupError: It ends again and again: without it a desktop would seem to work.
        """
        if self._process.poll() is None:
            return
        if not self._left:
            raise SetupError(f"the local internet ended {RESTARTS + 1} times; {self._tail()}")
        self._left -= 1
        cast("IO[bytes]", self._process.stdout).close()
        self._process = self._start()

    def _tail(self) -> str:
        text = self._log.read_text(encoding="utf-8", errors="replace")[-800:].strip()
        return f"the end of sites.log: {text or '(empty)'}"

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        cast("IO[bytes]", self._process.stdout).close()

    def _start(self) -> "subprocess.Popen[bytes]":
        with open(self._log, "ab") as log:
            return subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                cwd="/",
                preexec_fn=self._enter,
                env={"PATH": os.environ.get("PATH", os.defpath), "LANG": "C.UTF-8"},
            )

    def _enter(self) -> None:
        kernel.die_with_parent()
        kernel.join_namespace(self._namespace, kernel.CLONE_NEWNET)
        # With forwarding on and no way out, other addresses are "unreachable" at once instead of
        # after minutes.
        with open("/proc/sys/net/ipv4/ip_forward", "w", encoding="ascii") as setting:
            setting.write("1")
