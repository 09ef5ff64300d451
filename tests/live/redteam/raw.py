"""Asks the local internet's name server by a frame of our own making. Prints OPEN if answered."""

import contextlib
import socket
import struct
import time
from pathlib import Path

SITE, ME = "10.77.0.1", "10.77.0.2"


def gateway():
    poke = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with poke, contextlib.suppress(OSError):
        poke.sendto(b"x", (SITE, 9))
    time.sleep(0.2)
    for row in Path("/proc/net/arp").read_text().splitlines()[1:]:
        fields = row.split()
        if fields[0] == SITE:
            return bytes.fromhex(fields[3].replace(":", ""))
    return b"\xff" * 6


def checksum(data):
    total = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def frame(mac):
    name = b"".join(bytes([len(part)]) + part for part in (b"shop", b"test")) + b"\0"
    question = struct.pack(">6H", 0x4141, 0x0100, 1, 0, 0, 0) + name + struct.pack(">2H", 1, 1)
    udp = struct.pack(">4H", 33333, 53, 8 + len(question), 0) + question
    parts = (0x45, 0, 20 + len(udp), 1, 0, 64, 17)
    ends = socket.inet_aton(ME) + socket.inet_aton(SITE)
    head = struct.pack(">BBHHHBBH", *parts, 0) + ends
    head = struct.pack(">BBHHHBBH", *parts, checksum(head)) + ends
    result = bytes.fromhex(Path("/sys/class/net/eth0/address").read_text().strip().replace(":", ""))
    return mac + result + b"\x08\x00" + head + udp


try:
    line = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
    line.bind(("eth0", 0))
except OSError as error:
    print(f"refused: {error}")
    raise SystemExit from None
line.settimeout(0.5)
line.send(frame(gateway()))
end = time.monotonic() + 3
while time.monotonic() < end:
    try:
        data = line.recv(4096)
    except TimeoutError:
        continue
    if (
        b"AA" in data[42:44]
        and data[12:14] == b"\x08\x00"
        and data[26:30] == socket.inet_aton(SITE)
    ):
        print("OPEN: the name server answered")
        break
