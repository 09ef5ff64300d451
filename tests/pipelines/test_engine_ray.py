"""Builds on Ray: two nodes, each with processes of its own, on this machine."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import hijack_data as hj
from pipelines import build, verify
from pipelines.building.shards import ShardTask, shard_tasks
from pipelines.building.step_rows import RowSettings
from pipelines.engines import ray as engine
from pipelines.errors import BuildError, SourceError
from pipelines.sources import Sources

from support.dataset_files import file_contents

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'agenthijack[ray]'")
cluster_utils = pytest.importorskip("ray.cluster_utils")
ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "hijack_data.cli", "build"]
CONFIG = "corruptions:\n  - marks: {number: 4, mark_size: 8}\n"
STORE = 80 * 2**20
SOON = {
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 500,
    "health_check_timeout_ms": 2000,
    "health_check_failure_threshold": 4,
}


class Marks(hj.plugin.Augmentation):
    """Marks, whose planning calls `deed` first."""

    needs_elements = False

    def __init__(self, deed: Any = None) -> None:
        self.deed = deed

    def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
        if self.deed is not None:
            self.deed(**key)
        return hj.Marks(number=4, mark_size=8).plan(scene, **key)


# The card names its own folder.
contents = partial(file_contents, without="README.md")


def differences(out: Path, whole: Path) -> list[str]:
    """The rows and columns in which two datasets differ, or the files, where their rows agree."""
    items: list[str] = []
    for name, data in contents(whole).items():
        if (out / name).read_bytes() != data:
            items.append(f"{name}: {(out / name).stat().st_size} bytes, not {len(data)}")
            if name.endswith(".parquet"):
                pairs = zip(
                    *(pq.read_table(folder / name).to_pylist() for folder in (out, whole)),
                    strict=True,
                )
                items += [
                    f"{b['id']}: {key} {str(a[key])[:80]}"
                    for a, b in pairs
                    for key in b
                    if a[key] != b[key]
                ]
    return items


def once(flag: Path) -> bool:
    """Whether this is the first call with this path, in any process."""
    try:
        os.close(os.open(flag, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def kill_self(flag: Path, sample: str, **_: Any) -> None:
    if sample == "t3" and once(flag):
        os.kill(os.getpid(), signal.SIGKILL)


def kill_self_always(**_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_node(flag: Path, raylet: int, **_: Any) -> None:
    if os.getppid() == raylet and once(flag):
        os.kill(raylet, signal.SIGKILL)
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.1)  # the other node leaves shards for this one


def stumble(**_: Any) -> None:
    raise ZeroDivisionError("a mistake in a planner")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Two nodes of one CPU each, whose processes work in another folder than the tests do."""
    before = Path.cwd()
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    os.chdir(tmp_path_factory.mktemp("elsewhere"))
    options = {"num_cpus": 1, "object_store_memory": STORE, "include_dashboard": False}
    nodes = cluster_utils.Cluster(
        initialize_head=True, head_node_args={**options, "_system_config": SOON}
    )
    try:
        nodes.add_node(num_cpus=1, object_store_memory=STORE)
        os.chdir(before)
        ray.init(address=nodes.address, log_to_driver=False, logging_level="CRITICAL")
        yield nodes
    finally:
        os.chdir(before)
        ray.shutdown()
        nodes.shutdown()


def raylet(node: Any) -> int:
    return node.all_processes["raylet"][0].process.pid


def on_ray(source: Path, out: Path, deed: Any = None, **options: Any) -> Any:
    """Build one shard a trajectory with two workers of the cluster."""
    planners = {"marks": Marks(deed)}
    return build(
        source, out, corruptions=planners, rows_per_shard=1, engine="ray", workers=2, **options
    )


def locally(source: Path, out: Path, deed: Any = None) -> dict[str, bytes]:
    """What an undisturbed build in this process makes."""
    build(source, out, corruptions={"marks": Marks(deed)}, rows_per_shard=1)
    return contents(out)


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_the_same_bytes_as_a_local_build(
    output: str,
    recording: Any,
    cluster: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: Any,
) -> None:
    # twelve are more than the first wave
    source = recording(trajectories=12 if output == "lazy" else 3, steps=2)
    picture = source / "images" / "t1-1.png"
    picture.write_bytes(picture.read_bytes()[:-1000])
    planners = {"marks": hj.Marks(number=4, mark_size=8), "half": hj.Resolution()}
    options: dict[str, Any] = {"corruptions": planners, "rows_per_shard": 1, "output": output}
    # the nodes work in another folder: relative paths must not be theirs
    monkeypatch.chdir(tmp_path)
    here = build("source", "here", **options)
    calls: list[tuple[int, int]] = []
    result = build(
        "source",
        "there",
        **options,
        engine="ray",
        workers=2,
        progress=lambda d, n, _: calls.append((d, n)),
    )
    assert contents(Path("here")) == contents(Path("there"))
    assert (result.rows, result.rejected, result.shards) == (here.rows, 1, here.shards)
    total = here.shards * 2
    assert sorted(calls) == calls == [(item, total) for item in range(2, total + 1, 2)]
    assert verify("there").ok
    assert capfd.readouterr().out == ""


