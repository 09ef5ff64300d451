"""Agents of other frameworks: what they are given, what becomes of their answers, how they end."""

import io
import threading

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("lxml", reason="needs the extra [online]")

from hijack_data.errors import MissingDependencyError, ParameterError, ParameterTypeError
from online_env.agents.adapters import AgentS, CuaAgent, LoopAgent, OsworldAgent
from online_env.agents.registry import AGENTS
from online_env.bench.episodes import play

from support import waiting
from support.squares import JOB, SIZE, ClickSquare, middle_of_square, register_square, square_env

pytestmark = pytest.mark.usefixtures("no_waiting")


@pytest.fixture(autouse=True)
def square(monkeypatch):
    register_square(monkeypatch)


SEEN = {"screenshot": np.full((60, 80, 3), 7, np.uint8)}


class Wrapped:
    """An agent of OSWorld's shape, with the answer that a test wants."""

    def __init__(self, answer=("I wait", ["WAIT"])):  # noqa: B006
        self.answer, self.asked, self.resets = answer, [], []

    def reset(self, _logger=None, vm_ip=None, **kwargs):
        self.resets.append(_logger)

    def predict(self, instruction, obs):
        self.asked.append((instruction, obs))
        return self.answer


# OSWorld's shape


def test_an_agent_of_osworld_gets_a_png_and_the_instruction_and_nothing_else():
    wrapped = Wrapped()
    assert OsworldAgent(wrapped).predict("do it", SEEN) == ("I wait", ["WAIT"])
    [(instruction, obs)] = wrapped.asked
    assert instruction == "do it"
    assert set(obs) == {"screenshot", "accessibility_tree"}
    assert obs["accessibility_tree"] == ""
    picture = Image.open(io.BytesIO(obs["screenshot"]))
    assert picture.format == "PNG"
    assert np.array_equal(np.asarray(picture), SEEN["screenshot"])


@pytest.mark.parametrize(
    ("actions", "expected"),
    [
        (["pyautogui.click(1, 2)", "DONE"], ["pyautogui.click(1, 2)", "DONE"]),
        ("FAIL", ["FAIL"]),
        (None, []),
        ([{"action_type": "CLICK", "x": 3, "y": 4}], ["pyautogui.click(3, 4)"]),
        ([{"action_type": "SCROLL", "parameters": {"dx": 2, "dy": 0}}], ["pyautogui.hscroll(2)"]),
        ({"action_type": "DONE"}, ["DONE"]),
        ([{"name": "computer", "command": "pyautogui.press('a')"}], ["pyautogui.press('a')"]),
        (
            [{"action_space": "pyautogui", "action": "pyautogui.press('b')", "call_id": "x"}],
            ["pyautogui.press('b')"],
        ),
    ],
)
def test_actions_are_code_words_or_dicts(actions, expected):
    agent = OsworldAgent(Wrapped(("", actions)))
    assert agent.predict("do it", SEEN) == ("", expected)


@pytest.mark.parametrize(
    "action",
    [
        {"action_type": "JUMP"},
        {"action_type": "CLICK", "x": "12", "y": 3},
        {"action_type": "CLICK", "x": float("nan"), "y": 3},
        5,
        ["```python\npyautogui.click(1, 2)\n```"],
    ],
)
def test_an_action_that_cannot_be_read_is_a_malformed_step(action):
    env, desktop = square_env(max_steps=1)
    record = play(env, OsworldAgent(Wrapped(("", [action]))), JOB, 0, None)
    assert (record["status"], record["malformed"], record["steps"]) == ("ok", 1, 1)
    assert record["last_action"].startswith("unreadable action: ")
    assert desktop.ran == []


def test_words_may_be_a_dict_and_more_may_follow_the_actions():
    agent = OsworldAgent(Wrapped(({"plan": "wait", "at": {1}}, ["WAIT"], {"more": 1})))
    output, actions = agent.predict("do it", SEEN)
    assert (output, actions) == ('{"plan": "wait", "at": "{1}"}', ["WAIT"])
    with pytest.raises(ParameterTypeError, match=r"must return \(response, actions\)"):
        OsworldAgent(Wrapped("DONE")).predict("do it", SEEN)


