"""The environment of trainers whose desktops are behind `hijack serve`, with OpenEnv's own client."""

import numpy as np
import pytest

from support import needs

pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("prometheus_client", reason=needs.SERVE)
pytest.importorskip("openenv", reason=needs.SERVE)

import hijack_data as hj
from hijack_data.errors import ParameterError
from pipelines.train.adapters.served_env import TOKEN_VARIABLE, ServedEnv
from pipelines.train.errors import TrainError
from pipelines.train.rollouts import PolicyAnswer, RolloutRequest, play
from pipelines.train.sampler import CorruptionSampler, Draw

from support.episodes import CLICK
from support.serving import Desktops, server, until

pytestmark = pytest.mark.filterwarnings("ignore")


class Says:
    """Says the same at every step."""

    def __init__(self, *words):
        self.words = words
        self.turn = -1

    def act(self, observations, streams):
        self.turn += 1
        word = self.words[min(self.turn, len(self.words) - 1)]
        answer = PolicyAnswer(action=word, tokens=(0,), logprobs=(0.0,), is_well_formed=True)
        return [answer for _ in observations]


def request(draw, slot=0):
    return RolloutRequest(step=0, group="write_note", slot=slot, seed=3, draw=draw)


def marks(**values):
    return Draw(label="marks", planner=hj.make_corruption("marks", **values), key="k")


def play_one(env, draw, *words, max_steps=5):
    return play([env], Says(*words), [request(draw)], max_steps=max_steps)[0]


@pytest.fixture
def served():
    desktops = Desktops()
    with server(desktops) as (url, service):
        env = ServedEnv(url, size=(360, 640))
        yield env, desktops, service
        env.close()


def test_a_rollout_is_played_and_judged(served):
    env, desktops, _ = served
    rollout = play_one(env, marks(), CLICK, "DONE")
    assert (rollout.status, rollout.success, len(rollout.turns)) == ("ok", 1.0, 2)
    assert rollout.is_well_formed
    first = rollout.turns[0].observation
    assert first in env.observation_space
    assert {**first, "instruction": "Where is Kraków?"} in env.observation_space
    assert (first["screenshot"] != desktops.stages[0].desktop.screenshot()).any()
    assert env.record["corruption"] == "marks"
    assert env.step(CLICK)[1:4] == (0.0, False, True)  # it is over


def test_clean_rollouts_are_clean(served):
    env, desktops, _ = served
    calls, _ = env.reset(seed=1, options={"task": "write_note", "corruption": None})
    assert np.array_equal(calls["screenshot"], desktops.stages[0].desktop.screenshot())


def test_a_malformed_answer_is_seen_by_the_trainer(served):
    env, _, _ = served
    rollout = play_one(env, marks(), "well, let me see", "DONE")
    assert (rollout.success, rollout.is_well_formed) == (1.0, False)


def test_a_rollout_that_is_cut_off_is_judged(served):
    env, _, service = served
    rollout = play_one(env, marks(), CLICK, max_steps=2)
    assert (rollout.status, rollout.success, len(rollout.turns)) == ("ok", 1.0, 2)
    until(lambda: service.pool.counts().lent == 0)


def test_other_parameters_than_the_trainers_are_refused(served):
    env, _, service = served
    rollout = play_one(env, marks(number=7), "DONE")
    assert rollout.status == "error"
    assert "plays marks as" in rollout.problem
    assert "start the server with the trainer's corruptions" in rollout.problem
    until(lambda: service.pool.counts().lent == 0)  # and the desktop is free again


def test_a_corruption_that_is_not_served_is_an_error_of_the_rollout(served):
    env, _, _ = served
    rollout = play_one(env, Draw(label="fog", planner=hj.make_corruption("marks"), key="k"), "DONE")
    assert (rollout.status, "no corruption 'fog' is served here" in rollout.problem) == (
        "error",
        True,
    )
    assert play_one(env, marks(), "DONE").status == "ok"  # the next one connects anew


def test_a_desktop_that_ends_is_no_failure_of_the_policy(served):
    env, desktops, _ = served
    env.reset(seed=1, options={"task": "write_note", "corruption": None})
    desktops.stages[0].desktop.dead = True
    with pytest.raises(TrainError, match="the desktop ended in mid-episode"):
        env.step(CLICK)
    assert play_one(env, marks(), "DONE").status == "ok"


def test_a_server_that_is_not_there_is_named():
    env = ServedEnv("http://127.0.0.1:1")
    with pytest.raises(TrainError, match=r"http://127.0.0.1:1: reset: ConnectionError"):
        env.reset(seed=0)
    with pytest.raises(TrainError, match="no episode is under way: call reset first"):
        env.step(CLICK)  # an episode that never began is no rollout with a reward of 0


def test_the_token_comes_from_the_environment(monkeypatch):
    with server(token="correct-horse-battery-staple") as (url, _):
        env = ServedEnv(url)
        with pytest.raises(TrainError, match="401"):
            env.reset(seed=0)
        monkeypatch.setenv(TOKEN_VARIABLE, "correct-horse-battery-staple")
        env.reset(seed=0)
        env.close()


def test_sessions_are_spread_over_the_servers():
    addresses = ["http://a:1", "http://b:1", "http://c:1"]
    assert {ServedEnv(addresses).address for _ in range(3)} == set(addresses)
    assert ServedEnv(addresses, number=4).address == "http://b:1"


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [({"addresses": []}, "at least one server"), ({"timeout": 0}, "above 0")],
)
def test_wrong_arguments_are_refused(arguments, problem):
    with pytest.raises(ParameterError, match=problem):
        ServedEnv(**{"addresses": "http://a:1", **arguments})


def test_the_samplers_draws_reach_the_server():
    planners = {
        "marks": hj.make_corruption("marks"),
        "subtitle": hj.make_corruption("subtitle", fit="shrink"),
    }
    sampler = CorruptionSampler(hj.OneOf(list(planners.values())), seed=4)
    draws = [sampler.draw(step=0, group="write_note", slot=slot) for slot in range(8)]
    assert {draw.label for draw in draws} == set(planners)
    with server(planners=planners) as (url, _):
        env = ServedEnv(url)
        for draw in draws:
            rollout = play_one(env, draw, "DONE")
            assert (rollout.status, rollout.problem) == ("ok", "")
            assert env.record["corruption"] == draw.label
        env.close()
