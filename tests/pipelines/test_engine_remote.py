"""What the Ray engine checks and refuses; its builds are in `test_engine_ray`."""

import shutil
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.errors import MissingDependencyError, UnknownNameError
from pipelines import build
from pipelines.building.shards import ShardTask, build_shard, shard_tasks
from pipelines.building.step_rows import RowSettings
from pipelines.dataset.manifest import libraries
from pipelines.engines import ray as engine
from pipelines.engines import ray_connection, remote_worker
from pipelines.errors import BuildError
from pipelines.sources import Sources

MARKS = hj.Marks(number=4, mark_size=8)


def task_of(source: Path) -> ShardTask:
    (task,) = shard_tasks(Sources.open(source).read(), 500, 2, print)
    return task


@pytest.fixture
def job(tmp_path: Path) -> remote_worker.ShardJob:
    out = tmp_path / "shared"
    (out / ".build").mkdir(parents=True)
    (out / "data").mkdir()
    (out / ".build" / "token").write_text("abc")
    return remote_worker.ShardJob(
        RowSettings((("marks", MARKS),)), out, "abc", libraries(False), None, {}
    )


def test_a_node_that_sees_other_files_or_has_other_libraries(
    job: remote_worker.ShardJob, recording: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote_worker, "SHARED_FILE_TIMEOUT_S", 0)
    task = task_of(recording(trajectories=1, steps=2))
    record = remote_worker.make({"task": task}, job)["made"]
    assert record == build_shard(task, job.settings, job.out)
    (job.out / "data" / record.file).unlink(missing_ok=True)

    def refused(task: ShardTask, **changes: Any) -> str:
        error = remote_worker.make({"task": task}, replace(job, **changes))["made"]
        assert isinstance(error, BuildError)
        return str(error)

    assert str(job.out) in refused(task, token="abd")
    assert "all nodes share" in refused(task, out=job.out / "elsewhere")
    assert "pillow" in refused(task, libraries={**job.libraries, "pillow": "1.0"})
    assert "recorded pictures" in refused(task, assets={"sha256": "0"})
    picture = Path(task.trajectories[0].steps[1].image)
    picture.write_bytes(picture.read_bytes() + b"more")
    assert str(task.root) in refused(task)
    shutil.rmtree(task.root)
    assert "does not see the pictures" in refused(task)
    assert not list(job.out.rglob("*.parquet.*"))


def test_a_shard_that_was_written_elsewhere(
    job: remote_worker.ShardJob, recording: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(remote_worker, "SHARED_FILE_TIMEOUT_S", 0)
    task = task_of(recording(trajectories=1, steps=1))
    record = build_shard(task, job.settings, job.out)
    assert engine._record(record, "n1", job.out) is record
    for second in (job.out / "local", job.out):
        with pytest.raises(
            BuildError,
            match=rf"{second}/data/train-00000.parquet: the node n1 wrote.*all nodes share",
        ):
            engine._record(replace(record, bytes=record.bytes + 1), "n1", second)


def test_messages_of_ray_do_not_mix_with_the_output(capsys: Any) -> None:
    def speak() -> None:
        print("\033[33m(raylet)\033[0m A worker died.\n    [state-dump] 1\n    [state-dump] 2")

    with ray_connection._quiet():
        print("ours")
        for name in ("ray_listen_error_messages", "another"):
            thread = threading.Thread(target=speak, name=name)
            thread.start()
            thread.join()
    output = capsys.readouterr()
    assert output.err == "\033[33m(raylet)\033[0m A worker died.\n"
    assert output.out.startswith("ours\n\033[33m(raylet)")
    assert output.out.count("state-dump") == 2


def test_without_ray(recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r"pip install .*\[ray\]'"):
        build(recording(), tmp_path / "out", corruptions={"marks": MARKS}, engine="ray")


def test_engines_and_clusters_that_are_not_there(
    recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = pytest.importorskip("ray")
    source, out = recording(), tmp_path / "out"
    with pytest.raises(UnknownNameError, match=r"engine 'rey'.*did you mean 'ray'"):
        build(source, out, engine="rey")
    with pytest.raises(BuildError, match=r"ray_address 'auto' is for engine='ray'"):
        build(source, out, ray_address="auto")
    assert not out.exists()
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    for address, reason in (
        ("127.0.0.1:1", "refused"),
        ("ray://127.0.0.1:10001", "not served"),
        ("x", "Invalid"),
    ):
        with pytest.raises(BuildError, match=f"Ray at '{address}' cannot be used.*{reason}"):
            build(source, tmp_path / address.replace("/", "-"), engine="ray", ray_address=address)
