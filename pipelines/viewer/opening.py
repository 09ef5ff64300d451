"""Open a folder for the viewer: a dataset or a run."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from hijack_data.runs.run_log import EPISODES, RUN, find_run

from ..errors import DatasetError

if TYPE_CHECKING:
    from .dataset_source import DatasetSource
    from .runs import RunSource


def open_source(folder: str | os.PathLike[str]) -> "DatasetSource | RunSource":
    """Open a dataset or a run.

    Raises:
        DatasetError: the folder is neither, or is not finished.
    """
    path = Path(folder)
    if not os.path.isdir(path):
        reason = "not a folder" if os.path.lexists(path) else "no such folder"
        raise DatasetError(
            f"{path}: {reason}; give a dataset (hijack build) or a run (hijack bench)"
        )
    try:
        path = find_run(path)
        is_run = (path / RUN).exists() or (path / EPISODES).is_dir()
    except (OSError, ValueError) as error:
        raise DatasetError(
            f"{path}: not a usable path ({getattr(error, 'strerror', None) or error})"
        ) from None
    if is_run:
        from .runs import RunSource

        return RunSource(path)
    from .dataset_source import DatasetSource

    return DatasetSource(path)
