"""`python -m online_env.embedded.sites`: serve the local internet.

Its options are `--address A [--dns-port 53] [--http-port 80] [--answer A2] --state DIR`. It prints
one line, `{"address": ..., "dns": port, "http": port}`, when both ports are open, then serves until
a signal ends it (SIGTERM, SIGINT). Its exit status is 0, or 2 with a message if an argument is
wrong or a port is taken.
"""

import argparse
import asyncio
import json
import signal
import sys
from ipaddress import AddressValueError, IPv4Address
from pathlib import Path
from types import FrameType

from .server import bind, serve
from .state import SiteState


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except AddressValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no IPv4 address ({error})") from None


def _port(text: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 5 or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give 0 (any free one) to 65535")
    return int(text)


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m online_env.embedded.sites", description="The local internet of a desktop."
    )
    parser.add_argument("--address", type=_address, required=True, help="IPv4 address to listen on")
    parser.add_argument(
        "--dns-port", type=_port, default=53, help="UDP port of the DNS (default 53, 0 = any)"
    )
    parser.add_argument(
        "--http-port",
        type=_port,
        default=80,
        help="TCP port of the web server (default 80, 0 = any)",
    )
    parser.add_argument(
        "--answer", type=_address, help="what DNS answers for our names (default: --address)"
    )
    parser.add_argument(
        "--state",
        type=Path,
        required=True,
        help="folder for what is done on the sites; empty = new",
    )
    return parser.parse_args(argv)


def _end(number: int, frame: FrameType | None) -> None:
    del number, frame
    sys.exit(0)


def main(argv: list[str] | None = None) -> int:
    """Run the server; returns the exit status."""
    arguments = _arguments(argv)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _end)  # uvicorn closes what is open, then raises the signal again
    try:
        sites = SiteState(arguments.state)
        sockets = bind(arguments.address, arguments.dns_port, arguments.http_port)
    except RuntimeError as error:  # a DesktopError: naming it would load NumPy
        print(error, file=sys.stderr)
        return 2
    dns, http = sockets.ports
    print(json.dumps({"address": str(arguments.address), "dns": dns, "http": http}), flush=True)
    asyncio.run(serve(sockets, arguments.answer or arguments.address, sites))
    return 0


if __name__ == "__main__":
    sys.exit(main())
