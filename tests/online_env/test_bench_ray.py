"""Benchmarks on Ray: two nodes, each with processes of its own, on this machine."""


import json
import os
import signal
import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data import ray_session
from hijack_data.errors import MissingDependencyError, ParameterError, UnknownNameError
from online_env.agents.registry import AGENTS
from online_env.bench import parcel, ray_node, ray_pool, records
from online_env.bench.config import Bench
from online_env.bench.delivery import Arrival, outgoing
from online_env.bench.jobs import jobs
from online_env.bench.models import ModelOptions
from online_env.bench.pools import open_pool
from online_env.bench.providers import PROVIDERS
from online_env.bench.runner import run_jobs
from online_env.bench.workers import MEMORY, WorkerSetup, desktops_in, references
from online_env.errors import ClusterError
from online_env.tasks import TASKS
from pipelines.proof.rebuild import rebuild

from support import nodes, waiting
from support.squares import SIZE, ClickSquare

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'agenthijack[ray]'")
cluster_utils = pytest.importorskip("ray.cluster_utils")

ROOT = Path(__file__).resolve().parents[2]
NODE = {
    "num_cpus": 1,
    "object_store_memory": 80 * 2**20,
    "memory": MEMORY,
}
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
        found = cluster_utils.Cluster(
            initialize_head=True,
            head_node_args={**NODE, "include_dashboard": False, "_system_config": SOON},
        )
        try:
            found.add_node(**NODE)
            yield found
        finally:
            found.shutdown()


@pytest.fixture(autouse=True)
def known(orders, monkeypatch):
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


def played(
    folder,
    engine="local",
    chosen=None,
    address=None,
    desktops=None,
    models=None,
    retries=0,
):
    """Run all episodes; what `run_jobs` returned."""
    chosen = chosen or bench()
    listed = jobs(chosen)
    records.create(folder, chosen.to_data(), [job.id for job in listed])
    setup = WorkerSetup(
        bench=chosen,
        folder=folder,
        references=references(chosen),
        models=models or ModelOptions(),
    )
    with open_pool(engine, setup, len(listed), desktops, address) as pool:
        return run_jobs(
            listed,
            folder,
            retries,
            pool,
            Silent(),
            at_once=pool.most,
            stop=pool.stop,
            place=pool.place,
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
    found = {record["id"]: record for record in lines_of(run / "records.jsonl")}
    for path in (run / "episodes").rglob("*"):
        name = str(path.relative_to(run))
        if path.suffix == ".png":
            found[name] = path.read_bytes()
        elif path.is_file():
            found[name] = lines_of(path)
    return found


def seen(orders):
    """The raylets on whose nodes the agents were."""
    return {int(line.split()[0]) for line in (orders / "seen").read_text().splitlines()}


def raylet(node):
    return node.all_processes["raylet"][0].process.pid


def left_over():
    """Folders of actors that are on this machine."""
    return set(Path(ray_node.tempfile.gettempdir()).glob(f"{ray_node.PREFIX}*"))


def test_a_node_that_dies_changes_nothing_and_one_that_joins_is_used(cluster, orders, tmp_path):
    before = left_over()
    played(tmp_path / "local")
    (orders / "seen").unlink()
    dying = cluster.add_node(**NODE)
    (orders / "kill_node").write_text(str(raylet(dying)))
    ended = played(tmp_path / "ray", "ray", address=cluster.address)
    assert ended == {"ok": 6}
    assert (orders / "killed_node").exists()
    assert raylet(dying) in seen(orders)
    assert content(tmp_path / "ray") == content(tmp_path / "local")
    assert len(content(tmp_path / "ray")) > 6 * 4  # records, and files of each episode
    assert rebuild(tmp_path / "ray").ok
    assert len(left_over() - before) <= 1  # of the node that was killed
    assert "True" not in (orders / "seen").read_text()  # desktops hear SIGINT


def test_a_node_that_joins_is_used(cluster, orders, tmp_path):
    (orders / "wait").touch()
    joined = []

    class Joins(Silent):
        def begins(self, job, number, attempt):
            if not joined:
                joined.append(cluster.add_node(**NODE))

        def ended(self, job, number, record):
            (orders / "wait").unlink(missing_ok=True)

    chosen = bench()
    listed = jobs(chosen)
    records.create(tmp_path / "run", chosen.to_data())
    setup = WorkerSetup(
        bench=chosen,
        folder=tmp_path / "run",
        references=references(chosen),
    )
    def wanted():
        path = orders / "seen"
        return path.exists() and raylet(joined[0]) in seen(orders)

    with open_pool("ray", setup, len(listed), None, cluster.address) as pool:
        begun = pool.desktops
        import threading

        def release():
            waiting.until(lambda: joined and wanted())
            (orders / "wait").unlink(missing_ok=True)

        thread = threading.Thread(target=release)
        thread.start()
        ended = run_jobs(listed, tmp_path / "run", 0, pool, Joins(), at_once=pool.most, stop=pool.stop, place=pool.place)
        thread.join()
    assert begun == 2
    assert ended == {"ok": 6}
    cluster.remove_node(joined[0])


def test_a_process_that_is_killed_loses_its_episode_which_is_played_again(
    cluster, orders, tmp_path
):
    (orders / "kill_me").touch()
    ended = played(
        tmp_path / "run",
        "ray",
        bench(seeds=1),
        cluster.address,
        retries=1,
    )
    assert ended == {"ok": 2}
    kept = records.read(tmp_path / "run").records
    (lost,) = [record for record in kept if record["status"] != "ok"]
    assert (lost["status"], lost["cause"], lost["score"]) == ("error", "machine", None)
    assert "the process that played the episode on" in lost["problem"]
    (again,) = [record for record in kept if record["attempt"] == 1]
    assert again["id"] == f"{lost['id']}__a1"
    assert not (tmp_path / "run" / "episodes" / lost["id"]).exists()
