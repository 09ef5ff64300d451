"""Where a run was made: code, configuration, machine. `run.json` has that of its beginning.

Each `--resume` adds a line to `sessions.jsonl`, since machine and commit may have changed.
"""

import contextlib
import json
import os
import platform
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.file_io import unwritable
from hijack_data.runs.run_head import config_digest
from hijack_data.runs.run_log import SESSIONS

RunOrigin: TypeAlias = dict[str, Any]
GIT_TIMEOUT_S = 10.0  # s
_GROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")
_GROUP_USE = Path("/sys/fs/cgroup/memory.current")


def describe(config: Mapping[str, Any], **used: int) -> RunOrigin:
    """Return the origin of a run, as JSON data.

    Args:
        config: The benchmark, in the form of `Bench.to_data`, or the configuration of `hijack
            score`.
        used: How many `desktops`, or `workers`, are used side by side.

    Returns:
        `config_sha256`; `git` of this library and of the current folder, each with `commit` and
        `dirty` (files that git knows were changed), `None` outside a checkout; `machine` with
        `cpu`, `cores`, `memory` in bytes and `kernel`; and what is `used`.
    """
    return {
        "config_sha256": config_digest(config),
        "git": {
            "agenthijack": git_state(Path(__file__).parent, trusted=True),
            "folder": git_state(Path.cwd()),
        },
        "machine": machine(),
        **used,
    }


def git_state(folder: Path, trusted: bool = False) -> RunOrigin | None:
    """Return `commit` and `dirty` of the checkout that holds a folder.

    Args:
        folder: A folder that may be in a checkout.
        trusted: Read it even if it belongs to another user; git refuses that by default, since the
            settings of a checkout can name programs to run.

    Returns:
        `None` if there is no checkout, no commit or no git.
    """
    safe = ["-c", "safe.directory=*"] if trusted else []
    commit = _git(folder, *safe, "rev-parse", "HEAD")
    if commit is None:
        return None
    ours = ["-c", "core.fsmonitor=false", "status", "--porcelain", "--untracked-files=no"]
    changed = _git(folder, *safe, *ours)
    return {"commit": commit, "dirty": None if changed is None else bool(changed)}


def usable_cores() -> int:
    """Return how many cores this process may use, or all where the system does not say (macOS)."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _git(folder: Path, *words: str) -> str | None:
    """Return what git prints; `None` if it fails."""
    try:
        done = subprocess.run(
            ["git", *words],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=GIT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def machine() -> RunOrigin:
    """Return `cpu`, `cores`, `memory` in bytes (`None` on Windows) and `kernel` of this machine."""
    return {
        "cpu": _processor(),
        "cores": usable_cores(),
        "memory": _memory(),
        "kernel": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def _memory() -> int | None:
    if not hasattr(os, "sysconf"):
        return None
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def available_memory() -> int:
    """Return how many bytes programs can still use: memory that is free or can be freed.

    The limit of a container is respected.
    """
    found = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    for line in _lines(Path("/proc/meminfo")):
        if line.startswith("MemAvailable:"):
            found = int(line.split()[1]) * 1024
    with contextlib.suppress(OSError, ValueError):
        left = int(_GROUP_LIMIT.read_text()) - int(_GROUP_USE.read_text())
        found = min(found, max(0, left))
    return found


def _processor() -> str:
    for line in _lines(Path("/proc/cpuinfo")):
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(errors="replace").splitlines()
    except OSError:
        return []


def other_code(head: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return a sentence if a run was begun with another commit of this library, otherwise "".

    Args:
        head: The content of its `run.json`.
        now: The present origin, from `describe`.
    """
    was = _commit_of(head)
    here = _commit_of(now)
    if was == here:
        return ""
    return f"was begun with commit {was} of agenthijack, this is {here}"


def _commit_of(found: Mapping[str, Any]) -> object:
    """Return the commit of this library in an origin; `None` if it has none."""
    place: object = found
    for key in ("git", "agenthijack", "commit"):
        place = place.get(key) if isinstance(place, dict) else None
    return place


def add_session(folder: Path, found: Mapping[str, Any], made: int) -> None:
    """Record that a run is resumed.

    Args:
        folder: Of the run.
        found: The origin, from `describe`, and further fields.
        made: How many records the run has so far.

    Raises:
        unwritable: The file cannot be written.
    """
    path = folder / SESSIONS
    line = json.dumps({"at": time.time(), "records": made, **found}, ensure_ascii=False)
    begin = ""
    try:
        if path.exists() and not path.read_bytes().endswith(b"\n"):
            begin = "\n"  # the file may end in a line that was cut off
        with path.open("a", encoding="utf-8") as file:
            file.write(f"{begin}{line}\n")
    except OSError as error:
        raise unwritable(path, error) from None


def sessions(folder: Path) -> list[RunOrigin]:
    """Return the lines of `sessions.jsonl`, without a line that was cut off."""
    found: list[RunOrigin] = []
    for line in _lines(folder / SESSIONS):
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    return found
