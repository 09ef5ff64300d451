"""`CorruptedEnv` in gymnasium's hands: vectors of it, limits from outside, the checker, seeds."""

import contextlib

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from hijack_data.errors import ParameterError
from hijack_data.spaces import SHARED_TEXT, Text
from online_env.environment import CorruptedEnv

from support.episodes import CLICK, make
from support.live import AT_ONCE, SIZE, FakeDesktop, FakeStage, Marking
from support.runlog import records_of

pytestmark = pytest.mark.usefixtures("no_waiting")


class Told(FakeStage):
    """A stage whose instruction is given."""

    def __init__(self, instruction):
        super().__init__()
        self.instruction = instruction

    def reset(self, task, seed):
        setting = super().reset(task, seed)
        object.__setattr__(setting, "instruction", self.instruction)
        return setting


TEXTS = ("Öffne 名前 🎉 \ud800", "", "x" * SHARED_TEXT)


def vector(kind, texts=TEXTS):
    return kind(
        [lambda text=text: CorruptedEnv(Told(text), settle=AT_ONCE, max_steps=2) for text in texts]
    )


@pytest.mark.parametrize("kind", [AsyncVectorEnv, SyncVectorEnv])
def test_vectors_work_with_their_defaults(kind):
    env = vector(kind)
    try:
        obs, _ = env.reset(seed=3)
        assert tuple(obs["instruction"]) == TEXTS
        assert obs["screenshot"].shape == (3, *SIZE, 3)
        first = obs["screenshot"].copy()
        obs, rewards, terminated, truncated, _ = env.step((CLICK, "DONE", "WAIT"))
        assert (rewards.tolist(), terminated.tolist()) == ([0, 1, 0], [False, True, False])
        assert not truncated.any()
        assert not np.array_equal(first[0], obs["screenshot"][0])
        assert tuple(obs["instruction"]) == TEXTS
        *_, truncated, _ = env.step((CLICK, CLICK, CLICK))  # the second is reset by gymnasium
        assert truncated.tolist() == [True, False, True]
    finally:
        env.close()


def test_a_text_that_does_not_fit_is_an_error_and_not_cut_off():
    from gymnasium.vector.utils import create_shared_memory, write_to_shared_memory

    memory = create_shared_memory(Text(), n=2)
    with pytest.raises(ParameterError, match="shared_memory=False"):
        write_to_shared_memory(Text(), 1, "x" * (SHARED_TEXT + 1), memory)


class Repeatable(FakeDesktop):
    """Shows the same again after a reset."""

    def reset(self, task=None):
        super().reset(task)
        self.ran.clear()


def test_gymnasiums_own_checker_is_content():
    env, _ = make(FakeStage(Repeatable()), render_mode="rgb_array")
    check_env(env, skip_render_check=True)


# A limit that is not ours


@pytest.mark.parametrize("how", ["reset", "close"])
def test_an_episode_that_an_outer_limit_ends_is_judged(how, tmp_path):
    stage = FakeStage(score=0.5)
    inner = CorruptedEnv(stage, corruption=Marking(0), settle=AT_ONCE, log=tmp_path)
    env = gymnasium.wrappers.TimeLimit(inner, 2)
    env.reset(seed=0)
    env.step(CLICK)
    assert env.step(CLICK)[2:4] == (False, True)
    assert inner.record is None
    ends = {"reset": lambda: env.reset(seed=1), "close": env.close}
    ends[how]()
    (record,) = [r for r in records_of(tmp_path) if r["seed"] == 0]
    assert (record["status"], record["score"], record["ended"]) == ("ok", 0.5, "outside")
    assert stage.state_at_evaluation == {"marked"}, "judged before anything was put back"
    assert record["steps"] == 2


def test_how_an_episode_ended_is_on_record():
    env, _ = make(max_steps=2)
    for actions, ended in (
        (["DONE"], "agent"),
        (["WAIT", "WAIT"], "max_steps"),
        (["WAIT"], "outside"),
    ):
        env.reset(seed=0)
        for action in actions:
            env.step(action)
        env.truncate()
        env.truncate()
        assert env.record["ended"] == ended


@contextlib.contextmanager
def closing_an_episode_of(env):
    """As `close` does, but the desktop stays."""
    try:
        yield
    finally:
        env._runner.leave("the environment was closed before the end")


def test_an_episode_that_an_exception_ends_is_not_judged():
    env, stage = make()
    for stop in (KeyboardInterrupt, ZeroDivisionError):
        env.reset(seed=0)
        env.step(CLICK)
        with pytest.raises(stop), closing_an_episode_of(env):
            raise stop
        record = env.record
        assert (record["status"], record["score"], record["cause"]) == ("error", None, "outside")
        assert stop.__name__ in record["problem"]
    assert stage.history is None
