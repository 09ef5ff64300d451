"""Install a package of the tests as pip does."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SETUPTOOLS = 77  # what the packages of the tests are built with, at least


def install(package: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install the package into a folder of its own; return the environment that sees it."""
    source = tmp_path_factory.mktemp("source") / package.name
    result = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    shutil.copytree(package, source, ignore=result)
    target = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", *_builder()]
    command = [*pip, "--target", str(target), str(source)]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        pytest.skip(f"pip cannot install here: {process.stderr.strip().splitlines()[-1:]}")
    return {**os.environ, "PYTHONPATH": str(target)}


def _builder() -> list[str]:
    """Build with the setuptools that is here, if it is recent: pip would fetch another one."""
    try:
        version = importlib.metadata.version("setuptools")
    except importlib.metadata.PackageNotFoundError:
        return []
    return ["--no-build-isolation"] if int(version.partition(".")[0]) >= SETUPTOOLS else []
