"""Where a run was made, and what happens to it when a machine misbehaves: disk, clock, kills."""

import contextlib
import json
import os
import resource
import shutil
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import StorageError
from online_env.bench import episodes, providers, runner
from online_env.bench.episodes import lost_record
from online_env.bench.jobs import attempts
from online_env.errors import DesktopError, DesktopTimeoutError, MissingPackageError
from online_env.report.notes import commit_note
from online_env.results import origin, reading, records
from online_env.results.records import RunError
from pipelines.proof.rebuild import rebuild

from support.recorded import IDS, JOBS, Episodes, Silent, config, no_machine, record_run
from support.waiting import until


def git(folder, *words):
    name = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", *name, *words], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path):
    folder = tmp_path / "checkout"
    folder.mkdir()
    git(folder, "init", "-q")
    (folder / "agent.py").write_text("1\n")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "one")
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture
def run(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "run"))


def go_on(folder):
    player = Episodes(folder)
    with no_machine(), records.resume(folder, config(), IDS):
        earlier = attempts(JOBS, records.read(folder).records)
        runner.run_jobs(JOBS, folder, 1, player, Silent(), earlier)
    return player.played


# Where


def test_a_checkout_is_named_with_its_commit_and_whether_it_was_changed(checkout, tmp_path):
    (checkout / "runs").mkdir()
    (checkout / "runs" / "new.json").touch()
    clean = origin.git_state(checkout / "runs")
    assert (len(clean["commit"]), clean["dirty"]) == (40, False)
    (checkout / "agent.py").write_text("2\n")
    assert origin.git_state(checkout) == {**clean, "dirty": True}
    outside = tmp_path / "outside"
    outside.mkdir()
    assert origin.git_state(outside) is None


def test_without_git_there_is_no_state(checkout, monkeypatch):
    monkeypatch.setenv("PATH", str(checkout))
    assert origin.git_state(checkout) is None


def test_settings_of_a_checkout_name_no_program_to_run(checkout):
    hook = checkout / "hook"
    hook.write_text(f"#!/bin/sh\ntouch {checkout}/ran\n")
    hook.chmod(0o700)
    git(checkout, "config", "core.fsmonitor", str(hook))
    assert origin.git_state(checkout)["dirty"] is False
    assert not (checkout / "ran").exists()


def test_the_digest_of_a_configuration_ignores_its_file_and_the_order():
    result = config()
    entries = dict(reversed(list({**result, "source": "elsewhere.yaml"}.items())))
    assert origin.config_digest(result) == origin.config_digest(entries)
    assert origin.config_digest(result) != origin.config_digest({**result, "max_steps": 10})


def test_the_machine_is_described():
    result = origin.machine()
    assert result["cores"] == len(os.sched_getaffinity(0))
    assert result["memory"] > 2**26
    assert os.uname().release in result["kernel"]
    assert result["cpu"]
    assert 0 < origin.available_memory() <= result["memory"]


def test_the_limit_of_a_container_counts(tmp_path, monkeypatch):
    for name, text in (("_GROUP_LIMIT", "3000"), ("_GROUP_USE", "1000")):
        path = tmp_path / name
        path.write_text(text)
        monkeypatch.setattr(origin, name, path)
    assert origin.available_memory() == 2000
    (tmp_path / "_GROUP_LIMIT").write_text("max\n")
    assert origin.available_memory() > 2000


def test_a_run_keeps_where_it_was_begun_and_each_session_after_it(tmp_path):
    folder = tmp_path / "run"
    first = origin.describe(config(), desktops=3)
    records.create(folder, config(), IDS, first).release()
    head = json.loads((folder / "run.json").read_text())
    assert {key: head[key] for key in first} == first
    assert head["config_sha256"] == origin.config_digest(config())
    assert (head["desktops"], set(head["git"])) == (3, {"agenthijack", "folder"})
    assert origin.sessions(folder) == []
    go_on(folder)
    second = origin.describe(config(), desktops=1)
    records.resume(folder, config(), IDS, second).release()
    with (folder / "sessions.jsonl").open("a") as file:
        file.write('{"at": 17')  # a kill
    records.resume(folder, config(), IDS, second).release()
    result = origin.sessions(folder)
    assert [(line["records"], line["desktops"]) for line in result] == [(4, 1), (4, 1)]
    assert result[0]["versions"] == records.versions()
    assert result[0]["machine"] == first["machine"]
    assert rebuild(folder).problems == []


