"""Starting a desktop from the controller: its keeper is started, waited for and ended here."""

import json
import os
import platform
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import IO, Any, cast

from hijack_data.errors import ParameterError, suggest
from hijack_data.types import Size, as_size

from .. import extra
from ..errors import DesktopError, DesktopTimeoutError, RootRequiredError
from . import home
from .image import cache
from .runtime import hidden_folders, registry, session
from .runtime.desktop_config import DesktopConfig, SetupError

PACKAGES = Path(__file__).resolve().parents[2]
_KEEPER = (
    "import sys; sys.path.insert(0, sys.argv[1]); from online_env.embedded.runtime.keeper import"
    " main; sys.exit(main(sys.argv[2]))"
)
LINUX = "Linux"
INSTEAD = "use a desktop of your own over HTTP (docs/bring_your_own_vm.md)"
END_TIMEOUT_S = 4.0  # for a keeper to clear up, before it is killed
SMALLEST = 200
LARGEST = 8192


def require_linux() -> None:
    """Check that this system has the namespaces that a desktop is made of.

    Raises:
        DesktopError: it is another system than Linux.
    """
    if platform.system() != LINUX:
        system = f"{platform.system()} {platform.release()}"
        raise DesktopError(f"an embedded desktop needs Linux, and this is {system}; {INSTEAD}")


def make_order(
    size: Size = (1080, 1920),
    name: str | None = None,
    apps: tuple[str, ...] = (),
    *,
    osworld: bool = False,
    detached: bool = False,
    time_out: float = 60.0,
    image: str | None = None,
) -> DesktopConfig:
    """Check the options of a desktop, and order it.

    A missing extra `online` is a `MissingDependencyError`.

    Args:
        size: (height, width) of the screen in pixels, 200 to 8192 each.
        name: 1 to 20 of `a-z 0-9 -`; `None` for the next free one of d1, d2, ...
        apps: applications that are open when the desktop counts as ready, names in `session.APPS`.
        osworld: open OSWorld's routes without a token and let sudo work without a password.
        detached: let the desktop go on when this process ends.
        time_out: seconds until it counts as failed.
        image: the image that it starts from, or `host` for the machine's own packages; without it
            `$AGENTHIJACK_IMAGE` decides, and else what `hijack desktop install` chose.

    Raises:
        ParameterError: A value is out of range.
        DesktopImageError: There is no such image.
        RootRequiredError: An option needs root.
    """
    require_linux()
    height, width = as_size(size)
    if not (SMALLEST <= height <= LARGEST and SMALLEST <= width <= LARGEST):
        raise ParameterError(
            f"size ({height}, {width}): each side of a desktop is {SMALLEST} to {LARGEST} pixels"
        )
    for app in apps:
        if app not in session.APPS:
            raise ParameterError(f"no application {app!r} to open{suggest(app, session.APPS)}")
    if osworld and os.geteuid() != 0:
        raise RootRequiredError(
            "OSWorld's mode needs root: its tasks call sudo, and without root there is no other"
            " user to become; run the same command with sudo"
        )
    extra.require("an embedded desktop")
    me = os.getpid()
    folder = cache.find_image_folder(image)
    return DesktopConfig(
        name=name,
        screen=(width, height),
        layer=str(home.ensure_layer()),
        search_path=_search_path(),
        python=sys.executable,
        hidden=hidden_folders.hidden(),
        apps=tuple(apps),
        osworld=osworld,
        rootless=os.geteuid() != 0,
        controller=None if detached else (me, registry.process_start(me)),
        time_out=time_out,
        image="" if folder is None else str(folder),
    )


class Handle:
    """A desktop that this process started, by way of its keeper.

    Attributes:
        order: what it was asked to be.
        record: its entry in the registry, once it is ready.
    """

    def __init__(self, order: DesktopConfig) -> None:
        self.order = order
        self.record: dict[str, Any] = {}
        self._started = time.monotonic()
        command = [sys.executable, "-I", "-S", "-c", _KEEPER, str(PACKAGES), order.to_json()]
        self._keeper = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,
            cwd="/",
        )
        self._keeper_start = registry.process_start(self._keeper.pid)
        self._buffer = b""
        self._end: str | None = None

    def wait(self) -> dict[str, Any]:
        """Wait until the desktop is ready and return its record.

        If it cannot be built, it is a `DesktopError` with the reason; if nothing answers, a
        `DesktopTimeoutError`.
        """
        if not self.record:
            try:
                self.record = self._first_report()
            except BaseException:
                self.close()
                raise
        return self.record

    def ended(self) -> str | None:
        """Return why the desktop has ended by itself, or `None` while it runs."""
        if self._end is None:
            dead = bool(self.record) and not registry.alive(self.record["init"])
            # its keeper needs some time to give the reason
            message = self._report(2.0 if dead else 0.0)
            if message is not None:
                self._end = str(message.get("ended") or message.get("error", message))
            elif self._keeper.poll() is not None:
                self._end = f"its keeper ended with exit code {self._keeper.returncode}"
        return self._end

    def has_ended(self) -> bool:
        """Return whether the keeper has ended, and so has cleared up."""
        return self._keeper.poll() is not None

    def close(self, wait: bool = True) -> None:
        """End the desktop.

        Args:
            wait: until nothing is left of it. Otherwise its keeper clears up while the caller goes
                on; call again to make sure.
        """
        for number in (signal.SIGTERM, signal.SIGCONT):  # somebody may have stopped it
            self._keeper.send_signal(number)
        if not wait:
            return
        try:
            self._keeper.wait(timeout=END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._keeper.kill()
            self._keeper.wait()
        cast("IO[bytes]", self._keeper.stdout).close()
        if self._keeper.returncode < 0:
            self._remove_rest()

    def _remove_rest(self) -> None:
        """Remove what a keeper left that was killed, by us or by others.

        Raises:
            DesktopError: That is not possible.
        """
        keeper = [self._keeper.pid, self._keeper_start]
        for record in registry.records():
            if record.get("keeper") == keeper:
                try:
                    registry.remove(record)
                except SetupError as error:
                    raise DesktopError(str(error)) from None

    def release(self) -> None:
        """Let a detached desktop go on after this process."""
        cast("IO[bytes]", self._keeper.stdout).close()
        self._keeper.returncode = 0  # it goes on on purpose: no warning about a running child

    def _first_report(self) -> dict[str, Any]:
        timeout = self.order.time_out + 15 - (time.monotonic() - self._started)
        message = self._report(max(0.0, timeout))
        if message is None:
            raise DesktopTimeoutError(
                f"the desktop's keeper said nothing within {self.order.time_out + 15:.0f} s"
            )
        if "ready" not in message:
            raise DesktopError(f"the desktop did not start: {message.get('error', message)}")
        return message["ready"]

    def _report(self, timeout: float) -> dict[str, Any] | None:
        """Return the keeper's next line within `timeout` seconds, or `None`."""
        output = cast("IO[bytes]", self._keeper.stdout)
        if output.closed:
            return None
        deadline = time.monotonic() + timeout
        while b"\n" not in self._buffer:
            ready, _, _ = select.select([output], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                return None
            piece = os.read(output.fileno(), 65536)
            if not piece:
                return {
                    "ended": f"its keeper ended (exit code {self._keeper.wait()}) and said nothing"
                }
            self._buffer += piece
        line, _, self._buffer = self._buffer.partition(b"\n")
        return json.loads(line)


def _search_path() -> tuple[str, ...]:
    return (str(PACKAGES), *(path for path in sys.path if Path(path).is_dir()))
