"""The embedded desktop: `Desktop` (protocol.py) on this machine, without a virtual machine."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hijack_data.types import Size, UInt8Array

from ..desktops.http import HttpDesktop
from ..desktops.protocol import CAPABILITIES, Capability, RunResult, TaskConfig
from ..errors import DesktopError, GuestError, MissingCapabilityError, UnknownDesktopError
from . import handle, network_root
from .desktop_supply import DesktopSupply
from .runtime import network, registry
from .runtime.frame_reader import FrameReader
from .runtime.rootless import LACKING

RESTART_TIMEOUT_S = 20.0  # s that the guest server may take to be there again after it has ended


class EmbeddedDesktop:
    """A desktop in namespaces of its own, pristine after every `reset`.

    Make one with `up`, or reach one that runs with `attach`. Use it in a `with` statement, or call
    `close`. It ends with this process, whatever ends this process.
    """

    def __init__(self, supply: DesktopSupply | None, record: dict[str, Any]) -> None:
        self._supply = supply
        self._use(record)

    @classmethod
    def up(
        cls,
        size: Size = (1080, 1920),
        name: str | None = None,
        apps: Sequence[str] = (),
        *,
        standby: bool = False,
        osworld: bool = False,
        time_out: float = 60.0,
        image: str | None = None,
    ) -> "EmbeddedDesktop":
        """Start a desktop and wait until it is usable.

        Args:
            size: `(height, width)` of the screen in pixels. A `UserWarning` is given if it is
                higher than wide, as (1920, 1080) is.
            name: its id; each `reset` builds another one, called `name-2`, `name-3` ...
            apps: applications that are open when it is ready: `browser editor files terminal writer
                calc impress code`.
            standby: keep a second desktop ready, so that `reset` is quick. It costs the memory of
                one more.
            osworld: open OSWorld's routes without a token and let sudo work without a password.
            time_out: seconds until a desktop counts as failed.
            image: the image that it starts from (`hijack desktop image`), by name or id; `host` for
                the machine's own packages. Without it `$AGENTHIJACK_IMAGE` decides, and else what
                `hijack desktop install` chose.

        If it does not start, it is a `DesktopError` (or a subclass) with the reason and the log.
        """
        order = handle.make_order(
            size, name, tuple(apps), osworld=osworld, time_out=time_out, image=image
        )
        height, width = size
        if height > width:
            warnings.warn(
                f"size is (height, width): this desktop will be {width} wide and {height} high;"
                f" for a {height}x{width} screen give size=({width}, {height})",
                stacklevel=2,
            )
        supply = DesktopSupply(order, standby=standby)
        try:
            return cls(supply, supply.next())
        except BaseException:
            supply.close()
            raise

    @classmethod
    def attach(cls, name: str) -> "EmbeddedDesktop":
        """Reach the running desktop `name`; `close` then lets it run.

        Raises:
            UnknownDesktopError: There is no such desktop.
        """
        record = registry.load(name)
        if record is None or registry.state(record) != "ready":
            running_ids = ", ".join(r["id"] for r in registry.records()) or "none"
            raise UnknownDesktopError(
                f"no running desktop {name!r}; there are: {running_ids} (hijack desktop list)"
            )
        return cls(None, record)

    def __enter__(self) -> "EmbeddedDesktop":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def id(self) -> str:
        """The name of the present desktop; another one after `reset`."""
        return self.record["id"]

    @property
    def size(self) -> Size:
        """`(height, width)` of the screen in pixels."""
        width, height = self.record["screen"]
        return height, width

    @property
    def capabilities(self) -> frozenset[Capability]:
        """All of them."""
        return CAPABILITIES

    @property
    def namespace(self) -> Path:
        """The network namespace, for `nsenter --net=...` or a firewall rule from outside.

        Raises:
            MissingCapabilityError: The desktop was started without root; its namespaces have no
                names outside.
        """
        if self.record["rootless"]:
            raise MissingCapabilityError(f"desktop {self.id!r} was started without root: {LACKING}")
        return network.NETNS / self.record["netns"]

    def network_root(self, script: str) -> RunResult:
        """Run a shell script on this machine with root's rights over the desktop's network.

        Raises:
            DesktopError: The desktop has ended, or the script does not end.
        """
        self._check_alive()
        return network_root.run(self.record, script)

    @property
    def client(self) -> HttpDesktop:
        """The client of the guest server, for what the protocol does not have."""
        return self._client

    def screenshot(self) -> UInt8Array:
        """Return the screen with the pointer drawn, read from the X server's memory.

        Returns:
            uint8 RGB `[H, W, 3]`.
        """
        self._check_alive()
        try:
            return self._frames.read()
        # the guest server has just ended, or shows a screen of another kind
        except (OSError, ValueError):
            return self._ask("screenshot")

    def accessibility(self) -> str:
        """Return the accessibility tree in OSWorld's XML dialect."""
        return self._ask("accessibility")

    def run(self, code: str) -> RunResult:
        """Run pyautogui `code` as the desktop's user."""
        return self._ask("run", code)

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command as the desktop's user; a string goes to the shell.

        Args:
            argv: the command.
            timeout: in seconds.
        """
        return self._ask("execute", argv, timeout)

    def tool(
        self, name: str, operation: str, fields: Mapping[str, Any], timeout: float = 60
    ) -> dict[str, Any]:
        """Have the guest server carry out an operation of effects, in its own process.

        Args:
            name: of a tool (`online_env.embedded.guest.inside`).
            operation: of it.
            fields: its arguments.
            timeout: in seconds.
        """
        return self._ask("tool", name, operation, fields, timeout)

    def read_file(self, path: str) -> bytes:
        """Return the content of a file that the desktop's user may read."""
        return self._ask("read_file", path)

    def write_file(self, path: str, data: bytes) -> None:
        """Write a file as the desktop's user."""
        self._ask("write_file", path, data)

    def reset(self, task: TaskConfig | None = None) -> None:
        """Replace the desktop by a pristine one: new namespaces, home, session and applications.

        The runner of `task` sets up what it needs; nothing of it is read here.

        Raises:
            DesktopError: The new desktop cannot be built.
        """
        if self._supply is None:
            raise DesktopError(
                f"desktop {self.id!r} belongs to another process, which alone can reset it"
            )
        self._let_go()
        self._use(self._supply.next())

    def wait_for_standby(self) -> bool:
        """Wait until the standby desktop is ready; `reset` waits by itself.

        Returns:
            Whether there is one.
        """
        return self._supply is not None and self._supply.ready()

    def close(self) -> None:
        """End the desktop and wait until nothing of it is left; closing twice is fine."""
        self._let_go()
        if self._supply is not None:
            self._supply.close()

    def _use(self, record: dict[str, Any]) -> None:
        self.record = record
        token = Path(record["token_file"]).read_text(encoding="ascii")
        width, height = record["screen"]
        self._client = HttpDesktop(
            record["guest"],
            token,
            size=(height, width),
            restart_timeout=RESTART_TIMEOUT_S,
            door=record["door"],
        )
        self._frames = FrameReader(record)

    def _let_go(self) -> None:
        self._client.close()
        self._frames.close()

    def _ask(self, method: str, *arguments: object) -> Any:
        self._check_alive()
        try:
            return getattr(self._client, method)(*arguments)
        except GuestError:
            self._check_alive()
            raise

    def _check_alive(self) -> None:
        reason = self._supply.ended() if self._supply else None
        if reason is None and not registry.alive(self.record["init"]):
            reason = "its first process is gone"
        if reason is not None:
            raise DesktopError(f"desktop {self.id!r} has ended: {reason}; reset() makes a new one")
