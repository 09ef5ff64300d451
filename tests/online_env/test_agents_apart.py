"""Agents in threads of their own: slow ones, what is kept of an error, and what an oracle may do."""

import os
import sys
import threading
import time

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env.agents import oracle
from online_env.agents.agent_calls import MAX_FRAMES, AgentError
from online_env.agents.agent_thread import AgentThread
from online_env.agents.oracle import Oracle, OracleDesktop
from online_env.errors import DesktopError
from online_env.tasks import Hand

from support import waiting
from support.live import FakeDesktop


class Slow:
    """Answers a call of `predict` only once it may; every other call at once."""

    def __init__(self):
        self.may = threading.Event()
        self.threads = {threading.get_ident()}
        self.resets = 0

    def reset(self):
        self.threads.add(threading.get_ident())
        self.resets += 1

    def predict(self, instruction, obs):
        self.threads.add(threading.get_ident())
        self.may.wait(30)
        return instruction, ["WAIT"]


def test_an_agent_that_is_too_slow_is_not_called_again_and_its_late_answer_is_nobodys():
    with AgentThread(Slow, timeout=0.1) as apart:
        slow = apart.agent
        with pytest.raises(AgentError, match=r"^no answer within 0\.1 s$"):
            apart.predict("first", {})
        for call in (apart.reset, lambda: apart.predict("second", {})):
            with pytest.raises(
                AgentError, match=r"^it still works on a call that was interrupted$"
            ):
                call()
        slow.may.set()
        assert slow.resets == 0


def test_an_interrupted_call_leaves_no_answer_for_the_next_one(monkeypatch):
    with AgentThread(Slow) as apart:

        def interrupted(timeout):
            raise KeyboardInterrupt

        class Answers:
            get = staticmethod(lambda timeout: interrupted(timeout))

        answers_before = apart._answers
        monkeypatch.setattr(apart, "_answers", Answers())
        with pytest.raises(KeyboardInterrupt):
            apart.call(len, "abc")
        monkeypatch.setattr(apart, "_answers", answers_before)
        with pytest.raises(AgentError, match=r"^it still works on a call that was interrupted$"):
            apart.call(len, "abcd")


def test_all_calls_are_made_in_one_thread_that_is_not_the_callers_and_ends():
    before = {thread.name for thread in threading.enumerate()}
    with AgentThread(Slow) as apart:
        apart.agent.may.set()
        apart.reset()
        assert apart.predict("do it", {}) == ("do it", ["WAIT"])
        (ident,) = apart.agent.threads
        assert ident != threading.get_ident()
    apart.close()  # a second time
    waiting.until(
        lambda: {thread.name for thread in threading.enumerate()} <= before,
        "the agent's thread to end",
    )


def deep(left):
    if not left:
        raise ValueError("at the bottom")
    deep(left - 1)


def test_of_a_deep_error_the_innermost_frames_are_kept_and_none_of_ours():
    with AgentThread(Slow) as apart, pytest.raises(AgentError) as caught:
        apart.call(deep, 50)
    assert str(caught.value) == "ValueError: at the bottom"
    assert len(caught.value.frames) == MAX_FRAMES
    line = deep.__code__.co_firstlineno + 2
    assert (
        caught.value.frames[-1] == f'{__file__}:{line} in deep: raise ValueError("at the bottom")'
    )
    assert {frame.rpartition(" in ")[0].rpartition(":")[0] for frame in caught.value.frames} == {
        __file__
    }


@pytest.mark.parametrize(
    ("answer", "shown"),
    [
        (("", "DONE"), "('', 'DONE')"),
        (("", {"DONE"}), "('', {'DONE'})"),
        (("", b"DONE"), "('', b'DONE')"),
        ((None, ["DONE"]), "(None, ['DONE'])"),
        (("", ["DONE"], 1), "('', ['DONE'], 1)"),
        ("ab", "'ab'"),
        ("x" * 500, "'" + "x" * 199),
    ],
)
def test_an_answer_of_another_form_is_shown_and_the_right_one_is_too(answer, shown):
    class Odd:
        def predict(self, instruction, obs):
            return answer

    with AgentThread(Odd) as apart, pytest.raises(AgentError) as caught:
        apart.predict("do it", {})
    assert str(caught.value) == (
        f'predict must return (text, [actions]), such as ("", ["DONE"]), got {shown}'
    )


