"""The desktops of this machine: one folder each, with a record of who runs it since when.

The folder of a desktop is made before its namespaces and control groups and removed after them. So
what has the name of a desktop without a folder is left over, and whoever holds the lock may remove
it. Light on purpose: the first process of a desktop imports it.
"""

import contextlib
import itertools
import json
import os
import re
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hijack_data.locking import LockedError, lock

from . import limits, network
from .desktop_config import SetupError

# One folder for root's desktops, and one for those of each other user.
RUN = Path("/run/agenthijack") if os.geteuid() == 0 else Path(f"/tmp/agenthijack-{os.geteuid()}")
RECORD = "desktop.json"
SLOTS = 4096
EXIT_TIMEOUT_S = 20.0  # s for a process to end
LOCK_TIMEOUT_S = 30.0
POLL_S = 0.005
MAX_NAME_LENGTH = 20  # characters of a name
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,18}[a-z0-9])?")
_NEEDED = {"id", "slot", "state", "created"}  # in whatever record
_STATE_FIELD, _START_FIELD = 0, 19  # of /proc/PID/stat, counted after the name
_LOCK = ".lock"
# What numbers of processes in a record refer to. A folder may outlive a boot, and containers may
# share one.
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_PIDS = Path("/proc/self/ns/pid")

Record = dict[str, Any]


def process_start(pid: int) -> int:
    """When `pid` started, in clock ticks since boot; 0 if it is gone.

    Together with the pid it names a process for good.
    """
    fields = _stat(pid)
    if not fields or fields[_STATE_FIELD] == "Z":
        return 0
    return int(fields[_START_FIELD])


def _stat(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat after the name; empty if the process is gone."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    return text.rpartition(")")[2].split()


def resume(pid: int) -> None:
    """Continue a process if a signal has stopped it."""
    if _stat(pid)[:1] == ["T"]:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGCONT)


def alive(process: "list[int] | tuple[int, int] | None") -> bool:
    """Return whether the process `(pid, start)` still runs."""
    if process is None:
        return False
    pid, start = process
    return start != 0 and process_start(pid) == start


def folder(name: str) -> Path:
    """Return the run folder of a desktop."""
    return RUN / name


@contextlib.contextmanager
def locked() -> Iterator[None]:
    """Hold the registry: one process at a time makes or removes desktops.

    Raises:
        SetupError: The folder belongs to another user, or another process does not let go of it.
    """
    RUN.mkdir(mode=0o755 if os.geteuid() == 0 else 0o700, parents=True, exist_ok=True)
    _check_owner()
    deadline = time.monotonic() + LOCK_TIMEOUT_S
    while True:
        try:
            file_lock = lock(RUN / _LOCK)
            break
        except LockedError as error:
            if time.monotonic() > deadline:
                raise SetupError(
                    f"the list of desktops {RUN} is locked by {error.holder} since more than"
                    f" {LOCK_TIMEOUT_S:.0f} s; if that process is stopped, continue it (kill -CONT)"
                    " or end it"
                ) from None
            time.sleep(POLL_S)
    with file_lock:
        file_lock.sign()
        yield


def _check_owner() -> None:
    owner = RUN.stat().st_uid
    if not RUN.is_symlink() and owner == os.geteuid():
        return
    if os.geteuid() == 0 and not _is_root_of_machine():
        raise SetupError(
            f"{RUN} belongs to the root of this machine, and this process is root of a user"
            " namespace only; leave that namespace: desktops of users need no root"
        )
    raise SetupError(f"{RUN} belongs to somebody else; remove it as root")


def _is_root_of_machine() -> bool:
    """Return whether user 0 of this process' user namespace is user 0 of the one above it."""
    first = Path("/proc/self/uid_map").read_text(encoding="ascii").split()[:3]
    return first == ["0", "0", str(2**32 - 1)]


def _here() -> dict[str, str]:
    return {"boot": _BOOT.read_text(encoding="ascii").strip(), "pids": os.readlink(_PIDS)}


