"""Looks into the processes whose names are given: memory, environment, descriptors. Prints OPEN for
each look."""

import ctypes
import os
import sys
from pathlib import Path

libc = ctypes.CDLL(None, use_errno=True)
PTRACE_ATTACH, PIDFD_GETFD = 16, 438


def grab(pid):
    handle = os.pidfd_open(pid)
    return [n for n in range(64) if libc.syscall(PIDFD_GETFD, handle, n, 0) >= 0]


LOOKS = {
    "environ": lambda pid: Path(f"/proc/{pid}/environ").read_bytes(),
    "mem": lambda pid: os.open(f"/proc/{pid}/mem", os.O_RDONLY),
    "maps": lambda pid: Path(f"/proc/{pid}/maps").read_text(),
    "descriptors": lambda pid: [
        os.readlink(f"/proc/{pid}/fd/{n}") for n in os.listdir(f"/proc/{pid}/fd")
    ],
    "root": lambda pid: os.listdir(f"/proc/{pid}/root/"),
    "program": lambda pid: os.readlink(f"/proc/{pid}/exe"),
    "grab": grab,
    "trace": lambda pid: libc.ptrace(PTRACE_ATTACH, pid, 0, 0) == 0,
}
for name in filter(str.isdigit, os.listdir("/proc")):
    try:
        title = Path(f"/proc/{name}/comm").read_text().strip()
    except OSError:
        continue
    if title not in sys.argv[1:]:
        continue
    print("looking at", title)
    for kind, look in LOOKS.items():
        try:
            if look(int(name)):
                print("OPEN:", title, kind)
        except OSError as error:
            print("refused:", title, kind, error)
