"""The empty browsing history that one task fills, made by the guest's own browser.

OSWorld's setup step `update_browse_history` downloads a file unless its cache has one; a file made
by the guest's browser has the schema that this browser expects.
"""

from collections.abc import Iterable
from pathlib import Path

from hijack_data.file_io import make_folder, write_atomic

from ..desktops.osworld import OsworldLike
from .cache_files import HISTORY_NAME
from .errors import OsworldError
from .tasks import OsworldTask

PROFILE = "/tmp/agenthijack-history"
_MAKE = (
    "import subprocess; subprocess.run(['google-chrome', '--headless', '--user-data-dir={0}',"
    " '--dump-dom', 'about:blank'], timeout=60)"
)


def provide(env: OsworldLike, tasks: Iterable[OsworldTask], cache: Path) -> None:
    """Put an empty history into `cache` for each task that needs one and has none.

    Raises:
        OsworldError: The guest's browser makes none.
    """
    targets = [cache / task.id / HISTORY_NAME for task in tasks if is_made(task)]
    targets = [target for target in targets if not target.exists()]
    if not targets:
        return
    env.controller.execute_python_command(_MAKE.format(PROFILE))
    data = env.controller.get_file(f"{PROFILE}/Default/History")
    if not data:
        raise OsworldError(
            "the desktop's browser made no history file; is it installed? (hijack desktop install)"
        )
    for target in targets:
        make_folder(target.parent, target)
        write_atomic(target, data)


def is_made(task: OsworldTask) -> bool:
    """Return whether the file of a task is the empty history, which is made and not fetched."""
    steps = task.config.get("config", [])
    return any(step["type"] == "update_browse_history" for step in steps)
