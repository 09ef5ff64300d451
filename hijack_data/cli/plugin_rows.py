"""The rows of `hijack doctor` on plug-ins and loaded files: working or broken, and why."""

import warnings
from collections.abc import Iterator
from typing import TypeAlias

from rich.markup import escape

from ..entry_points import Plugin, groups, installed
from ..errors import HijackError, PluginError, PluginWarning
from ..loading import VARIABLE, LoadedFile, loaded_files
from ..registry import PREFIX, find_registry

PluginLine: TypeAlias = tuple[str, str, str, str]
OK = "[green]ok[/]"
BROKEN = "[red]broken[/]"


def plugin_rows() -> Iterator[PluginLine]:
    """Yield rows of state, name, origin, and either the registered names or the problem."""
    for state, *texts in (*_plugins(), *_files()):
        what, where, found = map(escape, texts)
        yield state, what, where, found


def _plugins() -> Iterator[PluginLine]:
    """Yield the plug-ins of installed packages, of all kinds, working or broken."""
    for group in groups():
        kinds = group.removeprefix(PREFIX)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PluginWarning)  # the registry already lists them
                find_registry(kinds).load_installed()
        # An unknown kind, or a kind that needs an extra that is not installed.
        except HijackError as error:
            yield BROKEN, kinds, group, str(error)
            continue
        for plugin in installed(group):
            yield _plugin(kinds, plugin)


def _plugin(kinds: str, plugin: Plugin) -> PluginLine:
    what = f"{kinds} {plugin.name}"
    where = f"{plugin.package} {plugin.version}"
    if plugin.problem:
        return BROKEN, what, where, f"{plugin.problem}; fix it, or remove it: {plugin.cure}"
    return OK, what, where, ", ".join(plugin.names) or plugin.module


def _files() -> Iterator[PluginLine]:
    """Yield the files of --load and AGENTHIJACK_LOAD."""
    try:
        files = loaded_files()
    except PluginError as error:
        yield BROKEN, "file", VARIABLE, str(error)
        return
    for file in files:
        yield OK, "file", _names(file), file.path


def _names(file: LoadedFile) -> str:
    return ", ".join(name for names in file.names.values() for name in names)
