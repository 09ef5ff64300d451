"""Shards: the unit of work.

A shard depends on its trajectories and the settings alone, so every worker writes the same file.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import ImageError
from hijack_data.file_io import replace_atomic
from hijack_data.types import Step, Trajectory

from ..dataset.manifest import TRANSPARENT
from ..dataset.shard import ShardRecord, file_sha256
from ..readers import Rejected
from ..readers.recorded_pictures import picture_file, picture_name, read_picture
from ..sources import SourceItem
from .parquet_writer import write_parquet
from .splits import TRAIN, Splits
from .step_rows import RowCounts, RowSettings, make_rows

DATA = "data"
RECENT_NS = 3_000_000_000  # file systems count in up to 2 s


@dataclass(frozen=True)
class ShardTask:
    """The trajectories of one file.

    Args:
        index: number of the shard in the dataset, from 0.
        trajectories: in the order of the source.
        root: the source folder.
        records: a hash of everything in the trajectories except the pixels.
        file: name of the file in the dataset.
    """

    index: int
    trajectories: tuple[Trajectory, ...]
    root: str
    records: str
    file: str

    @property
    def steps(self) -> int:
        """Number of steps in all trajectories."""
        return sum(len(trajectory.steps) for trajectory in self.trajectories)


# For workers, which already share the machine's processors; OpenCV reads it when it is first
# imported.
ONE_THREAD = {"OPENCV_FOR_THREADS_NUM": "1"}


def shard_file(index: int, split: str = TRAIN) -> str:
    """Return the file name of the `index`-th shard of a split.

    The name does not contain the number of shards, which is unknown until the last one is done.
    """
    return f"{DATA}/{split}-{index:05d}.parquet"


@dataclass
class _Batch:
    """Trajectories of one split that will share a file, and the number of files before it."""

    split: str
    number: int = 0
    rows: int = 0
    root: Path = Path()
    trajectories: list[Trajectory] = field(default_factory=list[Trajectory])

    def cut(self, index: int) -> ShardTask:
        """Return the `index`-th shard of the dataset, and start the next one."""
        task = ShardTask(
            index=index,
            trajectories=tuple(self.trajectories),
            root=os.fspath(self.root),
            records=records_hash(self.trajectories, self.root),
            file=shard_file(self.number, self.split),
        )
        self.number += 1
        self.rows = 0
        self.trajectories = []
        return task

    def is_full(self, root: Path, added_rows: int, max_rows: int) -> bool:
        """Return whether `added_rows` rows of a trajectory from `root` need a new file."""
        if not self.trajectories:
            return False
        return self.rows + added_rows > max_rows or self.root != root


def shard_tasks(
    items: Iterable[SourceItem],
    rows_per_shard: int,
    variants: int,
    reject: Callable[[Rejected], None],
    splits: Splits | None = None,
) -> Iterator[ShardTask]:
    """Group trajectories, in order, into shards.

    A shard holds at most `rows_per_shard` rows (or one trajectory), of one source and one split.

    Args:
        items: what the sources contain.
        rows_per_shard: the most rows in a shard.
        variants: rows that a step can have.
        reject: called with each input that could not be read.
        splits: shares of the episodes; all are `train` by default. `BuildError` if the episode of
            a trajectory is not known.
    """
    splits = splits or Splits()
    batches = {name: _Batch(name) for name in splits.names}
    index = 0
    for read in items:
        item = read.item
        if isinstance(item, Rejected):
            reject(item)
            continue
        batch = batches[splits.of(item)]
        added_rows = len(item.steps) * variants
        if batch.is_full(read.root, added_rows, rows_per_shard):
            yield batch.cut(index)
            index += 1
        batch.root = read.root
        batch.trajectories.append(item)
        batch.rows += added_rows
    for batch in batches.values():
        if batch.trajectories or not index:
            yield batch.cut(index)
            index += 1


def build_shard(
    task: ShardTask, settings: RowSettings, out: Path, tick: Callable[[int], None] | None = None
) -> ShardRecord:
    """Write one shard, whole or not at all, and return its record.

    Args:
        task: the shard.
        settings: those of the build.
        out: the folder of the dataset.
        tick: called with the number of rows of each step when it is done.
    """
    tally = RowCounts()
    stamps = picture_stamps(task)  # before any picture is read, so that a later change shows
    inputs = hashlib.sha256(task.records.encode())
    file_facts: list[tuple[int, int, str]] = []

    def write(path: Path) -> None:
        rows = write_parquet(path, shard_rows(task, settings, tally, inputs, tick), settings.lazy)
        file_facts.append((rows, path.stat().st_size, file_sha256(path)))

    replace_atomic(out / task.file, write)
    rows, size, digest = file_facts[0]
    reasons = {label: dict(counts) for label, counts in tally.not_applicable.items()}
    return ShardRecord(
        index=task.index,
        file=task.file,
        rows=rows,
        bytes=size,
        sha256=digest,
        records=task.records,
        inputs=inputs.hexdigest(),
        trajectories=len(task.trajectories),
        steps=task.steps,
        counts={
            "rows": dict(tally.rows),
            "dropped": dict(tally.dropped),
            "not_applicable": reasons,
            **({TRANSPARENT: tally.transparent} if tally.transparent else {}),
        },
        rejected=tuple(record.to_data() for record in tally.rejected),
        samples=_sample_keys(task),
        stamps=stamps,
    )


def _sample_keys(task: ShardTask) -> dict[str, str]:
    """Return the keys of random draws by trajectory, for trajectories with a key of their own."""
    keys: dict[str, str] = {}
    for trajectory in task.trajectories:
        if trajectory.sample is not None and trajectory.sample != trajectory.id:
            keys[trajectory.id] = trajectory.sample
    return keys


def picture_stamps(task: ShardTask) -> str:
    """Return a hash of size, times and inode of every picture file of a shard, or `""`.

    The kernel sets a file's change time at each write, and no program can set it, so the same hash
    means the same bytes. It is `""` if that is not certain: a file cannot be looked at, or was
    changed so recently that another change might leave the same time.
    """
    digest = hashlib.sha256()
    newest = 0
    for trajectory in task.trajectories:
        for step in trajectory:
            try:
                stat = os.stat(picture_file(step.image))
            except (OSError, ValueError):
                return ""
            newest = max(newest, stat.st_ctime_ns)
            stamp = (stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino)
            digest.update(repr(stamp).encode())
    return "" if newest > time.time_ns() - RECENT_NS else digest.hexdigest()


def inputs_hash(task: ShardTask) -> str:
    """Return the current hash of a shard's records and screenshots, as in `ShardRecord.inputs`.

    Every screenshot is read and none is decoded.
    """
    inputs = hashlib.sha256(task.records.encode())
    root = Path(task.root)
    for trajectory in task.trajectories:
        for step in trajectory:
            with suppress(ImageError):  # the build rejects such a picture without hashing it
                data = read_picture(step.image, picture_name(step.image, root))
                inputs.update(hashlib.sha256(data).digest())
    return inputs.hexdigest()


def shard_rows(
    task: ShardTask,
    settings: RowSettings,
    tally: RowCounts,
    inputs: Any,
    tick: Callable[[int], None] | None,
) -> Iterator[Any]:
    """Yield the rows of a shard, and count them.

    Args:
        task: the shard.
        settings: those of the build.
        tally: counts the rows, and what gave none.
        inputs: a hash that is updated with the screenshots.
        tick: called with the number of rows of each step when it is done.
    """
    root = Path(task.root)
    for trajectory in task.trajectories:
        for step in trajectory:
            image_name = picture_name(step.image, root)
            try:
                data = read_picture(step.image, image_name)
                inputs.update(hashlib.sha256(data).digest())
                yield from make_rows(trajectory, step, data, image_name, settings, tally)
            except ImageError as error:
                tally.reject(image_name, f"{trajectory.id}, step {step.index}", "image", error)
            if tick is not None:
                tick(settings.variants)


def records_hash(trajectories: Iterable[Trajectory], root: Path) -> str:
    """Return a hash of everything in trajectories, and of the sizes of their pictures."""
    digest = hashlib.sha256()
    for trajectory in trajectories:
        data = _fields(trajectory)
        data.pop("episode", None)  # it decides the file of a trajectory, not its rows
        if data.get("screen", "") is None:
            del data["screen"]
        data["steps"] = [{**_fields(step), "image": _image_name(step, root)} for step in trajectory]
        text = json.dumps(data, sort_keys=True, allow_nan=False, default=_fields)
        digest.update(text.encode())
    return digest.hexdigest()


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass; those inside it follow when JSON is written of them.

    Raises:
        TypeError: the value is no dataclass, and so no part of a record.
    """
    if not is_dataclass(value):
        raise TypeError(f"{type(value).__name__} cannot be part of a record")
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _image_name(step: Step, root: Path) -> str:
    path = picture_file(step.image)
    size = path.stat().st_size if path.exists() else -1
    return f"{picture_name(step.image, root)} ({size} bytes)"
