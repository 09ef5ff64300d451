"""Combinators and whole batches: the id alone decides, whatever the order, the batch or the
process."""

import json
import subprocess
import sys

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.config import load_config
from hijack_data.conformance import picture, reference, scene
from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.params import Every

SIZE = (360, 640)


def aug():
    small = [
        hj.PopUps(width=300, height=200),
        hj.Marks(number=9),
        hj.Subtitle(font_size=20),
        hj.Resolution(),
    ]
    return hj.OneOf(small, p_clean=0.2)


def batch(ids):
    return np.stack([np.roll(picture(SIZE), hash_free(i), axis=1) for i in ids])


def hash_free(key):
    return sum(map(ord, str(key))) % 50


def digests(ids, **key):
    res = aug()(batch(ids), ids=ids, seed=7, **key)
    return {i: p.digest() for i, p in zip(ids, res.plans, strict=True)}


IDS = [f"row-{i}" for i in range(8)]


def test_order_and_batch_do_not_matter():
    whole_digests = digests(IDS)
    assert digests(IDS[::-1]) == whole_digests
    parts: dict[str, str] = {}
    for start in range(0, 8, 3):
        parts.update(digests(IDS[start : start + 3]))
    assert parts == whole_digests
    assert digests(IDS, epoch=1) != whole_digests


def test_another_process_plans_the_same():
    code = (
        "import json, hijack_data as hj, sys; from hijack_data.conformance import"
        " scene\nprint(json.dumps({n: hj.make_corruption(n).plan(scene((1080, 1920)), seed=5,"
        " sample='p').digest() for n in hj.corruption_names()}))"
    )
    out = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONHASHSEED": "77"},
    ).stdout
    here = {
        n: hj.make_corruption(n).plan(scene((1080, 1920)), seed=5, sample="p").digest()
        for n in hj.corruption_names()
    }
    assert json.loads(out) == here


def test_results_are_those_of_the_definition():
    boxes = [scene(SIZE).boxes] * 8
    targets = [(600, 330)] * 8
    images = batch(IDS)
    res = aug()(images, ids=IDS, boxes=boxes, targets=targets, seed=7)
    kinds = {p.corruption for p in res.plans}
    assert len(kinds) >= 3
    for i, plan in enumerate(res.plans):
        assert np.array_equal(res.image[i], reference(plan, images[i]))
        scale = plan.out_size[0] / SIZE[0]
        assert res.boxes[i].max() <= 640 * scale
        assert res.targets[i] == tuple(int(np.floor(v * scale + 0.5)) for v in (592, 322, 608, 338))
        assert res.safety[i].target_visible is not None
        assert (res.safety[i].changed_pixels == 0) == (plan.corruption == "clean")


def test_a_drag_is_judged_at_both_ends():
    images, target, end = batch(IDS), (20, 20), (460, 260)
    res = aug()(images, ids=IDS, targets=[target] * 8, ends=[end] * 7 + [None], seed=7)
    starts = aug()(images, ids=IDS, targets=[target] * 8, seed=7)
    pairs = list(zip(res.plans, images, strict=True))
    results = [
        min(hj.judge(p, i, i, target=t).target_visible for t in (target, end)) for p, i in pairs
    ]
    assert res.plans == starts.plans
    assert (
        [s.target_visible for s in res.safety[:7]]
        == results[:7]
        != [s.target_visible for s in starts.safety[:7]]
    )
    assert res.safety[7].target_visible == starts.safety[7].target_visible


def test_torch_batches():
    torch = pytest.importorskip("torch")
    images = batch(IDS)
    result = aug()(images, ids=IDS, seed=7)
    second = aug()(torch.from_numpy(images).permute(0, 3, 1, 2).contiguous(), ids=IDS, seed=7)
    assert [p.digest() for p in result.plans] == [p.digest() for p in second.plans]
    for a, b in zip(result.image, second.image, strict=True):
        assert np.array_equal(a, b.permute(1, 2, 0).numpy())


def test_p_clean_is_a_probability():
    screen = hj.Scene(size=SIZE)
    mostly = hj.OneOf([hj.Marks(number=1)], p_clean=0.7)
    clean = sum(mostly.plan(screen, seed=1, sample=i).corruption == "clean" for i in range(1000))
    assert 650 < clean < 750
    assert hj.OneOf([hj.Marks()], p_clean=1).plan(screen, seed=1).corruption == "clean"


def test_a_trigger_of_each_step_is_drawn_at_most_so_often_in_an_episode():
    screen = hj.Scene(size=SIZE)
    corruption = hj.make_corruption("accidental_touch", step=Every(2))
    config = {"one_of": {"options": [corruption.to_config()], "p_clean": 0.5, "max_times": 2}}
    capped = load_config({"corruptions": [config]}).corruptions["one_of"]
    free = hj.OneOf([corruption], p_clean=0.5)
    assert capped.to_config()["one_of"] == config["one_of"] | {"weights": [1.0]}

    def steps(planner, sample):
        plans = {k: planner.plan(screen, seed=1, sample=sample, step=k) for k in range(-1, 40)}
        return [k for k, plan in plans.items() if plan.effects]

    for sample in range(20):
        assert steps(capped, sample) == steps(free, sample)[:2], "steps without an effect count not"
    assert len({tuple(steps(capped, sample)) for sample in range(20)}) > 10
    marks = hj.OneOf([hj.Marks(number=1)], max_times=3)
    acting = [bool(marks.plan(screen, seed=1, step=k).ops) for k in range(5)]
    assert acting == [True, True, True, False, False]
    rarely = hj.OneOf([hj.Marks(number=1)], p_clean=0.9)
    nested = hj.OneOf([hj.Sequence([rarely])], max_times=2)
    for sample in range(8):  # a step at which the part stays clean takes nothing from the cap
        plans = [nested.plan(screen, seed=0, sample=sample, step=step) for step in range(80)]
        assert sum(bool(plan.ops) for plan in plans) == 2
    with pytest.raises(ParameterError, match="OneOf: max_times must be int in"):
        hj.OneOf([hj.Marks()], max_times=0)


