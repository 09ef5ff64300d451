"""A planner of somebody else: by inheriting from `Planner` it is all that ours are."""

import pickle
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.composites import uses_elements
from hijack_data.config import dump
from hijack_data.errors import ParameterTypeError
from hijack_data.planner import leaves
from hijack_data.runs.run_planners import dump_planner, get_label, planner_params
from hijack_data.samples import SamplePlanner

SIZE = (200, 320)


class Rarely(hj.Planner):
    """A combinator of one's own: its part, at every tenth step."""

    def __init__(self, part: hj.Planner) -> None:
        self.part = part

    @property
    def parts(self) -> tuple[hj.Planner, ...]:
        return (self.part,)

    def is_due(self, step: int) -> bool:
        return step % 10 == 0 and self.part.is_due(step)

    def plan(self, scene: hj.Scene, *, step: int | None = None, **key: Any) -> hj.Plan:
        if (step or 0) % 10:
            return hj.Plan.clean(scene.size)
        return self.part.plan(scene, step=step, **key)


class Dots(hj.Planner):
    """A planner of one's own, without parts."""

    def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
        return hj.Marks(number=3, mark_size=9).plan(scene, **key)


class Lookalike:
    """Has all that is needed, and does not inherit."""

    needs_elements = False

    def plan(self, scene: hj.Scene, **key: Any) -> hj.Plan:
        return hj.Plan.clean(scene.size)


def test_what_follows_from_the_parts():
    locked = Rarely(hj.Sequence([hj.Verification(step=(0, 5, 10)), hj.Marks()]))
    assert (locked.label, locked.id, locked.params()) == ("rarely", "rarely", {})
    assert locked.effects == ("lock",)
    assert [step for step in range(-1, 21) if locked.is_due(step)] == [0, 10, 20]
    assert [leaf.id for leaf in leaves(locked)] == ["verification-v1", "marks-v1"]
    assert not locked.needs_elements
    assert Rarely(hj.PopUps()).needs_elements


def test_what_holds_without_parts():
    assert (Dots().label, Dots().effects, Dots().parts) == ("dots", (), ())
    assert Dots().needs_elements
    assert Dots().is_due(7)
    assert list(leaves(hj.OneOf([Rarely(dots := Dots())]))) == [dots]


def test_a_combinator_has_the_effects_of_its_parts_once():
    sequence = hj.OneOf([hj.NetworkError(), hj.Sequence([hj.Verification(), hj.NetworkError()])])
    assert sequence.effects == ("firewall", "lock")
    assert uses_elements(sequence)
    assert hj.Schedule(lambda epoch: hj.Verification() if epoch == 0 else hj.Marks()).effects == (
        "lock",
    )
    assert hj.OneOf([hj.Marks(), hj.Subtitle()]).effects == ()


@pytest.mark.parametrize("name", hj.corruption_names())
def test_a_corruption_declares_the_effects_of_its_plans(name):
    spec = hj.make_corruption(name)
    scene = hj.Scene((1080, 1920), [[10, 10, 60, 40]])
    assert tuple(effect.kind for effect in spec.plan(scene, seed=0).effects) == spec.effects
    assert bool(spec.effects) == (spec.scope != "observation")


def test_a_batch_call_takes_it():
    batch = np.full((4, *SIZE, 3), 240, np.uint8)
    mixed = hj.OneOf([Rarely(Dots()), hj.Marks(number=3, mark_size=9)])
    result = mixed(batch, ids=range(4), seed=1, steps=[0, 1, 10, 11])
    kinds = [plan.corruption for plan in result.plans]
    assert kinds == [
        mixed.plan(hj.Scene(SIZE), seed=1, sample=key, step=step).corruption
        for key, step in enumerate([0, 1, 10, 11])
    ]
    assert set(kinds) == {"marks-v1", "clean"}
    assert result.image[kinds.index("clean")].min() == 240


def test_others_take_it():
    assert SamplePlanner(Dots()).plan(SIZE, {}, 1).ops
    assert hj.plugin.plan_avoiding(Dots(), hj.Scene(SIZE), seed=1) is not None
    assert (get_label(Dots()), planner_params(Dots()), dump_planner(Dots())) == ("dots", {}, None)


def test_a_configuration_says_what_it_cannot_hold():
    with pytest.raises(ParameterTypeError, match="holds corruptions, OneOf and Sequence, got Dots"):
        dump([Dots()])


@pytest.mark.parametrize(
    "use",
    [
        lambda value: hj.OneOf([value]),
        lambda value: hj.Schedule(lambda _: value).plan(hj.Scene(SIZE), seed=1),
        lambda value: hj.plugin.plan_avoiding(value, hj.Scene(SIZE), seed=1),
        lambda value: SamplePlanner(value),
        lambda value: dump([value]),
    ],
)
def test_what_only_looks_like_one_is_told_apart(use):
    with pytest.raises(
        ParameterTypeError, match=r"method plan, but Lookalike must inherit from hijack_data\.Plan"
    ):
        use(Lookalike())
    with pytest.raises(ParameterTypeError, match=r"it is a class: give an instance, such as Marks"):
        use(hj.Marks)


def test_plan_must_be_written():
    class Nothing(hj.Planner):
        """Plans nothing."""

    with pytest.raises(TypeError, match="plan"):
        Nothing()  # type: ignore[abstract]


def test_planning_does_not_change_the_pickle():
    """Hugging Face datasets knows a transform by its pickle, and reuses its results."""
    marks = hj.Marks(number=7)
    before = pickle.dumps(marks)
    marks.plan(hj.Scene(size=(90, 160)), seed=1)
    assert pickle.dumps(marks) == before
