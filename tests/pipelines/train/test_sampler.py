"""Which rollout meets which corruption: odds, scopes, and nothing else that decides."""

from collections import Counter

import pytest

import hijack_data as hj
from hijack_data.errors import ParameterTypeError, UnknownNameError
from pipelines.train.sampler import CorruptionSampler

KINDS = hj.OneOf([hj.Marks(), hj.PopUps(), hj.Resolution(scale=0.5)], weights=[2, 1, 1])


def labels(sampler, steps=40, groups=("a", "b"), slots=4):
    return {
        (step, group, slot): sampler.draw(step=step, group=group, slot=slot).label
        for step in range(steps)
        for group in groups
        for slot in range(slots)
    }


def test_the_same_draws_in_any_order():
    first = labels(CorruptionSampler(KINDS, seed=3))
    sampler = CorruptionSampler(KINDS, seed=3)
    backwards = {
        key: sampler.draw(step=key[0], group=key[1], slot=key[2]).label
        for key in reversed(list(first))
    }
    assert backwards == first
    assert labels(CorruptionSampler(KINDS, seed=4)) != first


def test_odds_are_kept():
    counts = Counter(labels(CorruptionSampler(KINDS), steps=250).values())
    assert counts["marks"] / counts.total() == pytest.approx(0.5, abs=0.05)
    assert counts["pop_ups"] / counts.total() == pytest.approx(0.25, abs=0.05)


def test_rollouts_of_a_group_differ():
    result = labels(CorruptionSampler(KINDS))
    groups = [{result[step, "a", slot] for slot in range(4)} for step in range(40)]
    assert max(map(len, groups)) == 3


def test_a_group_has_one_corruption():
    result = labels(CorruptionSampler(KINDS, per="group"))
    for step in range(40):
        assert len({result[step, "a", slot] for slot in range(4)}) == 1
    assert len(set(result.values())) == 3


def test_a_worker_keeps_its_corruption():
    result = labels(CorruptionSampler(KINDS, per="worker"), slots=16)
    for slot in range(16):
        assert len({label for key, label in result.items() if key[2] == slot}) == 1
    assert len(set(result.values())) == 3


def test_clean_and_nested():
    assert set(labels(CorruptionSampler(None)).values()) == {"clean"}
    assert set(labels(CorruptionSampler(hj.OneOf([hj.Marks()], p_clean=1))).values()) == {"clean"}
    nested = hj.OneOf([hj.OneOf([hj.Marks()], p_clean=0.5), hj.PopUps()])
    counts = Counter(labels(CorruptionSampler(nested), steps=250).values())
    assert counts["clean"] / counts.total() == pytest.approx(0.25, abs=0.05)
    sequence = hj.Sequence([hj.Marks(), hj.PopUps()])
    assert set(labels(CorruptionSampler(sequence)).values()) == {"marks+pop_ups"}


def test_what_draws_at_the_steps_of_an_episode_is_a_rollouts_own():
    """`max_times` counted the steps of the optimiser, and the rollout had no limit."""
    trigger = hj.OneOf([hj.Marks()], p_clean=0.5, max_times=3)
    for planner in (trigger, hj.OneOf([trigger])):
        sampler = CorruptionSampler(planner)
        assert all(sampler.draw(step=n, group="a", slot=0).planner is trigger for n in range(20))


def test_a_schedule_follows_the_epoch():
    sampler = CorruptionSampler(hj.Schedule(lambda epoch: hj.PopUps() if epoch else hj.Marks()))
    values = [sampler.draw(step=0, group="a", slot=0, epoch=epoch).label for epoch in (0, 1)]
    assert values == ["marks", "pop_ups"]


def test_the_draw_as_data():
    data = CorruptionSampler(hj.Marks(number=7)).draw(step=5, group="a", slot=1).to_data()
    assert data["corruption"] == "marks"
    assert data["planner"]["marks"]["number"] == 7


def test_unknown_names():
    with pytest.raises(UnknownNameError, match="did you mean 'rollout'"):
        CorruptionSampler(KINDS, per="rolout")
    with pytest.raises(ParameterTypeError, match="CorruptionSampler takes"):
        CorruptionSampler("marks")  # pyright: ignore
