"""Load plug-ins from a user's own files: `hijack --load FILE.py`, `path/to/file.py:Name`.

A file is identified by the SHA-256 of its bytes, and exactly these bytes are run.
`AGENTHIJACK_LOAD` passes the list of loaded files to child processes. Corruptions from a file can
be sent to other processes, which load the file from the same path and refuse it if its bytes
differ.
"""

import copyreg
import hashlib
import importlib
import os
import re
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from . import params as p
from .entries import (
    EntryTable,
    defining_file,
    defining_module,
    import_table,
    registries,
    undone_on_failure,
)
from .entry_points import describe_error, error_location, load_installed
from .errors import HijackError, PluginError, UnknownNameError, suggest
from .paths import PathLike

VARIABLE = "AGENTHIJACK_LOAD"
SUFFIX = ".py"


@dataclass(frozen=True, kw_only=True)
class LoadedFile:
    """A Python file that was loaded for its registrations, or for one name in it.

    Args:
        path: the absolute path, with symbolic links resolved.
        sha256: the hash of its bytes, 64 hexadecimal digits.
        module: the name under which the file was imported.
        names: the registered names, by kind, such as `"corruption"`.
    """

    path: str
    sha256: str
    module: str
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])

    @property
    def corruptions(self) -> tuple[str, ...]:
        """Names of the corruptions that it registers."""
        return self.names.get("corruption", ())

    @property
    def effects(self) -> tuple[str, ...]:
        """Kinds of the live effects that it registers."""
        return self.names.get("effect", ())


_files: dict[str, LoadedFile] = {}
_listed: set[str] = set()  # entries of the environment variable that were handled


def load_file(path: PathLike) -> LoadedFile:
    """Load a Python file and register its plug-ins, once per process.

    Child processes load it too, because the file is added to `AGENTHIJACK_LOAD`.

    Args:
        path: the file, which must import its other modules from installed packages.

    Raises:
        PluginError: the file cannot be read or imported, registers nothing or a name that is taken,
            or has changed since this process loaded it.
    """
    file = run_file(path)
    if not file.names:
        raise PluginError(
            f"{file.path}: registers nothing; decorate a class with @hijack_data.plugin.register,"
            " or with the register of another kind, such as @online_env.effects.register"
        )
    return file


def run_file(path: PathLike) -> LoadedFile:
    """Load a Python file as `load_file` does, but allow it to register nothing."""
    file = _load(path)
    if file.names:
        _announce(file.path)
    return file


def load_environment() -> None:
    """Load the files that `AGENTHIJACK_LOAD` lists, each once.

    Raises:
        PluginError: one of them cannot be loaded; see `load_file`.
    """
    for path in _entries():
        if path in _listed:
            continue
        _listed.add(path)  # before the file runs, because it may itself list names
        try:
            load_file(path)
        except PluginError as error:
            _listed.discard(path)
            raise PluginError(f"{error} (listed in {VARIABLE})") from error


def is_reference(text: str) -> bool:
    """Return whether a text is `package.module:Name` or `path/to/file.py:Name`."""
    return ":" in text or text.endswith(SUFFIX)


def load_reference(text: str) -> Any:
    """Return the object that `package.module:Name` or `path/to/file.py:Name` refers to.

    Paths may be relative, and may begin with `~`. A file is loaded once per process. Child
    processes load it too if it registers something.

    Raises:
        UnknownNameError: the file or module has no such name.
        PluginError: the file or module cannot be read or imported; the message names file and line.
    """
    source, _, name = text.rpartition(":")
    lacks_name = text.endswith(SUFFIX) or not source or not name
    if lacks_name:
        example = f"{text.rstrip(':') or 'my_file.py'}:MyClass"
        raise PluginError(f"{text!r} names no class; write it behind a colon, such as {example}")
    is_file = source.endswith(SUFFIX)
    module = _module_of_file(source) if is_file else _import(source, text)
    if not hasattr(module, name):
        public = [key for key in vars(module) if not key.startswith("_")]
        hint = suggest(name, public)
        raise UnknownNameError(f"{source}: has no {name!r}{hint}")
    return getattr(module, name)


