"""The environments' names in gymnasium's registry."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium

from hijack_data.safety import Planner
from hijack_data.types import Size

from ..desktops.embedded.desktop import EmbeddedDesktop
from ..tasks.base import Task
from .core import CorruptedEnv
from .stage import SmallTasks

EMBEDDED_ID = "AgentHijack/Embedded-v0"


def register_envs() -> None:
    """Make `gymnasium.make("AgentHijack/Embedded-v0", corruption=..., task=..., size=...)` work; again is fine."""
    if EMBEDDED_ID not in gymnasium.registry:
        # A real desktop has clocks and blinking cursors: two runs show the same task, not the same pixels.
        gymnasium.register(EMBEDDED_ID, entry_point=f"{__name__}:make_embedded", nondeterministic=True)


def make_embedded(
    *, task: str | Task = "write_note", corruption: str | Planner | None = None, size: Size = (1080, 1920),
    name: str | None = None, apps: Sequence[str] = (), standby: bool = True, log: Path | str | None = None,
    **options: Any,
) -> CorruptedEnv:  # fmt: skip
    """A `CorruptedEnv` over the small tasks on an embedded desktop of its own, which ends with `close`.

    `size` is (height, width) in pixels, `name` the desktop's, `standby` keeps the next desktop ready; `options` are
    those of `CorruptedEnv`. Raises `DesktopError` where no desktop starts.
    """
    desktop = EmbeddedDesktop.up(size, name, apps, standby=standby)
    try:
        return CorruptedEnv(SmallTasks(desktop, task), corruption=corruption, log=log, **options)
    except BaseException:
        desktop.close()
        raise
