"""Install a package of the tests as pip does."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def install(package: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install the package into a folder of its own; return the environment that sees it."""
    source = tmp_path_factory.mktemp("source") / package.name
    made = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    shutil.copytree(package, source, ignore=made)
    target = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    command = [*pip, "--target", str(target), str(source)]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        pytest.skip(f"pip cannot install here: {done.stderr.strip().splitlines()[-1:]}")
    return {**os.environ, "PYTHONPATH": str(target)}
