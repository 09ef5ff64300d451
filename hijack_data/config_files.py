"""Find a configuration by its path, or by the bare name of one that comes with the package."""

import importlib.resources
import os
from collections.abc import Iterator
from importlib.resources.abc import Traversable
from pathlib import Path

from .errors import ConfigError, shorten_list, suggest

# The folder of an installed package that holds `configs/` of the repository.
PACKAGE = "hijack_data._configs"
MAX_BYTES = 2**20


def available() -> list[str]:
    """Return the names of the packaged configurations, such as `"corruptions/paper"`."""
    return sorted(_packaged())


def read_config(path_or_name: str | os.PathLike[str], folder: str = "") -> tuple[str, bytes]:
    """Return the name of a configuration for messages, and its bytes.

    An existing path takes precedence. A name is that of a packaged file without its ending: with
    its folder (`ablations/marks_number`) or, if that is unambiguous, without it.

    Args:
        path_or_name: a path, or the name of a packaged configuration.
        folder: the folder of packaged files that a bare name of several files means.

    Raises:
        ConfigError: there is no such file, it cannot be read, or it is larger than `MAX_BYTES`.
    """
    name = os.fsdecode(path_or_name)
    if os.path.isfile(name):
        return name, _read(Path(name), name)
    packaged = _packaged()
    path = [key for key in packaged if name in (key, key.rpartition("/")[2])]
    if len(path) > 1 and f"{folder}/{name}" in path:
        path = [f"{folder}/{name}"]
    if len(path) == 1:
        return path[0], _read(packaged[path[0]], path[0])
    if path:
        choices = " or ".join(sorted(path))
        raise ConfigError([f"{name!r} is the name of several configurations: use {choices}"])
    if os.path.isdir(name):
        raise ConfigError([f"{name}: is a folder; give the path of a YAML file"])
    if os.path.lexists(name):
        return name, _read(Path(name), name)
    first = f"{folder}/"
    names = sorted(packaged, key=lambda key: (not key.startswith(first), key))
    raise ConfigError([_unknown(name, names)])


def _unknown(name: str, names: list[str]) -> str:
    short_name = name if len(name) <= 100 else name[:100] + "..."
    listed = repr(short_name)
    packaged = shorten_list(names)
    if name.endswith((".yaml", ".yml")):
        advice = "check the path, or give the name of a packaged one"
        return f"{listed}: no such file; {advice}: {packaged}"
    bare_names = {key.rpartition("/")[2] for key in names}
    close = suggest(name, [*bare_names, *names])
    advice = close if "did you mean" in close else f"; packaged: {packaged}"
    return f"{listed} is neither a file nor a packaged configuration{advice}"


def _read(file: Path | Traversable, name: str) -> bytes:
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError([f"{name}: cannot be read ({error.strerror or error})"]) from None
    if len(data) > MAX_BYTES:
        raise ConfigError([f"{name}: larger than {MAX_BYTES} bytes; is it a configuration?"])
    return data


def _packaged() -> dict[str, Traversable]:
    try:
        root: Traversable = importlib.resources.files(PACKAGE)
    except ModuleNotFoundError:  # in a clone: the folder of the repository
        root = Path(__file__).resolve().parents[1] / "configs"
    if not root.is_dir():
        return {}
    return dict(_walk(root, ""))


def _walk(folder: Traversable, prefix: str) -> Iterator[tuple[str, Traversable]]:
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _walk(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".yaml"):
            yield prefix + entry.name.removesuffix(".yaml"), entry
