"""Benchmarks on Ray: two nodes, each with processes of its own, on this machine."""

import importlib
import json
import os
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.errors import MissingDependencyError, ParameterError, UnknownNameError
from hijack_data.file_io import write_atomic
from hijack_data.locking import lock
from online_env.agents.agent_files import read_agent
from online_env.agents.makers import FileAgentMaker
from online_env.agents.registry import AGENTS
from online_env.bench import ray_node, ray_pool, worker_bundle
from online_env.bench.config import Bench
from online_env.bench.episode_files import ReceivedEpisode, take_files
from online_env.bench.jobs import jobs
from online_env.bench.models import ModelOptions
from online_env.bench.pools import open_pool
from online_env.bench.providers import PROVIDERS
from online_env.bench.runner import run_jobs
from online_env.bench.workers import BYTES_PER_DESKTOP, WorkerSetup, desktops_in, references
from online_env.errors import ClusterError
from online_env.results import records
from online_env.tasks import TASKS
from pipelines.proof.rebuild import rebuild

from support import nodes, waiting
from support.squares import SIZE, ClickSquare

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'agenthijack[ray]'")
cluster_utils = pytest.importorskip("ray.cluster_utils")

ROOT = Path(__file__).resolve().parents[2]
NODE = {"num_cpus": 1, "object_store_memory": 80 * 2**20, "memory": BYTES_PER_DESKTOP}
SOON = {
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 500,
    "health_check_timeout_ms": 2000,
    "health_check_failure_threshold": 4,
}
# Of a record: what tells when it was made.
TIMES = ("seconds", "setup_seconds", "chain", "previous", "episode_sha256")


class Silent:
    """Is told, and says nothing."""

    def begins(self, job, number, attempt):
        pass

    def ended(self, job, number, record):
        pass


