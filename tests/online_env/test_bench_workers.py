"""Processes that play episodes: what is lost when one ends, and what is not."""

import os
import pickle
import subprocess
import sys
import threading
import time

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import HijackError, UnknownNameError
from online_env.agents.agent_thread import AgentError, AgentThread
from online_env.bench import machine_pool
from online_env.bench.config import Bench
from online_env.bench.jobs import Job
from online_env.bench.machine_pool import MachinePool
from online_env.bench.runner import run_jobs
from online_env.bench.workers import LocalPool, WorkerSetup, default_desktops
from online_env.results import records
from online_env.tasks.machines import MachineSettings

from support import waiting
from support.playing import serve


class Log:
    """Keeps what it is told."""

    def __init__(self):
        self.lines = []

    def begins(self, job, number, attempt):
        self.lines.append(("begins", number, attempt))

    def ended(self, job, number, record):
        self.lines.append(("ended", number, record["attempt"]))


@pytest.fixture
def folder(tmp_path):
    records.create(tmp_path / "run", Bench().to_data())
    return tmp_path / "run"


def job(task, corruption="clean"):
    return Job("oracle", task, corruption, 0)


@pytest.fixture
def known(monkeypatch):
    """Lets a lost episode of any task be named."""
    from online_env import tasks

    monkeypatch.setattr(tasks, "get", lambda name, seed: tasks.TASKS.get("write_note")(seed))


def pool_in(folder):
    return LocalPool(WorkerSetup(bench=Bench(), folder=folder), serve=serve)


def test_jobs_run_side_by_side_and_each_is_recorded_once(folder):
    listed = [job(f"t{n}") for n in range(6)]
    log = Log()
    with pool_in(folder) as pool:
        ended = run_jobs(listed, folder, 1, pool, log, at_once=2, stop=pool.stop)
    assert ended == {"ok": 6}
    stored_records = records.read(folder).records
    assert sorted(record["task"] for record in stored_records) == [f"t{n}" for n in range(6)]
    assert len({record["process"] for record in stored_records}) == 2
    assert sorted(log.lines) == sorted(
        [("begins", n, 0) for n in range(1, 7)] + [("ended", n, 0) for n in range(1, 7)]
    )


@pytest.mark.usefixtures("known")
def test_a_process_that_is_killed_loses_its_episode_which_is_played_again(folder):
    with pool_in(folder) as pool:
        ended = run_jobs([job("t"), job("killed_once")], folder, 1, pool, Log())
    assert ended == {"ok": 2}
    first, lost_record, again = records.read(folder).records
    assert (lost_record["status"], lost_record["cause"], lost_record["score"]) == (
        "error",
        "machine",
        None,
    )
    assert "ended (exit code -9)" in lost_record["problem"]
    assert (again["status"], again["attempt"]) == ("ok", 1)
    assert again["process"] != first["process"]


@pytest.mark.usefixtures("known")
def test_who_ends_its_process_each_time_counts_as_a_failure(folder):
    with pool_in(folder) as pool:
        assert run_jobs([job("exits")], folder, 1, pool, Log()) == {"error": 1}
    assert [record["attempt"] for record in records.read(folder).records] == [0, 1]


class Episodes:
    """Plays on a machine; the task's name says what happens."""

    def __call__(self, job, attempt):
        self.hung_in_judging = job.task == "hangs"
        cause = None if job.task == "t" else "machine"
        return {"task": job.task, "status": "error", "cause": cause, "problem": "gone"}

    def desktop_works(self):
        return False


class MachineProcess:
    """Plays on a machine, in this process; it is also its own connection."""

    alive = True

    def __init__(self, setup, serve):
        self.jobs = []

    def wait_until_ready(self):
        pass

    def play(self, job, attempt):
        self.jobs.append((job, attempt))
        machine_pool._answer_calls(self, Episodes())
        record, error = pickle.loads(pickle.dumps(self.answer))
        if error is not None:
            raise error
        return record

    def recv(self):
        if not self.jobs:
            raise EOFError
        return self.jobs.pop()

    def send(self, answer):
        self.answer = answer

    def close(self):
        pass


