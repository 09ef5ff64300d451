"""Agents and episodes, with a machine of straw: what an agent is shown, and what becomes of its
answers."""

import json
import threading

import numpy as np
import pytest

from hijack_data.errors import UnknownNameError

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("lxml", reason="needs the extra [online]")

from online_env import tasks
from online_env.agents import registry as agents
from online_env.agents.agent_thread import AgentError, AgentThread
from online_env.agents.base import Privileged
from online_env.agents.oracle import Oracle
from online_env.bench.episodes import _play_episode, play
from online_env.bench.jobs import Job
from online_env.desktops.protocol import CAPABILITIES, RunResult
from online_env.errors import DesktopError, MissingCapabilityError

from support.episodes import make

JOB = Job("oracle", "write_note", "marks", 0)
SIZE = (1080, 1920)


class Straw:
    """A desktop that notes what is asked of it."""

    size = SIZE
    capabilities = CAPABILITIES

    def __init__(self):
        self.looks = 0

    def accessibility(self):
        self.looks += 1
        return "<desktop/>"

    def screenshot(self):
        return np.zeros((*SIZE, 3), np.uint8)

    def execute(self, argv, timeout=60):
        return RunResult("success", "/home/user", "", 0)

    def read_file(self, path):
        return b"x"

    def run(self, code):
        raise AssertionError("an oracle acts through the environment only")


class Steps(tasks.Task):
    """Looks, clicks and types."""

    name = "steps"
    apps = ()
    phrasings = ("do it",)

    def problems(self, machine):
        return iter(())

    def oracle(self, hand):
        hand.look()
        hand.run("pyautogui.click(960, 540)")
        hand.type("Grüße (10, 20)")
        self.end(hand)

    def end(self, hand):
        hand.press("ctrl", "s")


class Failing(Steps):
    """Does not find what it needs."""

    def end(self, hand):
        raise DesktopError("no button Save came up")


class Impossible(Steps):
    """Cannot be done."""

    infeasible = "there is no such button"

    def end(self, hand):
        hand.give_up("There is no button Send.")


def observation(size=SIZE):
    return {"screenshot": np.zeros((*size, 3), np.uint8)}


def oracle_for(task):
    oracle, desktop = Oracle(), Straw()
    oracle.reset()
    oracle.prepare(task, tasks.Machine(desktop))
    return oracle, desktop


def actions_of(oracle, size=SIZE, most=10):
    items = []
    while len(items) < most and items[-1:] not in (["DONE"], ["FAIL"]):
        output, actions = oracle.predict("do it", observation(size))
        items += actions
    return items, output


# The oracle


def test_the_oracle_hands_out_its_solution_one_action_at_a_time():
    oracle, desktop = oracle_for(Steps())
    assert oracle.predict("do it", observation()) == ("", ["pyautogui.click(960, 540)"])
    assert desktop.looks == 1
    value, output = actions_of(oracle)
    assert value == ["pyautogui.write('Grüße (10, 20)')", "pyautogui.hotkey('ctrl', 's')", "DONE"]
    assert output == "The task is done."
    assert oracle.predict("do it", observation())[1] == ["DONE"]  # asked again, it does not hang


def test_its_actions_are_in_pixels_of_what_it_sees():
    oracle, _ = oracle_for(Steps())
    value, _ = actions_of(oracle, size=(540, 960))
    assert value[0] == "pyautogui.click(480, 270)"
    assert value[1] == "pyautogui.write('Grüße (10, 20)')"


def test_an_oracle_that_cannot_go_on_says_why():
    oracle, _ = oracle_for(Failing())
    value, output = actions_of(oracle)
    assert value[-1] == "FAIL"
    assert output == "DesktopError: no button Save came up"


def test_the_oracle_of_a_task_that_cannot_be_done_answers_fail():
    oracle, _ = oracle_for(Impossible())
    value, output = actions_of(oracle)
    assert (value[-1], output) == ("FAIL", "There is no button Send.")


def test_an_oracle_that_lost_its_way_does_not_pass_for_one_that_gave_up():
    class Lost(Failing):
        infeasible = "there is no such button"

    value, output = actions_of(oracle_for(Lost())[0])
    assert (value[-1], output) == ("DONE", "DesktopError: no button Save came up")


def test_reset_ends_a_solution_that_still_waits():
    before = threading.active_count()
    oracle, _ = oracle_for(Steps())
    oracle.predict("do it", observation())
    assert threading.active_count() == before + 1
    oracle.reset()
    assert threading.active_count() == before
    with pytest.raises(DesktopError, match="call prepare"):
        oracle.predict("do it", observation())
    oracle.prepare(Steps(), tasks.Machine(Straw()))
    assert actions_of(oracle)[0][-1] == "DONE"


def test_the_stand_in_changes_nothing_behind_the_screen():
    oracle, _ = oracle_for(Steps())
    stand_in = oracle._desktop
    assert stand_in is not None
    with pytest.raises(DesktopError, match="has to use the applications"):
        stand_in.write_file("x", b"")
    with pytest.raises(DesktopError, match="cannot reset"):
        stand_in.reset()


