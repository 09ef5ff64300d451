"""Limits of one desktop: a fork bomb or a memory hog must not take the machine with it.

Control groups (version 1 or 2) for processes and memory where the kernel lets us, and limits per
process in any case: they hold without control groups, too, but then the process count is shared by
all desktops, and files in memory count for nobody.
"""

import contextlib
import os
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from .desktop_config import DesktopConfig

GROUPS = Path("/sys/fs/cgroup")
RESOURCES = ("processes", "memory")
EXIT_TIMEOUT_S = 10.0  # s for the last process of a group to be reaped
POLL_S = 0.01
MAX_OPEN_FILES = 8192
_PREFIX = "agenthijack-"
OOM_SCORE = "500"  # the desktop's processes are the first to go without memory


@dataclass(frozen=True)
class Group:
    """The control group that limits one thing for a whole desktop.

    Attributes:
        resource: `"processes"` or `"memory"`.
        folder: of the group.
        settings: its files and the numbers to write; a file marked with a `?` may be missing.
    """

    resource: str
    folder: Path
    settings: tuple[tuple[str, int], ...]


def groups(name: str, order: "DesktopConfig | None" = None) -> list[Group]:
    """Return the groups that this machine's kernel offers to a desktop.

    Args:
        name: of the desktop.
        order: its limits; without it the groups are only named.

    Returns:
        The groups, none if the kernel has no control groups.
    """
    processes = 0
    memory = 0
    if order is not None:
        processes = order.processes
        memory = order.memory + order.storage
    group = f"{_PREFIX}{name}"
    if (GROUPS / "cgroup.controllers").exists():
        return _unified_groups(GROUPS / group, processes, memory)
    return _older_groups(group, processes, memory)


def _unified_groups(folder: Path, processes: int, memory: int) -> list[Group]:
    """Version 2: one folder for all controllers."""
    offered = _words(GROUPS / "cgroup.controllers")
    groups: list[Group] = []
    if "pids" in offered:
        groups.append(Group("processes", folder, (("pids.max", processes),)))
    if "memory" in offered:
        settings = (("memory.max", memory), ("?memory.swap.max", 0))
        groups.append(Group("memory", folder, settings))
    return groups


def _older_groups(group: str, processes: int, memory: int) -> list[Group]:
    """Version 1: a hierarchy for each controller."""
    limit = ("memory.limit_in_bytes", memory)
    with_swap = ("?memory.memsw.limit_in_bytes", memory)
    groups = (
        Group("processes", GROUPS / "pids" / group, (("pids.max", processes),)),
        Group("memory", GROUPS / "memory" / group, (limit, with_swap)),
    )
    return [group_ for group_ in groups if (group_.folder.parent / "tasks").exists()]


def join_groups(name: str, order: DesktopConfig) -> list[str]:
    """Put this process and its later children into groups of their own.

    Args:
        name: of the desktop.
        order: its limits.

    Returns:
        Which of `RESOURCES` they limit.
    """
    limited: list[str] = []
    with contextlib.suppress(OSError):
        (GROUPS / "cgroup.subtree_control").write_text("+pids +memory", encoding="ascii")
    for group in groups(name, order):
        try:
            _join(group)
        except OSError as error:
            print(
                f"no limit for the desktop's {group.resource}: {error}", file=sys.stderr, flush=True
            )
        else:
            limited.append(group.resource)
    return limited


def _join(group: Group) -> None:
    group.folder.mkdir(exist_ok=True)
    for file, value in group.settings:
        setting = group.folder / file.lstrip("?")
        if setting.exists() or not file.startswith("?"):
            setting.write_text(str(value), encoding="ascii")
    (group.folder / "cgroup.procs").write_text(str(os.getpid()), encoding="ascii")


def leave_groups(name: str, timeout: float = EXIT_TIMEOUT_S) -> None:
    """Remove the groups of a desktop whose processes have ended.

    Args:
        name: of the desktop.
        timeout: seconds for which they may be busy: until the last process is reaped.
    """
    deadline = time.monotonic() + timeout
    for group in groups(name):
        while group.folder.exists():
            with contextlib.suppress(OSError):
                group.folder.rmdir()
            if time.monotonic() >= deadline:
                break
            time.sleep(POLL_S)


def leftovers(ids: set[str]) -> list[str]:
    """Desktops (by name) that have a control group but are not in `ids`."""
    parents = (GROUPS, GROUPS / "pids", GROUPS / "memory")
    paths = (path for parent in parents for path in parent.glob(f"{_PREFIX}*"))
    return sorted({path.name.removeprefix(_PREFIX) for path in paths} - ids)


def limit_process(order: DesktopConfig) -> None:
    """Limit this process and all that it starts: data, file size, core files and processes.

    They are also the first to go without memory.
    """
    limits = {
        resource.RLIMIT_DATA: order.memory,
        resource.RLIMIT_FSIZE: order.storage,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NPROC: 4 * order.processes,
        resource.RLIMIT_NOFILE: MAX_OPEN_FILES,
    }
    for kind, amount in limits.items():
        _, hard = resource.getrlimit(kind)
        if hard != resource.RLIM_INFINITY:
            amount = min(amount, hard)
        resource.setrlimit(kind, (amount, amount))
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(OOM_SCORE, encoding="ascii")


def _words(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii").split()
    except OSError:
        return []
