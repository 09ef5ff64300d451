"""The type of arguments that name a file or a folder, and where the shipped recordings are."""

import os
from pathlib import Path
from typing import TypeAlias

from .errors import HijackError

PathLike: TypeAlias = str | os.PathLike[str]
_HERE = Path(__file__).resolve()
# The folders in an installed package, and in a clone.
_RECORDINGS = (
    _HERE.parent / "_examples" / "recordings",
    _HERE.parents[1] / "examples" / "recordings",
)


def example_recordings() -> Path:
    """Return the folder of the recordings that come with the package or the clone.

    Raises:
        HijackError: the folder is missing.
    """
    for folder in _RECORDINGS:
        if (folder / "trajectories.jsonl").is_file():
            return folder
    raise HijackError(f"{_RECORDINGS[0]}: no recordings there; reinstall agenthijack")