def test_the_commits_that_played_the_episodes_are_told(tmp_path):
    """A resume that recorded nothing is none, nor is one with the same commit."""
    folder = tmp_path / "run"
    records.create(folder, config(), IDS, code("a" * 40)).release()
    records.append_all(folder, [{"id": name} for name in IDS[:3]])
    for commit, count in (("a", 1), ("b", 2), ("c", 3), ("c", 3)):
        origin.add_session(folder, code(commit * 40, dirty=commit == "b"), count)
    assert origin.library_commits(folder, reading.read_head(folder)) == [
        (0, "aaaaaaaa"),
        (2, "bbbbbbbb with uncommitted changes"),
    ]
    (note,) = commit_note(reading.Run(folder=folder))
    assert "played the episodes: aaaaaaaa, bbbbbbbb with uncommitted changes after 2;" in note
    (folder / "sessions.jsonl").unlink()
    assert not list(commit_note(reading.Run(folder=folder)))


def code(commit, *, dirty=False):
    """The origin of a session, as far as it names the code."""
    return {"git": {"agenthijack": {"commit": commit, "dirty": dirty}, "folder": None}}


def test_other_code_is_named():
    head = {"git": {"agenthijack": {"commit": "a", "dirty": False}, "folder": None}}
    assert origin.other_code(head, head) == ""
    now = {"git": {"agenthijack": {"commit": "b", "dirty": False}, "folder": None}}
    assert "begun with commit a of agenthijack, this is b" in origin.other_code(head, now)
    assert "this is b" in origin.other_code({}, now)


# Kills and ends


def test_a_kill_before_the_first_file_is_whole_costs_nothing(tmp_path):
    folder = tmp_path / "run"
    records.hold(folder).release()
    (folder / "records.jsonl").touch()
    (folder / ".run.json.0a1b2c3d.tmp").write_text('{"for')
    with records.resume(folder, config(), IDS):
        assert sorted(path.name for path in folder.iterdir()) == [
            "lock",
            "records.jsonl",
            "run.json",
        ]
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / ".run.jsonl.tmp").touch()
    with pytest.raises(RunError, match="is not empty"):
        records.create(tmp_path / "other", config(), IDS)


def test_an_episode_that_is_whole_counts_though_its_process_was_killed(tmp_path):
    """The process ends between its last file and its answer: what is on the disk is true."""
    folder = tmp_path / "run"
    play = Episodes(folder)

    def killed_late(job, attempt):
        record = play(job, attempt)
        return {**record, "status": "error", "cause": "machine", "score": None, "problem": "ended"}

    with no_machine(), records.create(folder, config(), IDS):
        ended = runner.run_jobs(JOBS, folder, 1, killed_late, Silent())
    assert ended == {"ok": 4}
    assert play.played == [(job.corruption, 0) for job in JOBS]
    assert rebuild(folder).problems == []


@pytest.mark.parametrize("limit", [9, 1000, 2000, 4000, 12_000])
def test_a_full_disk_ends_a_run_that_goes_on_with_room(tmp_path, limit):
    """No file can grow beyond a limit, which is met in pictures, lines and records."""
    folder = tmp_path / "run"
    records.create(folder, config(), IDS).release()
    with full_at(limit), pytest.raises(StorageError, match="cannot be written"):
        go_on(folder)
    ended = len(records.read(folder).records)
    assert [attempt for _, attempt in go_on(folder)] == [0] * (len(IDS) - ended)
    assert [record["id"] for record in records.read(folder).records] == IDS
    assert rebuild(folder).problems == []


