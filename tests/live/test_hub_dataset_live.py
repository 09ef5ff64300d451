"""The script of the Hub's dataset records on a desktop, and makes a dataset that the Hub can show."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "examples" / "hub_dataset.py"


def test_the_dataset_is_whole(embedded_machine: None, tmp_path: Path):
    command = [sys.executable, str(SCRIPT), str(tmp_path)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=400)
    assert process.returncode == 0, process.stderr
    last = process.stdout.splitlines()[-1]
    assert last.startswith(f"{tmp_path / 'dataset'}: all nine")
    assert last.endswith("all is well")
