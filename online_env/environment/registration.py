"""Register the environments with gymnasium."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium

from hijack_data.planner import Planner
from hijack_data.types import Size

from ..embedded.desktop import EmbeddedDesktop
from ..tasks.base import Task
from .core import CorruptedEnv
from .stage import SmallTasks

EMBEDDED_ID = "AgentHijack/Embedded-v0"


def register_envs() -> None:
    """Register `AgentHijack/Embedded-v0` with `gymnasium.make`; calling it again does nothing.

    Its keyword arguments are those of `make_embedded`.
    """
    if EMBEDDED_ID in gymnasium.registry:
        return
    # A real desktop has clocks and blinking cursors: two runs show the same task, but not the
    # same pixels, so it is registered as non-deterministic.
    maker = f"{__name__}:{make_embedded.__name__}"
    gymnasium.register(EMBEDDED_ID, entry_point=maker, nondeterministic=True)


def make_embedded(
    *,
    task: str | Task = "write_note",
    corruption: str | Planner | None = None,
    size: Size = (1080, 1920),
    name: str | None = None,
    apps: Sequence[str] = (),
    standby: bool = True,
    log: Path | str | None = None,
    **options: Any,
) -> CorruptedEnv:
    """Return a `CorruptedEnv` with the small tasks on its own embedded desktop.

    `close` ends the desktop. Raises `DesktopError` if no desktop starts.

    Args:
        task: A name, or a task.
        corruption: As in `CorruptedEnv`.
        size: (height, width) of the desktop in pixels.
        name: The desktop's name; the next free one if omitted.
        apps: Applications that are started with the desktop.
        standby: Whether the next desktop is kept ready, so that a reset is quick.
        log: The folder of the run.
        **options: More arguments of `CorruptedEnv`.
    """
    desktop = EmbeddedDesktop.up(size, name, apps, standby=standby)
    try:
        return CorruptedEnv(SmallTasks(desktop, task), corruption=corruption, log=log, **options)
    except BaseException:
        desktop.close()
        raise