def test_a_worker_that_is_killed_in_the_middle_of_a_shard(
    recording: Any, cluster: Any, tmp_path: Path
) -> None:
    source = recording(trajectories=6, steps=2)
    deed = partial(kill_self, tmp_path / "flag")
    report = on_ray(source, tmp_path / "out", deed)
    assert (tmp_path / "flag").exists()
    assert (report.shards, report.rejected) == (6, 0)
    # and no temporary file
    assert contents(tmp_path / "out") == locally(source, tmp_path / "whole", deed)


def test_a_shard_that_kills_every_worker_is_given_up(
    recording: Any, cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "RETRIES", 1)
    source, out = recording(trajectories=2, steps=1), tmp_path / "out"
    with pytest.raises(
        BuildError, match=r"given up after 2 workers.*WorkerCrashedError.*resume=True"
    ):
        on_ray(source, out, kill_self_always)
    assert not list(out.rglob("*.tmp"))
    assert on_ray(source, out, resume=True).shards == 2
    assert contents(out) == locally(source, tmp_path / "whole")


def test_a_node_that_dies(recording: Any, cluster: Any, tmp_path: Path) -> None:
    source, out = recording(trajectories=8, steps=1), tmp_path / "out"
    node = cluster.add_node(num_cpus=1, object_store_memory=STORE)
    try:
        deed = partial(kill_node, tmp_path / "flag", raylet(node))
        report = build(
            source,
            out,
            corruptions={"marks": Marks(deed)},
            rows_per_shard=1,
            engine="ray",
            workers=3,
        )
    finally:
        cluster.remove_node(node, allow_graceful=False)
    assert (tmp_path / "flag").exists(), "the third node had no shard"
    assert report.shards == 8
    assert contents(out) == locally(source, tmp_path / "whole", deed)


@pytest.mark.parametrize(
    ("deed", "reason"),
    [(stumble, r"ZeroDivisionError.*a mistake in a planner.*resume=True"), (None, "effects")],
)
def test_mistakes_reach_the_caller(
    deed: Any, reason: str, recording: Any, cluster: Any, tmp_path: Path
) -> None:
    class Live(hj.plugin.Augmentation):
        def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
            return hj.NetworkError().plan(scene, **{**key, "step": -1})

    planners = {"x": Marks(deed) if deed else Live()}
    with pytest.raises(BuildError, match=reason):
        build(recording(steps=1), tmp_path / "out", corruptions=planners, engine="ray")


def test_strict_stops_at_the_first_bad_input(recording: Any, cluster: Any, tmp_path: Path) -> None:
    source = recording(trajectories=2, steps=1)
    picture = source / "images" / "t0-0.png"
    picture.write_bytes(picture.read_bytes()[:-1000])
    with pytest.raises(SourceError, match=r"images/t0-0.png.*strict"):
        on_ray(source, tmp_path / "out", strict=True)
    assert not (tmp_path / "out" / "manifest.json").exists()


def tasks_of(source: Path) -> list[ShardTask]:
    return list(shard_tasks(Sources.open(source).read(), 1, 2, print))


def test_the_source_is_read_as_shards_are_done(
    recording: Any, cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "FIRST_WAVE_SHARDS", 1)
    monkeypatch.setattr(engine, "MAX_WAVE_SHARDS", 2)
    tasks, taken_tasks = tasks_of(recording(trajectories=9, steps=1)), []

    def source() -> Iterator[ShardTask]:
        for task in tasks:
            taken_tasks.append(task.index)
            yield task

    (tmp_path / "out" / "data").mkdir(parents=True)
    (tmp_path / "out" / ".build").mkdir()
    settings, ahead, values = RowSettings((("marks", Marks()),)), [], []
    for record in engine.run(source(), settings, tmp_path / "out", 1, lambda _: None):
        ahead.append(len(taken_tasks) - len(values))
        values.append(record.index)
    assert sorted(values) == list(range(9))
    assert ahead[0] == 1  # the first shard is done before the third is read
    assert max(ahead) <= 4  # at most a wave in the making and one that waits


NAMESPACE = """
mount -t tmpfs tmpfs "$1" && exec {python} -m ray.scripts.scripts start --address={address} --num-cpus=1 \\
  --object-store-memory={store} --disable-usage-stats --block
"""


