"""A dataset class for Grain's `MapDataset.source` and `DataLoader(data_source=...)`."""

import os
from typing import Any, SupportsIndex

from ..dataset.opening import open_split


class GrainSource:
    """A dataset with Grain's `RandomAccessDataSource` protocol.

    A row has the columns of the dataset, `screenshot` as uint8 RGB `[H, W, 3]`. It can be pickled,
    read by Grain's worker processes and by its reading threads. Reading one row reads its row
    group, not a file.

    Args:
        folder: a dataset that `build` made.
        split: the split to read; required if the dataset has several.

    Raises:
        DatasetError: the folder is not such a dataset, or the split is missing.
    """

    def __init__(self, folder: str | os.PathLike[str], *, split: str | None = None) -> None:
        self.rows = open_split(folder, split)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, record_key: SupportsIndex) -> dict[str, Any]:
        row, picture = self.rows.pixels(record_key.__index__())
        return {**row, "screenshot": picture}

    def __repr__(self) -> str:
        # Grain compares this text when an iterator is restored, so that a checkpoint is never
        # resumed on other data.
        return (
            f"GrainSource({self.rows.folder.name!r}, rows={len(self)},"
            f" content={self.rows.fingerprint[:16]})"
        )
