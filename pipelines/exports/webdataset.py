"""WebDataset: `train-NNNNN.tar` with KEY.png, KEY.json (the row) and KEY.txt (the answer)."""

import io
import json
import tarfile
from collections.abc import Iterator
from pathlib import Path

from .example import Example


class WebDatasetWriter:
    """Writes one tar file per shard.

    Headers contain no time, owner or user, so that the same rows give the same bytes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard."""
        path = self.folder / f"train-{index:05d}.tar"
        with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
            for example in examples:
                row = {**example.row, "answer": example.answer, "question": example.question}
                text = json.dumps(row, ensure_ascii=False)
                _add(tar, f"{example.key}.png", example.png)
                _add(tar, f"{example.key}.json", text.encode())
                _add(tar, f"{example.key}.txt", example.answer.encode())

    def finish(self) -> None:
        """Do nothing: there are no files other than the shards."""


def _add(tar: tarfile.TarFile, name: str, data: bytes) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(data)
    info.mode = 0o644
    tar.addfile(info, io.BytesIO(data))
