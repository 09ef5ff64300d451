"""Bring a desktop to rest before a task is judged: nothing is under way, and nothing unwritten.

What an agent does last may still be under way when it answers `DONE`: an office program that saves,
a browser that sends a form. Such a program has a thread that runs, waits for a processor or waits
for a disk; one that has finished sleeps.
"""

from collections.abc import Iterable

from ..desktops import commands
from ..desktops.protocol import Desktop
from ..errors import DesktopError

MAX_WAIT_S = 20.0  # OSWorld's runs wait so long before every evaluation

# Every 20 ms the script looks at the threads of the named programs and of what they started. It
# ends when they slept in nearly all looks of the last 0.3 s (a caret blinks), and in the last ones.
# A process name has 15 characters at most.
_SCRIPT = """
import os, sys, time
names = {name[:15] for name in sys.argv[2:]}

def read(path):
    with open(path) as file:
        name, _, rest = file.read().partition("(")[2].rpartition(")")
    return name, rest.split()

def is_busy():
    states, parents, chosen = {}, {}, set()
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            name, fields = read(f"/proc/{pid}/stat")
            parents[pid] = fields[1]
            if name in names:
                chosen.add(pid)
        except OSError:
            pass
    for pid in parents:
        above = pid
        while above in parents and above not in chosen:
            above = parents[above]
        if above in chosen and pid != str(os.getpid()):
            try:
                for thread in os.listdir(f"/proc/{pid}/task"):
                    if read(f"/proc/{pid}/task/{thread}/stat")[1][0] in "RD":
                        return True
            except OSError:
                pass
    return False

deadline = time.monotonic() + float(sys.argv[1])
looks = []
while time.monotonic() < deadline:
    looks = [*looks[-14:], is_busy()]
    if len(looks) == 15 and sum(looks) <= 2 and not any(looks[-5:]):
        print("idle")
        break
    time.sleep(0.02)
"""


def wait_until_idle(
    desktop: Desktop, processes: Iterable[str], max_wait: float = MAX_WAIT_S
) -> bool:
    """Wait until programs, and what they started, have nothing left to do.

    Args:
        desktop: The desktop; it must have `python3` and `/proc`.
        processes: The names of the programs' processes.
        max_wait: Seconds to wait at most; a player never rests while it plays.

    Returns:
        Whether the programs are idle. A desktop without a screen runs none.

    Raises:
        DesktopError: The desktop cannot tell.
    """
    if not _has_programs(desktop):
        return True
    argv = ("python3", "-c", _SCRIPT, str(max_wait), *processes)
    return commands.command(desktop, *argv).strip() == "idle"


# Looks every 50 ms whether the process has ended: not there, or a zombie.
_END_SCRIPT = """
has_ended() {
    looks=$1
    while kill -0 $pid 2>/dev/null && ! grep -q "^State:.Z" /proc/$pid/status 2>/dev/null; do
        looks=$((looks - 1)); [ $looks -gt 0 ] || return 1
        sleep 0.05
    done
}
pid=$(FIND); [ -n "$pid" ] || exit 0
kill -CONT $pid 2>/dev/null  # one that was stopped goes on
{ CLOSE; } >/dev/null 2>&1
has_ended CLOSE_LOOKS && exit 0
kill -TERM $pid 2>/dev/null
has_ended 300 || echo $pid
"""


def end_process(desktop: Desktop, find: str, program_name: str, close: str = "") -> None:
    """End a process of the user, so that it writes what it holds, and wait until it has ended.

    Args:
        desktop: The desktop.
        find: A shell command that prints the number of the process, or nothing.
        program_name: Its name in the error.
        close: A shell command that asks the process `$pid` to end; if it has not ended 15 s later,
            or if there is no such command, it gets SIGTERM.

    Raises:
        DesktopError: It does not end within 15 s; what it holds is not known then.
    """
    if not _has_programs(desktop):
        return
    script = _END_SCRIPT.replace("FIND", find).replace("CLOSE_LOOKS", "300" if close else "1")
    script = script.replace("CLOSE", close or ":")
    # The last argument, which is the script's name, keeps a folder of this machine from running it.
    running = commands.command(desktop, "sh", "-c", script, "kill").strip()
    if running:
        raise DesktopError(f"{program_name} (process {running}) does not end")


def _has_programs(desktop: Desktop) -> bool:
    """Return whether a desktop has programs of its own; a folder would show this machine's."""
    return "accessibility" in desktop.capabilities
