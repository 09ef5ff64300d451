"""Parquet for verl, with images as bytes.

Columns are `data_source, prompt, images, ability, reward_model, extra_info`.

`reward_model.ground_truth` is JSON: the answer, the action and the target's box, in pixels of the
screenshot, for your own reward function (`custom_reward_function.path` of verl).
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..dataset.columns import Kind, arrow_schema, pyarrow
from .example import Example, ground_truth

GROUP = 16
KINDS: dict[str, Kind] = {
    "data_source": "string",
    "prompt": [{"role": "string", "content": "string"}],
    "images": ["image"],
    "ability": "string",
    "reward_model": {"style": "string", "ground_truth": "string"},
    "extra_info": {
        "split": "string",
        "index": "int64",
        "id": "string",
        "trajectory_id": "string",
        "step": "int32",
        "corruption": "string",
        "severity": "int32",
        "width": "int32",
        "height": "int32",
        "target_box": ["int32"],
        "target_visible": "float64",
        "answer": "string",
        "question": "string",
    },
}


class VerlWriter:
    """Writes `data/train-NNNNN.parquet`, one file per shard."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "data"
        self.folder.mkdir()
        self.count = 0

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard."""
        pa = pyarrow()
        schema = arrow_schema(KINDS)
        path = self.folder / f"train-{index:05d}.parquet"
        with pa.parquet.ParquetWriter(path, schema, version="2.6") as writer:
            for group in _groups(examples):
                rows = [self._row(example) for example in group]
                writer.write_table(pa.Table.from_pylist(rows, schema=schema))

    def finish(self) -> None:
        """Do nothing: there are no files other than the shards."""

    def _row(self, example: Example) -> dict[str, Any]:
        row = example.row
        extra = {name: row[name] for name in KINDS["extra_info"] if name in row}
        index = self.count
        self.count += 1
        return {
            "data_source": "agenthijack",
            "prompt": [{"role": "user", "content": example.question_with_history}],
            "images": [{"bytes": png, "path": None} for png in example.pictures],
            "ability": "computer_use",
            "reward_model": {
                "style": "rule",
                "ground_truth": json.dumps(ground_truth(example), ensure_ascii=False),
            },
            "extra_info": {
                **extra,
                "split": example.split,
                "index": index,
                "answer": example.answer,
                "question": row["instruction"],
            },
        }


def _groups(examples: Iterator[Example]) -> Iterator[list[Example]]:
    group: list[Example] = []
    for example in examples:
        group.append(example)
        if len(group) == GROUP:
            yield group
            group = []
    if group:
        yield group
