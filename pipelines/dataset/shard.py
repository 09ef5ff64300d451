"""A finished shard of a dataset, as the manifest stores it."""

import hashlib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, cast


@dataclass(frozen=True, kw_only=True)
class ShardRecord:
    """A finished shard, as the manifest stores it.

    Args:
        index: number of the shard in the dataset, from 0.
        file: name of the file in the dataset.
        rows: number of rows in the file.
        bytes: size of the file.
        sha256: SHA-256 of the file.
        records: see `ShardTask`.
        inputs: a hash of the records and of the bytes of the screenshots.
        trajectories: number of trajectories.
        steps: number of recorded steps.
        counts: rows, dropped and not applicable samples, by label.
        rejected: inputs that were rejected while the rows were made.
        samples: the key of random draws by trajectory, if that is not the trajectory itself.
        stamps: see `pipelines.building.shards.picture_stamps`; no part of the manifest, because it
            is different for a copy of the source.
    """

    index: int
    file: str
    rows: int
    bytes: int
    sha256: str
    records: str
    inputs: str
    trajectories: int
    steps: int
    counts: dict[str, Any]
    rejected: tuple[dict[str, str], ...] = ()
    samples: dict[str, str] = field(default_factory=dict[str, str])
    stamps: str = ""

    def to_data(self) -> dict[str, Any]:
        """Return the record as JSON data, as the manifest has it: without the stamps."""
        data = {**asdict(self), "rejected": list(self.rejected)}
        del data["stamps"]
        return data


def record_from(data: dict[str, Any]) -> ShardRecord:
    """Read a record that `to_data` made.

    Raises:
        TypeError: a field is missing or unknown.
    """
    rejected = cast("list[dict[str, str]]", data.get("rejected", []))
    return ShardRecord(**{**data, "rejected": tuple(rejected)})


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
