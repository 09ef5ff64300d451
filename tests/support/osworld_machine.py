"""A machine that nobody of the benchmark made, reached by HTTP alone, as OSWorld's own machine is.

It is an embedded desktop in OSWorld's mode in a process of its own. `python -m
support.osworld_machine` prints its address, then the command that resets it, and runs until its
input is closed. Root inside may set firewall rules, as root of a virtual machine may: an embedded
desktop keeps its network out of root's reach, so its `nft` asks this process.
"""

import contextlib
import http.server
import json
import os
import shlex
import socket
import sys
import threading
from typing import Any

from online_env import EmbeddedDesktop
from online_env.embedded import network_root

SOCKET = "/run/nft.sock"
NFT = f"""#!/usr/bin/python3 -I
import json, socket, sys
answer = b""
with socket.socket(socket.AF_UNIX) as link:
    link.connect("{SOCKET}")
    rules = sys.stdin.read() if "-f" in sys.argv else ""
    link.sendall(json.dumps([sys.argv[1:], rules]).encode())
    link.shutdown(socket.SHUT_WR)
    while block := link.recv(65536):
        answer += block
code, output, error = json.loads(answer)
sys.stdout.write(output)
sys.stderr.write(error)
sys.exit(code)
"""


class Firewall:
    """Answers the `nft` of a desktop."""

    def __init__(self, machine: EmbeddedDesktop) -> None:
        self._record = machine.record
        self._listener = socket.socket(socket.AF_UNIX)
        process = f"/proc/{machine.record['init'][0]}"
        self._listener.bind(f"{process}/root{SOCKET}")
        root = os.stat(process).st_uid  # of the root inside
        os.chown(f"{process}/root{SOCKET}", root, root)
        os.chmod(f"{process}/root{SOCKET}", 0o600)
        self._listener.listen()
        machine.write_file("/tmp/nft", NFT.encode())
        result = machine.execute("sudo install -m 755 /tmp/nft /usr/sbin/nft && rm /tmp/nft")
        assert result.ok, result
        threading.Thread(target=self._answer, daemon=True).start()

    def _answer(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                link, _ = self._listener.accept()
                with link, link.makefile("rwb") as stream:
                    words, rules = json.loads(stream.read())
                    script = f"printf %s {shlex.quote(rules)} | nft {shlex.join(words)}"
                    value = network_root.run(self._record, script)
                    stream.write(json.dumps([value.returncode, value.output, value.error]).encode())

    def close(self) -> None:
        self._listener.close()


def address(machine: EmbeddedDesktop) -> str:
    ports = machine.record["ports"]
    return f"{machine.record['guest']}?chromium={ports['chromium']}&vlc={ports['vlc']}"


def main() -> None:
    width, height = map(int, (sys.argv[1:] or ["1920x1080"])[0].split("x"))
    with EmbeddedDesktop.up(size=(height, width), osworld=True) as machine:
        firewall = Firewall(machine)

        class Control(http.server.BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                nonlocal firewall
                firewall.close()
                machine.reset()
                firewall = Firewall(machine)
                body = f"{address(machine)}\n".encode()
                self.send_response(200)
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                """Write nothing."""

        control = http.server.HTTPServer(("127.0.0.1", 0), Control)
        threading.Thread(target=control.serve_forever, daemon=True).start()
        print(address(machine), flush=True)
        url = f"http://127.0.0.1:{control.server_port}/"
        print(_post(url), flush=True)
        sys.stdin.read()


def _post(url: str) -> str:
    """The command that asks for a reset, and prints where the machine is then."""
    code = f"import urllib.request as u; print(u.urlopen({url!r}, b'', 60).read().decode())"
    return f"{sys.executable} -c {shlex.quote(code)}"


if __name__ == "__main__":
    main()