def test_weights():
    screen = hj.Scene(size=SIZE)
    composition = hj.OneOf([hj.Marks(number=1), hj.Resolution()], weights=[3, 1])
    marks = sum(
        composition.plan(screen, seed=1, sample=i).corruption == "marks-v1" for i in range(1000)
    )
    assert 700 < marks < 800
    never = hj.OneOf([hj.Marks(), hj.Resolution()], weights=[0, 1])
    assert {never.plan(screen, seed=1, sample=i).corruption for i in range(50)} == {"resolution-v2"}


def test_a_sequence_sees_what_came_before():
    screen = scene(SIZE)
    plan = hj.Sequence(
        [hj.Resolution(), hj.Marks(number=5, avoid_elements=True), hj.Subtitle(font_size=12)]
    ).plan(screen, seed=1)
    assert plan.corruption == "resolution-v2+marks-v1+subtitle-v2"
    assert plan.out_size == (180, 320)
    half = plan.coords.boxes_to_observation(screen.boxes)
    for x, y in plan.ops[1].at:
        assert 0 <= x <= 280
        assert all(
            x + 40 <= b[0] or x >= b[2] or y + 40 <= b[1] or y >= b[3] for b in half.tolist()
        )
    image = picture(SIZE)
    assert np.array_equal(hj.apply(plan, image), reference(plan, image))


def test_visual_and_state_corruptions_compose():
    plan = hj.Sequence([hj.Subtitle(font_size=20), hj.NetworkError()]).plan(
        hj.Scene(size=SIZE), seed=1, step=-1
    )
    assert len(plan.ops) == 1
    assert [e.kind for e in plan.effects] == ["firewall"]


def test_schedule_follows_the_epoch():
    rising = hj.Schedule(lambda epoch: hj.Marks.at(min(1 + epoch, 5)))
    counts = [len(rising.plan(hj.Scene(size=SIZE), seed=1, epoch=e).ops[0].at) for e in range(6)]
    assert counts == [10, 25, 50, 100, 200, 200]


def test_needs_elements_is_passed_on():
    assert hj.OneOf([hj.Subtitle(), hj.PopUps()]).needs_elements
    assert not hj.Sequence([hj.Subtitle(), hj.Marks()]).needs_elements


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: hj.OneOf([]), ParameterError, "at least one"),
        (lambda: hj.OneOf([hj.Marks]), ParameterTypeError, "takes corruptions such as Marks"),
        (lambda: hj.OneOf([hj.Marks()], p_clean=1.5), ParameterError, "p_clean"),
        (lambda: hj.OneOf([hj.Marks()], weights=[1, 2]), ParameterError, "weights"),
        (lambda: hj.Sequence(["marks"]), ParameterTypeError, "takes corruptions"),
        (lambda: aug()(batch(IDS), ids=IDS[:3], seed=1), ParameterError, "3 ids for 8 pictures"),
        (lambda: aug()(batch(IDS), ids=["a"] * 8, seed=1), ParameterError, "'a' appears twice"),
        (
            lambda: aug()(batch(IDS), ids="abcdefgh", seed=1),
            ParameterTypeError,
            "a list with one id",
        ),
        (lambda: aug()(batch(IDS)[0], ids=IDS, seed=1), ParameterError, "4 axes"),
        (
            lambda: aug()(batch(IDS), ids=IDS, boxes=[[]], seed=1),
            ParameterError,
            "1 boxes for 8 pictures",
        ),
        (
            lambda: aug()(batch(IDS), ids=IDS, ends=[(1, 2)], seed=1),
            ParameterError,
            "1 ends for 8 pictures",
        ),
        (lambda: aug()(batch(IDS), ids=IDS, ends=["a"] * 8, seed=1), ParameterTypeError, "a point"),
        (
            lambda: aug()(batch("ab"), ids=["a", "b"], targets=[np.array([5, 6])] * 2, seed=1),
            ParameterError,
            "targets of a batch of 2.*one number of all pictures each",
        ),
        (lambda: aug()(batch(IDS), ids=IDS, seed=-1), ParameterError, "seed must be"),
    ],
)
def test_refusals(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize("what", ["targets", "ends"])
def test_a_point_off_its_picture_is_refused(what):
    half = hj.OneOf([hj.Resolution(scale=0.5)])
    points = {"targets": [(5, 5)], what: [(700, 20)]}
    with pytest.raises(ParameterError, match=r"\(700, 20\) is outside the 640x360 screen"):
        half(batch(["a"]), ids=["a"], seed=1, **points)
    edge = {"targets": [(5, 5)], what: [(641, 20)]}  # recorded a little beside the edge
    assert half(batch(["a"]), ids=["a"], seed=1, **edge).safety[0].target_visible == 1.0
