"""The toy desktop: solvable under all nine, drawn as it is clicked, and a gymnasium environment."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import hijack_data as hj  # noqa: E402
from hijack_data.errors import ParameterTypeError, UnknownNameError  # noqa: E402
from hijack_data.rng import Stream  # noqa: E402
from pipelines.train.rollouts import PolicyTurn, RolloutRequest, play  # noqa: E402
from pipelines.train.sampler import Draw  # noqa: E402
from pipelines.train.toy.cloning import (  # noqa: E402
    CloningSettings,
    expert_answer,
    imitate_expert,
    record_demonstrations,
)
from pipelines.train.toy.env import DONE, ToyEnv  # noqa: E402
from pipelines.train.toy.policy import ToyNetwork, ToyPolicy  # noqa: E402
from pipelines.train.toy.settings import load_replication  # noqa: E402
from pipelines.train.toy.tasks import GOALS, task_names, toy_task  # noqa: E402

NAMES = task_names(8, 8)
SHIPPED = load_replication("train/toy")
CORRUPTIONS = {**SHIPPED.trained, **SHIPPED.untrained}


def solve(env, **options):
    """Let the expert play; return the screenshots and the score."""
    calls, _ = env.reset(seed=3, options=options)
    pictures, over, score = [calls["screenshot"]], False, 0.0
    while not over:
        calls, score, terminated, truncated, _ = env.step(expert_answer(env)[0])
        pictures.append(calls["screenshot"])
        over = terminated or truncated
    return pictures, score


def test_all_goals_are_there():
    assert {toy_task(name).goal for name in NAMES} == set(GOALS)
    assert toy_task("toy-00003") == toy_task("toy-00003")
    with pytest.raises(UnknownNameError, match="no task 'write_note'"):
        toy_task("write_note")


@pytest.mark.parametrize("label", ["clean", *CORRUPTIONS])
def test_the_expert_solves_all_under_all(label):
    env = ToyEnv()
    for name in NAMES:
        pictures, score = solve(env, task=name, corruption=CORRUPTIONS.get(label))
        assert score == 1.0, name
        assert env.record["malformed"] == 0
        clean, _ = solve(env, task=name, corruption=None)
        differs = len(clean) != len(pictures) or any(
            not np.array_equal(value, second) for value, second in zip(clean, pictures, strict=True)
        )
        assert differs == (label != "clean"), name


def test_all_nine_are_shipped():
    assert {planner.label for planner in CORRUPTIONS.values()} == set(hj.corruption_names())


def test_pictures_are_those_of_the_library():
    env, marks = ToyEnv(), CORRUPTIONS["marks"]
    calls, _ = env.reset(seed=5, options={"task": "toy-00001", "corruption": marks})
    scene = hj.Scene(size=(64, 96), boxes=env.screen.boxes)
    plan = marks.plan(scene, seed=5, sample="toy-00001", step=0)
    assert np.array_equal(calls["screenshot"], hj.apply(plan, env.screen.pixels))
    assert not np.array_equal(calls["screenshot"], env.screen.pixels)


def test_the_wrong_element_ends_it():
    env = ToyEnv()
    env.reset(options={"task": "toy-00000"})
    box = next(box for box, click in env.screen.clicks if click == "wrong")
    _, score, terminated, _, _ = env.step(f"click({box[0] + 2}, {box[1] + 2})")
    assert (score, terminated, env.record["score"]) == (0.0, True, 0.0)


def test_done_too_early_is_a_failure():
    env = ToyEnv()
    env.reset(options={"task": "toy-00000"})
    assert env.step(DONE)[1:4] == (0.0, True, False)


def test_a_malformed_action_does_nothing_but_counts():
    env = ToyEnv(max_steps=2)
    before = env.reset(options={"task": "toy-00000"})[0]["screenshot"]
    after, _, terminated, truncated, _ = env.step("press the red button")
    assert np.array_equal(before, after["screenshot"])
    assert (terminated, truncated) == (False, False)
    assert env.step("click()")[2:4] == (False, True)
    assert env.record["malformed"] == 2


def test_a_corruption_that_is_none_is_refused():
    with pytest.raises(ParameterTypeError, match="must be a planner"):
        ToyEnv().reset(options={"corruption": "marks"})


def test_it_is_a_gymnasium_environment():
    check_env(ToyEnv(), skip_render_check=True)


def test_the_start_learns_from_the_expert():
    settings = CloningSettings(tasks=40, epochs=3, malformed=0.0)
    names = task_names(100, settings.tasks)
    turns = record_demonstrations(names, 0, 0.0)
    torch.manual_seed(0)
    before, _ = ToyPolicy(ToyNetwork()).log_probs(turns)
    after, _ = ToyPolicy(imitate_expert(names, 0, settings)).log_probs(turns)
    assert after.mean().item() > before.mean().item() + 0.5


def test_draws_of_a_policy_depend_on_its_streams_alone():
    torch.manual_seed(0)
    policy = ToyPolicy(ToyNetwork())
    calls = [ToyEnv().reset(options={"task": name})[0] for name in NAMES]
    streams = [Stream(0, "test", name) for name in NAMES]
    together = policy.act(calls, streams)
    again = [
        policy.act([value], [Stream(0, "test", name)])[0]
        for value, name in zip(calls, NAMES, strict=True)
    ]
    assert [answer.tokens for answer in together] == [answer.tokens for answer in again]
    turns = [PolicyTurn(value, answer) for value, answer in zip(calls, together, strict=True)]
    chances, _ = policy.log_probs(turns)
    stored = torch.tensor([answer.logprobs for answer in together])
    assert torch.allclose(chances, stored, atol=1e-4)


def test_answers_that_are_malformed_are_called_so():
    torch.manual_seed(0)
    policy = ToyPolicy(ToyNetwork())
    env = ToyEnv()
    calls, _ = env.reset(options={"task": "toy-00000"})
    answers = policy.act([calls] * 60, [Stream(0, "test", i) for i in range(60)])
    assert {answer.is_well_formed for answer in answers} == {True, False}
    for answer in answers:
        env.reset(options={"task": "toy-00000"})
        env.step(answer.action)
        env.truncate()
        assert (env.record["malformed"] == 0) == answer.is_well_formed, answer


def test_the_loop_plays_the_toy():
    torch.manual_seed(0)
    draw = Draw(label="marks", planner=CORRUPTIONS["marks"], key="k")
    requests = [RolloutRequest(step=0, group=name, slot=0, seed=1, draw=draw) for name in NAMES]
    rollouts = play([ToyEnv() for _ in NAMES], ToyPolicy(ToyNetwork()), requests, max_steps=6)
    assert all(rollout.counts and 1 <= len(rollout.turns) <= 6 for rollout in rollouts)
    assert len({len(rollout.turns) for rollout in rollouts}) > 1
