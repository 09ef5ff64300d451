"""The rollout loop on environments that end, fail and judge in every way."""

import threading

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra [train]")
gymnasium = pytest.importorskip("gymnasium", reason="needs the extra [train]")

from hijack_data.errors import ParameterError  # noqa: E402
from pipelines.train.rollouts import PolicyAnswer, RolloutRequest, play  # noqa: E402
from pipelines.train.sampler import Draw  # noqa: E402


class Scripted(gymnasium.Env):
    """Ends after two steps with the record that it is given."""

    def __init__(self, record=None, at_reset=None, fails_at=None, endless=False):
        self.final, self.at_reset, self.fails_at, self.endless = record, at_reset, fails_at, endless
        self.record, self.steps, self.truncated, self.given = None, 0, False, None

    def reset(self, *, seed=None, options=None):
        self.given = (seed, options)
        self.record, self.steps = self.at_reset, 0
        return {"screenshot": np.zeros((2, 2, 3), np.uint8), "instruction": "x"}, {}

    def step(self, action):
        self.steps += 1
        if self.steps == self.fails_at:
            raise OSError("gone")
        over = self.steps == 2 and not self.endless
        if over:
            self.record = self.final
        entries = {"screenshot": np.full((2, 2, 3), self.steps, np.uint8), "instruction": "x"}
        return entries, float(over), over, False, {}

    def truncate(self):
        self.truncated = True
        self.record = {"status": "ok", "score": 0.5, "malformed": 1}


class Says:
    """Answers with a draw of the stream."""

    def __init__(self):
        self.batches = []

    def act(self, observations, streams):
        self.batches.append(len(observations))
        tokens = [stream.integer(0, 999) for stream in streams]
        return [
            PolicyAnswer(action=str(token), tokens=(token,), logprobs=(0.0,), is_well_formed=True)
            for token in tokens
        ]


def request(slot=0, task="a", step=0):
    draw = Draw(label="clean", planner=None, key="k")
    return RolloutRequest(step=step, group=task, slot=slot, seed=9, draw=draw)


def play_one(env, max_steps=5):
    return play([env], Says(), [request()], max_steps=max_steps)[0]


def test_a_plain_environment_counts_its_reward():
    rollout = play_one(Scripted())
    assert (rollout.success, rollout.status, len(rollout.turns)) == (1.0, "ok", 2)
    assert [int(turn.observation["screenshot"][0, 0, 0]) for turn in rollout.turns] == [0, 1]


def test_a_record_judges():
    rollout = play_one(Scripted({"status": "ok", "score": 0.25, "malformed": 2}))
    assert (rollout.success, rollout.is_well_formed, rollout.counts) == (0.25, False, True)


def test_an_episode_that_is_invalid_from_the_start_is_left_out():
    env = Scripted(at_reset={"status": "invalid", "score": None, "problem": "no firewall"})
    rollout = play_one(env)
    assert (rollout.status, rollout.problem, rollout.counts) == ("invalid", "no firewall", False)
    assert env.steps == 0


def test_an_invalid_end_is_left_out():
    assert not play_one(Scripted({"status": "invalid", "score": None, "problem": "x"})).counts


def test_an_agent_s_own_failure_is_a_zero():
    failed = play_one(
        Scripted({"status": "error", "score": None, "problem": "x", "cause": "agent"})
    )
    assert failed.counts
    broken = play_one(
        Scripted({"status": "error", "score": None, "problem": "x", "cause": "machine"})
    )
    assert not broken.counts


def test_a_step_that_raises_costs_one_rollout():
    policy = Says()
    envs = [Scripted(fails_at=1), Scripted(), Scripted()]
    rollouts = play(envs, policy, [request(slot) for slot in range(3)], max_steps=5)
    assert [rollout.status for rollout in rollouts] == ["error", "ok", "ok"]
    assert rollouts[0].problem == "step: OSError: gone"
    assert policy.batches == [3, 2]


def test_what_is_cut_off_is_judged_as_it_stands():
    env = Scripted(endless=True)
    rollout = play_one(env, max_steps=3)
    assert env.truncated
    assert (rollout.success, rollout.is_well_formed, len(rollout.turns)) == (0.5, False, 3)


