"""Look up plug-ins and built-ins by name: one `Registry` for each kind.

An entry comes from this library, from an installed package (an entry point of the group
`agenthijack.<kinds>`, see `plugins`) or from a loaded file (see `loading`). For names given by
users, `find` also accepts `package.module:Name` and `path/to/file.py:Name`.
"""

import importlib
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, KeysView, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from .errors import ParameterError, PluginError, UnknownNameError, suggest

PREFIX = "agenthijack."
OURS = ("hijack_data", "pipelines", "online_env")
# The module of each kind's registry, as text, because this package must not import the other two.
KINDS: Mapping[str, str] = MappingProxyType(
    {
        "corruptions": "hijack_data.corruption:CORRUPTIONS",
        "effects": "online_env.effects.base:EFFECTS",
        "edits": "pipelines.edits:EDITS",
        "readers": "pipelines.readers.base:READERS",
        "exports": "pipelines.exports.export:FORMATS",
        "engines": "pipelines.engines:ENGINES",
        "providers": "online_env.bench.providers:PROVIDERS",
        "tasks": "online_env.tasks:TASKS",
        "agents": "online_env.agents.registry:AGENTS",
    }
)
T = TypeVar("T")
V = TypeVar("V")


@dataclass(frozen=True)
class Lazy:
    """A built-in entry that is imported on first use: `module:attribute`."""

    place: str

    def load(self) -> Any:
        """Import the module and return the attribute."""
        name, _, attribute = self.place.partition(":")
        module = importlib.import_module(name)
        return getattr(module, attribute)


