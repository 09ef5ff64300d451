"""The network as a program inside the guest sees it, for effects. Needs Python only."""

import concurrent.futures
import json
import random
import socket
import struct
import time
from collections.abc import Callable
from typing import Any

ESTABLISHED = "01"
LISTEN = "0A"
REJECT = 0x200  # RTF_REJECT: the kernel's mark of an unreachable route
LOCAL = ("127.", "::1")
DNS_PORT = 53
HTTP_PORT = 80
RECURSION_DESIRED = 0x100
A_RECORD = 1
INTERNET = 1
MAPPED = b"\0" * 10 + b"\xff\xff"  # how an IPv6 address that stands for an IPv4 one begins

_Facts = dict[str, Any]


def survey(sites: list[tuple[str, int]], timeout: float) -> _Facts:
    """Interfaces of the default routes, controlling hosts, and what can be reached."""
    targets: list[_Facts] = [{"kind": "tcp", "host": host, "port": port} for host, port in sites]
    outside = [server for server in name_servers() if not server.startswith(LOCAL)]
    if outside:
        targets.append({"kind": "dns", "host": outside[0], "name": sites[0][0]})
    return {"interfaces": interfaces(), "hosts": hosts(), **reach(targets, timeout)}


def interfaces() -> list[str]:
    """Return the interfaces that default routes leave by, IPv4 then IPv6."""
    names: list[str] = []
    for line in _lines("/proc/net/route")[1:]:
        name, destination, _, flags, _, _, _, mask = line.split()[:8]
        is_default = destination == mask == "00000000"
        if is_default and not int(flags, 16) & REJECT:
            names.append(name)
    for line in _lines("/proc/net/ipv6_route"):
        words = line.split()
        is_default = words[0] == "0" * 32 and words[1] == "00"
        if is_default and not int(words[8], 16) & REJECT:
            names.append(words[9])
    return [name for name in dict.fromkeys(names) if name != "lo"]


def name_servers() -> list[str]:
    """Addresses of the name servers that the guest asks."""
    words = [line.split() for line in _lines("/etc/resolv.conf")]
    return [word[1] for word in words if len(word) > 1 and word[0] == "nameserver"]


def hosts() -> list[str]:
    """Peers of connections to ports that are listened on.

    Whoever controls this guest is among them right now.
    """
    rows = [line.split() for line in _lines("/proc/net/tcp")[1:]]
    rows += [line.split() for line in _lines("/proc/net/tcp6")[1:]]
    listening = {_port(row[1]) for row in rows if row[3] == LISTEN}
    names: set[str] = set()
    for row in rows:
        if row[3] == ESTABLISHED and _port(row[1]) in listening:
            names.add(_address(row[2].rpartition(":")[0]))
    return sorted(address for address in names if not address.startswith(LOCAL))


def _port(text: str) -> str:
    return text.rpartition(":")[2]


def _address(text: str) -> str:
    """Return an address as the kernel prints it: 32-bit words in the machine's byte order."""
    numbers = [int(text[i : i + 8], 16) for i in range(0, len(text), 8)]
    data = struct.pack(f"={len(numbers)}I", *numbers)
    if data.startswith(MAPPED) and len(data) == 16:
        data = data[len(MAPPED) :]
    return socket.inet_ntop(socket.AF_INET if len(data) == 4 else socket.AF_INET6, data)


def _lines(path: str) -> list[str]:
    try:
        with open(path) as file:
            return file.read().splitlines()
    except OSError:
        return []


def reach(targets: list[_Facts], timeout: float) -> _Facts:
    """Try all targets at once.

    Args:
        targets: `{"kind": "tcp", "host", "port"}` or `{"kind": "dns", "host" (the server), "name"}`
            each.
        timeout: for each, in seconds.
    """
    tries = {"tcp": _tcp, "dns": _dns}
    with concurrent.futures.ThreadPoolExecutor(max(len(targets), 1)) as pool:
        jobs = [pool.submit(_timed, tries[target["kind"]], target, timeout) for target in targets]
        results = [job.result() for job in jobs]
    reached = [{**target, **result} for target, result in zip(targets, results, strict=False)]
    return {"reached": reached}


def _timed(work: Callable[[_Facts, float], _Facts], target: _Facts, timeout: float) -> _Facts:
    start = time.monotonic()
    try:
        result = {"ok": True, **work(target, timeout)}
    except OSError as error:
        result = {"ok": False, "error": str(error) or type(error).__name__}
    return {**result, "seconds": round(time.monotonic() - start, 4)}


def _tcp(target: _Facts, timeout: float) -> _Facts:
    with socket.create_connection((target["host"], target["port"]), timeout) as connection:
        return {"address": connection.getpeername()[0]}


def _dns(target: _Facts, timeout: float) -> _Facts:
    """One A question over UDP; any answer to it counts.

    Raises:
        OSError: There is none.
    """
    number = random.randrange(1 << 16)
    parts = [part.encode() for part in target["name"].split(".")]
    name = b"".join(bytes([len(part)]) + part for part in parts)
    header = struct.pack(">6H", number, RECURSION_DESIRED, 1, 0, 0, 0)
    question = header + name + b"\0" + struct.pack(">2H", A_RECORD, INTERNET)
    family = socket.AF_INET6 if ":" in target["host"] else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as asker:
        asker.settimeout(timeout)
        asker.connect((target["host"], DNS_PORT))
        asker.send(question)
        answer = asker.recv(512)
    if answer[:2] != question[:2]:
        raise OSError("the answer is for another question")
    return {}


def speed(
    host: str, port: int, name: str, rounds: int, max_seconds: float, timeout: float
) -> _Facts:
    """Time connections to a site, and a download from it over HTTP.

    Args:
        host: its address.
        port: its port; a download needs 80.
        name: its name, for the request.
        rounds: how many connections are made, one after the other.
        max_seconds: seconds for which the download is timed at most.
        timeout: for each connection, in seconds.
    """
    seconds: list[float] = []
    for _ in range(rounds):
        start = time.monotonic()
        try:
            socket.create_connection((host, port), timeout).close()
        except OSError:
            break
        seconds.append(round(time.monotonic() - start, 5))
    received, download = (
        _download(host, name, max_seconds, timeout) if port == HTTP_PORT else (0, 0.0)
    )
    return {"seconds": seconds, "bytes": received, "download": download}


def _download(host: str, name: str, max_seconds: float, timeout: float) -> tuple[int, float]:
    """Return how many bytes came in how many seconds."""
    received = 0
    start = time.monotonic()
    try:
        with socket.create_connection((host, HTTP_PORT), timeout) as connection:
            request = f"GET / HTTP/1.0\r\nHost: {name}\r\n\r\n"
            start = time.monotonic()
            connection.sendall(request.encode())
            connection.settimeout(max_seconds)
            while time.monotonic() - start < max_seconds:
                part = connection.recv(1 << 16)
                if not part:
                    break
                received += len(part)
    except OSError:
        if not received:
            return 0, 0.0
    return received, max(time.monotonic() - start, 1e-6)


OPERATIONS: dict[str, Callable[..., _Facts]] = {"survey": survey, "reach": reach, "speed": speed}


def main(operation: str, fields: str) -> None:
    """Carry out an operation with JSON `fields`, and print JSON."""
    print(json.dumps(OPERATIONS[operation](**json.loads(fields))))
