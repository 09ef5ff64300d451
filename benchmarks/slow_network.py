"""slow_network by severity: round trip and download rate, in the network of a desktop without one.

    python benchmarks/slow_network.py          # needs root; no desktop is started

Makes the two namespaces and the cable of an embedded desktop, serves a page of 200 kB on one end, and
measures it from the other end as the effect's probe does.
"""

import functools
import http.server
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hijack_data.corruptions import SlowNetwork
from online_env.desktops.protocol import RunResult
from online_env.effects import slow_network
from online_env.effects.guest import Guest
from online_env.embedded.guest import inside
from online_env.embedded.runtime import network

NAME = "bench-slow"
SITE = {"host": network.WEB_ADDRESS, "name": "search.test", "port": 80}
PAGE_BYTES = 200_000


class Namespace:
    """The part of a desktop that the effect asks for."""

    is_ours = True

    def network_root(self, script: str) -> RunResult:
        """Run a shell script in the namespace, as root."""
        return _run(network.desktop_namespace(NAME), ["sh", "-c", script])

    def tool(self, name: str, operation: str, fields: Mapping[str, Any], _: float) -> Any:
        """Run an operation of `nettool` in the namespace."""
        argv = [sys.executable, "-c", inside.source(name), operation, json.dumps(dict(fields))]
        result = _run(network.desktop_namespace(NAME), argv)
        if not result.ok:
            sys.exit(f"{name} {operation} failed in the namespace: {result.error}")
        return json.loads(result.output)


def _run(namespace: str, argv: list[str]) -> RunResult:
    process = subprocess.run(
        ["ip", "netns", "exec", namespace, *argv], capture_output=True, text=True, check=False
    )
    return RunResult("success", process.stdout, process.stderr, process.returncode)


def serve() -> None:
    """Serve the page on the other end of the cable."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "index.html").write_bytes(os.urandom(PAGE_BYTES))
        handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
        http.server.ThreadingHTTPServer((SITE["host"], SITE["port"]), handler).serve_forever()


def main() -> None:
    """Print a row for each severity."""
    network.create(NAME)
    argv = ["ip", "netns", "exec", network.web_namespace(NAME), sys.executable, __file__, "serve"]
    server = subprocess.Popen(argv, stderr=subprocess.DEVNULL)
    try:
        guest: Any = Guest(Namespace(), "", None)  # pyright: ignore[reportArgumentType]
        slow_network.SlowLink().require(guest)
        while not guest.net("speed", 5.0, rounds=2, max_seconds=1.0, **SITE)["bytes"]:
            pass
        print("| severity | kbit/s | packet, ms | round trip, ms | download, kbit/s |")
        print("|---|---|---|---|---|")
        print(_row("none", "", "", slow_network._measure(guest, SITE)))
        for level in range(1, 6):
            rate = SlowNetwork.at(level).rate
            limited = guest.root(slow_network._limit(["eth0"], rate))
            if not limited.ok:
                sys.exit(limited.error)
            packet = f"{1000 * slow_network._packet_seconds(rate):.0f}"
            print(_row(str(level), str(rate), packet, slow_network._measure(guest, SITE)))
            guest.root(slow_network._REMOVE)
        print(_row("undone", "", "", slow_network._measure(guest, SITE)))
    finally:
        server.kill()
        server.wait()
        network.remove(NAME)


def _row(level: str, rate: str, packet: str, measured: Mapping[str, Any]) -> str:
    trip = f"{1000 * measured['round_trip']:.1f}"
    return f"| {level} | {rate} | {packet} | {trip} | {measured['kbit']:.0f} |"


if __name__ == "__main__":
    serve() if sys.argv[1:] == ["serve"] else main()
