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
from typing import Any, TypeAlias, cast

from hijack_data.file_io import unwritable
from hijack_data.runs.run_head import config_digest
from hijack_data.runs.run_log import RECORDS, SESSIONS

RunOrigin: TypeAlias = dict[str, Any]
GIT_TIMEOUT_S = 10.0  # s
COMMIT_CHARS = 8  # of a commit in a sentence
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
    status_command = ["-c", "core.fsmonitor=false", "status", "--porcelain", "--untracked-files=no"]
    status = _git(folder, *safe, *status_command)
    return {"commit": commit, "dirty": None if status is None else bool(status)}


def usable_cores() -> int:
    """Return how many cores this process may use, or all where the system does not say (macOS)."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _git(folder: Path, *words: str) -> str | None:
    """Return what git prints; `None` if it fails."""
    try:
        result = subprocess.run(
            ["git", *words],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=GIT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout.strip() if result.returncode == 0 else None


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
    available = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    for line in _lines(Path("/proc/meminfo")):
        if line.startswith("MemAvailable:"):
            available = int(line.split()[1]) * 1024
    with contextlib.suppress(OSError, ValueError):
        group_available = int(_GROUP_LIMIT.read_text()) - int(_GROUP_USE.read_text())
        available = min(available, max(0, group_available))
    return available


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


def other_code(head: Mapping[str, Any], origin: Mapping[str, Any]) -> str:
    """Return a sentence if a run was begun with another commit of this library, otherwise "".

    Args:
        head: The content of its `run.json`.
        origin: The present origin, from `describe`.
    """
    commit_before = _library_state(head, "commit")
    commit_now = _library_state(origin, "commit")
    if commit_before == commit_now:
        return ""
    return f"was begun with commit {commit_before} of agenthijack, this is {commit_now}"


def _library_state(origin: Mapping[str, Any], name: str) -> object:
    """Return `commit` or `dirty` of this library in an origin; `None` if it has none."""
    value: object = origin
    for key in ("git", "agenthijack", name):
        value = value.get(key) if isinstance(value, dict) else None
    return value


def library_commits(folder: Path, head: Mapping[str, Any]) -> list[tuple[int, str]]:
    """Return with which commits of this library the records of a run were made.

    Args:
        folder: Of the run.
        head: The content of its `run.json`.

    Returns:
        How many records were there before, and the commit, in their order; a commit that follows on
        itself is there once, one under which nothing was recorded is not.
    """
    origins = [(0, head), *((session.get("records"), session) for session in sessions(folder))]
    starts = [(start, _commit_text(origin)) for start, origin in origins if isinstance(start, int)]
    ends = [start for start, _ in starts[1:]] + [_count_records(folder / RECORDS)]
    commits: list[tuple[int, str]] = []
    for (start, commit), end in zip(starts, ends, strict=True):
        if start < end and (not commits or commits[-1][1] != commit):
            commits.append((start, commit))
    return commits


def _count_records(path: Path) -> int:
    try:
        return sum(map(bool, path.read_bytes().split(b"\n")))
    except OSError:
        return 0


def _commit_text(origin: Mapping[str, Any]) -> str:
    commit = _library_state(origin, "commit")
    short = str(commit)[:COMMIT_CHARS] if commit else "an unknown commit"
    return f"{short} with uncommitted changes" if _library_state(origin, "dirty") else short


def add_session(folder: Path, origin: Mapping[str, Any], record_count: int) -> None:
    """Record that a run is resumed.

    Args:
        folder: Of the run.
        origin: The origin, from `describe`, and further fields.
        record_count: How many records the run has so far.

    Raises:
        unwritable: The file cannot be written.
    """
    path = folder / SESSIONS
    line = json.dumps({"at": time.time(), "records": record_count, **origin}, ensure_ascii=False)
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
    origins: list[RunOrigin] = []
    for line in _lines(folder / SESSIONS):
        with contextlib.suppress(ValueError):
            session: object = json.loads(line)
            if isinstance(session, dict):
                origins.append(cast("RunOrigin", session))
    return origins
