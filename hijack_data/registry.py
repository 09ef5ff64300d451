"""Look up plug-ins and built-ins by name: one `Registry` for each kind.

An entry comes from this library, from an installed package (an entry point of the group
`agenthijack.<kinds>`, see `entry_points`) or from a loaded file (see `loading`). For names given by
users, `find` also accepts `package.module:Name` and `path/to/file.py:Name`.
"""

from collections.abc import Iterator, KeysView
from typing import Any, TypeVar, cast

from . import entry_points, loading
from .entries import (
    KINDS,
    OURS,
    PREFIX,
    EntryTable,
    Lazy,
    import_table,
    is_ours,
    registries,
    undone_on_failure,
)
from .errors import PluginError, UnknownNameError, suggest

__all__ = [
    "KINDS",
    "OURS",
    "PREFIX",
    "Lazy",
    "Registry",
    "find_registry",
    "is_ours",
    "registries",
    "undone_on_failure",
]

T = TypeVar("T")


class Registry(EntryTable[T]):
    """The entries of one kind by name, including plug-ins; see `EntryTable` for the arguments."""

    def names(self) -> list[str]:
        """Return all names: built-in ones, then those of plug-ins, then those of loaded files.

        Loads plug-ins and files, and raises `PluginError` if a file of `AGENTHIJACK_LOAD` cannot be
        loaded.
        """
        self.load()
        return list(self.entries)

    def get(self, name: str) -> T:
        """Return the entry registered as `name`.

        Raises:
            UnknownNameError: there is no such entry; the message suggests the closest name.
            PluginError: a plug-in that should register it cannot be loaded.
        """
        self.load_ours()
        if name not in self.entries:
            self.load()
        if name not in self.entries:
            self.check_not_broken(name)
            raise UnknownNameError(f"unknown {self.kind} {name!r}{self.hint(name)}")
        return self.resolve(name)

    def find(self, text: str) -> str:
        """Return the registered name for a name or reference given by a user.

        Args:
            text: a name, `package.module:Name`, or `path/to/file.py:Name`. For the last two forms,
                the object is loaded, and registered under its own name or, if it has none, under
                `text`.

        Raises:
            UnknownNameError: there is no such name, module or attribute.
            PluginError: the file or module cannot be loaded.
            ParameterError: the object is not of this kind, or its name is taken.
        """
        if text in self.entries or not loading.is_reference(text):
            self.get(text)
            return text
        self.load()
        return self.add(loading.load_reference(text), text)

    def is_reference(self, text: str) -> bool:
        """Return whether a text is a reference that `find` loads, not a registered name."""
        return loading.is_reference(text)

    def load_installed(self) -> None:
        """Load installed plug-ins, once per process; broken ones are left out with a warning."""
        entry_points.load_installed(self)

    def load(self) -> None:
        """Load installed plug-ins and the files of `AGENTHIJACK_LOAD`, each once per process."""
        self.load_installed()
        loading.load_environment()

    def hint(self, name: str) -> str:
        """Return the end of an error on an unknown name: the closest name, and broken plug-ins."""
        return suggest(name, self.names_in_use()) + entry_points.left_out(self.group)

    def check_not_broken(self, name: str) -> None:
        """Check that `name` does not belong to a plug-in that was left out.

        Raises:
            PluginError: the message names the plug-in, its problem and how to remove it.
        """
        if name in self.entries:
            return  # a plug-in tried to register a name that was taken
        for plugin in entry_points.broken(self.group):
            if not plugin.covers(name):
                continue
            raise PluginError(
                f"the {self.kind} {name!r} cannot be used: {plugin.title} cannot be loaded: "
                f"{plugin.problem}; fix it, or remove it: {plugin.cure}"
            )

    def __getitem__(self, name: str) -> T:
        return self.get(name)

    def keys(self) -> KeysView[str]:
        """Return all names, so that a registry can be used as a mapping."""
        return dict.fromkeys(self.names()).keys()

    def __contains__(self, name: object) -> bool:
        return name in self.entries or name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def __len__(self) -> int:
        return len(self.names())


def find_registry(kinds: str) -> Registry[Any]:
    """Import and return the registry of a kind, one of the keys of `KINDS`.

    Raises:
        UnknownNameError: there is no such kind.
    """
    return cast("Registry[Any]", import_table(kinds))
