"""Process 1 of a container that is a desktop (`hijack desktop image container`).

It starts the session and the guest server, as process 1 of an embedded desktop does, and makes the
desktop pristine when whoever holds the token asks for it. It needs no right that a container of
Docker's or Podman's lacks by default; a program inside cannot end it.
"""

import argparse
import contextlib
import importlib
import os
import secrets
import signal
import socket
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ..runtime import image_python, init, kernel, session
from ..runtime.desktop_config import DesktopConfig, SetupError
from ..runtime.framebuffer import DesktopEndpoints, Framebuffer
from ..runtime.identity import Identity
from . import pristine
from .control import Control

GUEST_PORT = 5000
TOKEN = "AGENTHIJACK_TOKEN"
SERVER = "/usr/local/lib/desktop-server"
FOLDER = Path("/run/desktop-server")
BACKLOG = 128


class Container(init.Init):
    """Process 1 of the container, for one session.

    Args:
        order: what to start.
        token: what clients must show.
        guest: the socket of the guest server.
    """

    def __init__(self, order: DesktopConfig, token: str, guest: socket.socket) -> None:
        # No user namespace, and the numbers inside are those outside.
        identity = Identity(-1, 0, False)
        framebuffer = Framebuffer(order.screen, FOLDER, identity)
        super().__init__(
            order,
            FOLDER,
            token,
            identity,
            DesktopEndpoints(framebuffer, guest),
            logs=os.open(FOLDER / "logs", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC),
        )

    def begin(self) -> None:
        """Start all of a session, and wait until it is usable.

        Raises:
            SetupError: A part of it does not come up.
        """
        self._start_spawner()
        self._write_authority()
        self._start_servers()
        self._start_session()
        for name, program in session.LATE.items():
            self.start(name, program.argv)

    def end(self) -> None:
        """End every other process of the container, and close what the session had."""
        with contextlib.suppress(ProcessLookupError):  # there is none
            os.kill(-1, signal.SIGKILL)
        with contextlib.suppress(ChildProcessError):
            while True:
                os.wait()
        self.spawner.close()
        self.endpoints.framebuffer.close()
        self.logs.close()
        os.close(self.wake)


def main(arguments: Sequence[str] | None = None) -> int:
    """Be the desktop until the container is stopped.

    Returns:
        The exit code: 2 where the container is not started as it must be.
    """
    options = _options(arguments)
    token = os.environ.pop(TOKEN, "") or secrets.token_urlsafe(24)
    # It ends all processes that it sees before each reset, so they have to be the container's own.
    if os.getpid() != 1 or os.geteuid() != 0:
        print(
            "the desktop must be process 1 of its container, as root: start it without --init,"
            " --pid and --user",
            file=sys.stderr,
        )
        return 2
    kernel.forbid_reading()  # the token was in this process' environment
    os.umask(0o022)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: os._exit(0))
    width, height = (int(number) for number in options.size.split("x"))
    order = DesktopConfig(
        name="container",
        screen=(width, height),
        layer=f"{SERVER}/layer",
        search_path=(),
        python=image_python.PYTHON,
        apps=tuple(options.app),
        osworld=options.osworld,
        time_out=options.time_out,
    )
    guest = _listen(options.port)
    control = Control(options.port + 1, token)
    control.load()
    _load()
    image_python.forget_modules()
    started = pristine.begin(order)
    print(f"token {token}", flush=True)
    return _serve(order, token, guest, control, started)


def _serve(
    order: DesktopConfig, token: str, guest: socket.socket, control: Control, started: int
) -> int:
    """Start sessions, one after the other, until one cannot be started or has ended."""
    while True:
        began = time.monotonic()
        container = Container(order, token, guest)
        try:
            container.begin()
            seconds = time.monotonic() - began
            control.answer({"ready": True, "seconds": round(seconds, 3)})
            print(f"ready ({seconds:.1f} s)", flush=True)
            control.wait(container.attend)
            container.end()
            pristine.check(started)
            pristine.fill(order)
        except (SetupError, OSError) as error:
            print(error, file=sys.stderr, flush=True)
            control.answer({"error": str(error)})
            return 1


def _load() -> None:
    """Import what guest servers need, while files can still be trusted."""
    for name in ("window_report", "guest.__main__"):
        importlib.import_module(f"online_env.embedded.{name}")
    from ..guest import preload

    preload.everything()


def _listen(port: int) -> socket.socket:
    # asyncio switches Nagle's algorithm off only where the protocol is named.
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("0.0.0.0", port))
    listener.listen(BACKLOG)
    return listener


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="desktop", description="A container that is a desktop.")
    parser.add_argument("--size", default="1920x1080", help="screen as WIDTHxHEIGHT in pixels")
    parser.add_argument(
        "--app",
        action="append",
        default=[],
        choices=sorted(session.APPS),
        help="open this before it is ready; may be given more than once",
    )
    parser.add_argument(
        "--osworld",
        action="store_true",
        help="OSWorld's routes without a token, sudo without a password",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=GUEST_PORT,
        help="of the guest server; resets are asked for on the next one",
    )
    parser.add_argument("--time-out", type=float, default=60.0, help="seconds for a start")
    return parser.parse_args(arguments)
