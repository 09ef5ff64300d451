"""Loaders give the rows of `open_dataset`, by number, in any process."""

import importlib
import multiprocessing
import pickle
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import hijack_data as hj
from pipelines import build, open_dataset
from pipelines.dataset.row_reader import RowReader
from pipelines.errors import DatasetError

PLANNERS: dict[str, Any] = {"marks": hj.Marks(number=4, mark_size=8), "half": hj.Resolution()}


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, recording: Any, add_line: Any, good_line: Any, tmp_path: Path) -> Path:
    source = recording(trajectories=4, steps=3)
    add_line(
        source,
        good_line("t9", 0, image="images/t0-0.png", target_box=None, action={"type": "wait"}),
    )
    build(source, tmp_path / "out", corruptions=PLANNERS, output=request.param, rows_per_shard=18)
    return tmp_path / "out"


def test_torch_items(dataset: Path) -> None:
    torch = pytest.importorskip("torch")
    from pipelines.loaders.torch import TorchDataset

    items = TorchDataset(dataset)
    rows = list(open_dataset(dataset))
    assert isinstance(items, torch.utils.data.Dataset)
    assert len(items) == len(rows) == 39
    for index, row in enumerate(rows):
        item = items[index]
        picture = item["screenshot"]
        assert picture.dtype == torch.uint8
        assert list(picture.shape) == [3, row["height"], row["width"]]
        assert np.array_equal(picture.permute(1, 2, 0).numpy(), np.asarray(row["screenshot"]))
        assert item["boxes"].dtype == torch.int32
        assert item["boxes"].tolist() == ([row["target_box"]] if row["target_box"] else [])
        assert item["boxes"].shape[1] == 4
        assert {k: v for k, v in item.items() if k not in ("screenshot", "boxes")} == {
            k: v for k, v in row.items() if k != "screenshot"
        }
    picture = items[1]["screenshot"]
    picture += 1  # its own memory: the next reader gets the row as it is
    assert np.array_equal(
        items[1]["screenshot"].permute(1, 2, 0).numpy(), np.asarray(rows[1]["screenshot"])
    )


def test_items_of_a_batch_have_the_same_entries() -> None:
    torch = pytest.importorskip("torch")
    from pipelines.loaders.torch import collate

    item = {"screenshot": torch.zeros(3, 2, 2, dtype=torch.uint8), "id": "a"}
    for items in ([item, {**item, "mask": 1}], [{**item, "mask": 1}, item]):
        with pytest.raises(DatasetError, match=r"differ in their entries \(mask\)"):
            collate(items)


@pytest.mark.parametrize("loader", ["torch:TorchDataset", "grain:GrainSource"])
def test_a_dataset_with_splits_is_read_one_split_at_a_time(
    loader: str, recording: Any, tmp_path: Path
) -> None:
    module, name = loader.split(":")
    pytest.importorskip(module)
    open_rows = getattr(importlib.import_module(f"pipelines.loaders.{module}"), name)
    folder = tmp_path / "set"
    splits = {"train": 0.5, "test": 0.5}
    build(recording(trajectories=12, steps=1), folder, corruptions=PLANNERS, splits=splits)
    with pytest.raises(DatasetError, match="the splits train, test, which must not be mixed"):
        open_rows(folder)
    ids = {
        split: [items[i]["id"] for i in range(len(items))]
        for split in splits
        for items in [pickle.loads(pickle.dumps(open_rows(folder, split=split)))]
    }
    assert ids["train"]
    assert ids["test"]
    assert sorted(ids["train"] + ids["test"]) == sorted(row["id"] for row in open_dataset(folder))
    stored = {row["id"] for row in open_dataset(folder, "test")}
    assert set(ids["test"]) == stored


def brighter(item: dict[str, Any]) -> Any:
    return item["id"], item["screenshot"].float().mean()


def test_torch_transform_and_pickle(dataset: Path) -> None:
    pytest.importorskip("torch")
    from pipelines.loaders.torch import TorchDataset

    items = TorchDataset(dataset, transform=brighter)
    again = pickle.loads(pickle.dumps(items))  # before and after it has opened files
    assert again[7] == items[7] == pickle.loads(pickle.dumps(items))[7]


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_torch_data_loader(workers: int, dataset: Path) -> None:
    torch = pytest.importorskip("torch")
    from pipelines.loaders.torch import TorchDataset, collate

    items = TorchDataset(dataset)
    items[0]  # a file is open already when the workers fork
    loader = torch.utils.data.DataLoader(
        items, batch_size=3, num_workers=workers, collate_fn=collate
    )
    batches = list(loader)
    rows = list(open_dataset(dataset))
    assert [name for batch in batches for name in batch["id"]] == [row["id"] for row in rows]
    assert isinstance(batches[0]["screenshot"], list)  # the half-size picture is among them
    pictures = [picture for batch in batches for picture in batch["screenshot"]]
    for picture, row in zip(pictures, rows, strict=True):
        assert np.array_equal(picture.permute(1, 2, 0).numpy(), np.asarray(row["screenshot"]))
    assert tuple(collate([items[0], items[1]])["screenshot"].shape) == (2, 3, 200, 320)


