"""Forwarding of ports of the machine's loopback interface to a desktop.

A child process of the keeper serves the ports. It runs on the machine; only its connection to a
port of the desktop is in the desktop's network. The desktop itself has no socket of the machine's
and no interface that leads to it.

Only the desktop's owner is let in; the kernel names the user who opened a connection.
"""

import contextlib
import os
import socket
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from . import kernel

LOOPBACK = "127.0.0.1"
# Inside: what OSWorld's clients reach beside the guest server: the browser's tools, and VLC's page.
OSWORLD_PORTS = {"chromium": 9222, "vlc": 8080}
CHUNK = 1 << 18
ACCEPT_PAUSE_S = 0.1  # s before accepting again what could not be accepted
_ESTABLISHED = "01"
_REFUSAL = b"only the user who started this desktop (or root) may use it\n"
_REFUSED = (
    b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nConnection: close\r\n"
    b"Content-Length: %d\r\n\r\n%s" % (len(_REFUSAL), _REFUSAL)
)


class Owners:
    """Who may connect: this process' user, root, and who became root by sudo.

    Make it while this process is in the machine's network and user namespace.
    """

    def __init__(self) -> None:
        self._allowed = {0, os.geteuid()}
        if os.geteuid() == 0 and os.environ.get("SUDO_UID", "").isdigit():
            self._allowed.add(int(os.environ["SUDO_UID"]))
        # The kernel goes on showing the network of who opened them.
        names = ("/proc/self/net/tcp", "/proc/self/net/tcp6")
        self._tables = [os.open(name, os.O_RDONLY) for name in names if os.path.exists(name)]

    def allow(self, caller: socket.socket) -> bool:
        """Return whether the other end of an accepted connection is one of them.

        Only a connection that its owner holds counts: the kernel gives the others to root.
        """
        remote = _kernel_notation(caller.getpeername())
        local = _kernel_notation(caller.getsockname())
        for table in self._tables:
            for row in _rows(table):
                if row.is_between(remote, local):
                    return row.inode != "0" and row.uid in self._allowed
        return False


@dataclass(frozen=True)
class _Row:
    """A connection in one of the kernel's tables."""

    local: str
    remote: str
    state: str
    uid: int
    inode: str

    def is_between(self, local: str, remote: str) -> bool:
        """Return whether it is open between these two addresses."""
        if self.state != _ESTABLISHED:
            return False
        return self.local.endswith(local) and self.remote.endswith(remote)


def _rows(table: int) -> "list[_Row]":
    text = b""
    piece = os.pread(table, CHUNK, 0)
    while piece:
        text += piece
        piece = os.pread(table, CHUNK, len(text))
    rows: list[_Row] = []
    for line in text.decode("ascii").splitlines()[1:]:
        words = line.split()
        rows.append(_Row(words[1], words[2], words[3], int(words[7]), words[9]))
    return rows


def _kernel_notation(address: tuple[str, int]) -> str:
    """An IPv4 address and port as the kernel's tables have it, at the end of a mapped one, too."""
    number = int.from_bytes(socket.inet_aton(address[0]), sys.byteorder)
    return f"{number:08X}:{address[1]:04X}"


@dataclass(frozen=True)
class Port:
    """A listening socket on the machine, and where it leads.

    That is a path, or a port of the desktop's loopback interface.
    """

    listener: socket.socket
    target: "str | int"


def listen(host: str, port: int = 0) -> socket.socket:
    """Return a listening socket on `host`: at port `port`, or any other if that is taken.

    Raises:
        OSError: There is no such address.
    """
    try:
        return socket.create_server((host, port), backlog=128)
    except OSError:
        if not port:
            raise
        return socket.create_server((host, 0), backlog=128)


def start(ports: "list[Port]", owners: Owners, network: Path, log: int) -> int:
    """Fork the process that serves `ports`; it ends with this process.

    Args:
        ports: to serve.
        owners: the users who may connect.
        network: of the desktop.
        log: descriptor that its errors go to.

    Returns:
        Its number.
    """
    keeper = os.getpid()
    pid = os.fork()
    if pid:
        for port in ports:
            port.listener.close()
        return pid
    _serve(ports, owners, network, keeper, log)


def _serve(ports: "list[Port]", owners: Owners, network: Path, keeper: int, log: int) -> NoReturn:
    try:
        kernel.die_with_parent(keeper)
        os.setsid()
        os.dup2(os.open("/dev/null", os.O_WRONLY), 1)  # the reports are the keeper's
        os.dup2(log, 2)
        threads = [threading.Thread(target=_attend, args=(port, owners, network)) for port in ports]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        os._exit(1)


def _attend(port: Port, owners: Owners, network: Path) -> None:
    if isinstance(port.target, int):
        # This thread, and those that it starts. A socket of the others has its path in the list of
        # the network that it was made in.
        kernel.join_namespace(str(network), kernel.CLONE_NEWNET)
    while True:
        try:
            caller, _ = port.listener.accept()
        except OSError:  # no descriptors left: others give some back
            time.sleep(ACCEPT_PAUSE_S)
            continue
        work = (caller, port.target, owners)
        threading.Thread(target=_connect, args=work, daemon=True).start()


def _connect(caller: socket.socket, target: "str | int", owners: Owners) -> None:
    with caller, contextlib.suppress(OSError):
        caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if not owners.allow(caller):
            caller.sendall(_REFUSED)
            caller.shutdown(socket.SHUT_WR)
            caller.recv(CHUNK)  # otherwise its request makes the answer be thrown away
            return
        with _reach(target) as desktop:
            backward = threading.Thread(target=_pump, args=(desktop, caller), daemon=True)
            backward.start()
            _pump(caller, desktop)
            backward.join()


def _reach(target: "str | int") -> socket.socket:
    if isinstance(target, int):
        return socket.create_connection((LOOPBACK, target), timeout=None)
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(target)
    return connection


def _pump(source: socket.socket, sink: socket.socket) -> None:
    """Pass on the bytes of `source` until it ends, and then that it has ended."""
    with contextlib.suppress(OSError):
        data = source.recv(CHUNK)
        while data:
            sink.sendall(data)
            data = source.recv(CHUNK)
    with contextlib.suppress(OSError):
        sink.shutdown(socket.SHUT_WR)
