"""The folders of this machine that no desktop may show: how agents are judged, and their records.

A desktop is laid over the machine's /usr, /etc, /var and /opt. Our packages, the clone, the golden
layers and the folder of a run are covered if they lie in there. Code that writes records of
episodes names its folder: `hide`.
"""

import importlib.metadata
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from hijack_data.extras import DISTRIBUTION

# The folder of root's golden layers and images, and that of this user.
_DATA = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share")
ROOT_LAYERS = Path("/var/lib/agenthijack")
LAYERS = ROOT_LAYERS if os.geteuid() == 0 else _DATA / "agenthijack"
PACKAGES = ("hijack_data", "online_env", "pipelines")
_hidden_by_caller: dict[str, None] = {}


def hide(path: str | os.PathLike[str]) -> None:
    """Show a folder in no desktop that this process starts from now on.

    A standby desktop that was started before is replaced.

    Args:
        path: the folder; it may come into being later.
    """
    _hidden_by_caller[os.path.realpath(os.fspath(path))] = None


def hidden() -> tuple[str, ...]:
    """Return all absolute paths to cover: our own, and those that `hide` named."""
    paths = [os.path.realpath(os.fspath(path)) for path in _project_folders()]
    return tuple(dict.fromkeys([*paths, *_hidden_by_caller]))


def _project_folders() -> Iterator[str | Path]:
    yield LAYERS
    yield ROOT_LAYERS
    # What was made for this project holds nothing that a desktop needs: a virtual environment, a
    # clone.
    if sys.prefix != sys.base_prefix:
        yield sys.prefix
    for name in PACKAGES:
        for folder in _package_folders(name):
            clone = Path(folder).parent
            is_clone = (clone / "pyproject.toml").exists()
            yield clone if is_clone else folder
    yield from _installed()


def _package_folders(name: str) -> list[str]:
    """Return the folders of a package."""
    spec = importlib.util.find_spec(name)
    if spec is None:
        return []
    return list(spec.submodule_search_locations or ())


def _installed() -> Iterator[Path]:
    """The files that an installation puts beside the packages: its metadata, and the commands."""
    try:
        files = importlib.metadata.distribution(DISTRIBUTION).files or ()
    except importlib.metadata.PackageNotFoundError:
        return
    for file in files:
        path = Path(str(file.locate()))
        if file.parts[0].endswith(".dist-info"):
            yield path.parent
        elif file.parts[0] not in PACKAGES:
            yield path