def test_an_agent_may_leave_by_sys_exit_without_taking_the_run_along():
    class Leaving:
        def predict(self, instruction, obs):
            sys.exit("enough")

    with AgentThread(Leaving) as apart:
        with pytest.raises(AgentError, match=r"^SystemExit: enough$"):
            apart.predict("do it", {})
        assert apart.call(os.getpid) == os.getpid(), "the thread goes on"


# Oracles


def test_an_oracle_has_no_way_behind_the_screen():
    desktop = FakeDesktop((40, 60))
    stand_in = OracleDesktop(desktop)
    with pytest.raises(DesktopError) as caught:
        stand_in.write_file("/home/user/x", b"x")
    assert str(caught.value) == (
        "an oracle cannot write /home/user/x behind the screen; it has to use the applications"
    )
    with pytest.raises(DesktopError, match=r"^an oracle cannot reset the desktop$"):
        stand_in.reset()
    stand_in.close()
    assert (desktop.ran, desktop.closed) == ([], False)
    assert (stand_in.size, stand_in.capabilities) == (desktop.size, desktop.capabilities)


class Endless:
    """A task whose solution never has an action."""

    id = "endless-0"
    infeasible = ""

    def __init__(self):
        self.may = threading.Event()
        self.ended = threading.Event()

    def oracle(self, hand: Hand):
        self.may.wait(30)
        try:
            hand.run("pyautogui.click(1, 1)")
        finally:
            self.ended.set()


class Defective(Endless):
    """A task whose solution stumbles after its first action."""

    id = "defective-0"

    def oracle(self, hand: Hand):
        hand.run("pyautogui.click(1, 1)")
        [][0]


class Holder:
    desktop = FakeDesktop((40, 60))


def test_an_oracle_without_a_next_action_says_so_and_its_solution_ends_with_the_episode(
    monkeypatch,
):
    monkeypatch.setattr(oracle, "ACTION_TIMEOUT_S", 0.1)
    result, task = Oracle(), Endless()
    with pytest.raises(
        DesktopError, match=r"^the oracle has no task yet: call prepare after reset"
    ):
        result.predict("do it", {})
    result.prepare(task, Holder())
    with pytest.raises(DesktopError) as caught:
        result.predict("do it", {"screenshot": FakeDesktop((40, 60)).screenshot()})
    assert str(caught.value) == "the solution of endless-0 had no next action within 0.1 s"
    task.may.set()
    result.reset()
    assert task.ended.wait(10), "reset ends it, whatever it waits for"
    with pytest.raises(DesktopError, match=r"^the oracle has no task yet"):
        result.predict("do it", {})


def test_a_solution_that_stumbles_is_an_error_at_once_and_not_the_answer_of_the_agent():
    result = Oracle()
    result.prepare(Defective(), Holder())
    entries = {"screenshot": FakeDesktop((40, 60)).screenshot()}
    assert result.predict("do it", entries) == ("", ["pyautogui.click(1, 1)"])
    began = time.monotonic()
    with pytest.raises(DesktopError) as caught:
        result.predict("do it", entries)
    assert time.monotonic() - began < oracle.ACTION_TIMEOUT_S / 10
    assert (
        str(caught.value)
        == "the solution of defective-0 raised IndexError: list index out of range"
    )
    assert isinstance(caught.value.__cause__, IndexError)
    result.reset()
    result.prepare(Defective(), Holder())
    assert result.predict("do it", entries) == ("", ["pyautogui.click(1, 1)"]), (
        "the next episode begins anew"
    )
