import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.errors import AssetError, ConfigError, ParameterError, UnknownNameError
from pipelines import build, open_dataset, verify
from pipelines.building.shards import shard_tasks
from pipelines.engines import local
from pipelines.errors import BuildError, SourceError
from pipelines.sources import Sources

from support.dataset_files import shard_hashes


def quarantined(out: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in (out / "quarantine.jsonl").read_text().splitlines()]


def test_shards_are_cut_between_trajectories(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=4, steps=3)
    items = list(Sources.open(folder).read())
    for per_shard, expected in (
        (1, [1, 1, 1, 1]),
        (6, [1] * 4),
        (12, [2, 2]),
        (18, [3, 1]),
        (500, [4]),
    ):
        tasks = list(shard_tasks(iter(items), per_shard, 2, lambda _: None))
        assert [len(task.trajectories) for task in tasks] == expected
        assert [task.index for task in tasks] == list(range(len(expected)))


def test_config_and_arguments(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=1, steps=1)
    config = tmp_path / "c.yaml"
    config.write_text(
        "corruptions:\n  - marks: {as: few, number: 3}\nseed: 9\nclean: false\nlabel_policy: drop\n"
    )
    build(folder, tmp_path / "a", config=config)
    (row,) = open_dataset(tmp_path / "a")
    assert (row["corruption"], row["seed"], json.loads(row["params"])["number"]) == ("few", 9, 3)
    build(folder, tmp_path / "b", config=config, seed=4, clean=True)
    assert [(r["corruption"], r["seed"]) for r in open_dataset(tmp_path / "b")] == [
        ("clean", 4),
        ("few", 4),
    ]
    build(folder, tmp_path / "again", config=tmp_path / "b" / "config.yaml")
    assert shard_hashes(tmp_path / "again") == shard_hashes(tmp_path / "b")
    with pytest.raises(ConfigError):
        build(folder, tmp_path / "x", config={"corruptions": ["markss"]})


def test_names_of_corruptions(recording: Any, assets: Path, tmp_path: Path) -> None:
    folder = recording(trajectories=1, steps=1)
    visual = [
        "clean",
        *(
            name
            for name in hj.corruption_names()
            if name in ("pop_ups", "resolution", "marks", "subtitle")
        ),
    ]
    assert list(build(folder, tmp_path / "a").rows) == visual
    assert list(build(folder, tmp_path / "b", corruptions="all", assets=assets).rows) == [
        "clean",
        *hj.corruption_names(),
    ]
    assert list(build(folder, tmp_path / "c", corruptions="marks, resolution").rows) == [
        "clean",
        "marks",
        "resolution",
    ]
    assert list(build(folder, tmp_path / "d", corruptions={}).rows) == ["clean"]


@pytest.mark.parametrize(
    ("arguments", "error", "reason"),
    [
        (
            {"corruptions": "marks,verification", "assets": "nowhere"},
            AssetError,
            "nowhere: no asset pack.*record",
        ),
        ({"corruptions": "mark"}, UnknownNameError, "did you mean 'marks'"),
        ({"corruptions": "marks,marks"}, BuildError, "twice"),
        ({"corruptions": ["marks"]}, BuildError, "mapping"),
        ({"corruptions": {"clean": hj.Marks()}}, BuildError, "label"),
        ({"corruptions": {"a/b": hj.Marks()}}, BuildError, "label"),
        ({"corruptions": {"a": hj.Marks}}, BuildError, "must be a corruption"),
        ({"corruptions": {}, "clean": False}, BuildError, "nothing to build"),
        ({"label_policy": "dropp"}, BuildError, "did you mean 'drop'"),
        ({"seed": -1}, ParameterError, "seed"),
        ({"rows_per_shard": 0}, BuildError, "rows_per_shard"),
        ({"workers": 0}, BuildError, "workers"),
        ({"format": "agentne"}, UnknownNameError, "did you mean 'agentnet'"),
        ({"output": "lasy"}, BuildError, "did you mean 'lazy'"),
        ({"splits": "train=0.5,held_out=0.5"}, BuildError, "no split 'held_out'.*known: test"),
        (
            {"config": {"corruptions": ["marks"], "splits": {"tests": 1.0}}},
            BuildError,
            "did you mean 'test'",
        ),
        ({"splits": "train=0.5,test=0.4"}, ParameterError, "sum to 1"),
        ({"splits": "train"}, ParameterError, "NAME=SHARE"),
        ({"splits": "train=0.5,train=0.5"}, ParameterError, "twice"),
        ({"limit": 0}, BuildError, "limit"),
        ({"resume": True, "overwrite": True}, BuildError, "exclude"),
        ({"corruptions": "clean", "clean": False}, BuildError, "--no-clean"),
        ({"corruptions": "marks:nmber=3"}, BuildError, "at character 7.*did you mean 'number'"),
    ],
)
def test_what_is_refused(
    arguments: dict[str, Any], error: type[Exception], reason: str, recording: Any, tmp_path: Path
) -> None:
    with pytest.raises(error, match=reason):
        build(recording(), tmp_path / "out", **arguments)
    assert not (tmp_path / "out" / "manifest.json").exists()


