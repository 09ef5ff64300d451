"""Agents in processes of their own: what they get, what their failures cost, and what is ended."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import ParameterError, PluginError, UnknownNameError
from hijack_data.runs.run_log import MAX_TEXT
from online_env.agents import agent_process, registry
from online_env.agents.agent_calls import AgentError
from online_env.agents.agent_process import AgentProcess
from online_env.bench import models
from online_env.bench.config import Bench
from online_env.bench.episodes import LiveEpisodes
from online_env.bench.jobs import Job

from support.live import AT_ONCE, FakeDesktop, FakeStage
from support.waiting import until

CODE = '''
import ctypes, json, multiprocessing, os, signal, sys, time
from pathlib import Path

HERE = Path(__file__).parent
with (HERE / "importers").open("a") as file:
    file.write(f"{os.getpid()}\\n")


def stay():
    time.sleep(1000)


def helper(questions, answers):
    while True:
        answers.put(questions.get() * 2)


class Any:
    """Does what the instruction says."""

    def predict(self, instruction, obs):
        return getattr(self, instruction)(obs) or ("", ["DONE"])

    def exit(self, obs):
        os._exit(9)

    def crash(self, obs):
        ctypes.string_at(0)

    def orphan(self, obs):
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(1000)

    def hang(self, obs):
        time.sleep(1000)

    def grow(self, obs):
        self.data = bytearray(os.urandom(1)) * 300_000_000
        time.sleep(1000)

    def babble(self, obs):
        for number in range(3, 2000):
            try:
                os.write(number, b"x" * 100)
            except OSError:
                pass
        time.sleep(1000)

    def leave(self, obs):
        sys.exit("enough")

    def odd(self, obs):
        return "", [3, "WAIT"]

    def giant(self, obs):
        return "a" * 20_000_000, ["b" * 20_000_000]

    def many(self, obs):
        return "", ["WAIT"] * 1001

    def close(self, obs):
        os.close(0)

    def paint(self, obs):
        obs["screenshot"][:] = 7
        return str(obs["screenshot"].sum()), ["DONE"]

    def fork(self, obs):
        if os.fork() == 0:
            stay()

    def both(self, obs):
        os.fork()
        return str(int(obs["screenshot"].sum())), ["DONE"]

    def helped(self, obs):
        questions, answers = multiprocessing.Queue(), multiprocessing.Queue()
        multiprocessing.Process(target=helper, args=(questions, answers)).start()
        questions.put(21)
        return str(answers.get()), ["DONE"]

    def daemon(self, obs):
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                (HERE / "daemon").write_text(str(os.getpid()))
                stay()
            os._exit(0)
        os.wait()

    def look(self, obs):
        found = {
            "files": sorted(os.listdir("/proc/self/fd")),
            "folder": os.getcwd(),
            "environment": dict(os.environ),
            "modules": sorted(sys.modules),
            "words": sys.argv,
        }
        return json.dumps(found), ["DONE"]


class Fragile(Any):
    def predict(self, instruction, obs):
        os._exit(7)


class Wants(Any):
    def prepare(self, task, machine):
        self.task = task


def made():
    return Wants()
'''
PICTURE = np.full((40, 60, 3), 1, np.uint8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("agents")
    (folder / "mine.py").write_text(CODE)
    before = dict(registry.AGENTS.entries)
    yield folder
    registry.AGENTS.entries.clear()
    registry.AGENTS.entries.update(before)


@pytest.fixture(scope="module")
def name(folder):
    return registry.AGENTS.find(f"{folder}/mine.py:Any")


@pytest.fixture
def agent(name):
    with AgentProcess(registry.AGENTS.get(name), 20, memory=250 * 2**20) as agent:
        agent.make()
        yield agent


def ask(agent, word):
    return agent.predict(word, {"screenshot": PICTURE})


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_no_code_of_an_agent_is_imported_by_the_runner(folder, agent):
    importers = {int(pid) for pid in (folder / "importers").read_text().split()}
    assert os.getpid() not in importers
    assert len(importers) >= 2, "the one that described it, and the agent's own"


def test_an_agent_gets_instruction_and_picture_and_nothing_of_ours(name, monkeypatch):
    monkeypatch.setenv("AGENTHIJACK_SERVE_TOKEN", "secret")
    monkeypatch.setenv("MY_API_KEY", "mine")
    read, write = os.pipe()
    os.set_inheritable(write, True)
    try:
        with AgentProcess(registry.AGENTS.get(name), 20) as agent:
            agent.make()
            result = eval(ask(agent, "look")[0])
    finally:
        os.close(read)
        os.close(write)
    assert len(result["files"]) == 6, "0 to 2, its connection, the pictures, and the list itself"
    assert result["environment"]["MY_API_KEY"] == "mine", "its own keys are its own"
    assert "secret" not in result["environment"].values()
    assert Path(result["folder"]).name.startswith("agent-")
    assert not Path(result["folder"]).exists(), "it ends with the agent"
    assert result["words"] == ["agent"]
    module_names = set(result["modules"])
    assert not {"online_env.environment", "online_env.bench", "online_env.tasks"} & module_names


@pytest.mark.parametrize(
    ("word", "problem"),
    [
        ("exit", "its process died (exit code 9)"),
        ("crash", "its process died (SIGSEGV)"),
        ("grow", "its process used more than 0.2 GiB of memory (--agent-memory)"),
        ("orphan", "its process died, and its supervisor with it"),
        ("babble", "its process sent a message of 2021161080 bytes, of which 16777216 are allowed"),
        ("leave", "SystemExit: enough"),
        ("many", "an answer has at most 1000 actions, got 1001"),
    ],
)
def test_what_fails_is_told_and_the_next_object_is_made(word, problem, agent):
    with pytest.raises(AgentError) as caught:
        ask(agent, word)
    assert str(caught.value) == problem
    if word == "crash":
        assert any("string_at" in line for line in caught.value.frames), "where native code crashed"
    agent.make()
    assert ask(agent, "close") == ("", ["DONE"])


def test_an_agent_that_hangs_is_ended(name):
    with AgentProcess(registry.AGENTS.get(name), 1) as agent:
        agent.make()
        with pytest.raises(AgentError, match=r"^no answer within 1 s$"):
            ask(agent, "hang")
        assert not agent.alive
        with pytest.raises(AgentError, match=r"^its process has ended$"):
            agent.reset()


@pytest.mark.parametrize("word", ["close", "fork", "daemon", "odd"])
def test_what_does_no_harm_is_no_failure(word, agent):
    output, actions = ask(agent, word)
    assert (output, [repr(action) for action in actions]) == (
        "",
        ["3", "'WAIT'"] if word == "odd" else ["'DONE'"],
    )


def test_a_picture_is_the_agents_own_and_a_forked_child_does_not_answer(agent):
    assert ask(agent, "paint") == (str(7 * PICTURE.size), ["DONE"])
    assert ask(agent, "both") == (str(PICTURE.size), ["DONE"])
    assert ask(agent, "both") == (str(PICTURE.size), ["DONE"])
    assert ask(agent, "helped") == ("42", ["DONE"])


def test_a_giant_answer_is_cut(agent):
    output, (action,) = ask(agent, "giant")
    assert (len(output), len(action)) == (MAX_TEXT + 1, MAX_TEXT + 1)


def daemon_in(folder):
    """The process that the word "daemon" leaves, once it says so."""
    file = folder / "daemon"
    until(lambda: file.exists() and file.read_text(), "the daemon to begin")
    daemon = int(file.read_text())
    file.unlink()
    assert is_running(daemon)
    return daemon


def test_all_that_an_agent_started_ends_with_it(folder, name):
    (folder / "daemon").unlink(missing_ok=True)
    with AgentProcess(registry.AGENTS.get(name), 20) as agent:
        agent.make()
        ask(agent, "daemon")
        daemon = daemon_in(folder)
    until(lambda: not is_running(daemon), "the daemon to end")


RUNNER = """
import sys, time
import numpy as np
from online_env.agents.agent_process import AgentProcess, describe

