"""OSWorld's tasks as one of `tasks.families.FAMILIES`.

Tables are written without gymnasium, so what plays tasks is imported when it is used.
"""

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from hijack_data.types import Size

from ..tasks.base import Task
from ..tasks.machines import MachineSettings
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

    def read_options(self, texts: tuple[str, ...]) -> dict[str, str | bool]:
        """Return the arguments of `DesktopEnv` that texts such as `region=us-east-1` name."""
        from .machines import read_options

        return read_options(texts)

    def check_machines(self, machines: MachineSettings, episodes: int) -> None:
        """Check that machines of the user can be used; none is started or changed."""
        from .machines import check

        check(machines, episodes)

    def find_unplayable(
        self, tasks: Iterable[type[Task]], files: Path | None, machines: MachineSettings | None
    ) -> dict[str, str]:
        """Return why tasks cannot be played, by name; those that can are left out."""
        from .file_tasks import OsworldFileTask, find_unplayable

        listed = [task.file for task in tasks if issubclass(task, OsworldFileTask)]
        return find_unplayable(listed, files, machines)

    def judging_code(self) -> Mapping[str, Mapping[str, str]]:
        """Return what is installed of OSWorld; nothing if it is not installed."""
        from .venv import DEFAULT, judging_code

        code = judging_code(DEFAULT)
        return {} if code is None else {"desktop_env": code}

    def open_stage(
        self, size: Size, files: Path | None, machine: AbstractContextManager[Any] | None = None
    ) -> AbstractContextManager[Any]:
        """Start OSWorld's environment, on an embedded desktop if there is no machine."""
        from .file_tasks import osworld_stage

        return osworld_stage(size, files, machine)


FAMILY = OsworldFamily()