def test_sources_that_hold_nothing(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "blank").mkdir()
    (tmp_path / "blank" / "trajectories.jsonl").write_text("\n\n")
    for name, reason in (
        ("none", "no such file"),
        ("empty", "is empty"),
        ("blank", "holds no trajectory"),
    ):
        with pytest.raises(SourceError, match=f"{name}.*{reason}.*agentnet.*jsonl"):
            build(tmp_path / name, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_source_of_which_nothing_is_readable(recording: Any, tmp_path: Path) -> None:
    folder = recording(trajectories=1, steps=2)
    for image in (folder / "images").iterdir():
        image.write_bytes(b"no picture")
    report = build(folder, tmp_path / "out")
    assert (report.total, report.rejected, report.exit_code) == (0, 2, 1)
    assert len(quarantined(tmp_path / "out")) == 2
    assert list(open_dataset(tmp_path / "out")) == []
    assert verify(tmp_path / "out").ok
    assert "there is no row" in "\n".join(report.lines())


def test_strict_stops_at_the_first_bad_input(
    recording: Any, add_line: Any, small: Any, tmp_path: Path
) -> None:
    folder = recording(trajectories=3)
    image = (folder / "images" / "t1-0.png").read_bytes()
    (folder / "images" / "t1-0.png").write_bytes(image[:-2000])
    with pytest.raises(SourceError, match=r"images/t1-0.png.*t1, step 0"):
        build(folder, tmp_path / "late", corruptions=small, strict=True, rows_per_shard=1)
    # the third trajectory was not begun
    assert len(list((tmp_path / "late" / "data").iterdir())) == 2
    add_line(folder, b"rubbish")
    with pytest.raises(SourceError, match=r"line 10.*not JSON"):
        build(folder, tmp_path / "early", corruptions=small, strict=True)
    assert not (tmp_path / "early" / "manifest.json").exists()


def test_progress_reaches_the_total(recording: Any, small: Any, tmp_path: Path) -> None:
    calls: list[tuple[int, int, str]] = []
    build(
        recording(), tmp_path / "out", corruptions=small, progress=lambda *call: calls.append(call)
    )
    assert calls == [(item, 6, "steps") for item in range(1, 7)]


def test_folders_that_cannot_be_written_to(recording: Any, tmp_path: Path) -> None:
    folder = recording()
    (tmp_path / "file").write_text("x")
    for out in (tmp_path / "file", tmp_path / "file" / "out", Path("/proc/out"), Path("a\0b")):
        with pytest.raises(BuildError, match=r"cannot be made|not a usable path"):
            build(folder, out)
    with pytest.raises(BuildError, match="lies in the source"):
        build(folder, folder / "out")
    with pytest.raises(BuildError, match="lies in the source"):
        build(folder, folder)
    assert sorted(os.listdir(folder)) == ["images", "trajectories.jsonl"]


def test_a_disk_that_is_full(
    recording: Any, small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    import pyarrow.parquet

    monkeypatch.setattr(pyarrow.parquet.ParquetWriter, "write_table", full)
    with pytest.raises(hj.HijackError, match=r"train-00000.parquet.*No space left"):
        build(recording(), tmp_path / "out", corruptions=small)
    monkeypatch.undo()
    assert build(tmp_path / "source", tmp_path / "out", corruptions=small, resume=True).total == 30


def opencv_threads() -> int:
    import cv2

    return cv2.getNumThreads()


@pytest.mark.skipif(
    (os.cpu_count() or 1) < 2, reason="on one processor OpenCV has one thread anyway"
)
def test_workers_leave_the_other_processors_alone() -> None:
    pytest.importorskip("cv2")
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, spawn, initializer=local._start_worker) as pool:
        assert pool.submit(opencv_threads).result() == 1
