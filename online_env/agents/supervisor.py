"""Supervise the process of an agent, with all that it starts.

The supervisor starts the agent's process and stays its parent. It is a child subreaper (Linux), so
that a process which the agent started remains its descendant even after a double fork. When the
agent's process ends, uses too much memory, or the runner is gone, all descendants are killed.

Three descriptors connect it with the runner. Its standard input never carries data and ends with
the runner. On its standard output it writes two lines of JSON: the id of the agent's process, and
how that ended. Its standard error takes what the agent prints.
"""

import contextlib
import ctypes
import json
import mmap
import os
import select
import shutil
import signal
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

POLL_S = 1.0  # seconds between two looks at the memory of the agent
EXIT_TIMEOUT_S = 2.0  # seconds that the agent has to end by itself once the runner is gone
KILL_TIMEOUT_S = 5.0  # seconds until processes that do not end are left alone
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER
_OOM = "/proc/self/oom_score_adj"
_PAGE = mmap.PAGESIZE


def main(control: int, pictures: int, memory: int) -> None:
    """Supervise the process of an agent that is served over two inherited descriptors.

    Args:
        control: the descriptor of the connection to the runner.
        pictures: the descriptor of the memory file.
        memory: bytes that the agent may use; 0 for no limit.
    """
    for number in (control, pictures):
        os.set_inheritable(number, False)  # programs that the agent starts do not get it

    def serve() -> None:
        from .agent_server import AgentServer  # loads NumPy, which starts threads

        AgentServer(socket.socket(fileno=control), pictures).run()

    supervise(serve, memory, (control, pictures))


def supervise(serve: Callable[[], None], memory: int, descriptors: Iterable[int] = ()) -> None:
    """Run `serve` in a child process, and return once it and all its descendants have ended.

    Args:
        serve: what the agent's process runs.
        memory: bytes that it and its descendants may use together; 0 for no limit.
        descriptors: descriptors that only the child keeps.
    """
    with contextlib.suppress(OSError, AttributeError):  # another system than Linux
        ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    wake, waker = os.pipe()
    os.set_blocking(waker, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(waker)
    child = os.fork()
    if not child:
        signal.set_wakeup_fd(-1)
        _become_agent((wake, waker))
        serve()
        return
    for number in descriptors:
        os.close(number)
    _report({"pid": child})
    status, reason = _wait(child, wake, memory)
    _report({"status": status, "reason": reason})
    _kill_all(child)
    shutil.rmtree(os.getcwd(), ignore_errors=True)  # the agent's folder; the runner may be dead
    os._exit(0)


def _report(line: dict[str, object]) -> None:
    with contextlib.suppress(OSError):  # the runner is gone
        os.write(1, json.dumps(line).encode() + b"\n")


def descendants(root: int) -> Iterator[int]:
    """Yield the ids of all processes below another; none where there is no `/proc`."""
    children: dict[int, list[int]] = {}
    with contextlib.suppress(OSError):
        for entry in os.listdir("/proc"):
            if entry.isdigit():
                with contextlib.suppress(OSError, IndexError, ValueError):
                    stat = Path(f"/proc/{entry}/stat").read_text(errors="replace")
                    parent = int(stat.rpartition(")")[2].split()[1])
                    children.setdefault(parent, []).append(int(entry))
    below = children.get(root, [])
    while below:
        pid = below.pop()
        yield pid
        below += children.get(pid, [])


def kill_descendants(root: int) -> bool:
    """Send SIGKILL to all processes below another; return whether there were any."""
    below = list(descendants(root))
    for pid in below:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, signal.SIGKILL)
    return bool(below)


def _become_agent(descriptors: tuple[int, ...]) -> None:
    """Prepare the child: a session of its own, no descriptor of the supervisor, killed first."""
    os.setsid()
    for number in descriptors:
        os.close(number)
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.close(empty)
    os.dup2(2, 1)  # what the agent prints is no status
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with contextlib.suppress(OSError):
        # If memory runs out before the supervisor looks, the kernel ends the agent first.
        Path(_OOM).write_text("1000")


def _wait(child: int, wake: int, memory: int) -> tuple[int | None, str]:
    """Wait until the agent's process ends; return its wait status, and why it was ended."""
    poller = select.poll()
    poller.register(0, select.POLLIN | select.POLLHUP)
    poller.register(wake, select.POLLIN)
    deadline = float("inf")
    while True:
        ready = dict(poller.poll(POLL_S * 1000))
        if wake in ready:
            os.read(wake, 4096)
        status = _reap(child)
        if status is not None:
            return status, ""
        if 0 in ready and deadline == float("inf"):
            poller.unregister(0)
            deadline = time.monotonic() + EXIT_TIMEOUT_S
        if time.monotonic() > deadline:
            return None, "closed"
        if memory and memory_use(os.getpid()) > memory:
            return None, "memory"


def _reap(child: int) -> int | None:
    """Collect ended processes; return the wait status of the agent's own, if it is among them."""
    agent_status: int | None = None
    with contextlib.suppress(ChildProcessError):
        while True:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                break
            if pid == child:
                agent_status = status
    return agent_status


def memory_use(root: int) -> int:
    """Return how many bytes the processes below another use; shared pages count once.

    The exact figure (the proportional set size) takes milliseconds, so it is read only if the sum
    of the resident sizes, in which shared pages count several times, is above a GiB.
    """
    below = list(descendants(root))
    resident = sum(_resident(pid) for pid in below)
    return resident if resident < 2**30 else sum(_proportional(pid) for pid in below)


def _resident(pid: int) -> int:
    with contextlib.suppress(OSError, IndexError, ValueError):
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE
    return 0


def _proportional(pid: int) -> int:
    with contextlib.suppress(OSError, IndexError, ValueError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    return _resident(pid)


def _kill_all(child: int) -> None:
    """Kill all descendants; a process that forks meanwhile is met by the next look."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    deadline = time.monotonic() + KILL_TIMEOUT_S
    while kill_descendants(os.getpid()) and time.monotonic() < deadline:
        _reap(child)
        time.sleep(0.01)
    _reap(child)
