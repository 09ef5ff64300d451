"""Running the notebooks of `examples/notebooks`, and what they show."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
VARIES = "varies"  # the tag of a cell whose text depends on the machine


def run(name: str, folder: Path) -> Path:
    """Run a notebook; what it shows is stored in a copy, which is returned."""
    for module in ("nbclient", "ipykernel"):
        pytest.importorskip(module, reason="needs the extra [dev]; make env")
    command = [sys.executable, str(NOTEBOOKS / "run.py"), name, "--out", str(folder)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 0, process.stderr
    return folder / f"{name}.ipynb"


def code_cells(path: Path) -> list[dict[str, Any]]:
    """The cells that are run."""
    cells = json.loads(path.read_text())["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def shown(path: Path) -> list[str]:
    """What each cell printed or gave, as text; `picture` for a picture, `varies` where it may."""
    return [_shown(cell) for cell in code_cells(path)]


def _shown(cell: dict[str, Any]) -> str:
    if VARIES in cell["metadata"].get("tags", ()):
        return VARIES
    parts: list[str] = []
    for output in cell["outputs"]:
        data = output.get("data", {})
        text = output.get("text") or data.get("text/plain", "")
        parts.append("picture" if "image/jpeg" in data else "".join(text))
    return "".join(parts)
