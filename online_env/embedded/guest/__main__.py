"""`python -m online_env.embedded.guest`: load everything, become the user, then open the ports.

The order matters: the interpreter and its packages may lie where that user can't read them.
"""

import argparse
import asyncio
import contextlib
import errno
import os
import pwd
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import uvicorn

from . import preload
from .commands import TOOLS
from .freeze import Freezer
from .machine import GuestMachine
from .server import make_app

BACKLOG = 128
REFUSED = 2
EXHAUSTED = 3
# What accept(2) says when this process, or the system, has no room for another connection.
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until a signal ends it; returns 2 for wrong usage."""
    options = _options(arguments)
    if os.geteuid() == 0 and not options.user:
        return _refuse(
            "the server runs commands for whoever asks and never does so as root; add --user NAME"
        )
    source = options.token_file or options.token_from
    if source is None and not options.osworld:
        return _refuse(
            "give --token-file FILE, or --osworld to serve OSWorld's routes without a token"
        )
    try:
        token = None if source is None else _read_all(source)
        if token == "":
            return _refuse(f"{source} is empty: it must hold the token")
        preload.everything()
        if options.user:
            become(options.user)
        sockets = [_listen(host, options.port) for host in options.host.split(",") if host]
        if options.listen is not None:
            sockets.append(socket.socket(fileno=options.listen))
        freeze_listener = None if options.freeze is None else socket.socket(fileno=options.freeze)
    except (OSError, KeyError, UnicodeDecodeError) as error:
        return _refuse(f"{error}")
    os.chdir(os.environ.get("HOME", "/"))
    os.umask(0o022)
    machine = GuestMachine(options.bin)
    if freeze_listener is not None:
        Freezer(freeze_listener, machine.name, machine.screen).start()
    config = uvicorn.Config(
        make_app(machine, token, options.osworld),
        log_level="warning",
        access_log=False,
        lifespan="off",
        ws="none",
        http="h11",
        loop="asyncio",
        timeout_keep_alive=75,
    )
    asyncio.run(_Server(config, options.ready).serve(sockets=sockets))
    return 0


class _Server(uvicorn.Server):
    """Says when it serves: a line to the descriptor `ready`, if there is one."""

    def __init__(self, config: uvicorn.Config, ready: int | None) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self._ready is not None:
            # Whoever waits for that line starts the server again when it ends.
            asyncio.get_running_loop().set_exception_handler(_end_if_exhausted)
            with contextlib.suppress(BrokenPipeError):  # nobody waits any more
                os.write(self._ready, b"ready\n")
            os.close(self._ready)


def _end_if_exhausted(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """End this process if it can accept no connection, for lack of descriptors or memory."""
    error = context.get("exception")
    if isinstance(error, MemoryError) or getattr(error, "errno", None) in _EXHAUSTED:
        os.write(2, f"the guest server ends: {error}\n".encode())
        os._exit(EXHAUSTED)
    loop.default_exception_handler(context)


def _read_all(source: Path | int) -> str:
    """Return the content of a file, or of the file behind a descriptor."""
    with open(source, encoding="ascii") as file:
        return file.read().strip()


def become(user: str) -> None:
    """Give up all rights but those of `user`, for good.

    A missing account is a `KeyError`.

    Raises:
        PermissionError: We are neither root nor that user.
    """
    account = pwd.getpwnam(user)
    if os.geteuid() == 0:
        os.initgroups(user, account.pw_gid)
        os.setresgid(account.pw_gid, account.pw_gid, account.pw_gid)
        os.setresuid(account.pw_uid, account.pw_uid, account.pw_uid)
    elif os.geteuid() != account.pw_uid:
        raise PermissionError(f"only root can become {user!r}")
    os.environ.setdefault("HOME", account.pw_dir)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m online_env.embedded.guest", description=__doc__
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        help="addresses to listen on, with commas between; may be empty",
    )
    parser.add_argument("--port", type=int, default=5000)
    parser.add_argument(
        "--token-file",
        type=Path,
        help="a file that holds the token; read before rights are given up",
    )
    parser.add_argument(
        "--token-from", type=int, help="a descriptor from which the token can be read"
    )
    parser.add_argument(
        "--osworld", action="store_true", help="serve OSWorld's routes without a token"
    )
    parser.add_argument("--user", help="the account to run as; needed as root")
    parser.add_argument("--listen", type=int, help="descriptor of one more listening socket")
    parser.add_argument(
        "--freeze", type=int, help="descriptor of a socket whose callers may freeze the screen"
    )
    parser.add_argument(
        "--ready", type=int, help="a descriptor that is told when the server serves"
    )
    parser.add_argument(
        "--bin", default=TOOLS, help="the folder of our wrappers (python, google-chrome)"
    )
    return parser.parse_args(arguments)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio switches Nagle's algorithm off only where the protocol is named; with it each answer
    # takes 40 ms more.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        raise OSError(f"can't listen on {host} port {port}: {error.strerror}") from None
    listener.listen(BACKLOG)
    return listener


def _refuse(message: str) -> int:
    print(f"online_env.embedded.guest: {message}", file=sys.stderr)
    return REFUSED


if __name__ == "__main__":
    sys.exit(main())
