"""Chat rows for supervised fine-tuning, as LLaMA-Factory reads them (format `sharegpt`).

`train.jsonl` has one line per example with `messages` and `images`, `images/SHARD/NUMBER.png` is
its screenshot (with `NUMBER-previous.png`, that of the step before, after a fault of the input),
and `dataset_info.json` describes both to LLaMA-Factory: `dataset_dir: OUT`, `media_dir: OUT`,
`dataset: agenthijack`.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from hijack_data.file_io import write_atomic

from .example import Example

ROWS = "train.jsonl"
_INFO = {
    "agenthijack": {
        "file_name": ROWS,
        "formatting": "sharegpt",
        "columns": {"messages": "messages", "images": "images"},
        "tags": {
            "role_tag": "role",
            "content_tag": "content",
            "user_tag": "user",
            "assistant_tag": "assistant",
        },
    }
}


class ChatWriter:
    """Writes image files and one file of JSON lines."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard."""
        with (self.folder / ROWS).open("a", encoding="utf-8", newline="\n") as file:
            for example in examples:
                self._write(example, file)

    def finish(self) -> None:
        """Write the description for LLaMA-Factory, and the file of rows even if it is empty."""
        (self.folder / ROWS).touch()
        write_atomic(self.folder / "dataset_info.json", json.dumps(_INFO, indent=2) + "\n")

    def _write(self, example: Example, file: IO[str]) -> None:
        stem = f"images/{example.key.replace('-', '/')}"
        names = [f"{stem}-previous.png", f"{stem}.png"][-len(example.pictures) :]
        for name, png in zip(names, example.pictures, strict=True):
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(png)
        messages = [
            {"role": "user", "content": example.question_with_history},
            {"role": "assistant", "content": example.answer},
        ]
        row = {"messages": messages, "images": names, **example.about}
        file.write(json.dumps(row, ensure_ascii=False) + "\n")
