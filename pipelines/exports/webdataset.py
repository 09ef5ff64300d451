"""WebDataset: `train-NNNNN.tar` with KEY.png, KEY.json (the row) and KEY.txt (the answer).

`datasets` infers the types of KEY.json from the first examples of a file, so a field that is null
or empty in those would have no type, and later examples could not be read. Every field therefore
has one type in every example: what may be null, holds several values, or may be larger than 64 bits
with a sign is JSON text (`TEXTS`), and a sentence that is missing is empty.
"""

import io
import json
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .example import Example, Row

# The columns written as JSON text.
TEXTS = ("action", "target_box", "severity", "seed", "target_visible")
# The columns written as an empty text where there is none.
SENTENCES = ("event", "reminder", "extra")


class WebDatasetWriter:
    """Writes one tar file per shard that has examples.

    Headers contain no time, owner or user, so that the same rows give the same bytes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard."""
        first = next(examples, None)
        if first is None:
            return  # `datasets` reads no file without examples
        path = self.folder / f"train-{index:05d}.tar"
        with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
            _write(tar, first)
            for example in examples:
                _write(tar, example)

    def finish(self) -> None:
        """Do nothing: there are no files other than the shards."""


def _write(tar: tarfile.TarFile, example: Example) -> None:
    row = {**typed_row(example.row), "answer": example.answer, "question": example.question}
    text = json.dumps(row, ensure_ascii=False)
    _add(tar, f"{example.key}.png", example.png)
    _add(tar, f"{example.key}.json", text.encode())
    _add(tar, f"{example.key}.txt", example.answer.encode())


def typed_row(row: Row) -> dict[str, Any]:
    """Return a row in which each field has the same type whatever the row holds."""
    values = dict(row)
    for name in TEXTS:
        values[name] = json.dumps(row[name], ensure_ascii=False)
    for name in SENTENCES:
        values[name] = row[name] or ""
    return values


def _add(tar: tarfile.TarFile, name: str, data: bytes) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(data)
    info.mode = 0o644
    tar.addfile(info, io.BytesIO(data))
