"""The output of `hijack --version`: the version, and the environment for bug reports."""

import importlib.metadata
import platform
from collections.abc import Iterator

import click

from .. import __version__
from .terminal import echo

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

    No package is imported for this, and the lines contain neither paths nor user names.
    """
    yield f"hijack {__version__}"
    python = f"{platform.python_implementation()} {platform.python_version()}"
    yield f"  {python}, {platform.system()} {platform.release()}, {platform.machine()}"
    packages: list[str] = []
    for name in PACKAGES:
        try:
            packages.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    yield f"  {', '.join(packages)}"


def show_version(context: click.Context) -> None:
    """Print the version and the environment, then exit."""
    for line in lines():
        echo(line)
    context.exit()