# The others


def test_do_nothing_outwaits_every_corruption_of_the_paper():
    agent = agents.make("do_nothing")
    for _ in range(2):
        agent.reset()
        output = [agent.predict("", observation())[1] for _ in range(6)]
        assert output == [["WAIT"]] * 5 + [["DONE"]]


def test_names():
    assert agents.names()[:3] == ("oracle", "recovering", "do_nothing")
    assert set(agents.names()) >= {"random", "fail", "scripted"}
    assert isinstance(agents.make("oracle"), Privileged)
    assert not isinstance(agents.make("do_nothing"), Privileged)
    with pytest.raises(UnknownNameError, match="did you mean 'oracle'"):
        agents.make("oracl")


# Episodes


class Env:
    """Ends after `steps` actions, or as it is told."""

    def __init__(self, steps=3, fails=None):
        self.steps, self.fails, self.done, self.record, self.options = steps, fails, [], None, {}
        self.said = ""

    def obs(self):
        return {"screenshot": np.full((2, 2, 3), len(self.done), np.uint8), "instruction": "do it"}

    def reset(self, *, seed=None, options=None):
        self.options = {"seed": seed, **(options or {})}
        if self.fails is not None:
            raise self.fails
        return self.obs(), {}

    def step(self, action):
        assert self.record is None, "stepped after the end"
        self.done.append(action)
        if len(self.done) == self.steps:
            self.record = {"status": "ok", "score": 0.5, "said": self.said}
        return self.obs(), 0.0, False, False, {}

    def record_message(self, said):
        self.said = said

    def declare_privileged_inputs(self, what):
        self.given = list(what)

    def abandon(self, why, traceback=()):
        self.record = {
            "status": "error",
            "score": None,
            "problem": why,
            "steps": len(self.done),
            "said": self.said,
            "traceback": list(traceback),
        }


class Speaker:
    """Answers with what it is given, and keeps what it was shown."""

    def __init__(self, *answers):
        self.answers, self.shown, self.resets = list(answers), [], 0

    def reset(self):
        self.resets += 1

    def predict(self, instruction, obs):
        self.shown.append((instruction, obs))
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return f"said {len(self.shown)}", answer


def test_an_agent_is_shown_instruction_and_screenshot_and_nothing_else():
    env, agent = Env(), Speaker(["a"], ["b", "c"])
    record = play(env, agent, JOB, 0, None)
    assert record == {"status": "ok", "score": 0.5, "said": "said 2"}
    assert env.done == ["a", "b", "c"]
    assert agent.resets == 1
    assert [(text, set(obs)) for text, obs in agent.shown] == [("do it", {"screenshot"})] * 2
    assert [obs["screenshot"][0, 0, 0] for _, obs in agent.shown] == [0, 1]
    assert env.options == {
        "seed": 0,
        "task": "write_note",
        "corruption": None,
        "label": "marks",
        "attempt": 0,
    }


def test_actions_after_the_end_are_dropped_and_none_counts_as_one():
    env, agent = Env(steps=2), Speaker([], ["a", "b", "c"])
    play(env, agent, JOB, 0, None)
    assert env.done == ["", "a"]


def test_an_agent_needs_no_reset():
    class Plain:
        def predict(self, instruction, obs):
            return instruction, ["a"]

    record = play(Env(steps=2), Plain(), JOB, 0, None)
    assert (record["status"], record["said"]) == ("ok", "do it")


def test_what_is_made_without_predict_is_the_agents_error():
    record = play(Env(), object(), JOB, 0, None)
    assert (record["status"], record["score"]) == ("error", None)
    assert record["problem"] == "the agent raised object has no predict(instruction, obs)"


def test_an_agent_that_raises_makes_an_error_not_a_crash():
    record = play(Env(), Speaker(["a"], ZeroDivisionError("oops")), JOB, 2, None)
    assert (record["status"], record["score"]) == ("error", None)
    assert record["problem"] == "the agent raised ZeroDivisionError: oops"
    assert (record["steps"], record["said"]) == (1, "said 1")


class Broken:
    """Says something, and breaks two calls deep."""

    def __init__(self):
        self.threads = set()

    def reset(self):
        self.threads.add(threading.get_ident())

    def predict(self, instruction, obs):
        self.threads.add(threading.get_ident())
        if len(self.threads) == 1 and instruction == "Open the file" and not hasattr(self, "spoke"):
            self.spoke = True
            return "I look", ["WAIT", "WAIT"]
        return self.see()

    def see(self):
        raise ValueError("my bug")


