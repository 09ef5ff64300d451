"""Make the environments that are registered with gymnasium."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hijack_data.planner import Planner
from hijack_data.types import Size

from ..embedded.desktop import EmbeddedDesktop
from ..gymnasium_registration import EMBEDDED_ID as EMBEDDED_ID
from ..gymnasium_registration import register_with_gymnasium
from ..tasks.base import Task
from .core import CorruptedEnv
from .stage import SmallTasks


def register_envs() -> None:
    """Register `AgentHijack/Embedded-v0` with `gymnasium.make`, which importing `online_env` does.

    Its keyword arguments are those of `make_embedded`.
    """
    register_with_gymnasium()


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

    `close` ends the desktop.

    Args:
        task: A name, or a task.
        corruption: As in `CorruptedEnv`.
        size: (height, width) of the desktop in pixels.
        name: The desktop's name; the next free one if omitted.
        apps: Applications that are started with the desktop.
        standby: Whether the next desktop is kept ready, so that a reset is quick.
        log: The folder of the run.
        **options: More arguments of `CorruptedEnv`.

    Raises:
        DesktopError: No desktop starts.
    """
    desktop = EmbeddedDesktop.up(size, name, apps, standby=standby)
    try:
        return CorruptedEnv(SmallTasks(desktop, task), corruption=corruption, log=log, **options)
    except BaseException:
        desktop.close()
        raise
