"""The notebooks run, and show what is stored in them; the live one is in tests/live."""

from pathlib import Path

import pytest

from support import notebooks

NEEDS = {"datasets": "datasets", "torch_training": "torchvision", "jax_grain": "grain"}


@pytest.mark.slow
@pytest.mark.parametrize("name", NEEDS)
def test_a_notebook_shows_what_is_stored_in_it(name: str, tmp_path: Path):
    pytest.importorskip(NEEDS[name])
    result = notebooks.run(name, tmp_path)
    stored = notebooks.NOTEBOOKS / result.name
    assert notebooks.shown(result) == notebooks.shown(stored), "run examples/notebooks/run.py"


def test_all_are_tried_and_small():
    files = {path.stem: path for path in notebooks.NOTEBOOKS.glob("*.ipynb")}
    assert set(files) == {*NEEDS, "live_agent"}
    for path in files.values():
        assert path.stat().st_size < 120_000, f"{path}: pictures that are too large"
        assert all(cell["execution_count"] for cell in notebooks.code_cells(path)), path