@pytest.fixture(scope="module")
def orders(tmp_path_factory):
    """The folder where the agents on the nodes look for orders."""
    return tmp_path_factory.mktemp("orders")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, orders):
    """Two nodes with room for a desktop each, whose processes work in another folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
        patch.setenv(nodes.FOLDER, str(orders))
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        patch.chdir(tmp_path_factory.mktemp("elsewhere"))
        result = cluster_utils.Cluster(
            initialize_head=True,
            head_node_args={**NODE, "include_dashboard": False, "_system_config": SOON},
        )
        try:
            result.add_node(**NODE)
            yield result
        finally:
            result.shutdown()


@pytest.fixture(autouse=True)
def registered_agents(orders, monkeypatch):
    """What the nodes load by its place is known here; no order is left from another test."""
    monkeypatch.setenv(nodes.FOLDER, str(orders))
    AGENTS.find(nodes.AGENT)
    PROVIDERS.find(nodes.PROVIDER)
    TASKS.add(ClickSquare)
    yield
    for order in orders.iterdir():
        order.unlink()


def bench(seeds=3, **settings):
    """Clean and marked squares to click."""
    settings = {"agents": (nodes.AGENT,), "provider": nodes.PROVIDER} | settings
    return Bench(
        size=SIZE,
        tasks=("square",),
        corruptions={"clean": None, "marks": hj.Marks(number=4, mark_size=8)},
        seeds=tuple(range(seeds)),
        **settings,
    )


def play_run(folder, engine="local", chosen=None, address=None, desktops=None):
    """Run all episodes; what `run_jobs` returned."""
    chosen = chosen or bench()
    listed = jobs(chosen)
    records.create(folder, chosen.to_data(), [job.id for job in listed])
    setup = WorkerSetup(bench=chosen, folder=folder, references=references(chosen))
    with open_pool(engine, setup, len(listed), desktops, address) as pool:
        return run_jobs(
            listed,
            folder,
            0,
            pool,
            Silent(),
            at_once=pool.max_episodes,
            stop=pool.stop,
            reserve=pool.reserve,
        )


def timeless(data):
    """JSON data without what tells when it was made, in any depth."""
    if isinstance(data, dict):
        return {key: timeless(value) for key, value in data.items() if key not in TIMES}
    if isinstance(data, list):
        return [timeless(value) for value in data]
    return data


def lines_of(path):
    return [timeless(json.loads(line)) for line in path.read_text().splitlines()]


def content(run):
    """All that a run holds, but for times: its records by id, and its files by name."""
    entries = {record["id"]: record for record in lines_of(run / "records.jsonl")}
    for path in (run / "episodes").rglob("*"):
        name = str(path.relative_to(run))
        if path.suffix == ".png":
            entries[name] = path.read_bytes()
        elif path.is_file():
            entries[name] = lines_of(path)
    return entries


def raylet(node):
    return node.all_processes["raylet"][0].process.pid


def left_over():
    """Folders of actors that are on this machine."""
    return set(Path(ray_node.tempfile.gettempdir()).glob(f"{ray_node.PREFIX}*"))


def test_a_node_that_dies_changes_nothing(cluster, orders, tmp_path):
    before = left_over()
    play_run(tmp_path / "local", desktops=1)
    (orders / nodes.SEEN).unlink()
    dying = cluster.add_node(**NODE)
    (orders / "kill_node").write_text(str(raylet(dying)))
    assert play_run(tmp_path / "ray", "ray", address=cluster.address) == {"ok": 6}
    assert (orders / "killed_node").exists()
    assert content(tmp_path / "ray") == content(tmp_path / "local")
    assert len(content(tmp_path / "ray")) > 6 * 4  # records, and files of each episode
    assert rebuild(tmp_path / "ray").ok
    assert len(left_over() - before) <= 1  # of the actor that was killed
    assert "True" not in (orders / nodes.SEEN).read_text()  # desktops hear SIGINT


def test_a_node_that_joins_is_used(cluster, orders, tmp_path):
    (orders / "wait_for").write_text("0")  # nobody's number: all agents wait
    with ThreadPoolExecutor(1) as pool:
        ended = pool.submit(play_run, tmp_path / "run", "ray", address=cluster.address)
        waiting.until(lambda: ended.done() or (orders / nodes.SEEN).exists())
        joined = cluster.add_node(**NODE)
        try:
            write_atomic(orders / "wait_for", str(raylet(joined)))
            assert ended.result() == {"ok": 6}
            assert raylet(joined) in nodes.raylets(orders)
        finally:
            cluster.remove_node(joined)


def is_gone(actor):
    try:
        ray.get(actor.ping.remote(), timeout=5)
    except ray.exceptions.RayError:
        return True
    return False


def test_a_process_that_is_killed_loses_the_episode_that_it_plays_and_no_other(
    cluster, orders, tmp_path
):
    class Kills(Silent):
        def begins(self, job, number, attempt):
            if number == 2:  # a desktop that is free, and about to be used
                desktop = next(iter(pool._actors))
                ray.kill(desktop)
                waiting.until(lambda: is_gone(desktop))  # Ray kills a little later

    (orders / "kill_me").touch()  # the first episode
    config = bench(seeds=1)
    listed = jobs(config)
    run = tmp_path / "run"
    records.create(run, config.to_data())
    setup = WorkerSetup(bench=config, folder=run, references=references(config))
    with open_pool("ray", setup, len(listed), 1, cluster.address) as pool:
        assert run_jobs(listed, run, 1, pool, Kills(), reserve=pool.reserve) == {"ok": 2}
    lost_record, *others = records.read(run).records
    second, again = sorted(others, key=lambda record: record["attempt"])  # played in either order
    assert (lost_record["status"], lost_record["cause"], lost_record["score"]) == (
        "error",
        "machine",
        None,
    )
    assert "the process that played the episode on" in lost_record["problem"]
    assert not (run / "episodes" / lost_record["id"]).exists()
    assert (again["id"], again["status"]) == (f"{lost_record['id']}__a1", "ok")
    assert (second["attempt"], second["status"]) == (0, "ok")


ONLY_HERE = """
from online_env.bench.ray_node import NodeDesktop

class Desktop(NodeDesktop):
    pass
