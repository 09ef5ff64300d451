"""Tasks on real applications, each with an oracle that can do it.

A task of your own is a subclass of `Task`: of an installed package (entry points
`agenthijack.tasks`), or `hijack bench --tasks my_task.py:MyTask`.

task = tasks.get("rename_file", seed=3)
machine = Machine(desktop, sites)
task.setup(machine)
task.oracle(Hand(desktop))               # or an agent, with task.instruction
task.validate(machine).score             # 1.0
"""

from collections.abc import Iterator
from typing import Any, TypeVar

from hijack_data.registry import Registry

from .. import extra
from . import suite

try:
    from .base import Task, Verdict
    from .hand import Hand
    from .machine import Machine
except ModuleNotFoundError as error:
    raise extra.import_error(error, "a live task") from None

__all__ = ["TASKS", "Hand", "Machine", "Task", "Verdict", "get", "names", "register"]

OSWORLD_SUFFIX = ".json"
T = TypeVar("T", bound=Task)


def _problems(cls: Any, name: str) -> Iterator[str]:
    """Yield what is wrong with the class of a task."""
    if not isinstance(cls, type) or not issubclass(cls, Task):
        yield "it is not a subclass of online_env.tasks.Task"
        return
    missing = sorted(cls.__abstractmethods__)
    missing += [key for key in ("name", "apps") if not hasattr(cls, key)]
    if not cls.phrasings and cls.instruction is Task.instruction:
        missing.append("phrasings")
    if missing:
        yield f"{', '.join(missing)} is missing"
    elif not name or name != cls.name:
        yield "name is empty"


class TaskRegistry(Registry[type[Task]]):
    """Tasks by name; a task of OSWorld is found by its file."""

    def find(self, text: str) -> str:
        """Return the name of what a user asks for, as `Registry.find`.

        A file of OSWorld is read, and its task is registered under its id. Mistakes in it are a
        `ConfigError`.
        """
        if text in self.entries or not text.endswith(OSWORLD_SUFFIX):
            return super().find(text)
        from ..osworld.played import task_class  # it needs desktops, which need tasks

        self.load()
        return self.add(task_class(text))

    def is_reference(self, text: str) -> bool:
        """Return whether a text names a file or a module, and not a task."""
        return text.endswith(OSWORLD_SUFFIX) or super().is_reference(text)


TASKS = TaskRegistry(
    "task", "tasks", builtin=suite.class_references(), own_name="name", problems=_problems
)


def register(cls: type[T]) -> type[T]:
    """Class decorator: make a task known under its `name`.

    Raises `ParameterError` if the class is incomplete, or the name is taken.
    """
    TASKS.add(cls)
    return cls


def names() -> tuple[str, ...]:
    """The names of all tasks."""
    return tuple(TASKS.names())


def get(name: str, seed: int = 0) -> Task:
    """Return the task `name` for `seed`, 0 to 2**64 - 1.

    Raises `UnknownNameError` with the closest name, and `PluginError` if its file, module or
    plug-in cannot be loaded.
    """
    return TASKS.get(TASKS.find(name))(seed)
