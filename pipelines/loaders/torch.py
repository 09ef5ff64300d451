"""A map-style dataset for `torch.utils.data.DataLoader`, picklable for its workers."""

import os
from collections.abc import Callable, Sequence
from typing import Any

from hijack_data import extras
from hijack_data.types import as_boxes

from ..dataset.opening import open_split
from ..errors import DatasetError

try:
    import torch
    from torch.utils.data import Dataset
except ImportError:
    raise extras.missing("this loader needs torch", "torch") from None

Item = dict[str, Any]


class TorchDataset(Dataset[Any]):
    """Rows as dictionaries of tensors and plain values, by number.

    Reading one reads its row group, not a file. An item has the columns of the dataset with two
    changes: `screenshot` is a uint8 tensor `[3, H, W]` (RGB, with the strides of the decoded
    picture: `channels_last`), and `boxes` is an int32 tensor `[N, 4]` (`xyxy`): the target's box,
    or none. Unknown values are `None`, so batches need `collate`.

    Args:
        folder: a dataset that `build` made.
        transform: called with each item; its result replaces the item.
        split: the split to read; required if the dataset has several.

    Raises:
        DatasetError: the folder is not such a dataset, or the split is missing.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        transform: Callable[[Item], Any] | None = None,
        *,
        split: str | None = None,
    ) -> None:
        self.rows = open_split(folder, split)
        self.transform = transform

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: int) -> Any:
        row, picture = self.rows.pixels(int(index))
        box = row["target_box"]
        boxes = torch.from_numpy(as_boxes([box] if box else None))
        item = {**row, "screenshot": torch.from_numpy(picture).permute(2, 0, 1), "boxes": boxes}
        return item if self.transform is None else self.transform(item)


def collate(items: Sequence[Item]) -> Item:
    """Join items to a batch, for `DataLoader(..., collate_fn=collate)`.

    `screenshot` becomes one tensor `[B, 3, H, W]` if all have the same size, otherwise a list;
    every other value becomes a list with one entry for each item.

    Raises:
        DatasetError: the items, which a transform may have changed, differ in their entries.
    """
    names = set(items[0])
    for item in items[1:]:
        if item.keys() != names:
            differing = ", ".join(sorted(map(str, names ^ item.keys())))
            raise DatasetError(
                f"the items of a batch differ in their entries ({differing}); let the transform"
                " give each item all of them, None where there is nothing"
            )
    batch: Item = {name: [item[name] for item in items] for name in items[0]}
    pictures = batch["screenshot"]
    if len({tuple(picture.shape) for picture in pictures}) == 1:
        batch["screenshot"] = torch.stack(pictures)
    return batch
