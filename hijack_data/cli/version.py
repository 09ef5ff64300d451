"""What `hijack --version` prints: the version, and the environment as a bug report needs it."""

import importlib.metadata
import platform
from collections.abc import Iterator

import click

from .. import __version__

# Packages whose versions change what the library does, in the order of their importance.
PACKAGES = (
    "numpy",
    "pillow",
    "click",
    "pyyaml",
    "rich",
    "torch",
    "torchvision",
    "jax",
    "grain",
    "datasets",
    "pyarrow",
    "numba",
    "opencv-python-headless",
    "gymnasium",
    "ray",
)


def lines() -> Iterator[str]:
    """Yield the version, the Python with its system, and the packages that are installed.

    Nothing is imported for it, and no path or name of a user is in it.
    """
    yield f"hijack {__version__}"
    python = f"{platform.python_implementation()} {platform.python_version()}"
    yield f"  {python}, {platform.system()} {platform.release()}, {platform.machine()}"
    found: list[str] = []
    for name in PACKAGES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    yield f"  {', '.join(found)}"


def show_version(
    context: click.Context,
    _option: click.Parameter,
    wanted: bool,
) -> None:
    """Print all of it and end, as the callback of an option."""
    if not wanted or context.resilient_parsing:
        return
    for line in lines():
        click.echo(line)
    context.exit()
