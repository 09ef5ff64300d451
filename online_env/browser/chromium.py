"""Find, start and end a Chromium."""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from hijack_data.types import Size

from ..errors import DesktopError, MissingPackageError

VARIABLE = "AGENTHIJACK_CHROMIUM"  # names the program
OLDEST = 128  # the major version; older ones were never tried
SHUTDOWN_TIMEOUT_S = 5.0
_PROGRAMS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
)
_MAC_PROGRAMS = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
# Browsers that Playwright has downloaded, by system.
_PLAYWRIGHT = {
    "linux": (".cache/ms-playwright", "chromium-*/chrome-linux*/chrome"),
    "darwin": ("Library/Caches/ms-playwright", "chromium-*/chrome-mac*/*.app/Contents/MacOS/*"),
}
_INSTALL = "apt-get install chromium, or pip install playwright && playwright install chromium"
_PROFILE = "agenthijack-browser-"
# Nothing is asked, fetched or updated behind a task, and every font and colour is drawn alike.
_HEADLESS = "--headless=new"
_FLAGS = (
    "--remote-debugging-pipe",
    "--no-first-run",
    "--no-default-browser-check",
    "--no-service-autorun",
    "--disable-background-networking",
    "--disable-breakpad",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-gpu",
    "--disable-sync",
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    # Frames of other sites stay in the page's process: its tree, and being offline, include them.
    "--disable-site-isolation-trials",
    # Sites of this machine are like others.
    "--disable-features=Translate,MediaRouter,OptimizationHints,LocalNetworkAccessChecks,"
    "IsolateOrigins,site-per-process",
    "--font-render-hinting=none",
    "--force-color-profile=srgb",
    "--lang=en-US",
    "--metrics-recording-only",
    "--mute-audio",
    "--password-store=basic",
    "--use-mock-keychain",
)


def find_program() -> str:
    """Return the path of a Chromium on this machine.

    Raises:
        MissingPackageError: There is none; the message has the command that installs one.
    """
    configured = os.environ.get(VARIABLE)
    if configured:
        program = shutil.which(configured)
        if program is None:
            raise MissingPackageError(f"{VARIABLE}={configured}: there is no such program")
        return program
    for name in (*_PROGRAMS, *_MAC_PROGRAMS):
        program = shutil.which(name)
        if program is not None:
            return program
    folder, pattern = _PLAYWRIGHT.get(sys.platform, ("", ""))
    downloads = sorted((Path.home() / folder).glob(pattern)) if pattern else []
    if downloads:
        return str(downloads[-1])
    raise MissingPackageError(
        f"no Chromium is on this machine: {_INSTALL}; or name one by {VARIABLE}=PATH"
    )


class Chromium:
    """A running Chromium with a profile of its own.

    Args:
        size: `(height, width)` of its windows in pixels.
        arguments: More arguments of its command line.
        headed: Whether its windows show on a display.

    Attributes:
        reader: The descriptor of the pipe that it writes; who uses it closes it.
        writer: The descriptor of the pipe that it reads; closing it ends Chromium.

    Raises:
        MissingPackageError: No Chromium is installed.
        DesktopError: This system cannot start one with pipes.
    """

    def __init__(
        self, size: Size, arguments: tuple[str, ...] = (), *, headed: bool = False
    ) -> None:
        if not hasattr(os, "posix_spawn"):
            raise DesktopError("a browser is started with pipes, which need Linux or macOS")
        self.program = find_program()
        _remove_left_profiles()
        self._profile = Path(tempfile.mkdtemp(prefix=f"{_PROFILE}{os.getpid()}-"))
        self._log = self._profile / "stderr.txt"
        height, width = size
        command = [
            self.program,
            *_FLAGS,
            *([] if headed else [_HEADLESS]),
            # Chromium refuses to run as root with its own sandbox.
            *(["--no-sandbox"] if os.geteuid() == 0 else []),
            f"--user-data-dir={self._profile / 'profile'}",
            f"--window-size={width},{height}",
            *arguments,
        ]
        child_reader, self.writer = os.pipe()
        self.reader, child_writer = os.pipe()
        log = os.open(self._log, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
        nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
        # Numbers above 4, so that no descriptor is overwritten before it is copied.
        ends = [_above_four(fd) for fd in (child_reader, child_writer, log, nowhere)]
        actions = [
            (os.POSIX_SPAWN_DUP2, ends[3], 0),
            (os.POSIX_SPAWN_DUP2, ends[3], 1),
            (os.POSIX_SPAWN_DUP2, ends[2], 2),
            (os.POSIX_SPAWN_DUP2, ends[0], 3),
            (os.POSIX_SPAWN_DUP2, ends[1], 4),
        ]
        try:
            self._pid = os.posix_spawn(
                self.program, command, dict(os.environ), file_actions=actions, setpgroup=0
            )
        except OSError as error:
            os.close(self.reader)
            os.close(self.writer)
            shutil.rmtree(self._profile, ignore_errors=True)
            raise DesktopError(f"{self.program} cannot be started: {error}") from None
        finally:
            for descriptor in ends:
                os.close(descriptor)
        self._is_running = True

    def read_port(self) -> int:
        """Return the port of `--remote-debugging-port=0`; 0 while there is none."""
        with contextlib.suppress(OSError, ValueError):
            lines = (self._profile / "profile/DevToolsActivePort").read_text().split("\n")
            return int(lines[0])
        return 0

    def explain_end(self) -> str:
        """Return that it has ended, with the end of what it printed."""
        lines: list[str] = []
        with contextlib.suppress(OSError):
            lines = self._log.read_text(errors="replace").split("\n")
        printed = " | ".join(line.strip() for line in lines if line.strip())[-400:]
        return f"the browser {self.program} has ended" + (f": {printed}" if printed else "")

    def close(self) -> None:
        """Wait until it has ended, end it if it does not, and remove its profile."""
        if not self._is_running:
            return
        self._is_running = False
        deadline = time.monotonic() + SHUTDOWN_TIMEOUT_S
        while _runs(self._pid):
            if time.monotonic() > deadline:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._pid, signal.SIGKILL)
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(self._pid, 0)
                break
            time.sleep(0.01)
        shutil.rmtree(self._profile, ignore_errors=True)


def _above_four(descriptor: int) -> int:
    """Return a copy of a descriptor with a number above 4; the descriptor itself is closed."""
    import fcntl

    copy = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 5)
    os.close(descriptor)
    return copy


def _runs(pid: int) -> bool:
    """Return whether a child still runs."""
    try:
        return os.waitpid(pid, os.WNOHANG)[0] == 0
    except ChildProcessError:
        return False


def _remove_left_profiles() -> None:
    """Remove the profiles of processes of this user that were killed; their browsers have ended."""
    for folder in _left_profiles():
        shutil.rmtree(folder, ignore_errors=True)


def _left_profiles() -> Iterator[Path]:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PROFILE}*"):
        pid = folder.name.removeprefix(_PROFILE).partition("-")[0]
        with contextlib.suppress(OSError, ValueError):
            if folder.stat().st_uid != os.geteuid():
                continue
            try:
                os.kill(int(pid), 0)
            except ProcessLookupError:
                yield folder