class Registry(Generic[T]):
    """The entries of one kind by name, including plug-ins.

    Args:
        kind: the word for one entry in messages, such as `"agent"`.
        kinds: the end of its entry-point group, one of the keys of `KINDS`.
        builtin: the built-in entries by name, each as `module:attribute`, imported on first use.
        package: a module that registers built-in entries when it is imported.
        own_name: the attribute that holds the name of an entry; empty if this kind has none.
        problems: called with an object and its name before it is registered; yields its problems.
        prepare: makes the entry from the registered object, such as an instance from a class.
        check: called with each entry of a plug-in; raises if the entry cannot be used.
        related: kinds whose plug-ins may register here, too.
        reserved: names with a built-in meaning that are not registered, and where that meaning is
            defined.
    """

    def __init__(
        self,
        kind: str,
        kinds: str,
        *,
        builtin: Mapping[str, str] = MappingProxyType({}),
        package: str = "",
        own_name: str = "",
        problems: Callable[[Any, str], Iterable[str]] = lambda _thing, _name: (),
        prepare: Callable[[Any], T] = lambda thing: thing,
        check: Callable[[T], object] = lambda _: None,
        related: Iterable[str] = (),
        reserved: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.kind = kind
        self.group = PREFIX + kinds
        self.entries: dict[str, Any] = {name: Lazy(place) for name, place in builtin.items()}
        self.check = check
        self._package = package
        self._own_name = own_name
        self._problems = problems
        self._prepare = prepare
        self._related = tuple(related)
        self._reserved: dict[str, Any] = {name: Lazy(place) for name, place in reserved.items()}
        _registries.append(self)

    def names(self) -> list[str]:
        """Return all names: built-in ones, then those of plug-ins, then those of loaded files.

        Loads plug-ins and files, and raises `PluginError` if a file of `AGENTHIJACK_LOAD` cannot be
        loaded.
        """
        self.load()
        return list(self.entries)

    def get(self, name: str) -> T:
        """Return the entry registered as `name`.

        Raises `PluginError` if a plug-in that should register it cannot be loaded.

        Raises:
            UnknownNameError: there is no such entry; the message suggests the closest name.
        """
        self.load_ours()
        if name not in self.entries:
            self.load()
        if name not in self.entries:
            self.check_not_broken(name)
            raise UnknownNameError(f"unknown {self.kind} {name!r}{self.hint(name)}")
        entry = self.entries[name]
        if isinstance(entry, Lazy):
            entry = self.entries[name] = self._prepare(entry.load())
        return entry

    def find(self, text: str) -> str:
        """Return the registered name for a name or reference given by a user.

        Raises `UnknownNameError` if there is no such name, module or attribute, `PluginError` if
        the file or module cannot be loaded, and `ParameterError` as `add` does.

        Args:
            text: a name, `package.module:Name`, or `path/to/file.py:Name`. For the last two forms,
                the object is loaded, and registered under its own name or, if it has none, under
                `text`.
        """
        from . import loading  # it needs the registries

        if text in self.entries or not loading.is_reference(text):
            self.get(text)
            return text
        self.load()
        return self.add(loading.load_reference(text), text)

    def is_reference(self, text: str) -> bool:
        """Return whether a text is a reference that `find` loads, not a registered name."""
        from . import loading

        return loading.is_reference(text)

    def register(self, name: str) -> Callable[[V], V]:
        """Decorator: register an object that has no name of its own under `name`."""

        def decorate(thing: V) -> V:
            self.add(thing, name)
            return thing

        return decorate

    def add(self, thing: Any, name: str = "") -> str:
        """Register an object, and return its name.

        Args:
            thing: the object; registering the same class or function again is allowed.
            name: its name; ignored if entries of this kind hold their own name.

        Raises:
            ParameterError: the object is not of this kind, or the name is taken.
        """
        title = getattr(thing, "__qualname__", type(thing).__qualname__)
        own = getattr(thing, self._own_name, "") if self._own_name else ""
        if own:
            name = str(own)
        problems = "; ".join(self._problems(thing, name))
        if problems:
            raise ParameterError(f"cannot register {title}: {problems}")
        self.load_ours()
        taken = {**self._reserved, **self.entries}
        if name in taken and _identity(taken[name]) != _identity(thing):
            source = "" if is_ours(thing) else f" of {describe_origin(thing)}"
            raise ParameterError(
                f"cannot register {title}{source}: {name!r} is taken by {describe_origin(taken[name])}; "
                "choose another name, or leave one of the two out"
            )
        self.entries[name] = self._prepare(thing)
        return name

    def load_ours(self) -> None:
        """Import the module that registers the built-in entries, which come first."""
        if self._package:
            importlib.import_module(self._package)

    def load_installed(self) -> None:
        """Load installed plug-ins, once per process; broken ones are left out with a warning."""
        from .entry_points import load_plugins  # it needs the registries

        self.load_ours()
        for kinds in self._related:
            find_registry(kinds).load_installed()
        load_plugins(self.group, self)

    def load(self) -> None:
        """Load installed plug-ins and the files of `AGENTHIJACK_LOAD`, each once per process."""
        from . import loading

        self.load_installed()
        loading.load_environment()

    def of_module(self, module: str) -> list[str]:
        """Return the names that a module registered."""
        return [name for name, entry in self.entries.items() if defining_module(entry) == module]

    def hint(self, name: str) -> str:
        """Return the end of an error on an unknown name: the closest name, and broken plug-ins."""
        from .entry_points import left_out

        known = [*self.entries, *self._reserved]
        return suggest(name, known) + left_out(self.group)

    def check_not_broken(self, name: str) -> None:
        """Check that `name` does not belong to a plug-in that was left out.

        Raises:
            PluginError: the message names the plug-in, its problem and how to remove it.
        """
        from .entry_points import broken

        if name in self.entries:
            return  # a plug-in tried to register a name that was taken
        for plugin in broken(self.group):
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


_registries: list[Registry[Any]] = []


def registries() -> tuple[Registry[Any], ...]:
    """Return the registries whose modules this process has imported."""
    return tuple(_registries)


def find_registry(kinds: str) -> Registry[Any]:
    """Import and return the registry of a kind, one of the keys of `KINDS`.

    Raises:
        UnknownNameError: there is no such kind.
    """
    if kinds not in KINDS:
        raise UnknownNameError(f"there are no plug-ins of kind {kinds!r}{suggest(kinds, KINDS)}")
    return Lazy(KINDS[kinds]).load()


@contextmanager
def undone_on_failure() -> Generator[None]:
    """If the body raises, remove what it registered, except for entries of this library."""
    before: dict[int, dict[str, Any]] = {}
    for registry in registries():
        before[id(registry)] = dict(registry.entries)
    try:
        yield
    except BaseException:
        for registry in registries():
            _restore(registry.entries, before.get(id(registry), {}))
        raise


def _restore(entries: dict[str, Any], before: Mapping[str, Any]) -> None:
    """Restore earlier entries; built-in ones stay, since an import may have added them."""
    for name, entry in list(entries.items()):
        if name in before:
            entries[name] = before[name]
        elif not is_ours(entry):
            del entries[name]


def defining_module(entry: object) -> str:
    """Return the module that defines an entry: a class, a function, or the class of an object."""
    if isinstance(entry, Lazy):
        return entry.place.partition(":")[0]
    if isinstance(entry, type) or hasattr(entry, "__qualname__"):
        return str(getattr(entry, "__module__", ""))
    return type(entry).__module__


def is_ours(entry: object) -> bool:
    """Return whether an entry comes from this library."""
    return defining_module(entry).partition(".")[0] in OURS


def describe_origin(entry: object) -> str:
    """Return the origin of an entry for messages: our module, or the file of a plug-in."""
    module = defining_module(entry)
    if is_ours(entry):
        return module
    return defining_file(entry) or module


def defining_file(entry: object) -> str | None:
    """Return the file of the module that defines an entry, if it has one."""
    module = sys.modules.get(defining_module(entry))
    return getattr(module, "__file__", None)


def _identity(thing: object) -> str:
    """Return an identity that a class keeps when it is reloaded, and that its objects share."""
    if isinstance(thing, Lazy):
        return thing.place
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    name = getattr(named, "__qualname__", "")
    return f"{defining_module(thing)}:{name}"
