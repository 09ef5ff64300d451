"""`hijack new corruption`: what it writes passes `hijack check` as it is."""

import subprocess
from pathlib import Path

import pytest

from support import lean

ROOT = Path(__file__).resolve().parents[2]


def run(folder, *words, code=0):
    command = [*lean.HIJACK, *words]
    process = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)
    assert process.returncode == code, (process.stdout, process.stderr)
    assert "Traceback" not in process.stderr
    return process.stdout + process.stderr


@pytest.mark.parametrize(
    ("scope", "severity"),
    [("observation", "severity 5: height=320"), ("action", "severity 5: pixels=64")],
)
def test_what_it_writes_passes(tmp_path, scope, severity):
    output = run(tmp_path, "new", "corruption", "dust_band", "--scope", scope)
    assert "hijack check dust_band.py" in output
    assert "class DustBand(Corruption):" in (tmp_path / "dust_band.py").read_text()
    checked = run(tmp_path, "check", "dust_band.py")
    assert "FAIL" not in checked
    assert not [line for line in checked.splitlines() if line.strip().startswith("note")]
    assert f'scope: ClassVar[str] = "{scope}"' in (tmp_path / "dust_band.py").read_text()
    assert severity in run(tmp_path, "--load", "dust_band.py", "show", "dust_band")


def test_it_overwrites_nothing(tmp_path):
    (tmp_path / "dust.py").write_text("mine")
    assert "dust.py: exists already" in run(tmp_path, "new", "corruption", "dust", code=2)
    assert (tmp_path / "dust.py").read_text() == "mine"
    run(tmp_path, "new", "corruption", "dust", "-o", "other.py")
    assert (tmp_path / "other.py").is_file()
    assert "name the file *.py" in run(tmp_path, "new", "corruption", "dust", "-o", "x", code=2)


@pytest.mark.parametrize(
    ("name", "problem"),
    [("Dust", "lower-case letters"), ("clean", "means something else"), ("marks", "is taken")],
)
def test_names_that_cannot_be_are_refused(tmp_path, name, problem):
    assert problem in run(tmp_path, "new", "corruption", name, code=2)
    assert not list(tmp_path.iterdir())
