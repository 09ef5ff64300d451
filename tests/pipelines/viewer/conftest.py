"""The dataset and the runs that the tests of `hijack view` look at."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from pipelines import build

from support.viewed_runs import play_run


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, recording: Any, small: Any, tmp_path: Path) -> Path:
    """Two trajectories of three steps under four corruptions and clean: 30 rows in two files."""
    build(recording(), tmp_path / "out", corruptions=small, output=request.param, rows_per_shard=15)
    return tmp_path / "out"


@pytest.fixture(scope="session")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two agents on two tasks, clean, under marks and minimised: 12 episodes. Nobody changes it."""
    return play_run(tmp_path_factory.mktemp("played") / "run")


@pytest.fixture
def harmed(played: Path, tmp_path: Path) -> Path:
    """A copy that a test may harm."""
    shutil.copytree(played, tmp_path / "run")
    return tmp_path / "run"