def _lives(record: Record, role: str) -> bool:
    """Return whether a process of a record still runs: its `keeper`, `controller` or `init`."""
    return record.get("boot", _here()["boot"]) == _here()["boot"] and alive(record.get(role))


def _is_elsewhere(record: Record) -> bool:
    """Whether its processes have numbers of another namespace, and cannot be seen from here."""
    namespace = _here()
    return record.get("boot", namespace["boot"]) == namespace["boot"] and (
        record.get("pids", namespace["pids"]) != namespace["pids"]
    )


def claim(
    name: str | None, keeper: tuple[int, int], controller: "tuple[int, int] | None", fields: Record
) -> Record:
    """Reserve a name and a slot; what dead desktops have left is removed first.

    Args:
        name: of the desktop; `None` for the next free one of `d1`, `d2` ...
        keeper: the process that looks after it, as `(pid, start)`.
        controller: the process that it ends with, or `None`.
        fields: further entries of the record.

    Returns:
        The new record.

    Raises:
        SetupError: The name is not allowed or taken, or all slots are.
    """
    if name is not None and not _NAME.fullmatch(name):
        raise SetupError(
            f"desktop name {name!r} must be 1 to 20 of a-z, 0-9 and '-', not at an end"
        )
    with locked():
        _sweep()
        present = records()
        slot = _free_slot({record["slot"] for record in present})
        name = _free_name(name, {record["id"] for record in present})
        record: Record = {
            "id": name,
            "slot": slot,
            "state": "starting",
            "keeper": list(keeper),
            "controller": list(controller) if controller else None,
            "created": time.time(),
            **_here(),
            **fields,
        }
        _publish(record)
    return record


def _free_name(name: str | None, present: set[str]) -> str:
    if name is None:
        numbers = itertools.count(1)
        name = next(f"d{i}" for i in numbers if not _is_taken(f"d{i}", present))
    elif _is_taken(name, present):
        raise SetupError(
            f"a desktop {name!r} is there already; end it with: hijack desktop down {name}"
        )
    return name


def _is_taken(name: str, present: set[str]) -> bool:
    return name in present or folder(name).exists()


def _free_slot(slots: set[int]) -> int:
    for slot in range(SLOTS):
        if slot not in slots:
            return slot
    raise SetupError(f"all {SLOTS} places for desktops are taken; see: hijack desktop list")


def _publish(record: Record) -> None:
    """Make the run folder; it appears with its record in it, never as one that looks broken."""
    fresh = RUN / f".{record['id']}"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(mode=0o700)
    (fresh / "logs").mkdir()
    (fresh / RECORD).write_text(json.dumps(record), encoding="utf-8")
    fresh.rename(folder(record["id"]))


def save(record: Record) -> None:
    """Write a record; readers see the old or the new one, never half of it."""
    target = folder(record["id"]) / RECORD
    fresh = target.with_suffix(".tmp")
    fresh.write_text(json.dumps(record, indent=1), encoding="utf-8")
    fresh.rename(target)


