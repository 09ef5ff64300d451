"""App freeze on a live machine: the processes of the window in front stop for some seconds.

They get SIGSTOP, and SIGCONT from a timer inside the guest, so the time does not depend on when the
agent acts next. The spec is `hijack_data/corruptions/app_freeze.py`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..desktops.protocol import Capability
from ..errors import DesktopError
from .app_minimization import on_screen
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .duration import LASTS, Duration
from .guest import Guest

MAX_ROUNDS = 5  # of looking for processes that began while others were stopped
STOPPED = ("T", "t")
# Built into the shell, so no program of the user's can answer instead.
_LIST = 'for f in /proc/[0-9]*/stat; do read -r line <"$f" && echo "$line"; done 2>/dev/null; true'
_SIGNAL = 'for p; do kill -s "$0" "$p" 2>/dev/null; done; true'
_TIMER = (
    'seconds=$1; shift; (sleep "$seconds"; for p; do kill -s CONT "$p"; done)'
    " </dev/null >/dev/null 2>&1 &"
)


@dataclass(frozen=True, kw_only=True)
class _Process:
    """A line of /proc/PID/stat; a number that is used again has another `start`."""

    pid: int
    name: str
    state: str
    parent: int
    start: int

    @classmethod
    def parse(cls, line: str) -> "_Process":
        """Read a line; the name is in brackets, and may itself hold brackets and spaces."""
        head, _, tail = line.rpartition(") ")
        pid, _, name = head.partition(" (")
        words = tail.split()
        return cls(
            pid=int(pid), name=name, state=words[0], parent=int(words[1]), start=int(words[19])
        )


@register
class Freeze(LiveEffect):
    """Stops the process of the window in front, with all that it has started."""

    kind: ClassVar[str] = "freeze"
    needs: ClassVar[frozenset[Capability]] = frozenset({"windows"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Stop the processes, and start the timer that lets them go on.

        Raises:
            EffectError: There is no window, or it does not say which process it belongs to.
        """
        seconds = _seconds(params)
        window = _front_window(guest.x("state"))
        if window is None or not window["pid"]:
            title = "" if window is None else window["title"]
            raise EffectError(f"freeze: no window in front that names its process ({title!r})")
        processes = _list_processes(guest)
        tree = _tree(processes, [window["pid"]])
        if not tree:
            raise EffectError(
                f"freeze: process {window['pid']} of {window['title']!r} is not there"
            )
        already = all(process.state in STOPPED for process in tree)
        for _ in range(MAX_ROUNDS):
            running = [process for process in tree if process.state not in STOPPED]
            if not running:
                break
            _signal(guest, "STOP", running)
            tree = _tree(_list_processes(guest), [window["pid"]])
        if not already:
            numbers = [str(process.pid) for process in tree]
            guest.shell(_TIMER, f"{seconds:g}", *numbers)
        return {
            "window": window["title"],
            "seconds": seconds,
            "already": already,
            "processes": [[process.pid, process.start, process.name] for process in tree],
        }

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check in /proc that every process of the window is stopped."""
        present = _list_processes(guest)
        recorded = _recorded(present, record)
        facts = {
            "window": record["window"],
            "seconds": record["seconds"],
            "states": {str(process.pid): process.state for process in recorded},
        }
        if not recorded:
            return Probe(False, facts, "the processes that were stopped are not there")
        tree = _tree(present, [process.pid for process in recorded])
        running = [process for process in tree if process.state not in STOPPED]
        if running:
            names = ", ".join(f"{process.name} ({process.state})" for process in running[:5])
            return Probe(False, facts, f"not stopped: {names}")
        return Probe(True, facts)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Let the processes go on; without a record, those of all windows that are stopped."""
        present = _list_processes(guest)
        if record:
            stopped = _tree(present, [process.pid for process in _recorded(present, record)])
        else:
            roots = [window["pid"] for window in guest.x("state")["windows"] if window["pid"]]
            stopped = _tree(present, roots)
        stopped = [process for process in stopped if process.state in STOPPED]
        _signal(guest, "CONT", stopped)
        numbers = {(process.pid, process.start) for process in stopped}
        still_stopped = [
            process.name
            for process in _list_processes(guest)
            if (process.pid, process.start) in numbers and process.state in STOPPED
        ]
        facts = {"continued": len(stopped) - len(still_stopped)}
        return Undone(
            not still_stopped,
            facts,
            f"still stopped: {', '.join(still_stopped)}" if still_stopped else "",
        )

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return which window hangs, and how many processes are stopped."""
        count = len(facts["states"])
        return (
            f"the window {facts['window']!r} hangs for {facts['seconds']:g} s:"
            f" {count} of its processes are stopped"
        )

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return how many processes were still stopped."""
        return f"no process is stopped any more; {facts['continued']} had to be continued"


def _seconds(params: Mapping[str, Any]) -> float:
    seconds = Duration.read(params).seconds
    if seconds is None:
        raise EffectError(f'freeze: {LASTS} must be {{"seconds": a number}}, got {params!r:.80}')
    return seconds


def _front_window(state: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the active window, or the topmost one; `None` if only the desktop is there."""
    windows = on_screen(state)
    active = [window for window in windows if window["id"] == state["active"]]
    candidates = active or windows[-1:]
    return candidates[0] if candidates else None


def _list_processes(guest: Guest) -> list[_Process]:
    """Return all processes that the guest shows.

    Raises:
        DesktopError: It shows none, so nothing can be said of any.
    """
    processes: list[_Process] = []
    for line in guest.shell(_LIST).output.splitlines():
        try:
            processes.append(_Process.parse(line))
        except (ValueError, IndexError):
            continue  # a name with a line break, or a process that ended meanwhile
    if not processes:
        raise DesktopError("the guest's /proc shows no process")
    return processes


def _tree(processes: Sequence[_Process], roots: Iterable[int]) -> list[_Process]:
    """Return processes with all that descend from them; zombies are left out."""
    members = set(roots)
    while True:
        grown = members | {process.pid for process in processes if process.parent in members}
        if grown == members:
            break
        members = grown
    return [process for process in processes if process.pid in members and process.state != "Z"]


def _recorded(processes: Sequence[_Process], record: EffectRecord) -> list[_Process]:
    """Return the processes of a record that are still there."""
    numbers = {(pid, start) for pid, start, _ in record["processes"]}
    return [process for process in processes if (process.pid, process.start) in numbers]


def _signal(guest: Guest, name: str, processes: Sequence[_Process]) -> None:
    """Send a signal to processes of the desktop's user."""
    if processes:
        numbers = [str(process.pid) for process in processes]
        guest.shell(_SIGNAL.replace("$0", name), *numbers)
