"""One rollout that another library's trainer drives: whatever its environment does has an outcome."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra [train]")
gymnasium = pytest.importorskip("gymnasium", reason="needs the extra [train]")

from hijack_data.errors import UnknownNameError  # noqa: E402
from pipelines.train.adapters.driven_episode import DrivenEpisode  # noqa: E402
from pipelines.train.rollouts import RolloutRequest  # noqa: E402
from pipelines.train.sampler import Draw  # noqa: E402

SEEN = {"instruction": "x"}
SCREEN = {**SEEN, "screenshot": np.zeros((1080, 1920, 3), np.uint8)}


class Plays(gymnasium.Env):
    """An endless episode whose rewards, record and failures are given."""

    def __init__(self, reward=0.0, record=None, fails=()):
        self.reward, self.final, self.fails = reward, record, fails
        self.record = None
        self.closed = 0

    def _act(self, what):
        if what in self.fails:
            raise OSError(f"no {what}")

    def reset(self, *, seed=None, options=None):
        self._act("reset")
        if options["task"] == "unheard of":
            raise UnknownNameError("no task 'unheard of'")
        self.record = None
        return SEEN, {}

    def step(self, action):
        self._act("step")
        return SEEN, self.reward, False, False, {}

    def truncate(self):
        self._act("truncate")
        self.record = self.final

    def close(self):
        self.closed += 1
        self._act("close")


def begun(env, task="a"):
    episode = DrivenEpisode(lambda: env)
    draw = Draw(label="clean", planner=None, key="k")
    calls = episode.reset(RolloutRequest(step=0, group=task, slot=0, seed=1, draw=draw))
    return episode, calls


def test_what_is_cut_off_is_judged():
    episode, _ = begun(Plays(record={"status": "ok", "score": 0.5, "malformed": 1}))
    assert episode.step("click") is SEEN
    rollout = episode.finish()
    assert (rollout.success, rollout.is_well_formed, rollout.answers) == (0.5, False, 1)
    assert rollout.reward() == -0.5
    assert episode.finish() is rollout


UI_TARS = "Thought: There.\nAction: click(start_box='<|box_start|>(966,546)<|box_end|>')"
READ_IN = {
    "ui_tars_1.5": ["pyautogui.click(960, 540)"],  # of the smart-resized 1932x1092
    None: [UI_TARS],
    "qwen3_vl": ["unreadable action: "],
}


@pytest.mark.parametrize("dialect", READ_IN)
def test_an_answer_is_read_in_the_dialect_of_the_model(dialect):
    """UI-TARS does not write pyautogui: every answer would be malformed, and every reward -1."""
    taken = []
    env = Plays()
    env.step = lambda action: (taken.append(action), (SCREEN, 0.0, False, False, {}))[1]
    env.reset = lambda **_: (SCREEN, {})
    episode = DrivenEpisode(lambda: env, dialect)
    draw = Draw(label="clean", planner=None, key="k")
    episode.reset(RolloutRequest(step=0, group="a", slot=0, seed=1, draw=draw))
    assert episode.step(UI_TARS) is SCREEN
    (action,) = taken
    assert action.startswith(READ_IN[dialect][0])
    with pytest.raises(UnknownNameError, match="did you mean 'ui_tars"):
        DrivenEpisode(Plays, "ui_tar")


@pytest.mark.parametrize("reward", [float("nan"), -1.0, 3.0])
def test_a_reward_outside_0_to_1_ends_the_rollout(reward):
    episode, _ = begun(Plays(reward, {"status": "ok", "score": 1.0}))
    assert episode.step("click") is None
    assert episode.is_over
    rollout = episode.finish()
    assert rollout.reward() is None
    assert rollout.problem == f"the environment gave the reward {reward!r}; it must be in 0..1"


def test_a_score_outside_0_to_1_leaves_the_rollout_out():
    episode, _ = begun(Plays(record={"status": "ok", "score": float("nan")}))
    assert episode.finish().reward() is None


@pytest.mark.parametrize("where", ["step", "truncate"])
def test_an_environment_that_fails_is_closed_and_its_rollout_left_out(where):
    env = Plays(fails=(where, "close"))
    episode, _ = begun(env)
    episode.step("click")
    rollout = episode.finish()
    assert (rollout.status, rollout.problem) == ("error", f"{where}: OSError: no {where}")
    assert rollout.reward() is None
    assert env.closed == 1


def test_a_reset_that_fails_is_tried_once_more():
    items = []

    def make():
        items.append(Plays(fails=("reset",) if not items else ()))
        return items[-1]

    draw = Draw(label="clean", planner=None, key="k")
    request = RolloutRequest(step=0, group="a", slot=0, seed=1, draw=draw)
    episode = DrivenEpisode(make)
    assert episode.reset(request) is SEEN
    assert [env.closed for env in items] == [1, 0]
    failing, nothing = begun(Plays(fails=("reset",)))
    assert nothing is None
    assert failing.finish().problem == "reset: OSError: no reset"


def test_an_unknown_task_is_no_machine_s_fault():
    with pytest.raises(UnknownNameError, match="unheard of"):
        begun(Plays(), task="unheard of")


def test_nothing_can_be_finished_before_it_began():
    with pytest.raises(RuntimeError, match="before reset"):
        DrivenEpisode(Plays).finish()