with AgentProcess(describe(sys.argv[1]), 20) as agent:
    agent.make()
    agent.predict("daemon", {"screenshot": np.zeros((4, 4, 3), np.uint8)})
    print(agent.pid, agent._process._folder, flush=True)
    time.sleep(1000)
"""


def test_an_agent_ends_with_its_runner(folder):
    (folder / "daemon").unlink(missing_ok=True)
    words = [sys.executable, "-c", RUNNER, f"{folder}/mine.py:Any"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as runner:
        try:
            pid, agent_folder = runner.stdout.readline().split()
            daemon = daemon_in(folder)
        finally:
            runner.send_signal(signal.SIGKILL)
    until(lambda: not is_running(int(pid)) and not is_running(daemon), "all to end")
    until(lambda: not Path(agent_folder).exists(), "its folder to be removed")


def test_pictures_are_in_a_file_where_the_system_has_no_memory_files(name, monkeypatch):
    monkeypatch.delattr(agent_process.os, "memfd_create")
    with AgentProcess(registry.AGENTS.get(name), 20) as agent:
        agent.make()
        assert ask(agent, "both") == (str(PICTURE.size), ["DONE"])


def test_what_an_agent_prints_steers_no_terminal(folder, capfd):
    file = folder / "loud.py"
    body = r"""
    class Loud:
        def predict(self, instruction, obs):
            print("\x1b[31mred", "x" * 100_000)
            return "", ["DONE"]
    """
    file.write_text(textwrap.dedent(body))
    name = registry.AGENTS.find(f"{file}:Loud")
    with AgentProcess(registry.AGENTS.get(name), 20) as agent:
        agent.make()
        ask(agent, "")
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("\ufffd[31mred xxx")
    assert printed.err.endswith("(more that the agent prints is left out)\n")
    assert len(printed.err) < 70_000


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("mine.py:An", UnknownNameError, "has no 'An'; did you mean 'Any'"),
        ("none.py:Any", PluginError, "No such file"),
        ("mine.py:stay", None, ""),
        (
            "mine.py:HERE",
            ParameterError,
            "an agent is a class, or a function that returns an agent",
        ),
    ],
)
def test_what_is_no_agent_is_refused_before_the_run(text, kind, message, folder):
    if kind is None:
        assert registry.AGENTS.find(f"{folder}/{text}")
        return
    with pytest.raises(kind, match=message):
        registry.AGENTS.find(f"{folder}/{text}")


# Episodes


@pytest.fixture
def bench_of(monkeypatch, no_waiting):
    monkeypatch.setattr(FakeDesktop, "settle", AT_ONCE, raising=False)

    def make(name, **options):
        return Bench(agents=(name,), tasks=("write_note",), corruptions={"clean": None}, **options)

    return make


def play_jobs(bench, folder, count=1):
    (name,) = bench.agents
    with LiveEpisodes(bench, folder, FakeStage()) as play:
        return [play(Job(name, "write_note", "clean", seed), 0) for seed in range(count)]


def test_a_crash_is_the_agents_failure_and_the_next_episode_is_played(folder, tmp_path, bench_of):
    name = registry.AGENTS.find(f"{folder}/mine.py:Fragile")
    for record in play_jobs(bench_of(name), tmp_path, 2):
        assert (record["status"], record["cause"], record["given"]) == ("error", "agent", [])
        assert record["problem"] == "the agent raised its process died (exit code 7)"


def test_an_agent_in_the_runners_process_is_recorded(folder, tmp_path, bench_of):
    name = registry.AGENTS.find(f"{folder}/mine.py:Wants")
    with pytest.raises(ParameterError, match="use --in-process"):
        models.check_agents(bench_of(name))
    config = bench_of(name, in_process=True)
    models.check_agents(config)
    assert config.to_data()["in_process"]
    (record,) = play_jobs(config, tmp_path)
    assert record["given"] == ["task", "process"]
    maker = registry.AGENTS.find(f"{folder}/mine.py:made")  # only its object says what it wants
    (record,) = play_jobs(bench_of(maker), tmp_path)
    assert (record["status"], record["cause"]) == ("error", "agent")
    assert "use --in-process" in record["problem"]
