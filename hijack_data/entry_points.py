"""Plug-ins of installed packages, found by their entry points.

An entry point names either a module, which registers its plug-ins when it is imported, or
`module:attribute`, which is registered under the name of the entry point unless the attribute has a
name of its own. A plug-in that cannot be loaded is left out, with one `PluginWarning` per process;
all others work. `hijack doctor` lists all of them.
"""

import importlib
import sys
import traceback
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .entries import PREFIX, EntryTable, import_table, undone_on_failure
from .errors import HijackError, PluginError, PluginWarning

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@dataclass(frozen=True, kw_only=True)
class Plugin:
    """One entry point of an installed package.

    Args:
        group: the group of entry points, such as `"agenthijack.corruptions"`.
        name: the name of the entry point.
        module: the module that is imported.
        package: the distribution that declares the entry point, with its `version`.
        names: the names that it registered; for a broken plug-in, those before it failed.
        problem: why it was left out; empty if it works.
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
        """The description of the plug-in in messages."""
        return f"the plug-in {self.name!r} of {self.package} {self.version} ({self.module})"

    @property
    def cure(self) -> str:
        """The command that uninstalls the plug-in's package."""
        return f"pip uninstall {self.package}"

    def covers(self, name: str) -> bool:
        """Return whether this plug-in would probably have registered `name`."""
        return name == self.name or name in self.names


_plugins_by_group: dict[str, list[Plugin]] = {}


def load_installed(registry: EntryTable[Any]) -> None:
    """Import the built-in entries of a registry, then the plug-ins of installed packages.

    Args:
        registry: its `related` kinds are loaded first, because their plug-ins may register here.
    """
    registry.load_ours()
    for kinds in registry.related:
        load_installed(import_table(kinds))
    load_plugins(registry.group, registry)


def load_plugins(group: str, registry: EntryTable[Any]) -> None:
    """Import the plug-ins of installed packages in an entry-point group, once per process.

    A plug-in that raises any exception is left out: a `PluginWarning` names it, its package and the
    command that uninstalls it.

    Args:
        group: the group of entry points.
        registry: the registry of these plug-ins; its `check` is called with each new entry.
    """
    if group in _plugins_by_group:
        return
    # imported here, because it takes a quarter of the import time of the whole package
    import importlib.metadata

    plugins: list[Plugin] = []
    _plugins_by_group[group] = (
        plugins  # before the imports, because a plug-in may itself list names
    )
    entries = importlib.metadata.entry_points(group=group)
    in_order = sorted(entries, key=lambda entry: entry.name)
    plugins.extend(_load(entry, registry) for entry in in_order)
    for plugin in broken(group):
        _warn(plugin)


def installed(group: str) -> tuple[Plugin, ...]:
    """Return all plug-ins of a loaded group, working and broken."""
    return tuple(_plugins_by_group.get(group, ()))


def broken(group: str) -> tuple[Plugin, ...]:
    """Return the plug-ins of a group that were left out."""
    return tuple(plugin for plugin in installed(group) if plugin.problem)


def left_out(group: str) -> str:
    """Return the addition to an error about an unknown name that lists the broken plug-ins."""
    reasons = [f"{plugin.title}: {plugin.problem}" for plugin in broken(group)]
    if not reasons:
        return ""
    return f" (left out, as they cannot be loaded: {'; '.join(reasons)})"


def groups() -> list[str]:
    """Return our entry-point groups for which an installed package has an entry point."""
    import importlib.metadata

    return sorted(g for g in importlib.metadata.entry_points().groups if g.startswith(PREFIX))


def describe_error(error: BaseException) -> str:
    """Return an exception's message in one line, with its type unless it is a `HijackError`."""
    message = " ".join(str(error).split())
    name = type(error).__name__
    if not message:
        return name
    if isinstance(error, HijackError):
        return message
    return f"{name}: {message}"


def error_location(error: BaseException) -> str:
    """Return the file and line that raised an exception."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{frame.filename}:{frame.lineno}"


def _load(entry: "EntryPoint", registry: EntryTable[Any]) -> Plugin:
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
                registry.check(registry.resolve(name))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001  (SystemExit too: a plug-in may raise anything)
        problem = describe_error(error)
    existing = [name for name in registry.of_module(module) if name not in new]
    return Plugin(
        group=entry.group,
        name=entry.name,
        module=module,
        package=entry.dist.name if entry.dist else "an unknown package",
        version=entry.dist.version if entry.dist else "",
        names=(*new, *existing),
        problem=problem,
    )


def _register(entry: "EntryPoint", module: str, registry: EntryTable[Any]) -> None:
    """Import the module of an entry point, and register the attribute that it may name.

    Raises:
        PluginError: the module has no such attribute.
    """
    obj: Any = importlib.import_module(module)
    path = entry.attr
    if not path:
        return
    for attribute in path.split("."):
        if not hasattr(obj, attribute):
            raise PluginError(f"{module} has no {path!r}, which its entry point names")
        obj = getattr(obj, attribute)
    registry.add(obj, entry.name)


def _warn(plugin: Plugin) -> None:
    """Warn about a broken plug-in, except in worker processes, whose parent warns already."""
    workers = sys.modules.get("multiprocessing")
    if workers is not None and workers.parent_process() is not None:
        return
    problem = f"{plugin.title} cannot be loaded and was left out: {plugin.problem}"
    warnings.warn(f"{problem}; fix it, or remove it: {plugin.cure}", PluginWarning, stacklevel=4)
