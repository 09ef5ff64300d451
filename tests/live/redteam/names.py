"""Looks for the words given in what a desktop shows of itself. Prints OPEN for each place that has
one."""

import os
import sys

WORDS = [word.encode() for word in sys.argv[1:]]
SKIPPED = {"/proc", "/sys", "/dev"}


def tell(place, data):
    for word in WORDS:
        if word.lower() in data.lower():
            print("OPEN:", place, word)


def read(path):
    try:
        with open(path, "rb") as file:
            return file.read(1 << 20)
    except OSError:
        return b""


def links(folder):
    try:
        return b"\0".join(os.readlink(f"{folder}/{n}").encode() for n in os.listdir(folder))
    except OSError:
        return b""


for pid in filter(str.isdigit, os.listdir("/proc")):
    if int(pid) == os.getpid() or b"names.py" in read(f"/proc/{pid}/cmdline"):
        continue
    for name in ("cmdline", "environ", "comm", "mountinfo", "cgroup", "maps"):
        tell(f"/proc/{pid}/{name}", read(f"/proc/{pid}/{name}"))
    tell(f"/proc/{pid}/fd", links(f"/proc/{pid}/fd"))
for name in ("/proc/net/unix", "/proc/keys", "/proc/mounts", "/proc/sys/kernel/hostname"):
    tell(name, read(name))
for folder, folders, files in os.walk("/"):
    folders[:] = [one for one in folders if os.path.join(folder, one) not in SKIPPED]
    tell(folder, "\0".join([*folders, *files]).encode("utf-8", "surrogateescape"))
    if folder.startswith(("/etc", "/home", "/run", "/tmp", "/usr/local")):
        for one in files:
            path = os.path.join(folder, one)
            if not one.endswith("names.py") and os.path.isfile(path):
                tell(path, read(path))
print("looked")