@pytest.mark.usefixtures("no_waiting")
def test_words_and_tracebacks_are_kept_where_the_agent_left_them(tmp_path):
    env, _ = make(log=tmp_path)
    agent = Broken()
    record = play(env, agent, Job("oracle", "write_note", "clean", 0), 0, None)
    assert len(agent.threads) == 1, "one thread, which libraries may tie themselves to"
    assert threading.get_ident() not in agent.threads
    assert (record["status"], record["score"], record["cause"]) == ("error", None, "agent")
    assert record["problem"] == "the agent raised ValueError: my bug"
    functions = [frame.partition(" in ")[2].partition(":")[0] for frame in record["traceback"]]
    assert functions == ["predict", "see"]
    assert all(frame.startswith(f"{__file__}:") for frame in record["traceback"])
    assert record["traceback"][-1].endswith('raise ValueError("my bug")')
    home = tmp_path / "episodes" / record["id"]
    assert json.loads((home / "episode.json").read_text()) == record == env.record
    lines = [json.loads(line) for line in (home / "steps.jsonl").read_text().splitlines()]
    assert [line["said"] for line in lines] == ["I look", None, None]
    assert record["said"] == "I look"


@pytest.mark.parametrize(
    "answer", [None, "DONE", ("x",), ("x", "DONE"), (None, ["DONE"]), (1, 2), ("x", 5)]
)
def test_an_answer_that_is_none_is_the_agents_failure_and_no_crash(answer):
    class Odd:
        def reset(self):
            pass

        def predict(self, instruction, obs):
            return answer

    record = play(Env(), Odd(), JOB, 0, None)
    assert record["status"] == "error"
    assert "predict must return (text, [actions])" in record["problem"]


def test_an_agent_that_raises_while_it_is_reset_has_failed():
    class Resetting(Speaker):
        def reset(self):
            raise KeyError("x")

    record = play(Env(), Resetting(), JOB, 0, None)
    assert (record["status"], record["problem"]) == ("error", "the agent raised KeyError: 'x'")


def test_a_desktop_that_fails_at_first_makes_an_invalid_episode_but_what_it_lacks_is_raised():
    env = Env(fails=DesktopError("gone"))
    env.record = {
        "status": "invalid",
        "score": None,
        "task": "write_note",
        "effects": [{"step": -1}],
    }
    for record, effects in (
        (play(env, Speaker(), JOB, 0, None), [{"step": -1}]),
        (play(Env(fails=DesktopError("gone")), Speaker(), JOB, 0, None), []),
    ):
        assert (record["status"], record["problem"]) == ("invalid", "DesktopError: gone")
        # pairs with the clean episode
        assert (record["task"], record["effects"]) == ("write_note-0", effects)
    with pytest.raises(MissingCapabilityError):
        play(Env(fails=MissingCapabilityError("no locker")), Speaker(), JOB, 0, None)
    env.fails = MissingCapabilityError("no locker")  # once something was done it is an episode
    assert play(env, Speaker(), JOB, 0, None)["status"] == "invalid"


class Prepared(Speaker):
    def prepare(self, task, machine):
        raise NotImplementedError


class PreparedAndTold(Prepared):
    uses_plan = True

    def follow(self, lines):
        self.lines = lines


class Planless(Speaker):
    uses_plan = False


@pytest.mark.parametrize(
    ("kind", "given"),
    [(Speaker, []), (Planless, []), (Prepared, ["task"]), (PreparedAndTold, ["task", "plan"])],
)
def test_only_the_privileged_are_shown_more_and_the_record_says_so(kind, given):
    env, items = Env(steps=1), []
    with AgentThread(lambda: kind(["a"])) as agent:
        _play_episode(
            env,
            agent,
            JOB,
            0,
            None,
            lambda agent, job: items.append((agent, job)),
            read_plan=lambda: ("wait",),
        )
    assert [job for _, job in items] == ([JOB] if "task" in given else [])
    assert env.given == given


def test_what_an_agent_was_given_is_kept_though_it_raised_over_it():
    def raises(agent, job):
        raise ValueError("no")

    env = Env(steps=1)
    assert play(env, Prepared(["a"]), JOB, 0, None, raises)["status"] == "error"
    assert env.given == ["process", "task"]


class Unspeakable(Exception):
    def __str__(self):
        raise RuntimeError("nothing")

    __repr__ = __str__


class Unspeaking:
    """Its exception, its answer or its very attributes raise when they are looked at."""

    def __init__(self, how):
        self.how = how

    def __getattribute__(self, name):
        if name == "predict" and object.__getattribute__(self, "how") == "attribute":
            raise Unspeakable
        return object.__getattribute__(self, name)

    def predict(self, instruction, obs):
        if self.how == "raises":
            raise Unspeakable
        return Unspeakable()


@pytest.mark.parametrize(
    ("how", "problem"),
    [
        ("raises", "Unspeakable, whose text cannot be shown"),
        ("answers", "RuntimeError: nothing"),
        ("attribute", "Unspeakable, whose text cannot be shown"),
    ],
)
def test_what_cannot_be_shown_ends_an_episode_and_not_the_run(how, problem):
    with (
        AgentThread(lambda: Unspeaking(how)) as agent,
        pytest.raises(AgentError, match=f"^{problem}$"),
    ):
        agent.predict("do it", {})