def load(name: str) -> Record | None:
    """Return the record of a desktop, or `None`."""
    try:
        record = json.loads((folder(name) / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_record = isinstance(record, dict) and record.keys() >= _NEEDED
    return record if is_record else None


def records() -> list[Record]:
    """All records, oldest first; a folder without a readable record is one in state `"broken"`."""
    names = [path.name for path in RUN.glob("[!.]*") if path.is_dir()]
    rows = [load(name) or _broken(name) for name in names]
    return sorted(rows, key=lambda record: (record["created"], record["id"]))


def _broken(name: str) -> Record:
    return {"id": name, "slot": -1, "state": "broken", "created": 0.0}


def state(record: Record) -> str:
    """`"starting"`, `"ready"`, `"broken"`, `"orphan"` or `"elsewhere"`.

    An orphan's keeper or controller ended without clearing up. A desktop elsewhere belongs to a
    container that shares the folder: its processes cannot be seen from here.
    """
    if _is_elsewhere(record):
        return "elsewhere"
    if not _lives(record, "keeper"):
        return "orphan"
    if record.get("controller") and not _lives(record, "controller"):
        return "orphan"
    return record["state"]


def running() -> list[Record]:
    """Return the records of the desktops whose keeper runs, oldest first."""
    return [record for record in records() if state(record) not in ("orphan", "elsewhere")]


def orphans() -> list[Record]:
    """Return desktops without a running keeper; also namespaces and groups without a folder."""
    listed = records()
    return [
        *(record for record in listed if state(record) == "orphan"),
        *(_broken(name) for name in _leftovers({record["id"] for record in listed})),
    ]


def _leftovers(ids: set[str]) -> list[str]:
    if os.geteuid() != 0:
        return []  # without root there are no groups, and namespaces have no names outside
    return sorted({*network.leftovers(ids), *limits.leftovers(ids)})


def _sweep() -> None:
    """Remove what dead desktops have left, without waiting; the caller holds the lock.

    A folder without a readable record stays: who made it, and whether that process lives, is not
    known.
    """
    for record in records():
        if state(record) != "orphan" or record["state"] == "broken" or _lives(record, "keeper"):
            continue
        if _lives(record, "init"):  # the kernel is about to end it
            os.kill(record["init"][0], signal.SIGKILL)
        else:
            clear(record, timeout=0.0)
    for name in _leftovers({record["id"] for record in records()}):
        limits.leave_groups(name, timeout=0.0)
        network.remove(name)
    for path in RUN.glob(".*"):  # a start or an end was killed half-way
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)


def remove(record: Record, timeout: float = EXIT_TIMEOUT_S) -> None:
    """End a desktop: its keeper is asked to clear up; if it does not, this does.

    Args:
        record: of the desktop.
        timeout: for each of its processes, in seconds.

    Raises:
        SetupError: A process does not end, or cannot be seen from here.
    """
    if _is_elsewhere(record):
        raise SetupError(
            f"desktop {record['id']!r} belongs to another container, which shares {RUN}; end it"
            " there"
        )
    if _lives(record, "keeper"):
        _end(record["keeper"], signal.SIGTERM, timeout)
    for role in ("keeper", "init"):
        if _lives(record, role) and not _end(record[role], signal.SIGKILL, timeout):
            raise SetupError(
                f"process {record[role]} of desktop {record['id']!r} does not end; is it stuck on"
                " a disk?"
            )
    withdraw(record)


def withdraw(record: Record) -> None:
    """Remove what is left of a desktop that has ended, unless its name is another's by now.

    Args:
        record: of the desktop.

    Raises:
        SetupError: Another process does not let go of the registry.
    """
    with locked():
        present = load(record["id"])
        if present is None or present.get("keeper") == record.get("keeper"):
            clear(record)


def clear(record: Record, timeout: float = limits.EXIT_TIMEOUT_S) -> None:
    """Remove groups, network and folder of a desktop; the caller holds the lock.

    Args:
        record: of the desktop, whose processes have ended.
        timeout: seconds that the kernel may take to empty its groups.
    """
    limits.leave_groups(record["id"], timeout)
    network.remove(record["id"])
    desktop_folder = folder(record["id"])
    leaving = RUN / f".{record['id']}"  # so that nobody sees a folder without its record
    shutil.rmtree(leaving, ignore_errors=True)
    with contextlib.suppress(OSError):
        desktop_folder.rename(leaving)
    shutil.rmtree(leaving, ignore_errors=True)


def _end(process: list[int], number: int, timeout: float) -> bool:
    """Signal a process, also a stopped one, and wait for its end; return whether it has ended."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(process[0], number)
        os.kill(process[0], signal.SIGCONT)
    deadline = time.monotonic() + timeout
    while alive(process) and time.monotonic() < deadline:
        time.sleep(POLL_S)
    return not alive(process)