@pytest.mark.skipif(
    os.geteuid() != 0 or not shutil.which("unshare"),
    reason="only root can hide a folder from a node",
)
def test_a_node_that_does_not_share_the_output(
    recording: Any, cluster: Any, tmp_path: Path
) -> None:
    """A real third node, in a mount namespace where the output folder is another one."""
    source, out = recording(trajectories=6, steps=1), tmp_path / "out"
    out.mkdir()
    if subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode:
        pytest.skip("mount namespaces are not allowed here")
    script = NAMESPACE.format(python=sys.executable, address=cluster.address, store=STORE)
    command = ["unshare", "-m", "sh", "-c", script, "sh", str(out)]
    names = {n["NodeID"] for n in ray.nodes()}  # dead ones, too: a cluster learns of a death late
    node = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, start_new_session=True
    )
    try:
        deadline = time.monotonic() + 60
        while {n["NodeID"] for n in ray.nodes()} == names and time.monotonic() < deadline:
            assert node.poll() is None, "the node did not start"
            time.sleep(0.1)
        assert {n["NodeID"] for n in ray.nodes()} > names, "the node did not join"
        with pytest.raises(
            BuildError, match=rf"{out}: the node .* does not see this folder.*all nodes share"
        ):
            build(
                source,
                out,
                corruptions={"marks": Marks()},
                rows_per_shard=1,
                engine="ray",
                workers=3,
            )
    finally:
        node.send_signal(signal.SIGTERM)
        node.wait(timeout=30)
    assert on_ray(source, out, resume=True).shards == 6
    assert contents(out) == locally(source, tmp_path / "whole")


def test_a_cluster_that_runs_already(recording: Any, cluster: Any, tmp_path: Path) -> None:
    source, out = recording(trajectories=2, steps=1), tmp_path / "out"
    (tmp_path / "config.yaml").write_text(CONFIG)
    options = ["--config", str(tmp_path / "config.yaml"), "--engine", "ray", "--json"]
    command = [*COMMAND, str(source), "--out", str(out), *options]
    environment = {**os.environ, "RAY_ADDRESS": cluster.address}
    process = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stderr
    assert json.loads(process.stdout)["rows"] == 4
    build(source, tmp_path / "whole", config=tmp_path / "config.yaml")
    assert contents(out) == contents(tmp_path / "whole")
    assert len([node for node in ray.nodes() if node["Alive"]]) == 2  # it goes on


MARK = "AGENTHIJACK_TEST_RAY"
# They write nothing; after a kill they wait 60 s for a cluster that is gone, as long as Ray's own
# time-out.
AGENTS = {"ray::DashboardAgent", "ray::RuntimeEnvAgent"}
SHORT = """
import sys
from pipelines import dataset_commands
from pipelines.building.build_options import BuildOptions

if __name__ == "__main__":
    BuildOptions.__init__.__kwdefaults__["rows_per_shard"] = 1
    dataset_commands.build(sys.argv[1:])
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_ctrl_c_and_kill_end_the_cluster_that_was_started(
    how: signal.Signals, recording: Any, tmp_path: Path
) -> None:
    source, out = recording(trajectories=60, steps=2), tmp_path / "out"
    (tmp_path / "config.yaml").write_text(CONFIG)
    (tmp_path / "run.py").write_text(SHORT)
    options = ["--config", str(tmp_path / "config.yaml"), "--engine", "ray", "--workers", "2"]
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PYTHONWARNINGS": "error",
        MARK: str(tmp_path),
    }
    environment.pop("RAY_ADDRESS", None)
    command = [sys.executable, str(tmp_path / "run.py"), str(source), "--out", str(out), *options]
    # files: the agents of Ray would keep a pipe open
    message = tmp_path / "stdout", tmp_path / "stderr"
    with message[0].open("w") as first, message[1].open("w") as second:
        process = subprocess.Popen(
            command, env=environment, stdout=first, stderr=second, start_new_session=True
        )
    deadline = time.monotonic() + 90
    while (
        process.poll() is None
        and not list(out.glob(".build/[0-9]*.json"))
        and time.monotonic() < deadline
    ):
        time.sleep(0.002)
    assert len(marked(tmp_path)) > 4  # Ray's own processes, and the workers
    if how == signal.SIGINT:
        os.killpg(process.pid, how)  # a terminal tells all processes
    else:
        process.kill()
    process.wait(timeout=60)
    output, errors = (file.read_text() for file in message)
    assert output == ""
    assert "Traceback" not in errors
    if how == signal.SIGINT:
        assert process.returncode == 130, errors
        assert errors.splitlines()[-1] == "hijack: stopped; the same command with --resume goes on"
        assert not list(out.rglob("*.tmp"))
    idle = AGENTS if how == signal.SIGKILL else set[str]()
    deadline = time.monotonic() + 30
    while set(marked(tmp_path)) - idle and time.monotonic() < deadline:
        time.sleep(0.1)
    assert set(marked(tmp_path)) <= idle
    assert 1 <= len(list((out / "data").glob("train-*.parquet"))) < 60
    report = build(source, out, config=tmp_path / "config.yaml", rows_per_shard=1, resume=True)
    assert report.kept >= 1
    build(source, tmp_path / "whole", config=tmp_path / "config.yaml", rows_per_shard=1)
    assert differences(out, tmp_path / "whole") == []
    assert contents(out) == contents(tmp_path / "whole")


def marked(value: Path) -> list[str]:
    """The processes that run with the mark in their environment."""
    items = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={value}".encode() in (process / "environ").read_bytes().split(b"\0"):
                items.append(
                    (process / "cmdline").read_bytes().partition(b"\0")[0].decode().strip()
                )
        except OSError:
            continue
    return items
