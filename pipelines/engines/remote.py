"""The work on another machine: check that it sees the same files, then make a shard."""

import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError

from ..building.rows import RowSettings
from ..building.settings import assets_of
from ..building.shards import ShardTask, build_shard, records_hash
from ..dataset.manifest import STATE, libraries
from ..dataset.shard import ShardRecord
from ..errors import BuildError

TOKEN = "token"
GUIDE = "docs/clusters.md says how to set up a cluster"
# A network file system may show a new file to other machines with a delay.
PATIENCE = 5.0


@dataclass(frozen=True)
class Errand:
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


def make(row: Mapping[str, Any], errand: Errand) -> dict[str, Any]:
    """Make the shard `row["task"]`.

    Returns:
        `made`, its record or the error for the user, and `node`, the name of this machine.
    """
    os.environ.update(errand.environment)
    task: ShardTask = row["task"]
    try:
        check_node(task, errand)
        made: ShardRecord | HijackError = build_shard(task, errand.settings, errand.out)
    except HijackError as error:
        made = error
    return {"made": made, "node": socket.gethostname()}


def check_node(task: ShardTask, errand: Errand) -> None:
    """Check that this machine shares the folders of the build and has the same libraries.

    Raises:
        BuildError: a folder, a library or the asset pack differs.
    """
    host = socket.gethostname()
    if not soon(lambda: _read(errand.out / STATE / TOKEN) == errand.token):
        raise BuildError(
            f"{errand.out}: the node {host} does not see this folder as the machine that started"
            " the build does; the output must lie in a folder that all nodes share under one path"
            f" ({GUIDE})"
        )
    here = libraries(errand.settings.detect)
    other = [
        f"{name} {here.get(name)} instead of {v}"
        for name, v in errand.libraries.items()
        if here.get(name) != v
    ]
    if other:
        raise BuildError(
            f"the node {host} has {', '.join(other)}, and would make other bytes; install the same"
        )
    if assets_of(errand.settings) != errand.assets:
        raise BuildError(
            f"the node {host} has other recorded pictures, and would make other bytes; install the"
            " same"
        )
    root = Path(task.root)
    if not soon(lambda: records_hash(task.trajectories, root) == task.records):
        raise BuildError(
            f"{root}: the node {host} does not see the pictures in this folder that the machine"
            " that started the build sees, or they are being changed; the source must lie in a"
            f" folder that all nodes share ({GUIDE})"
        )


def soon(check: Callable[[], bool]) -> bool:
    """Return whether `check()` becomes true within `PATIENCE` seconds."""
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