@contextlib.contextmanager
def full_at(limit):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_ctrl_c_twice_in_one_episode_is_not_the_agents_failure(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    records.create(folder, config(), IDS).release()
    for _ in range(3):
        with monkeypatch.context() as patch:
            patch.setattr("support.live.FakeDesktop.run", interrupted)
            with pytest.raises(KeyboardInterrupt):
                go_on(folder)
        assert records.read(folder).records == []
    assert go_on(folder) == [(job.corruption, 0) for job in JOBS]
    assert rebuild(folder).problems == []


def interrupted(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize("error", [DesktopError, DesktopTimeoutError])
def test_a_desktop_that_does_not_start_is_started_again(monkeypatch, error):
    """The keeper of a new desktop is killed: the run goes on."""
    desktop = pytest.importorskip("online_env.embedded.desktop")
    outcomes = [error("its keeper ended"), error("its keeper ended"), "a desktop"]
    monkeypatch.setattr(desktop.EmbeddedDesktop, "up", starting(outcomes))
    assert providers.embedded((360, 640)) == "a desktop"
    monkeypatch.setattr(desktop.EmbeddedDesktop, "up", starting([error("no")] * 3 + ["late"]))
    with pytest.raises(error, match="no"):
        providers.embedded((360, 640))


def test_what_no_second_start_mends_is_raised_at_once(monkeypatch):
    desktop = pytest.importorskip("online_env.embedded.desktop")
    outcomes = [MissingPackageError("xfce4"), "a desktop"]
    monkeypatch.setattr(desktop.EmbeddedDesktop, "up", starting(outcomes))
    with pytest.raises(MissingPackageError):
        providers.embedded((360, 640))
    assert outcomes == ["a desktop"]


def starting(outcomes):
    """What stands for the start of a desktop: each call has the next outcome."""

    def up(size, standby):
        result = outcomes.pop(0)
        if isinstance(result, Exception):
            raise result
        return result

    return up


def test_a_process_whose_runner_was_killed_as_it_began_starts_no_desktop(tmp_path):
    """Its parent is gone before it can ask to die with it."""
    code = """
        import multiprocessing, os, sys, time
        from pathlib import Path
        from online_env.bench import workers
        def late(connection, setup):
            while multiprocessing.parent_process().is_alive():
                time.sleep(0.02)
            workers._serve = lambda *_: Path(setup, "began").touch()
            workers.serve_episodes(connection, setup)
            Path(setup, "ended").touch()
        if __name__ == "__main__":
            context = multiprocessing.get_context("fork")
            here, there = context.Pipe()
            context.Process(target=late, args=(there, sys.argv[1])).start()
            os._exit(0)
    """
    argv = [sys.executable, "-c", textwrap.dedent(code), str(tmp_path)]
    subprocess.run(argv, check=True, cwd=Path(__file__).resolve().parents[2])
    until((tmp_path / "ended").exists, "the end of the process")
    assert not (tmp_path / "began").exists()


# The clock


def test_a_clock_that_is_set_changes_no_duration(tmp_path, monkeypatch):
    """Hours forth and back at each look: seconds stay what passed, and no limit is met."""
    jumps = iter(range(10**9))
    monkeypatch.setattr(time, "time", lambda: 1.7e9 + 36_000 * (-1) ** next(jumps))
    monkeypatch.setattr(episodes, "tasks", NamedTasks)
    begun = time.monotonic()
    value = lost_record(JOBS[0], 0, "why", start=begun)
    assert 0 <= value["seconds"] <= time.monotonic() - begun + 0.001
    folder = record_run(tmp_path / "run")
    for record in records.read(folder).records:
        assert (record["status"], 0 <= record["seconds"] < 60) == ("ok", True)
    assert rebuild(folder).problems == []


class NamedTasks:
    """Tasks that need no suite."""

    @staticmethod
    def get(name, seed):
        class Task:
            id = f"{name}-{seed}"
            instruction = "do"
            apps = ()
            infeasible = False

        return Task


def test_the_limit_of_an_episode_is_kept_when_the_clock_is_set_back(tmp_path, monkeypatch):
    """With the wall clock, an episode that begins before a jump would never end, or at once."""
    from online_env.agents.agent_thread import AgentThread
    from online_env.environment import CorruptedEnv

    from support.live import AT_ONCE, FakeDesktop, FakeStage
    from support.recorded import Teller

    days = iter(range(10**6))
    monkeypatch.setattr(time, "time", lambda: 1.7e9 + 86_400 * next(days))
    env = CorruptedEnv(FakeStage(FakeDesktop(), score=1.0), settle=AT_ONCE, max_steps=9)
    with no_machine(), AgentThread(Teller) as agent:
        record = episodes._play_episode(env, agent, JOBS[0], 0, None, None, 600)
    assert record["status"] == "ok", record["problem"]