def test_a_subclass_with_an_attribute_is_an_agent_for_the_command_line(tmp_path):
    file = tmp_path / "my.py"
    file.write_text(
        "from online_env.agents.adapters import OsworldAgent\n"
        "class Theirs:\n"
        "    def predict(self, instruction, obs): return instruction, ['DONE']\n"
        "def make(): return Theirs()\n"
        "class MyAgent(OsworldAgent):\n"
        "    wrapped = Theirs\n"
        "class Made(OsworldAgent):\n"
        "    wrapped = make\n"
        "class Shared(OsworldAgent):\n"
        "    wrapped = Theirs()\n"
    )
    for name in ("MyAgent", "Made", "Shared"):
        maker = AGENTS.get(AGENTS.find(f"{file}:{name}"))
        assert maker().predict("do it", SEEN) == ("do it", ["DONE"])
        assert (maker().agent is maker().agent) == (name == "Shared")


def test_a_reset_that_needs_a_logger_gets_one_and_one_that_needs_more_is_refused():
    class Logging(Wrapped):
        def reset(self, runtime_logger):
            self.resets.append(runtime_logger)

    class Needing(Wrapped):
        def reset(self, env):
            raise AssertionError

    wrapped = Wrapped()
    OsworldAgent(wrapped).reset()
    assert wrapped.resets == [None]
    logging = Logging()
    OsworldAgent(logging).reset()
    assert logging.resets[0].name == "desktopenv.agent"
    with pytest.raises(ParameterTypeError, match="reset needs env; only a logger"):
        OsworldAgent(Needing()).reset()


def test_what_cannot_be_wrapped_is_refused():
    class Treeful(Wrapped):
        observation_type = "screenshot_a11y_tree"

    with pytest.raises(ParameterError, match="give it a class attribute `wrapped`"):
        OsworldAgent()
    with pytest.raises(ParameterTypeError, match="has no predict"):
        OsworldAgent(object())
    with pytest.raises(ParameterError, match="agents see the screen only"):
        OsworldAgent(Treeful())


# Loops


def loop_threads():
    return [thread for thread in threading.enumerate() if thread.name == "loop"]


def ended():
    waiting.until(lambda: not loop_threads(), "the threads to end")


def clicking(computer, instruction):
    """A loop that does the task, and looks before and after."""
    point = middle_of_square(computer.screenshot())
    after = computer.act(f"pyautogui.click{point}", said="there it is")
    assert middle_of_square(after) is None
    assert np.array_equal(after, computer.screenshot())
    assert instruction == ClickSquare.phrasings[0]
    return "clicked"


def test_each_action_of_a_loop_is_a_step_and_its_end_is_done():
    env, desktop = square_env()
    agent = LoopAgent(clicking)
    record = play(env, agent, JOB, 0, None)
    agent.reset()
    ended()
    assert (record["status"], record["score"], record["ended"]) == ("ok", 1.0, "agent")
    assert (record["steps"], record["said"]) == (2, "clicked")
    assert len(desktop.ran) == 1


@pytest.mark.parametrize(("words", "word"), [(None, "DONE"), ("", "DONE"), (" FAIL\n", "FAIL")])
def test_what_a_loop_returns_ends_the_episode(words, word):
    agent = LoopAgent(lambda computer, instruction: words)
    assert agent.predict("do it", SEEN) == (words or "", [word])
    assert agent.predict("do it", SEEN) == (words or "", [word])  # asked again, it says the same


def test_dicts_of_computer_tools_are_actions_in_pixels_of_the_picture():
    problems = []

    def loop(computer, instruction):
        x, y = middle_of_square(computer.screenshot())
        computer.act({"action": "mouse_move", "coordinate": [x, y]}, "anthropic")
        computer.act({"type": "click", "button": "left", "x": "no", "y": y}, "openai")
        problems.append(computer.problem)
        computer.act({"type": "click", "button": "left", "x": x, "y": y}, "openai")
        problems.append(computer.problem)
        assert computer.size == SIZE
        assert computer.png_base64().startswith("iVBOR")

    env, desktop = square_env()
    record = play(env, LoopAgent(loop), JOB, 0, None)
    assert (record["score"], record["malformed"], record["steps"]) == (1.0, 1, 4)
    assert problems == ["click x must be a number, got 'no'; give pixels such as 100", ""]
    assert len(desktop.ran) == 2