def test_a_task_whose_judging_always_hangs_takes_no_machine_out(folder, monkeypatch):
    monkeypatch.setattr(machine_pool, "EpisodeWorker", MachineProcess)
    bench = Bench(machines=MachineSettings(vm=("http://a", "http://b")))
    notices = []
    pool = MachinePool(WorkerSetup(bench=bench, folder=folder), 2, notices.append)

    def play(task):
        with pool.reserve():  # the machines play in turn
            return pool(job(task), 0).get("desktop", {}).get("machine")

    assert [play("hangs") for _ in range(7)] == ["http://a", "http://b"] * 3 + ["http://a"]
    assert notices == [
        "judging hangs hung on http://a and http://b: the task is at fault, both play on"
    ]
    assert [play("dies") for _ in range(3)] == ["http://b", "http://a", "http://b"]
    assert notices[1:] == ["http://b is taken out: gone (1 machines left)"]


@pytest.mark.parametrize(
    ("task", "error"), [("refused", UnknownNameError), ("unportable", HijackError)]
)
def test_what_refuses_an_episode_ends_the_run(folder, task, error):
    with pool_in(folder) as pool, pytest.raises(error):
        run_jobs([job(task), job("t")], folder, 1, pool, Log())
    assert records.read(folder).records == []


def test_a_process_that_cannot_begin_ends_the_run_with_its_reason(folder):
    setup = WorkerSetup(bench=Bench(provider="none"), folder=folder)
    with LocalPool(setup) as pool, pytest.raises(UnknownNameError, match="provider 'none'"):
        run_jobs([job("t")], folder, 1, pool, Log())
    assert records.read(folder).records == []


def test_a_run_that_is_broken_off_ends_its_processes_and_records_nothing_half_done(folder):
    class Interrupt(Log):
        def begins(self, job, number, attempt):
            if number == 3:
                waiting.until(lambda: list(folder.glob("slow-*")))
                raise KeyboardInterrupt

    started = time.monotonic()
    with pool_in(folder) as pool, pytest.raises(KeyboardInterrupt):
        run_jobs(
            [job("slow"), job("t"), job("u")],
            folder,
            0,
            pool,
            Interrupt(),
            at_once=2,
            stop=pool.stop,
        )
    assert time.monotonic() - started < 50
    assert [record["task"] for record in records.read(folder).records] == ["t"]
    (slow,) = folder.glob("slow-*")
    with pytest.raises(ProcessLookupError):
        os.kill(int(slow.read_text()), 0)


REFERENCES = """
import sys
from online_env.bench.config import load_bench, override
from online_env.bench.workers import load_references, references
bench = override(load_bench("embedded_small"), agent=f"{sys.argv[1]}:Mine,oracle")
print(references(bench))
load_references(references(bench))
"""


def test_files_of_users_are_loaded_in_the_processes(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("class Mine:\n    def predict(self, a, b): return '', []\n")
    process = subprocess.run(
        [sys.executable, "-c", REFERENCES, str(path)], capture_output=True, text=True, check=True
    )
    assert f"reference=AgentReference(place='{path}:Mine'" in process.stdout


def test_there_is_always_one_desktop():
    assert 1 <= default_desktops() <= (os.cpu_count() or 1)


def test_an_agent_that_hangs_is_left_behind():
    class Hangs:
        def predict(self, instruction, obs):
            threading.Event().wait(5)

    with AgentThread(Hangs, timeout=0.2) as agent:
        with pytest.raises(AgentError, match=r"no answer within 0\.2 s"):
            agent.predict("", {})
        with pytest.raises(AgentError, match="still works on a call"):
            agent.predict("", {})
