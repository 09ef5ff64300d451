"""The folder of a run: `run.json` says what was run, `records.jsonl` holds one episode a line, as they ended.

Lines are only ever appended, and are on the disk before the next episode begins: whatever ends a run, what it has done
is kept. A line that cannot be read is reported with its number, never a reason to lose the others.
"""

import contextlib
import importlib.metadata
import json
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

from hijack_data.errors import HijackError
from hijack_data.files import write_atomic
from hijack_data.run_log import FORMAT, RECORDS, RUN, VERSION

Record: TypeAlias = dict[str, Any]
STATUSES = ("ok", "invalid", "error")
PACKAGES = ("agenthijack", "numpy", "pillow", "gymnasium")
MAX_LINE = 8 * 2**20


class RunError(HijackError, ValueError):
    """A folder that is no run, or that holds something already."""


@dataclass(frozen=True)
class Damage:
    """A line of `records.jsonl` that was skipped, counted from 1, and why."""

    line: int
    problem: str


@dataclass(frozen=True)
class Run:
    """What a folder holds: the head, the records that can be read, and the lines that cannot."""

    folder: Path
    config: Mapping[str, Any]
    records: list[Record]
    damaged: list[Damage]


def check_empty(folder: Path) -> None:
    """Raise `RunError` unless the folder is empty, or is not there yet: a run is never written over another."""
    try:
        holds = sorted(path.name for path in folder.iterdir()) if folder.exists() else []
    except OSError as error:
        raise RunError(f"{folder}: cannot be read ({error.strerror or error})") from None
    if RUN in holds:
        raise RunError(f"{folder}: holds a run already; read it with: hijack report {folder}, or give another --out")
    if holds:
        raise RunError(f"{folder}: is not empty ({', '.join(holds[:3])} ...); give --out a new folder")


def create(folder: Path, config: Mapping[str, Any]) -> None:
    """Begin a run in a folder that is new or empty. Raises `RunError` where it holds anything, or cannot be made."""
    check_empty(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"{folder}: cannot be made ({error.strerror or error})") from None
    head = {
        "format": FORMAT,
        "version": VERSION,
        "config": dict(config),
        "versions": versions(),
        "created": time.time(),
    }
    write_atomic(folder / RUN, json.dumps(head, indent=1, ensure_ascii=False) + "\n")
    (folder / RECORDS).touch()


def append(folder: Path, record: Record) -> None:
    """Add a finished episode; it is on the disk when this returns. Raises `RunError` where it cannot be written."""
    line = json.dumps(record, ensure_ascii=False, allow_nan=False) + "\n"
    try:
        with open(folder / RECORDS, "ab") as handle:
            handle.write(line.encode("utf-8", "backslashreplace"))
            handle.flush()
            os.fsync(handle.fileno())
    except OSError as error:
        raise RunError(f"{folder / RECORDS}: cannot be written ({error.strerror or error})") from None


def versions() -> dict[str, str]:
    """What the run was made with."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for name in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def read(folder: Path) -> Run:
    """Read a run. Raises `RunError` where the folder is none, or is of a newer version."""
    head = _head(folder)
    records: list[Record] = []
    damaged: list[Damage] = []
    try:
        lines = (folder / RECORDS).read_bytes().split(b"\n")
    except OSError as error:
        raise RunError(f"{folder / RECORDS}: cannot be read ({error.strerror or error})") from None
    for number, line in enumerate(lines, 1):
        if line.strip():
            record, problem = _parse(line)
            if record is not None:
                records.append(record)
            else:
                damaged.append(Damage(number, problem))
    return Run(folder, cast("Mapping[str, Any]", head.get("config") or {}), records, damaged)


def _head(folder: Path) -> dict[str, Any]:
    path = folder / RUN
    try:
        head: object = json.loads(path.read_bytes())
    except OSError as error:
        why = error.strerror or error
        raise RunError(f"{folder}: is not the folder of a run ({RUN}: {why}); `hijack bench` makes one") from None
    except (ValueError, RecursionError) as error:
        raise RunError(f"{path}: is not JSON ({str(error)[:200]})") from None
    if not isinstance(head, dict) or cast("dict[str, Any]", head).get("format") != FORMAT:
        raise RunError(f"{path}: is not the head of a run (field 'format' must be {FORMAT!r})")
    head = cast("dict[str, Any]", head)
    if not isinstance(head.get("version"), int) or head["version"] > VERSION:
        raise RunError(f"{path}: version {head.get('version')!r} is newer than this library reads; upgrade agenthijack")
    if not isinstance(head.get("config", {}), dict):
        raise RunError(f"{path}: field 'config' is not an object")
    return head


def _parse(line: bytes) -> tuple[Record | None, str]:
    """A record, or what is wrong with it."""
    if len(line) > MAX_LINE:
        return None, f"longer than {MAX_LINE} bytes"
    try:
        data: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        return None, f"not JSON, perhaps cut off ({str(error)[:120]})"
    if not isinstance(data, dict):
        return None, "not an object"
    record = cast("Record", data)
    for key, kinds in {"agent": str, "task": str, "corruption": str, "seed": int, "status": str}.items():
        if not isinstance(record.get(key), kinds):
            return None, f"field {key!r} is missing or of the wrong type"
    if record["status"] not in STATUSES:
        return None, f"status {record['status']!r} is none of {', '.join(STATUSES)}"
    score = record.get("score")
    if record["status"] == "ok" and (not isinstance(score, int | float) or not 0 <= score <= 1):
        return None, f"score {score!r} is no number in 0..1"
    return record, ""