def test_grain(dataset: Path) -> None:
    grain = pytest.importorskip("grain")
    from pipelines.loaders.grain import GrainSource

    source = GrainSource(dataset)
    rows = list(open_dataset(dataset))
    assert isinstance(source, grain.sources.RandomAccessDataSource)
    assert repr(source) == repr(pickle.loads(pickle.dumps(source)))
    assert "'out', rows=39" in repr(source)
    shuffled = grain.MapDataset.source(source).shuffle(seed=3)
    entries = {}
    for row in shuffled.to_iter_dataset(grain.ReadOptions(num_threads=4, prefetch_buffer_size=8)):
        assert row["screenshot"].dtype == np.uint8
        entries[row["id"]] = row["screenshot"]
    assert len(entries) == 39
    assert all(np.array_equal(entries[row["id"]], np.asarray(row["screenshot"])) for row in rows)


def test_the_name_of_grain_data_follows_its_content(recording: Any, tmp_path: Path) -> None:
    from pipelines.loaders.grain import GrainSource

    for seed in (1, 2):
        build(recording(f"s{seed}"), tmp_path / f"{seed}" / "out", corruptions=PLANNERS, seed=seed)
    assert repr(GrainSource(tmp_path / "1" / "out")) != repr(GrainSource(tmp_path / "2" / "out"))


def test_one_row_reads_one_row_group(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    real = pq.ParquetFile.read_row_group

    def counted(self: Any, group: int, *args: Any, **options: Any) -> Any:
        read.append(group)
        return real(self, group, *args, **options)

    monkeypatch.setattr(pq.ParquetFile, "read_row_group", counted)
    rows = open_dataset(dataset)
    files = len(list((dataset / "data").iterdir()))
    assert files == 3
    first = rows[0]["id"]
    assert len(read) == 1
    assert rows[1]["trajectory_id"] == rows[0]["trajectory_id"]
    assert len(read) == 1  # kept
    for index in (20, 38, 0):
        rows[index]
    assert len(read) == 3
    assert rows[0]["id"] == first


def test_caches_are_bounded(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipelines.dataset.row_reader.OPEN_FILES", 1)
    monkeypatch.setattr("pipelines.dataset.row_reader.GROUPS", 1)
    rows = open_dataset(dataset)
    names = [row["id"] for row in rows]
    assert [rows[i]["id"] for i in (38, 0, 20, 37, 1)] == [names[i] for i in (38, 0, 20, 37, 1)]
    assert (len(rows.reader._open.items), len(rows.reader._groups.items)) == (1, 1)


def test_threads_share_a_dataset(dataset: Path) -> None:
    rows = open_dataset(dataset)
    names = [row["id"] for row in rows]
    items: list[str] = []

    def work(start: int) -> None:
        items.extend(f"{i} {rows[i]['id']}" for i in range(start, 39, 4))

    threads = [threading.Thread(target=work, args=(start,)) for start in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(items) == sorted(f"{i} {name}" for i, name in enumerate(names))


@pytest.mark.filterwarnings("ignore:This process")
def test_a_lock_that_was_held_at_a_fork(dataset: Path) -> None:
    """A child must not wait for a thread that only its parent has."""
    rows = open_dataset(dataset)
    rows[0]
    context = multiprocessing.get_context("fork")
    simple_queue = context.SimpleQueue()
    child = context.Process(target=lambda: simple_queue.put(rows[0]["id"]), daemon=True)
    with rows.reader._lock:
        child.start()
        child.join(20)
    assert child.exitcode == 0
    assert simple_queue.get() == "t0/0000/clean"


def test_files_with_fewer_rows_than_the_manifest_says(dataset: Path) -> None:
    manifest = open_dataset(dataset).manifest
    shards = [{**manifest["shards"][0], "rows": 1000}]
    with pytest.raises(DatasetError, match="fewer rows than the manifest says"):
        RowReader(dataset, shards)[999]
    (dataset / "data" / "train-00000.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"train-00000\.parquet: cannot be read"):
        open_dataset(dataset)[0]
