"""What a process on another machine does with a shard: check that it sees the same files, then make it."""

import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError

from ..errors import BuildError
from ..folder import STATE
from ..manifest import libraries
from ..options import assets_of
from ..rows import Settings
from ..shards import ShardRecord, ShardTask, build_shard, records_hash

TOKEN = "token"
GUIDE = "docs/clusters.md says how to set up a cluster"
# A network file system may show a new file to other machines late.
PATIENCE = 5.0


@dataclass(frozen=True)
class Errand:
    """What every shard of a build needs to know.

    `out` is an absolute path, `token` is what `out/.build/token` holds, `libraries` are the versions that decide bytes,
    `assets` names the recorded pictures, `environment` are variables to set.
    """

    settings: Settings
    out: Path
    token: str
    libraries: Mapping[str, str]
    assets: Mapping[str, str] | None
    environment: Mapping[str, str]


def make(row: Mapping[str, Any], errand: Errand) -> dict[str, Any]:
    """Make the shard `row["task"]`; `made` of the result is its record, or the error that a user should see."""
    os.environ.update(errand.environment)
    task: ShardTask = row["task"]
    try:
        check_node(task, errand)
        made: ShardRecord | HijackError = build_shard(task, errand.settings, errand.out)
    except HijackError as error:
        made = error
    return {"made": made, "node": socket.gethostname()}


def check_node(task: ShardTask, errand: Errand) -> None:
    """Raise `BuildError` unless this machine shares the folders of the build and has the same libraries."""
    host = socket.gethostname()
    if not soon(lambda: _read(errand.out / STATE / TOKEN) == errand.token):
        raise BuildError(
            f"{errand.out}: the node {host} does not see this folder as the machine that started the build does; the "
            f"output must lie in a folder that all nodes share under one path ({GUIDE})"
        )
    here = libraries(errand.settings.detect)
    other = [f"{name} {here.get(name)} instead of {v}" for name, v in errand.libraries.items() if here.get(name) != v]
    if other:
        raise BuildError(f"the node {host} has {', '.join(other)}, and would make other bytes; install the same")
    if assets_of(errand.settings) != errand.assets:
        raise BuildError(f"the node {host} has other recorded pictures, and would make other bytes; install the same")
    root = Path(task.root)
    if not soon(lambda: records_hash(task.trajectories, root) == task.records):
        raise BuildError(
            f"{root}: the node {host} does not see the pictures in this folder that the machine that started the build "
            f"sees, or they are being changed; the source must lie in a folder that all nodes share ({GUIDE})"
        )


def soon(check: Callable[[], bool]) -> bool:
    """Return whether `check()` comes true within `PATIENCE` seconds."""
    end = time.monotonic() + PATIENCE
    while not check():
        if time.monotonic() > end:
            return False
        time.sleep(0.2)
    return True


def _read(path: Path) -> str | None:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError):
        return None
