"""OSWorld's tasks as one of `tasks.families.FAMILIES`.

Tables are written without gymnasium, so what plays tasks is imported when it is used.
"""

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from hijack_data.types import Size

from ..tasks.base import Task
from .tasks import load


class OsworldFamily:
    """Reads, checks and plays the tasks of OSWorld."""

    title = "OSWorld"
    provider = "embedded"

    def read_task(self, path: str) -> type[Task]:
        """Return the class of the task in a file; mistakes in it are a `ConfigError`."""
        from .file_tasks import task_class

        return task_class(path)

    def list_files(self, folder: str) -> list[str]:
        """Return the files of all tasks in a folder, by domain and id.

        A folder without tasks, or with a wrong one, is a `ConfigError`.
        """
        return [str(task.path) for task in load(Path(folder))]

    def check_runnable(self, tasks: Iterable[type[Task]], files: Path | None) -> None:
        """Check that OSWorld's evaluators and files for some tasks are here."""
        from .file_tasks import OsworldFileTask, check_runnable

        check_runnable([task.file for task in tasks if issubclass(task, OsworldFileTask)], files)

    def open_stage(self, size: Size, files: Path | None) -> AbstractContextManager[Any]:
        """Start OSWorld's environment on an embedded desktop, with a cache of its own."""
        from .file_tasks import osworld_stage

        return osworld_stage(size, files)


FAMILY = OsworldFamily()
