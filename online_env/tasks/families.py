"""Families of tasks that are read from files and played in an environment of their own.

`FAMILIES` names each family's module. It is imported only when a run has a task of the family.
"""

import importlib
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from hijack_data.errors import ParameterError, shorten_list
from hijack_data.types import Size

from .base import Task
from .machines import MachineSettings


class TaskFamily(Protocol):
    """How tasks of one family are read, checked and played."""

    title: str
    provider: str  # the provider of the desktops on which its tasks are played

    def read_task(self, path: str) -> type[Task]:
        """Return the class of the task in a file; mistakes in it are a `ConfigError`."""
        ...

    def list_files(self, folder: str) -> list[str]:
        """Return the files of all tasks in a folder; `ConfigError` if there are none."""
        ...

    def read_options(self, texts: tuple[str, ...]) -> dict[str, str | bool]:
        """Return the arguments for providers of machines in texts such as `region=us-east-1`.

        A text that names none is a `ParameterError`.
        """
        ...

    def check_machines(self, machines: MachineSettings, episodes: int) -> None:
        """Raise a `HijackError` if machines of the user can't be used; none is started or changed.

        Args:
            machines: The machines.
            episodes: How many episodes are played.
        """
        ...

    def find_unplayable(
        self, tasks: Iterable[type[Task]], files: Path | None, machines: MachineSettings | None
    ) -> dict[str, str]:
        """Return why tasks cannot be played, by name; those that can are left out.

        Args:
            tasks: The tasks.
            files: The folder of files that tasks need; `None` for none.
            machines: The machines of the user; `None` for embedded desktops.
        """
        ...

    def judging_code(self) -> Mapping[str, Mapping[str, str]]:
        """Return the code that judges tasks and is not this library's, by name.

        Each has a `path` and a `sha256`.
        """
        ...

    def open_stage(
        self, size: Size, files: Path | None, machine: AbstractContextManager[Any] | None = None
    ) -> AbstractContextManager[Any]:
        """Start a desktop, and return it with the family's tasks: an `environment.stage.TaskStage`.

        Args:
            size: `(height, width)` of the screen in pixels.
            files: The folder of files that tasks need; `None` for none.
            machine: Yields the desktop; `None` for an embedded one.
        """
        ...


@dataclass(frozen=True)
class FamilyEntry:
    """Where a family is.

    Args:
        suffix: The end of the names of its task files.
        module: The module that has it as `FAMILY`.
    """

    suffix: str
    module: str


FAMILIES: Mapping[str, FamilyEntry] = MappingProxyType(
    {
        "osworld": FamilyEntry(".json", "online_env.osworld.family"),
        "miniwob": FamilyEntry(".html", "online_env.browser.miniwob"),
    }
)


def load_family(name: str) -> TaskFamily:
    """Import a family, one of the keys of `FAMILIES`."""
    return importlib.import_module(FAMILIES[name].module).FAMILY


def find_by_file(path: str) -> str | None:
    """Return the name of the family whose task files end as `path` does; `None` if none's do."""
    names = (name for name, entry in FAMILIES.items() if path.endswith(entry.suffix))
    return next(names, None)


def find_by_folder(folder: Path) -> TaskFamily:
    """Return the family whose task files a folder holds.

    Without any it is the first family, whose methods raise an error about the folder.
    """
    for name, entry in FAMILIES.items():
        if any(folder.rglob(f"*{entry.suffix}")):
            return load_family(name)
    return load_family(next(iter(FAMILIES)))


def shared_family(classes: Mapping[str, type[Task]]) -> TaskFamily | None:
    """Return the family of all tasks of a run; `None` if `SmallTasks` plays them.

    Args:
        classes: The tasks by name.

    Raises:
        ParameterError: Some tasks are of a family, and others are not.
    """
    names = sorted({task.family for task in classes.values()} - {""})
    if not names:
        return None
    family = load_family(names[0])
    strangers = [name for name, task in classes.items() if task.family != names[0]]
    if strangers:
        raise ParameterError(
            f"--tasks: {family.title}'s tasks are played in its own environment,"
            f" {shorten_list(strangers)} are not; make a run of each"
        )
    return family