def loaded_files() -> tuple[LoadedFile, ...]:
    """Return the files that this process loaded, in order.

    The files of `AGENTHIJACK_LOAD` are loaded first, so the errors of `load_file` are possible.
    """
    load_environment()
    return tuple(_files.values())


def find_loaded_file(cls: object) -> LoadedFile | None:
    """Return the loaded file that defines a class or function, if one does."""
    module = defining_module(cls)
    for file in _files.values():
        if file.module == module:
            return file
    return None


def find_source(obj: object) -> dict[str, str] | None:
    """Return the file that defines a class or function: its `path` and `sha256`.

    For a loaded file the hash is that of the bytes that were run. Returns `None` if there is no
    such file.
    """
    file = find_loaded_file(obj)
    if file is not None:
        return {"path": file.path, "sha256": file.sha256}
    path = defining_file(obj)
    if path is None or not Path(path).is_file():
        return None
    real_path = os.path.realpath(path)
    return {"path": real_path, "sha256": _hash(real_path)}


def holds(sha256: str, corruptions: Iterable[str]) -> bool:
    """Return whether these corruptions come from a file with this SHA-256, loaded or imported."""
    if sha256 in [file.sha256 for file in loaded_files()]:
        return True
    registry = import_table("corruptions")
    load_installed(registry)
    for name in registry.entries.keys() & set(corruptions):
        source = find_source(registry.resolve(name))
        if source is not None and source["sha256"] == sha256:
            return True
    return False


def _entries() -> list[str]:
    listed = os.environ.get(VARIABLE, "")
    return [path for path in listed.split(os.pathsep) if path]


def _load(path: PathLike) -> LoadedFile:
    """Load a file once per process.

    Raises:
        PluginError: see `load_file`.
    """
    real_path, data = _read(path)
    sha256 = hashlib.sha256(data).hexdigest()
    file = _files.get(real_path)
    if file is not None:
        if file.sha256 != sha256:
            raise PluginError(f"{path}: was changed since this process loaded it; start again")
        return file
    # Installed plug-ins are loaded first: a name that both define is an error of the file.
    load_installed(import_table("corruptions"))
    load_environment()
    file = _files.get(real_path)
    if file is None:
        file = _installed(real_path, sha256)
    if file is None:
        file = _execute(real_path, data, sha256)
    _files[real_path] = file
    return file


def _read(path: PathLike) -> tuple[str, bytes]:
    """Return the place of a file and its bytes.

    Raises:
        PluginError: the file is not a Python file, or cannot be read.
    """
    path = Path(path).expanduser()
    if path.suffix != SUFFIX:
        raise PluginError(f"{path}: not a Python file; give a file that ends in {SUFFIX}")
    real_path = os.path.realpath(path)
    if os.pathsep in real_path:
        problem = f"its path holds {os.pathsep!r}, which parts the paths of {VARIABLE}"
        raise PluginError(f"{path}: {problem}; rename it")
    try:
        real_path.encode()
    except UnicodeEncodeError:
        raise PluginError(f"{real_path!r}: its path is not UTF-8; rename the file") from None
    try:
        return real_path, Path(real_path).read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise PluginError(f"{path}: not a Python file that can be read ({reason})") from None


def _module_of_file(path: str) -> ModuleType:
    """Load a file and return its module; child processes load it if it registers something."""
    return sys.modules[run_file(path).module]


def _import(module: str, text: str) -> ModuleType:
    """Import the module of a reference.

    Raises:
        PluginError: the module does not exist, or raises when it is imported.
        KeyboardInterrupt: the user interrupted the import.
    """
    try:
        return importlib.import_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit too: a module may raise anything
        reason = f"{describe_error(error)} ({error_location(error)})"
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and missing in module:
            reason = f"there is no module {missing!r}; a file is named by its path, file.py:Class"
        raise PluginError(f"{text}: cannot be imported: {reason}") from error


