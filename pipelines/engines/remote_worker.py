"""The work on another machine: check that it sees the same files, then make a shard."""

import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError

from ..building.output_folder import STATE
from ..building.row_settings import pack_identity
from ..building.shards import ShardTask, build_shard, records_hash
from ..building.step_rows import RowSettings
from ..dataset.manifest import libraries
from ..dataset.shard import ShardRecord
from ..errors import BuildError

TOKEN = "token"
GUIDE = "docs/clusters.md says how to set up a cluster"
# A network file system may show a new file to other machines with a delay.
SHARED_FILE_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class ShardJob:
    """The data that every shard of a build needs.

    Args:
        settings: those of the build.
        out: the folder of the dataset, an absolute path.
        token: the content of `out/.build/token`.
        libraries: the versions of the libraries that decide the bytes.
        assets: digest and licence of the recorded pictures.
        environment: variables to set.
    """

    settings: RowSettings
    out: Path
    token: str
    libraries: Mapping[str, str]
    assets: Mapping[str, str] | None
    environment: Mapping[str, str]


def make(row: Mapping[str, Any], job: ShardJob) -> dict[str, Any]:
    """Make the shard `row["task"]`.

    Returns:
        `made`, its record or the error for the user, and `node`, the name of this machine.
    """
    os.environ.update(job.environment)
    task: ShardTask = row["task"]
    try:
        check_node(task, job)
        made: ShardRecord | HijackError = build_shard(task, job.settings, job.out)
    except HijackError as error:
        made = error
    return {"made": made, "node": socket.gethostname()}


def check_node(task: ShardTask, job: ShardJob) -> None:
    """Check that this machine shares the folders of the build and has the same libraries.

    Raises:
        BuildError: a folder, a library or the asset pack differs.
    """
    host = socket.gethostname()
    if not wait_until(lambda: _read(job.out / STATE / TOKEN) == job.token):
        raise BuildError(
            f"{job.out}: the node {host} does not see this folder as the machine that started"
            " the build does; the output must lie in a folder that all nodes share under one path"
            f" ({GUIDE})"
        )
    here = libraries(job.settings.detect)
    other = [
        f"{name} {here.get(name)} instead of {v}"
        for name, v in job.libraries.items()
        if here.get(name) != v
    ]
    if other:
        raise BuildError(
            f"the node {host} has {', '.join(other)}, and would make other bytes; install the same"
        )
    if pack_identity(job.settings) != job.assets:
        raise BuildError(
            f"the node {host} has other recorded pictures, and would make other bytes; install the"
            " same"
        )
    root = Path(task.root)
    if not wait_until(lambda: records_hash(task.trajectories, root) == task.records):
        raise BuildError(
            f"{root}: the node {host} does not see the pictures in this folder that the machine"
            " that started the build sees, or they are being changed; the source must lie in a"
            f" folder that all nodes share ({GUIDE})"
        )


def wait_until(check: Callable[[], bool]) -> bool:
    """Return whether `check()` becomes true within `SHARED_FILE_TIMEOUT_S` seconds."""
    end = time.monotonic() + SHARED_FILE_TIMEOUT_S
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
