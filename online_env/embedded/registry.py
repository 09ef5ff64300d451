"""The desktops of this machine: one folder each, with a record of who runs it since when.

Light on purpose: the first process of a desktop imports it.
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

from hijack_data.locking import lock

from .runtime import limits, network
from .runtime.plain import SetupError

# One folder for root's desktops, and one for those of each other user.
RUN = Path("/run/agenthijack") if os.geteuid() == 0 else Path(f"/tmp/agenthijack-{os.geteuid()}")
RECORD = "desktop.json"
SLOTS = 4096
PATIENCE = 20.0  # s for a process to end
POLL = 0.005
LONGEST = 20  # characters of a name
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,18}[a-z0-9])?")
_NEEDED = {"id", "slot", "state", "created"}  # in whatever record
_STATE_FIELD, _START_FIELD = 0, 19  # of /proc/PID/stat, counted after the name

Record = dict[str, Any]


def process_start(pid: int) -> int:
    """When `pid` started, in clock ticks since boot; 0 if it is gone.

    Together with the pid it names a process for good.
    """
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0
    fields = text.rpartition(")")[2].split()
    if fields[_STATE_FIELD] == "Z":
        return 0
    return int(fields[_START_FIELD])


def alive(process: "list[int] | tuple[int, int] | None") -> bool:
    """Whether the process `(pid, start)` still runs."""
    if process is None:
        return False
    pid, start = process
    return start != 0 and process_start(pid) == start


def folder(name: str) -> Path:
    """The run folder of a desktop."""
    return RUN / name


@contextlib.contextmanager
def locked() -> Iterator[None]:
    """Hold the registry: one controller at a time makes or removes desktops.

    Raises:
        SetupError: The folder belongs to another user.
    """
    RUN.mkdir(mode=0o755 if os.geteuid() == 0 else 0o700, parents=True, exist_ok=True)
    if RUN.is_symlink() or RUN.stat().st_uid != os.geteuid():
        raise SetupError(f"{RUN} belongs to somebody else; remove it as root")
    with lock(RUN / ".lock", wait=True):
        yield


def claim(
    name: str | None, keeper: tuple[int, int], controller: "tuple[int, int] | None", more: Record
) -> Record:
    """Reserve a name and a slot.

    Args:
        name: of the desktop; `None` for the next free one of `d1`, `d2` ...
        keeper: the process that looks after it, as `(pid, start)`.
        controller: the process that it ends with, or `None`.
        more: further entries of the record.

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
            **more,
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


def _free_slot(taken: set[int]) -> int:
    for slot in range(SLOTS):
        if slot not in taken:
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
    """The record of a desktop, or `None`."""
    try:
        found = json.loads((folder(name) / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_record = isinstance(found, dict) and found.keys() >= _NEEDED
    return found if is_record else None


def records() -> list[Record]:
    """All records, oldest first; a folder without a readable record is one in state `"broken"`."""
    names = [path.name for path in RUN.glob("[!.]*") if path.is_dir()]
    found = [load(name) or _broken(name) for name in names]
    return sorted(found, key=lambda record: (record["created"], record["id"]))


def _broken(name: str) -> Record:
    return {"id": name, "slot": -1, "state": "broken", "created": 0.0}


def state(record: Record) -> str:
    """`"starting"`, `"ready"`, `"broken"` or `"orphan"`.

    An orphan's keeper or controller ended without clearing up.
    """
    if not alive(record.get("keeper")):
        return "orphan"
    if record.get("controller") and not alive(record["controller"]):
        return "orphan"
    return record["state"]


def running() -> list[Record]:
    """The records of the desktops that somebody looks after, oldest first."""
    return [record for record in records() if state(record) != "orphan"]


def orphans() -> list[Record]:
    """Desktops that nobody looks after any more, namespaces without a folder included."""
    listed = records()
    found = [record for record in listed if state(record) == "orphan"]
    if os.geteuid() == 0:
        known = {record["id"] for record in listed}
        found += [_broken(name) for name in network.leftovers(known)]
    return found


def remove(record: Record, patience: float = PATIENCE) -> None:
    """End a desktop: its keeper is asked to clear up; if it does not, this does.

    Args:
        record: of the desktop.
        patience: for each of its processes, in seconds.

    Raises:
        SetupError: A process does not end.
    """
    _end(record.get("keeper"), signal.SIGTERM, patience)
    for process in (record.get("keeper"), record.get("init")):
        if not _end(process, signal.SIGKILL, patience):
            raise SetupError(
                f"process {process} of desktop {record['id']!r} does not end; is it stuck on a"
                " disk?"
            )
    clear(record)


def clear(record: Record) -> None:
    """Remove network, control group and folder of a desktop whose processes have ended."""
    limits.leave_groups(record["id"])
    network.remove(record["id"])
    shutil.rmtree(folder(record["id"]), ignore_errors=True)


def _end(process: "list[int] | None", number: int, patience: float) -> bool:
    """Signal a process and wait for its end; return whether it has ended."""
    if process is None or not alive(process):
        return True
    with contextlib.suppress(ProcessLookupError):
        os.kill(process[0], number)
    deadline = time.monotonic() + patience
    while alive(process) and time.monotonic() < deadline:
        time.sleep(POLL)
    return not alive(process)