def _installed(path: str, sha256: str) -> LoadedFile | None:
    """Return a file that an installed plug-in has already imported as a module, or `None`."""
    for registry in registries():
        for entry in registry.entries.values():
            source = defining_file(entry)
            if source is None or os.path.realpath(source) != path:
                continue
            module = defining_module(entry)
            return _make_loaded_file(path, sha256, module)
    return None


def _hash(path: str) -> str:
    content = Path(path).read_bytes()
    return hashlib.sha256(content).hexdigest()


def _execute(path: str, data: bytes, sha256: str) -> LoadedFile:
    """Run the bytes that were read and hashed, as a new module.

    Raises:
        PluginError: the bytes cannot be compiled, or raise when they run.
        KeyboardInterrupt: the user interrupted the file.
    """
    stem = re.sub(r"\W", "_", Path(path).stem)
    digest = hashlib.sha256(path.encode()).hexdigest()
    name = f"hijack_file_{stem}_{digest[:8]}"
    module = ModuleType(name)
    module.__file__ = path
    sys.modules[name] = module
    try:
        with undone_on_failure():
            exec(compile(data, path, "exec", dont_inherit=True), vars(module))  # noqa: S102
            file = _make_loaded_file(path, sha256, name)
            for registry, key in _registered(name):
                registry.check(registry.resolve(key))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit too: a file may raise anything
        del sys.modules[name]
        line = _line(error, path)
        raise PluginError(f"{path}: cannot be imported{line}: {describe_error(error)}") from error
    for corruption in file.corruptions:
        copyreg.pickle(import_table("corruptions").resolve(corruption), _reduce)
    return file


def _registered(module: str) -> Iterator[tuple[EntryTable[Any], str]]:
    """Yield the registrations of a module as pairs of a registry and a name."""
    for registry in registries():
        for name in registry.of_module(module):
            yield registry, name


def _make_loaded_file(path: str, sha256: str, module: str) -> LoadedFile:
    names: dict[str, tuple[str, ...]] = {}
    for registry, name in _registered(module):
        registered = names.get(registry.kind, ())
        names[registry.kind] = (*registered, name)
    return LoadedFile(path=path, sha256=sha256, module=module, names=names)


def _line(error: BaseException, path: str) -> str:
    """Return the line of the file that was running, in words."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == path]
    return f" (line {lines[-1]})" if lines else ""


def _announce(path: str) -> None:
    """Add a file to the list for child processes, by its absolute path."""
    paths = [os.path.realpath(entry) for entry in _entries()]
    if path not in paths:
        paths.append(path)
    os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys(paths))
    _listed.add(path)


def _reduce(spec: Any) -> tuple[Any, ...]:
    """Pickle a corruption from a file as the file and the values of its parameters.

    Raises:
        PluginError: the file is no longer known.
    """
    file = find_loaded_file(cast("type[Any]", type(spec)))
    if file is None:
        raise PluginError(f"{spec.name}: the file that it was loaded from is not known any more")
    values = {key: getattr(spec, key) for key in p.parameters(spec)}
    return _revive, (file.path, file.sha256, spec.name, values)


def _revive(path: str, sha256: str, name: str, values: Mapping[str, Any]) -> Any:
    """Unpickle a corruption from a file, in another process.

    Raises:
        HijackError: the file has different bytes in this process.
    """
    hashes = [file.sha256 for file in _files.values()]
    if sha256 not in hashes:
        actual_sha256 = load_file(path).sha256
        if actual_sha256 != sha256:
            raise HijackError(
                f"{path}: another file (SHA-256 {actual_sha256[:12]}) than the one that {name} was "
                f"loaded from ({sha256[:12]}); every process needs the same file under this path"
            )
    cls = import_table("corruptions").resolve(name)
    return cls(**values)
