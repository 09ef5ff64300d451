"""Make the environment `AgentHijack/Browser-v0`, which is registered with gymnasium."""

from pathlib import Path
from typing import Any

from hijack_data.planner import Planner
from hijack_data.types import Size

from .. import tasks
from ..environment.core import CorruptedEnv
from ..tasks.base import Task
from .desktop import BrowserDesktop
from .miniwob import open_miniwob
from .site_tasks import open_site_tasks


def make_browser(
    *,
    task: str | Task = "miniwob/click-test.html",
    corruption: str | Planner | None = None,
    size: Size = (720, 960),
    log: Path | str | None = None,
    **options: Any,
) -> CorruptedEnv:
    """Return a `CorruptedEnv` with tasks of MiniWoB++ or the local sites in a browser of its own.

    `close` ends the browser.

    Args:
        task: A page of the installed `miniwob`, such as `miniwob/enter-text.html`, its path, the
            name of a task that needs no more than a browser, such as `compare_products`, or a task.
        corruption: As in `CorruptedEnv`.
        size: (height, width) of the screen in pixels.
        log: The folder of the run.
        **options: More arguments of `CorruptedEnv`.

    Raises:
        DesktopError: No browser starts.
    """
    family = task.family if isinstance(task, Task) else tasks.get(task, 0).family
    stage = open_miniwob(size, task) if family else open_site_tasks(size, task)
    options.setdefault("settle", BrowserDesktop.settle)
    try:
        return CorruptedEnv(stage, corruption=corruption, log=log, **options)
    except BaseException:
        stage.close()
        raise
