"""The files of a training run: two logs, to which lines are added, and one checkpoint.

`rollouts.jsonl` has the corruption and the result of each rollout; `steps.jsonl` has a line for
each step. A checkpoint holds the lengths of both, so a run that continues from it removes later
lines.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from hijack_data.file_io import make_folder, replace_atomic, unwritable

from .errors import TrainError
from .replay import read_tensors

CHECKPOINT = "checkpoint.pt"
ROLLOUTS = "rollouts.jsonl"
STEPS = "steps.jsonl"
FORMAT = "agenthijack-training"
VERSION = 1


class TrainJournal:
    """The files of one run.

    Args:
        folder: the folder, which is created if it is missing.
    """

    def __init__(self, folder: Path) -> None:
        make_folder(folder)
        self.folder = folder

    def rollouts(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Add a line for each rollout."""
        self._append(ROLLOUTS, rows)

    def step(self, row: Mapping[str, Any]) -> None:
        """Add the line of a step."""
        self._append(STEPS, [row])

    def lengths(self) -> dict[str, int]:
        """Return the length of both logs in bytes."""
        return {name: self._length(name) for name in (ROLLOUTS, STEPS)}

    def cut(self, lengths: Mapping[str, int]) -> None:
        """Remove the lines that were written after a checkpoint.

        Raises:
            TrainError: a log is shorter than it was at the checkpoint.
        """
        for name in (ROLLOUTS, STEPS):
            length = int(lengths.get(name, 0))
            size = self._length(name)
            if size < length:
                raise TrainError(
                    f"{self.folder / name}: {size} bytes, but the checkpoint was made at {length};"
                    " the log was shortened: start again in another folder"
                )
            if size > length:
                os.truncate(self.folder / name, length)

    def _length(self, name: str) -> int:
        path = self.folder / name
        return path.stat().st_size if path.exists() else 0

    def _append(self, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
        lines = "".join(json.dumps(row) + "\n" for row in rows)
        try:
            with (self.folder / name).open("a", encoding="utf-8") as stream:
                stream.write(lines)
        except OSError as error:
            raise unwritable(self.folder / name, error) from None


def save_checkpoint(
    journal: TrainJournal, run: Mapping[str, Any], state: Mapping[str, Any]
) -> None:
    """Replace the checkpoint of a run.

    Args:
        journal: the files of the run.
        run: the identity of the run, as JSON data; `load_checkpoint` requires the same.
        state: numbers and tensors.
    """
    data = {
        "format": FORMAT,
        "version": VERSION,
        "run": json.dumps(run, sort_keys=True),
        "lengths": journal.lengths(),
        "state": dict(state),
    }
    replace_atomic(
        journal.folder / CHECKPOINT, lambda temporary_path: torch.save(data, temporary_path)
    )


def load_checkpoint(journal: TrainJournal, run: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the state of the last checkpoint; `None` without one.

    Its `lengths` are those of the logs, to which `TrainJournal.cut` takes them back.

    Raises:
        TrainError: the checkpoint is damaged, or of a run with other tasks, settings or
            corruptions.
    """
    path = journal.folder / CHECKPOINT
    if not path.exists():
        return None
    data = read_tensors(path, FORMAT, VERSION, "a checkpoint of a training run")
    stored = json.loads(data["run"])
    expected = json.loads(json.dumps(run))
    if stored != expected:
        keys = [key for key in sorted({*stored, *expected}) if stored.get(key) != expected.get(key)]
        raise TrainError(
            f"{path}: a checkpoint of another run; it differs in {', '.join(keys)}. Give those as"
            " they were, or another folder"
        )
    return {**data["state"], "lengths": data["lengths"]}
