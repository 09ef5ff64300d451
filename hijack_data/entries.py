"""The named entries of one kind, built-in or registered by plug-ins: a table that loads nothing.

`registry.Registry` adds the loading of plug-ins to this table; `entry_points` and `loading` fill
it, with the plug-ins of installed packages and those of a user's files.
"""

import importlib
import sys
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from .errors import ParameterError, UnknownNameError, suggest

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

    reference: str

    def load(self) -> Any:
        """Import the module and return the attribute."""
        name, _, attribute = self.reference.partition(":")
        module = importlib.import_module(name)
        return getattr(module, attribute)


class EntryTable(Generic[T]):
    """The entries of one kind by name.

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
        problems: Callable[[Any, str], Iterable[str]] = lambda _obj, _name: (),
        prepare: Callable[[Any], T] = lambda obj: obj,
        check: Callable[[T], object] = lambda _: None,
        related: Iterable[str] = (),
        reserved: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.kind = kind
        self.group = PREFIX + kinds
        self.entries: dict[str, Any] = {
            name: Lazy(reference) for name, reference in builtin.items()
        }
        self.check = check
        self._package = package
        self._own_name = own_name
        self._problems = problems
        self._prepare = prepare
        self.related = tuple(related)
        self._reserved: dict[str, Any] = {
            name: Lazy(reference) for name, reference in reserved.items()
        }
        _tables.append(self)

    def resolve(self, name: str) -> T:
        """Return the entry registered as `name`, which is imported on its first use."""
        entry = self.entries[name]
        if isinstance(entry, Lazy):
            entry = self.entries[name] = self._prepare(entry.load())
        return entry

    def names_in_use(self) -> list[str]:
        """Return the names registered so far, and the reserved ones."""
        return [*self.entries, *self._reserved]

    def register(self, name: str) -> Callable[[V], V]:
        """Decorator: register an object that has no name of its own under `name`."""

        def decorate(obj: V) -> V:
            self.add(obj, name)
            return obj

        return decorate

    def add(self, obj: Any, name: str = "") -> str:
        """Register an object, and return its name.

        Args:
            obj: the object; registering the same class or function again is allowed.
            name: its name; ignored if entries of this kind hold their own name.

        Raises:
            ParameterError: the object is not of this kind, or the name is taken.
        """
        title = getattr(obj, "__qualname__", type(obj).__qualname__)
        own_name = getattr(obj, self._own_name, "") if self._own_name else ""
        if own_name:
            name = str(own_name)
        problems = "; ".join(self._problems(obj, name))
        if problems:
            raise ParameterError(f"cannot register {title}: {problems}")
        self.load_ours()
        used_names = {**self._reserved, **self.entries}
        if name in used_names and _identity(used_names[name]) != _identity(obj):
            source = "" if is_ours(obj) else f" of {describe_origin(obj)}"
            raise ParameterError(
                f"cannot register {title}{source}: {name!r} is taken by "
                f"{describe_origin(used_names[name])}; choose another name, or leave one of the "
                "two out"
            )
        self.entries[name] = self._prepare(obj)
        return name

    def load_ours(self) -> None:
        """Import the module that registers the built-in entries, which come first."""
        if self._package:
            importlib.import_module(self._package)

    def of_module(self, module: str) -> list[str]:
        """Return the names that a module registered."""
        return [name for name, entry in self.entries.items() if defining_module(entry) == module]


_tables: list[EntryTable[Any]] = []


def registries() -> tuple[EntryTable[Any], ...]:
    """Return the registries whose modules this process has imported."""
    return tuple(_tables)


def import_table(kinds: str) -> EntryTable[Any]:
    """Import and return the table of a kind, one of the keys of `KINDS`.

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
        return entry.reference.partition(":")[0]
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


def _identity(obj: object) -> str:
    """Return an identity that a class keeps when it is reloaded, and that its objects share."""
    if isinstance(obj, Lazy):
        return obj.reference
    target = obj if hasattr(obj, "__qualname__") else type(obj)
    name = getattr(target, "__qualname__", "")
    return f"{defining_module(obj)}:{name}"