def test_a_loop_without_end_is_ended_from_outside():
    calls = []

    def loop(computer, instruction):
        while True:
            try:
                calls.append(1)
                computer.act("WAIT")
            except Exception:  # noqa: BLE001
                continue

    env, _ = square_env(max_steps=3)
    agent = LoopAgent(loop)
    record = play(env, agent, JOB, 0, None)
    assert (record["status"], record["ended"], record["steps"]) == ("ok", "max_steps", 3)
    assert len(loop_threads()) == 1, "it waits for the next picture"
    agent.reset()
    ended()
    assert len(calls) == 3


def test_a_loop_that_swallows_everything_sleeps_in_the_end(monkeypatch):
    asleep = threading.Event()
    wake = threading.Event()

    def loop(computer, instruction):
        while not wake.is_set():
            try:
                computer.act("WAIT")
            except BaseException:  # noqa: BLE001
                continue

    class Sleep:
        def wait(self):
            asleep.set()
            wake.wait(30)

    env, _ = square_env(max_steps=1)
    agent = LoopAgent(loop)
    monkeypatch.setattr("online_env.agents.adapters.loop.SHUTDOWN_TIMEOUT_S", 0.0)
    monkeypatch.setattr("online_env.agents.adapters.loop.PARKED", Sleep())
    play(env, agent, JOB, 0, None)
    agent.reset()
    assert asleep.wait(30)
    wake.set()
    ended()


def test_what_a_loop_raises_is_the_agents_failure_with_its_own_frames():
    def broken(computer, instruction):
        computer.act("WAIT")
        raise ValueError("my bug")

    env, _ = square_env()
    record = play(env, LoopAgent(broken), JOB, 0, None)
    assert (record["status"], record["cause"]) == ("error", "agent")
    assert record["problem"] == "the agent raised ValueError: my bug"
    assert record["traceback"][-1].endswith('in broken: raise ValueError("my bug")')


@pytest.mark.parametrize(
    ("loop", "problem"),
    [
        (lambda computer, _: [computer.screenshot() for _ in range(101)], "looked 100 times"),
        (lambda computer, _: 5, "returns nothing, words, or FAIL, got 5"),
        (lambda computer, _: computer.act({}, "no_dialect"), "unknown dialect 'no_dialect'"),
        (None, "override run"),
    ],
)
def test_a_loop_that_only_looks_or_is_none_fails(loop, problem):
    env, _ = square_env()
    record = play(env, LoopAgent(loop), JOB, 0, None)
    assert record["status"] == "error"
    assert problem in record["problem"]


def test_a_loop_that_hangs_fails(monkeypatch):
    monkeypatch.setattr(LoopAgent, "action_timeout_s", 0.2)
    answer = threading.Event()
    env, _ = square_env()
    agent = LoopAgent(lambda computer, _: answer.wait(30) and "late")
    record = play(env, agent, JOB, 0, None)
    assert record["problem"].endswith("LoopAgent took no action for 0.2 s")
    answer.set()
    agent.reset()
    ended()


def test_a_new_episode_begins_a_new_loop():
    agent = LoopAgent(clicking)
    for seed in (3, 4):
        env, _ = square_env()
        agent.reset()
        assert play(env, agent, JOB, seed, None)["score"] == 1.0
    agent.reset()
    ended()


# What is not installed


@pytest.mark.parametrize(
    ("cls", "extra", "module"),
    [
        (type("S", (AgentS,), {}), "agent-s", "gui_agents"),
        (type("C", (CuaAgent,), {"model": "openai/x"}), "cua", "cua_agent"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(cls, extra, module, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, module, None)
    cls.engine = {"engine_type": "openai", "model": "m"}
    cls.grounding = {**cls.engine, "grounding_width": 10, "grounding_height": 10}
    with pytest.raises(MissingDependencyError, match=rf"{module}: pip .*\[{extra}\]"):
        cls()


def test_what_an_adapter_needs_is_named():
    with pytest.raises(ParameterError, match="CuaAgent names no model"):
        CuaAgent()
    with pytest.raises(ParameterError, match=r"AgentS.engine lacks engine_type, model"):
        AgentS()
