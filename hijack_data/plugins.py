"""Plug-ins: installed packages that register things, found by their entry points.

An entry point names a module, which registers what it offers when it is imported, or
`module:attribute`, which is registered under the name of the entry point unless it holds its own.
A plug-in that cannot be loaded is named in a `PluginWarning`, once a process, and left out; all
others work. `hijack doctor` lists them all.
"""

import importlib
import sys
import traceback
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .errors import HijackError, PluginError, PluginWarning
from .registry import PREFIX, Registry, undone_on_failure

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@dataclass(frozen=True, kw_only=True)
class Plugin:
    """One entry point of an installed package.

    Args:
        group: of entry points, such as `"agenthijack.corruptions"`.
        name: of the entry point.
        module: that is imported.
        package: the distribution it belongs to, and its `version`.
        names: what it registered; of a broken one, what it registered before it failed.
        problem: why it was left out; empty when it works.
    """

    group: str
    name: str
    module: str
    package: str
    version: str
    names: tuple[str, ...] = ()
    problem: str = ""

    @property
    def title(self) -> str:
        """What it is called in messages."""
        return f"the plug-in {self.name!r} of {self.package} {self.version} ({self.module})"

    @property
    def cure(self) -> str:
        """The command that removes it."""
        return f"pip uninstall {self.package}"

    def covers(self, name: str) -> bool:
        """Whether `name` is what this plug-in should have registered, as far as can be told."""
        return name == self.name or name in self.names


_loaded: dict[str, list[Plugin]] = {}


def load_plugins(group: str, registry: Registry[Any]) -> None:
    """Import what installed packages offer under an entry-point group, once a process.

    A plug-in that raises, whatever it raises, is left out: a `PluginWarning` names it, its package
    and the command that removes it.

    Args:
        group: of entry points.
        registry: where its plug-ins register; its `check` is called with each new entry.
    """
    if group in _loaded:
        return
    # a quarter of the import time of the whole package, and only needed here
    import importlib.metadata

    found: list[Plugin] = []
    _loaded[group] = found  # before the imports: a plug-in may itself ask for the names
    entries = importlib.metadata.entry_points(group=group)
    in_order = sorted(entries, key=lambda entry: entry.name)
    found.extend(_load(entry, registry) for entry in in_order)
    for plugin in broken(group):
        _warn(plugin)


def installed(group: str) -> tuple[Plugin, ...]:
    """Return the plug-ins of a group that was loaded, working and broken ones."""
    return tuple(_loaded.get(group, ()))


def broken(group: str) -> tuple[Plugin, ...]:
    """Return the plug-ins of a group that were left out."""
    return tuple(plugin for plugin in installed(group) if plugin.problem)


def left_out(group: str) -> str:
    """Return what an error on an unknown name adds: one of the broken plug-ins may be meant."""
    lost = [f"{plugin.title}: {plugin.problem}" for plugin in broken(group)]
    if not lost:
        return ""
    return f" (left out, as they cannot be loaded: {'; '.join(lost)})"


def groups() -> list[str]:
    """Return our groups of entry points that an installed package offers something in."""
    import importlib.metadata

    return sorted(g for g in importlib.metadata.entry_points().groups if g.startswith(PREFIX))


def reason_of(error: BaseException) -> str:
    """Return the message of an exception in one line, with its type unless it is one of ours."""
    message = " ".join(str(error).split())
    name = type(error).__name__
    if not message:
        return name
    if isinstance(error, HijackError):
        return message
    return f"{name}: {message}"


def place_of(error: BaseException) -> str:
    """Return the file and line that raised an exception."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{frame.filename}:{frame.lineno}"


def _load(entry: "EntryPoint", registry: Registry[Any]) -> Plugin:
    module = entry.value.partition(":")[0].strip()
    before = set(registry.entries)
    new: list[str] = []
    problem = ""
    try:
        with undone_on_failure():
            try:
                _register(entry, module, registry)
            finally:
                new = [name for name in registry.entries if name not in before]
            for name in new:
                registry.check(registry.get(name))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001  (SystemExit too: a plug-in may raise anything)
        problem = reason_of(error)
    own = [name for name in registry.of_module(module) if name not in new]
    return Plugin(
        group=entry.group,
        name=entry.name,
        module=module,
        package=entry.dist.name if entry.dist else "an unknown package",
        version=entry.dist.version if entry.dist else "",
        names=(*new, *own),
        problem=problem,
    )


def _register(
    entry: "EntryPoint",
    module: str,
    registry: Registry[Any],
) -> None:
    """Import the module of an entry point, and register the attribute that it may name.

    Raises:
        PluginError: the module has no such attribute.
    """
    thing: Any = importlib.import_module(module)
    path = entry.attr
    if not path:
        return
    for attribute in path.split("."):
        if not hasattr(thing, attribute):
            raise PluginError(f"{module} has no {path!r}, which its entry point names")
        thing = getattr(thing, attribute)
    registry.add(thing, entry.name)


def _warn(plugin: Plugin) -> None:
    """Name a broken plug-in; worker processes leave that to the process that started them."""
    workers = sys.modules.get("multiprocessing")
    if workers is not None and workers.parent_process() is not None:
        return
    problem = f"{plugin.title} cannot be loaded and was left out: {plugin.problem}"
    warnings.warn(f"{problem}; mend it, or remove it: {plugin.cure}", PluginWarning, stacklevel=4)
