"""The processes of this machine as /proc shows them; one that has just ended has no name and no
command line."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from online_env.embedded.runtime.guest_spawner import SERVER_PROCESS_NAME

# A process that traces another one: that one stops, and its parent does not learn of it.
_TRACER = """
import ctypes, os, sys
attach, any_thread = 16, 0x40000000  # PTRACE_ATTACH, __WALL
pid = int(sys.argv[1])
assert ctypes.CDLL(None).ptrace(attach, pid, None, None) == 0
while os.WIFSTOPPED(os.waitpid(pid, any_thread)[1]):
    print("stopped", flush=True)
"""


@contextlib.contextmanager
def traced(pid: int) -> Iterator[None]:
    """Keep a process from running, and its parent from noticing; it may be killed meanwhile."""
    command = [sys.executable, "-c", _TRACER, str(pid)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as tracer:
        assert tracer.stdout is not None
        assert tracer.stdout.readline() == b"stopped\n"
        try:
            yield
        finally:
            tracer.kill()


def children(pid: int) -> list[int]:
    """Pids, as the machine counts them, of what `pid` started."""
    return [int(word) for word in _read(pid, f"task/{pid}/children").split()]


def comm(pid: int) -> str:
    """The name of a process."""
    return _read(pid, "comm").decode().strip()


def cmdline(pid: int) -> bytes:
    """The command line of a process."""
    return _read(pid, "cmdline")


def parent(pid: int) -> int:
    """The pid of what started a process."""
    return int(_read(pid, "stat").rpartition(b")")[2].split()[1])


def state(pid: int) -> str:
    """The letter of what a process does: `R`, `S`, `T` (stopped) ...; empty if it is gone."""
    return (_read(pid, "stat").rpartition(b")")[2].split() or [b""])[0].decode()


def guest_server(record: dict) -> int:
    """The guest server of a desktop."""
    matches = [pid for pid in children(record["init"][0]) if comm(pid) == SERVER_PROCESS_NAME]
    return matches[0]


def _read(pid: int, name: str) -> bytes:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/{name}").read_bytes()
    return b""
