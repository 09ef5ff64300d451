"""The extras of the package: the modules that each installs, and the command that adds it.

All messages about missing extras come from here, so that the remedy is the same everywhere.
"""

import functools
import importlib
import importlib.util
import json
import re
import shlex
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import unquote, urlsplit

from .errors import MissingDependencyError

DISTRIBUTION = "agenthijack"
# Extras for no single use: all of them at once, and the tools for developing the library.
WIDE = frozenset({"all", "dev", "docs"})
# For environments of their own, because they pin packages that other extras need.
APART = ("agent-s", "cua", "verl")
# Distributions whose module has another name.
_MODULES = {
    "TransferQueue": "transfer_queue",
    "inspect-ai": "inspect_ai",
    "markdown-it-py": "markdown_it",
    "mkdocs-material": "material",
    "opencv-python-headless": "cv2",
    "pytest-xdist": "xdist",
    "python-docx": "docx",
    "python-multipart": "multipart",
    "python-pptx": "pptx",
    "python-xlib": "Xlib",
}
_REQUIREMENT = re.compile(r"""([A-Za-z0-9._-]+).*;\s*extra\s*==\s*["']([^"']+)["']""")


def remedy(*extras: str) -> str:
    """Return the command that adds `extras` to this installation: a clone, a wheel or a release."""
    return install_command(extras, _origin())


def remedy_anywhere(*extras: str) -> str:
    """Return the commands that add `extras` on another machine, for a release and for a clone."""
    names = ",".join(extras)
    return f"pip install 'agenthijack[{names}]', or from a clone: pip install -e '.[{names}]'"


def install_command(extras: Iterable[str], origin: str) -> str:
    """Return the command that adds extras to the package as it is installed.

    Args:
        extras: their names.
        origin: `direct_url.json` of the installed package (PyPA's "Direct URL Data Structure"),
            or "" for a release.
    """
    names = ",".join(extras)
    release = f"pip install '{DISTRIBUTION}[{names}]'"
    try:
        direct_url: dict[str, Any] = json.loads(origin or "{}")
        url = str(direct_url["url"])
    except (ValueError, TypeError, KeyError):
        return release
    if "dir_info" not in direct_url:
        return f"pip install '{DISTRIBUTION}[{names}] @ {url}'"
    folder = unquote(urlsplit(url).path)
    about: dict[str, Any] = direct_url["dir_info"] or {}
    editable = "-e " if about.get("editable") else ""
    return f"pip install {editable}{shlex.quote(f'{folder}[{names}]')}"


@functools.lru_cache(maxsize=1)
def _origin() -> str:
    import importlib.metadata  # here: it is slow to import, and rarely needed

    try:
        return importlib.metadata.distribution(DISTRIBUTION).read_text("direct_url.json") or ""
    except (importlib.metadata.PackageNotFoundError, OSError, ValueError):
        return ""


def missing(problem: str, *extras: str) -> MissingDependencyError:
    """Return the error with `problem`, such as `"datasets need pyarrow"`, and the remedy."""
    return MissingDependencyError(f"{problem}: {remedy(*extras)}")


def lacking(modules: Iterable[str]) -> list[str]:
    """Return the top-level `modules` that cannot be found, without importing any."""
    return [name for name in modules if not _is_importable(name)]


def require(feature: str, extra: str, modules: Iterable[str]) -> None:
    """Check that none of some modules is missing.

    Args:
        feature: the feature that needs them, for the message.
        extra: the extra that installs them.
        modules: names of top-level modules.

    Raises:
        MissingDependencyError: one is missing; the message has the command that adds the extra.
    """
    absent = lacking(modules)
    if absent:
        problem = missing(f"{feature} needs {', '.join(absent)}", extra)
        raise problem


def load(module: str, feature: str, extra: str) -> Any:
    """Import and return `module`, which `feature` needs.

    Raises:
        MissingDependencyError: it is missing; the message has the command that adds `extra`.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        problem = missing(f"{feature} needs {module.partition('.')[0]}", extra)
        raise problem from None


@functools.lru_cache(maxsize=1)
def extras() -> Mapping[str, tuple[str, ...]]:
    """Return the modules of each extra, from the metadata of the installed package.

    Empty if the package is not installed, as in a folder that is only on the path.
    """
    import importlib.metadata  # here: it is slow to import, and rarely needed

    try:
        metadata = importlib.metadata.metadata(DISTRIBUTION)
    except importlib.metadata.PackageNotFoundError:
        return {}
    modules_by_extra: dict[str, list[str]] = {
        name: [] for name in metadata.get_all("Provides-Extra") or ()
    }
    for line in importlib.metadata.requires(DISTRIBUTION) or ():
        parts = _REQUIREMENT.match(line)
        if parts is not None and parts[1] != DISTRIBUTION:
            module = _MODULES.get(parts[1], parts[1].replace("-", "_"))
            modules_by_extra.setdefault(parts[2], []).append(module)
    return {name: tuple(modules) for name, modules in sorted(modules_by_extra.items())}


def find_extra(module: str) -> str | None:
    """Return the first extra for users that installs a module (full name), or `None`."""
    top = module.partition(".")[0]
    bringing = (name for name, modules in extras().items() if top in modules)
    return next((name for name in bringing if name not in WIDE), None)


def _is_importable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    # A module inserted into `sys.modules` by hand may have no spec.
    except (ImportError, ValueError):
        return False
