"""What `make` says where Python cannot carry the library: before anything is made."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# Python with something changed before the Makefile's question is put to it.
CHANGED = """#!/bin/sh
test "$1" = -c || exit 9
exec {python} -c "import sys; {change}; exec(sys.argv[1])" "$2"
"""
SAID = {
    "sys.version_info = (3, 10, 14)": "needs Python 3.11 or newer: make PYTHON=python3.12 demo",
    "sys.modules['ensurepip'] = None": "needs venv: apt-get install -y python3-venv",
    "sys.modules['venv'] = None": "needs venv: apt-get install -y python3-venv",
}


@pytest.mark.parametrize("change", SAID)
def test_a_python_that_cannot_carry_it_is_refused(change: str, tmp_path: Path):
    if shutil.which("make") is None:
        pytest.skip("needs make; apt-get install make")
    python = tmp_path / "python"
    python.write_text(CHANGED.format(python=sys.executable, change=change))
    python.chmod(0o755)
    (tmp_path / "pyproject.toml").touch()
    process = subprocess.run(
        ["make", "-f", str(ROOT / "Makefile"), f"PYTHON={python}", "demo"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 2
    assert SAID[change] in process.stdout
    assert not (tmp_path / ".venv").exists()
