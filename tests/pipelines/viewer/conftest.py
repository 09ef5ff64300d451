"""The dataset that the tests of `hijack view` look at."""

from pathlib import Path
from typing import Any

import pytest

from pipelines import build


@pytest.fixture(params=["materialised", "lazy"])
def dataset(
    request: Any,
    recording: Any,
    small: Any,
    tmp_path: Path,
) -> Path:
    """Two trajectories of three steps under four corruptions and clean: 30 rows in two files."""
    build(
        recording(),
        tmp_path / "out",
        corruptions=small,
        output=request.param,
        rows_per_shard=15,
    )
    return tmp_path / "out"