"""


def test_a_node_that_cannot_import_the_actor(cluster, tmp_path, monkeypatch):
    (tmp_path / "only_here.py").write_text(ONLY_HERE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(ray_pool, "NodeDesktop", importlib.import_module("only_here").Desktop)
    (tmp_path / "only_here.py").unlink()
    expected = "a node cannot start a desktop .*only_here.*install the same agenthijack"
    with pytest.raises(ClusterError, match=expected):
        play_run(tmp_path / "run", "ray", address=cluster.address, desktops=1)


AGENT_FILE = """
model: some-model
base_url: http://127.0.0.1:1/v1
api_key_env: AGENTHIJACK_TEST_KEY
prompt: pyautogui
parser: pyautogui
"""


def test_a_key_that_a_node_lacks_is_named_and_never_sent(cluster, tmp_path, monkeypatch):
    monkeypatch.setenv("AGENTHIJACK_TEST_KEY", "very-secret-0123")
    (tmp_path / "mine.yaml").write_text(AGENT_FILE)
    config = bench(agents=(AGENTS.find(str(tmp_path / "mine.yaml")),))
    (tmp_path / "mine.yaml").unlink()  # what was read of it travels
    with pytest.raises(ClusterError, match=r"node \S+: .*AGENTHIJACK_TEST_KEY"):
        play_run(tmp_path / "run", "ray", config, cluster.address, desktops=1)
    logs = Path(cluster.head_node.get_session_dir_path())
    paths = [path for path in logs.rglob("*") if path.is_file()]
    assert paths
    assert [path for path in paths if b"very-secret-0123" in path.read_bytes()] == []


def test_nodes_without_room(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("online_env.bench.workers.BYTES_PER_DESKTOP", 2**50)
    monkeypatch.setattr(ray_pool, "BYTES_PER_DESKTOP", 2**50)
    expected = r"no node .* 1 CPU and 1.04858e\+06 GiB of memory \(\S+ has 1 CPUs and 1.5 GiB"
    with pytest.raises(ClusterError, match=expected):
        play_run(tmp_path / "run", "ray", address=cluster.address)


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:10001"])
def test_a_cluster_that_is_not_there(address, tmp_path):
    with pytest.raises(ClusterError, match=f"Ray at '{address}' cannot be used: "):
        play_run(tmp_path / "run", "ray", address=address)


def test_without_ray(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r"pip install .*\[ray\]'"):
        play_run(tmp_path / "run", "ray")


def test_engines_that_are_not_there(tmp_path):
    with pytest.raises(UnknownNameError, match=r"engine 'rya'; did you mean 'ray'"):
        play_run(tmp_path / "one", "rya")
    with pytest.raises(ParameterError, match=r"--ray-address auto is for --engine ray"):
        play_run(tmp_path / "two", address="auto")


def test_room_is_counted_in_cores_and_memory():
    assert desktops_in(8, 100 * BYTES_PER_DESKTOP) == 8
    assert desktops_in(8, 2.9 * BYTES_PER_DESKTOP) == 2
    assert desktops_in(0.5, 100 * BYTES_PER_DESKTOP) == 0


# What travels


def test_a_node_with_other_software_or_another_file_is_refused(tmp_path, monkeypatch):
    agent_file = tmp_path / "mine.py"
    agent_file.write_text("class Mine:\n    def predict(self, a, b): return '', []\n")
    config = bench(agents=(AGENTS.find(f"{agent_file}:Mine"),))
    setup = WorkerSetup(bench=config, folder=tmp_path, references=references(config))
    packed = worker_bundle.pack(setup)
    agent_file.write_text("class Mine:\n    def predict(self, a, b): return '', ['DONE']\n")
    with pytest.raises(ClusterError, match=f"{agent_file}: .*every node needs this file"):
        worker_bundle.unpack(packed, tmp_path / "node")
    agent_file.unlink()
    with pytest.raises(
        ClusterError, match=f"{agent_file}: .*No such file.*every node needs this file"
    ):
        worker_bundle.unpack(packed, tmp_path / "node")
    monkeypatch.setattr(worker_bundle, "software", lambda: {**packed.software, "numpy": "1.0"})
    with pytest.raises(ClusterError, match=r"has numpy 1.0 instead of .*install the same"):
        worker_bundle.unpack(packed, tmp_path / "node")


def test_the_code_of_the_package_is_part_of_its_software(monkeypatch):
    before = worker_bundle.software()
    assert before == worker_bundle.software()
    monkeypatch.setattr(worker_bundle, "OURS", ("hijack_data",))
    assert worker_bundle.software()[worker_bundle.CODE] != before[worker_bundle.CODE]


def test_agent_files_prompts_and_logs_travel(tmp_path, monkeypatch):
    texts = {"prompts": "pyautogui.yaml", "own": "pyautogui.yaml", "log/requests": "e.jsonl"}
    for folder, name in texts.items():
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / name).write_text(f"of {folder}")
    config = bench(agents=("mine",))
    models = ModelOptions(prompts=tmp_path / "prompts", replay=tmp_path / "log")
    agent = read_agent("gpt-4o")
    AGENTS.add(FileAgentMaker(replace(agent, prompts=str(tmp_path / "own"))), "mine")
    packed = worker_bundle.pack(WorkerSetup(bench=config, folder=tmp_path, models=models))
    shutil.rmtree(tmp_path / "own")
    (tmp_path / "node").mkdir()
    setup = worker_bundle.unpack(packed, tmp_path / "node")
    assert setup.folder == tmp_path / "node" / "run"
    assert (setup.models.prompts / "pyautogui.yaml").read_text() == "of prompts"
    assert (setup.models.replay / "e.jsonl").read_text() == "of log/requests"
    path = Path(AGENTS.get("mine").settings.prompts)
    assert path.is_relative_to(tmp_path / "node")
    assert (path / "pyautogui.yaml").read_text() == "of own"


def left_by_an_episode(folder):
    """The files of an episode and its requests, in a folder of a node."""
    entries = {
        "episodes/e/episode.json": b"{}",
        "episodes/e/frames/0000.png": b"picture",
        "episodes/e/steps.jsonl": b"steps",
        "requests/e.jsonl": b"asked",
    }
    for name, content in entries.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return entries


def test_files_are_sent_with_the_record_last_and_placed_over_what_was_broken_off(tmp_path):
    result = left_by_an_episode(tmp_path / "node")
    (tmp_path / "run" / "episodes" / "e" / "frames").mkdir(parents=True)
    (tmp_path / "run" / "episodes" / "e" / "frames" / "0007.png").touch()
    arrival = ReceivedEpisode(tmp_path / "run")
    names = []
    for name, content in take_files(tmp_path / "node"):
        names.append(name)
        arrival.put(name, content)
    assert names[-1] == "episodes/e/episode.json"
    run = tmp_path / "run"
    placed = [path for path in run.rglob("*") if path.is_file()]
    assert {str(path.relative_to(run)): path.read_bytes() for path in placed} == result
    assert list((tmp_path / "node").iterdir()) == []
    with pytest.raises(ClusterError, match=r"episodes/e: holds an episode already"):
        ReceivedEpisode(run).put("episodes/e/steps.jsonl", b"other")


def test_what_arrived_of_a_lost_episode_goes(tmp_path):
    left_by_an_episode(tmp_path / "node")
    (tmp_path / "run").mkdir()
    arrival = ReceivedEpisode(tmp_path / "run")
    for name, content in list(take_files(tmp_path / "node"))[:-1]:
        arrival.put(name, content)
    arrival.undo()
    assert [path for path in (tmp_path / "run").rglob("*") if path.is_file()] == []


@pytest.mark.parametrize(
    "name", ["run.json", "episodes/../run.json", "/etc/passwd", "", "episodes"]
)
def test_only_files_of_episodes_are_placed(name, tmp_path):
    with pytest.raises(ClusterError, match="none of an episode"):
        ReceivedEpisode(tmp_path).put(name, b"")


def test_folders_of_actors_that_were_killed_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(ray_node.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(ray_node.tempfile, "tempdir", str(tmp_path))
    old = tmp_path / f"{ray_node.PREFIX}old"
    value = tmp_path / f"{ray_node.PREFIX}held"
    for folder in (old, value):
        folder.mkdir()
        os.utime(folder, (0, 0))
    with lock(value), ray_node.node_folder() as result:
        assert sorted(tmp_path.iterdir()) == sorted([value, result])
    assert list(tmp_path.iterdir()) == [value]
