"""Pixels that a renderer of pages drew are compared with the plan where it paints them fully."""

import numpy as np

from hijack_data import Marks, PopUps, apply
from hijack_data.runs.page_layer import compare_painted
from hijack_data.types import Scene

SIZE = (300, 400)


def test_only_fully_painted_pixels_in_the_area_are_compared() -> None:
    plan = Marks(number=3, mark_type="rectangle", mark_size=10).plan(Scene(SIZE), seed=1)
    elsewhere = np.random.default_rng(0).integers(0, 256, (*SIZE, 3), np.uint8)
    pixels, difference = compare_painted(plan, apply(plan, elsewhere), SIZE)
    assert 800 < pixels <= 3 * 400  # the edge of the picture cuts some off
    assert difference == 0
    picture = apply(plan, elsewhere).copy()
    x, y = plan.ops[0].at[0]
    picture[max(y, 0), max(x, 0)] = (250, 3, 0)
    assert compare_painted(plan, picture, SIZE) == (pixels, 5)
    assert compare_painted(plan, picture, (0, 0)) == (0, 0)
    assert compare_painted(plan, elsewhere, SIZE)[1] > 100


def test_a_plan_without_pixels_has_nothing_to_compare() -> None:
    plan = PopUps().plan(Scene(SIZE, [(0, 0, 400, 300)]), seed=1)
    assert not plan.ops
    assert compare_painted(plan, np.zeros((*SIZE, 3), np.uint8), SIZE) == (0, 0)
