"""What tests ask of rows, however a dataset stores them."""

import hashlib
from pathlib import Path
from typing import Any

import pytest

from pipelines.dataset.columns import COLUMNS


def assert_same_rows(one: Any, other: Any) -> int:
    """Two datasets hold the same rows and pictures, and the hashes of the second are true; return
    how many."""
    count = 0
    for first_row, right in zip(one, other, strict=True):
        assert list(first_row) == list(right) == list(COLUMNS)
        for name, value in first_row.items():
            if name == "screenshot":
                assert (
                    (value.mode, value.size)
                    == (right[name].mode, right[name].size)
                    == ("RGB", value.size)
                )
                assert value.tobytes() == right[name].tobytes()
            else:
                assert right[name] == value, name
        assert hashlib.sha256(right["screenshot"].tobytes()).hexdigest() == right["image_sha256"]
        count += 1
    return count


def load(folder: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Read a dataset with `datasets`, without the network."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    return datasets.load_dataset(str(folder), split="train", cache_dir=str(cache))
