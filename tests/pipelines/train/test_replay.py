"""The replay buffer: when it acts, what it draws, and whose file it takes."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra [train]")
pytest.importorskip("gymnasium", reason="needs the extra [train]")

import hijack_data as hj
from hijack_data.errors import ParameterError, UnknownNameError
from pipelines.train.errors import TrainError
from pipelines.train.replay import ReplayBuffer
from pipelines.train.rollout_data import rollout_from_data, rollout_to_data
from pipelines.train.rollouts import PolicyAnswer, PolicyTurn, Rollout, RolloutRequest
from pipelines.train.sampler import Draw


def rollout(success=0.0, well_formed=True, task="a", step=0, slot=0):
    request = RolloutRequest(
        step=step,
        group=task,
        slot=slot,
        seed=1,
        draw=Draw(label="marks", planner=hj.Marks(number=3), key="k"),
    )
    entries = {"screenshot": np.full((4, 4, 3), step, np.uint8), "instruction": task}
    answer = PolicyAnswer(
        action="x", tokens=(1, 2), logprobs=(-1.0, -2.0), is_well_formed=well_formed
    )
    return Rollout(
        request=request,
        turns=[PolicyTurn(entries, answer)],
        success=success,
        is_well_formed=well_formed,
    )


def group(*successes, task="a"):
    return [rollout(value, task=task, slot=slot) for slot, value in enumerate(successes)]


def filled(buffer, successes, step=0, task="a", rewards=None):
    rollouts = group(*successes, task=task)
    result = buffer.fill(rollouts, list(successes) if rewards is None else rewards, step)
    return [item.replayed for item in result]


def with_success(**options):
    buffer = ReplayBuffer(**options)
    assert buffer.add(rollout(1.0, step=7))
    return buffer


def test_only_a_group_without_reward_is_filled():
    buffer = with_success()
    assert sum(filled(buffer, (0, 0, 0, 0))) == 1
    assert sum(filled(buffer, (0, 1, 0, 0))) == 0
    assert sum(filled(buffer, (1, 1, 1, 1))) == 0


def test_the_slot_is_drawn():
    buffer = with_success()
    places = Counter(filled(buffer, (0, 0, 0, 0), step).index(True) for step in range(200))
    assert sorted(places) == [0, 1, 2, 3]
    assert min(places.values()) > 30
    again = [filled(buffer, (0, 0, 0, 0), step).index(True) for step in range(200)]
    assert Counter(again) == places
    authors = with_success(slot=0)
    assert {filled(authors, (0, 0), step).index(True) for step in range(20)} == {0}


def test_algorithm_and_text_differ_for_wrong_forms():
    rewards = [0.0, -1.0]
    assert sum(filled(with_success(), (0, 0), rewards=rewards)) == 0
    assert sum(filled(with_success(when="failed"), (0, 0), rewards=rewards)) == 1


def test_a_success_of_another_task_is_not_taken():
    assert sum(filled(with_success(), (0, 0), task="b")) == 0


def test_only_successes_in_the_right_form_are_kept():
    buffer = ReplayBuffer()
    assert not buffer.add(rollout(0.0))
    assert not buffer.add(rollout(1.0, well_formed=False))
    assert not buffer.add(replace(rollout(1.0), replayed=True))
    assert not buffer.add(replace(rollout(1.0), status="invalid"))
    assert len(buffer) == 0


def test_the_oldest_goes_first():
    buffer = ReplayBuffer(2)
    for step in (1, 2, 3):
        buffer.add(rollout(1.0, step=step))
    assert len(buffer) == 2
    steps = {buffer.fill(group(0, 0), [0, 0], n)[0].request.step for n in range(100)}
    assert steps == {0, 2, 3}  # 0 is the rollout that stayed in its place


def test_a_saved_buffer_is_the_same(tmp_path):
    buffer = with_success()
    buffer.save(tmp_path / "replay.pt", run="one")
    replay_buffer = ReplayBuffer()
    replay_buffer.load(tmp_path / "replay.pt", run="one")
    state, other_state = buffer.state()[0], replay_buffer.state()[0]
    picture, same = (
        item["turns"][0]["observation"].pop("screenshot") for item in (state, other_state)
    )
    assert state == other_state
    assert (picture == same).all()
    assert state == {**rollout_to_data(rollout(1.0, step=7)), "turns": state["turns"]}


def test_the_buffer_of_another_run_is_refused(tmp_path):
    with_success().save(tmp_path / "replay.pt", run="one")
    with pytest.raises(TrainError, match="another run"):
        ReplayBuffer().load(tmp_path / "replay.pt", run="two")


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04"])
def test_a_damaged_file_is_refused(tmp_path, content):
    (tmp_path / "replay.pt").write_bytes(content)
    with pytest.raises(TrainError, match="replay buffer"):
        ReplayBuffer().load(tmp_path / "replay.pt", run="one")
    with pytest.raises(TrainError, match="no such file"):
        ReplayBuffer().load(tmp_path / "none.pt", run="one")


def test_wrong_options():
    with pytest.raises(ParameterError, match="capacity"):
        ReplayBuffer(0)
    with pytest.raises(UnknownNameError, match="did you mean 'zero'"):
        ReplayBuffer(when="zer")


def test_everything_that_was_observed_comes_back():
    stored_rollout = rollout(1.0)
    entries = {
        **stored_rollout.turns[0].observation,
        "accessibility_tree": None,
        "dpi": 96,
        "mask": np.eye(3, dtype=np.float32),
    }
    stored_rollout.turns[0] = replace(stored_rollout.turns[0], observation=entries)
    observation = rollout_from_data(rollout_to_data(stored_rollout)).turns[0].observation
    assert observation.keys() == entries.keys()
    assert (observation["accessibility_tree"], observation["dpi"]) == (None, 96)
    np.testing.assert_array_equal(observation["mask"], entries["mask"])
    np.testing.assert_array_equal(observation["screenshot"], entries["screenshot"])


def test_what_a_file_cannot_hold_is_refused():
    stored_rollout = rollout(1.0)
    entries = {**stored_rollout.turns[0].observation, "tree": object()}
    stored_rollout.turns[0] = replace(stored_rollout.turns[0], observation=entries)
    with pytest.raises(TrainError, match="observation 'tree' is a object"):
        rollout_to_data(stored_rollout)


@pytest.mark.parametrize("wrong", [{"slot": -1}, {"seed": -1}, {"capacity": 0}])
def test_numbers_out_of_their_range_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        ReplayBuffer(**wrong)