def test_draws_depend_on_step_task_and_slot_alone():
    def tokens(requests):
        envs = [Scripted() for _ in requests]
        rollouts = play(envs, Says(), requests, max_steps=5)
        return {
            (item.request.group, item.request.slot): item.turns[0].answer.tokens
            for item in rollouts
        }

    first = tokens([request(0), request(1), request(0, "b")])
    assert tokens([request(0, "b"), request(0), request(1)]) == first
    assert len(set(first.values())) == 3
    assert tokens([request(0, step=1)])["a", 0] != first["a", 0]


def test_options_and_seed_reach_the_environment():
    env = Scripted()
    play_one(env)
    assert env.given == (9, {"task": "a", "corruption": None, "label": "clean"})


def test_too_few_environments():
    with pytest.raises(ParameterError, match="2 rollouts for 1 environments"):
        play([Scripted()], Says(), [request(0), request(1)], max_steps=5)


class Meets(Scripted):
    """Goes on only when another environment does so at the same time."""

    def __init__(self, barrier):
        super().__init__()
        self.barrier = barrier

    def step(self, action):
        self.barrier.wait()
        return super().step(action)


def test_environments_that_wait_do_so_at_the_same_time():
    requests = [request(slot) for slot in range(2)]
    barrier = threading.Barrier(2, timeout=5)
    met = play([Meets(barrier), Meets(barrier)], Says(), requests, max_steps=5, threads=2)
    plain = play([Scripted(), Scripted()], Says(), requests, max_steps=5)
    assert [rollout.to_data() for rollout in met] == [rollout.to_data() for rollout in plain]
    assert [rollout.status for rollout in met] == ["ok", "ok"]


def test_no_threads_are_refused():
    with pytest.raises(ParameterError, match="threads"):
        play([Scripted()], Says(), [request()], max_steps=1, threads=0)


@pytest.mark.parametrize("reward", [float("nan"), -0.01, 1.5, float("inf"), None, "much"])
def test_a_reward_outside_0_to_1_is_no_success(reward):
    class Rewards(Scripted):
        def step(self, action):
            calls, _, over, cut, info = super().step(action)
            return calls, reward, over, cut, info

    policy = Says()
    bad, good = play([Rewards(), Scripted()], policy, [request(0), request(1)], max_steps=5)
    assert (bad.status, bad.counts) == ("error", False)
    assert bad.problem == f"the environment gave the reward {reward!r}; it must be in 0..1"
    assert good.success == 1
    assert policy.batches == [2, 1]  # the first one is over


@pytest.mark.parametrize("score", [float("nan"), -1, 2, None])
def test_a_score_outside_0_to_1_is_no_success(score):
    rollout = play_one(Scripted({"status": "ok", "score": score}))
    assert (rollout.status, rollout.counts) == ("error", False)
    assert f"the score {score!r}" in rollout.problem


def test_an_episode_that_is_over_at_once_teaches_nothing():
    rollout = play_one(Scripted(at_reset={"status": "ok", "score": 1.0}))
    assert not rollout.counts
    assert rollout.problem == "the episode was over before the first action"


def test_what_cannot_be_cut_off_costs_one_rollout():
    class Stuck(Scripted):
        def truncate(self):
            raise OSError("gone")

    envs = [Stuck(endless=True), Scripted()]
    stuck, good = play(envs, Says(), [request(0), request(1)], max_steps=3)
    assert (stuck.status, stuck.problem) == ("error", "truncate: OSError: gone")
    assert good.success == 1


def test_one_environment_for_two_rollouts_is_refused():
    with pytest.raises(ParameterError, match=r"given twice.*not \[make\(\)\] \* n"):
        play([Scripted()] * 2, Says(), [request(0), request(1)], max_steps=5)


def test_a_policy_that_does_not_answer_everything_is_refused():
    class Silent(Says):
        def act(self, observations, streams):
            return super().act(observations, streams)[1:]

    with pytest.raises(ParameterError, match="1 answers to 2 observations"):
        play([Scripted(), Scripted()], Silent(), [request(0), request(1)], max_steps=5)
