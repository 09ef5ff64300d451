"""Label safety: what still shows, what is covered, what changed."""

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.conformance import picture
from hijack_data.drawing.raster import png_recipe
from hijack_data.errors import ParameterError
from hijack_data.plan import Paste, Plan, Resample
from hijack_data.safety import changed_pixels, covered, hidden, target_visible, visible_share

SIZE = (100, 200)


def box_plan(x, y, w, h, alpha=255, size=SIZE, after=()):
    rgba = np.full((h, w, 4), 7, np.uint8)
    rgba[..., 3] = alpha
    return Plan("test-v1", size, ops=(Paste(png_recipe(rgba), ((x, y),)), *after))


@pytest.mark.parametrize(
    ("target", "share"),
    [
        ((10, 10, 30, 30), 0.0),
        ((20, 10, 40, 30), 0.5),
        ((100, 50, 120, 60), 1.0),
        ((15, 15), 0.0),
        ((150, 80), 1.0),
    ],
)
def test_visible_share_of_a_target(target, share):
    assert target_visible(box_plan(0, 0, 30, 40), target) == pytest.approx(share)


def test_without_a_target_there_is_no_answer():
    assert target_visible(box_plan(0, 0, 5, 5), None) is None


@pytest.mark.parametrize(
    ("target", "end", "share"), [((15, 15), (150, 80), 0.0), ((150, 80), (20, 10, 40, 30), 0.5)]
)
def test_the_lesser_share_of_a_drags_ends_counts(target, end, share):
    plan = box_plan(0, 0, 30, 40)
    assert (
        target_visible(plan, target, end)
        == target_visible(plan, end, target)
        == pytest.approx(share)
    )


def test_faint_sprites_hide_nothing():
    assert target_visible(box_plan(0, 0, 50, 50, alpha=100), (10, 10, 20, 20)) == 1.0
    assert target_visible(box_plan(0, 0, 50, 50, alpha=200), (10, 10, 20, 20)) == 0.0


def test_targets_are_followed_through_a_resize():
    plan = box_plan(0, 0, 100, 100, after=(Resample((50, 100)),))
    assert hidden(plan).shape == (50, 100)
    assert target_visible(plan, (90, 40, 110, 60)) == pytest.approx(0.5)
    assert (
        target_visible(hj.Resolution().plan(hj.Scene(size=SIZE), seed=1), (90, 40, 110, 60)) == 1.0
    )


def test_boxes_off_the_screen_show_nothing():
    assert visible_share(
        Plan.clean(SIZE), [[300, 10, 320, 20], [5, 5, 5, 9], [-10, -10, 10, 10]]
    ) == [0.0, 0.0, 1.0]


def test_covered_boxes():
    boxes = [[0, 0, 20, 20], [20, 0, 60, 20], [100, 50, 120, 60]]
    assert covered(box_plan(0, 0, 45, 40), boxes) == (0, 1)
    assert covered(box_plan(0, 0, 35, 40), boxes) == (0,)


def test_changed_pixels():
    before = picture(SIZE)
    after = before.copy()
    after[5, 5] += 1
    after[6, 7, 2] += 1
    assert changed_pixels(before, after) == 2
    assert changed_pixels(before, before) == 0
    assert changed_pixels(before, before[:50, :100]) == 5000


@pytest.mark.parametrize("layers", [1, 300])
def test_few_and_many_stamps_hide_the_same(layers):
    """Shares from single stamps and from a mask of the whole picture are those of the
    definition."""
    rng = np.random.default_rng(layers)
    rgba = rng.integers(0, 256, (20, 30, 4), dtype=np.uint8)
    at = tuple((int(x), int(y)) for x, y in rng.integers(-20, 190, (layers, 2)))
    plan = Plan("test-v1", SIZE, ops=(Paste(png_recipe(rgba), at),))
    boxes = [[x, y, x + 40, y + 30] for x in range(0, 160, 11) for y in range(0, 70, 7)]
    result = np.zeros((300, 300), bool)
    for x, y in at:
        result[y + 50 : y + 70, x + 50 : x + 80] |= rgba[..., 3] >= 128
    expected = [1 - result[50:150, 50:250][y1:y2, x1:x2].mean() for x1, y1, x2, y2 in boxes]
    assert visible_share(plan, boxes) == pytest.approx(expected, abs=1e-12)
    assert min(expected) < 1


def test_judge_puts_it_together():
    before = picture(SIZE)
    plan = box_plan(0, 0, 30, 40)
    safety = hj.judge(
        plan,
        before,
        hj.apply(plan, before),
        target=(0, 0, 10, 10),
        boxes=[[0, 0, 9, 9], [90, 90, 99, 99]],
    )
    assert safety.target_visible == 0.0
    assert safety.covered == (0,)
    assert 1190 <= safety.changed_pixels <= 1200


@pytest.mark.parametrize(
    ("target", "end", "share"),
    [
        ((15, 15), (150, 80), 0.0),
        ((150, 80), (20, 10, 40, 30), 0.5),
        ((150, 80), (160, 80), 1.0),
        (None, (15, 15), 0.0),
    ],
)
def test_judge_takes_the_lesser_share_of_a_drags_ends(target, end, share):
    before, plan = picture(SIZE), box_plan(0, 0, 30, 40)
    safety = hj.judge(
        plan, before, hj.apply(plan, before), target=target, end=end, boxes=[[0, 0, 9, 9]]
    )
    assert safety.target_visible == target_visible(plan, target, end) == pytest.approx(share)
    assert safety.covered == (0,)


def test_planning_around_the_target():
    scene = hj.Scene(size=(300, 400), target=(150, 100, 250, 200))
    spec = hj.Marks(number=4, mark_size=20)
    plain = [target_visible(spec.plan(scene, seed=1, sample=i), scene.target) for i in range(20)]
    assert min(plain) < 1.0
    for i in range(20):
        plan = hj.plugin.plan_avoiding(spec, scene, seed=1, sample=i)
        assert plan is None or target_visible(plan, scene.target) == 1.0
        assert plan == hj.plugin.plan_avoiding(spec, scene, seed=1, sample=i)
    visible_index = next(i for i, share in enumerate(plain) if share == 1.0)
    assert hj.plugin.plan_avoiding(spec, scene, seed=1, sample=visible_index) == spec.plan(
        scene, seed=1, sample=visible_index
    )


def test_planning_around_a_target_that_cannot_be_saved():
    scene = hj.Scene(size=(300, 400), target=(0, 0, 400, 300))
    assert hj.plugin.plan_avoiding(hj.Marks(), scene, seed=1) is None
    assert hj.plugin.plan_avoiding(hj.Marks(), scene, seed=1, at_least=0.0) is not None
    with pytest.raises(ParameterError, match="at_least"):
        hj.plugin.plan_avoiding(hj.Marks(), scene, seed=1, at_least=2)
