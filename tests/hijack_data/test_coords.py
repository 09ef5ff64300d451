"""Maps between observation and screen: points, boxes, vectors, composition, model space."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.coords import CoordMap
from hijack_data.errors import (
    ActionError,
    ParameterError,
    ParameterTypeError,
    PlanError,
    UnknownNameError,
)
from hijack_data.smart_resize import MAX_PIXELS, MIN_PIXELS, smart_resize
from hijack_data.types import Action

SIDES = st.integers(1, 5000)
SIZES = st.tuples(SIDES, SIDES)
HALF = CoordMap((540, 960), (1080, 1920))


@st.composite
def maps_and_points(draw):
    coords = CoordMap(draw(SIZES), draw(SIZES))
    height, width = coords.screen
    return coords, (draw(st.integers(0, width - 1)), draw(st.integers(0, height - 1)))


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((10, 20), (20, 40)),
        ((0, 0), (0, 0)),
        ((959, 539), (1918, 1078)),
        ((-7, 5000), (0, 1079)),
        ((0.25, 0.2), (1, 0)),
    ],
)
def test_points_scale_by_the_ratio_of_the_sides(point, expected):
    assert HALF.to_screen(point) == expected


def test_a_whole_number_names_a_pixel_and_its_centre_decides():
    assert HALF.to_observation((1, 3)) == (0, 1)  # centres at 0.75 and 1.75
    third = CoordMap((300, 300), (100, 100))
    assert third.to_screen((2, 1)) == (0, 0)
    assert third.to_screen((290, 292)) == (96, 97)
    assert third.to_observation((0, 99)) == (1, 298)  # the middle one of three pixels
    assert HALF.to_screen((10, 20)) == (20, 40)  # between two pixels: the left, upper one


def test_a_fractional_number_is_a_position_and_halves_round_up():
    assert HALF.to_screen((10.25, 20.7)) == (21, 41)
    assert HALF.to_observation((10.5, 21.5)) == (5, 11)
    assert CoordMap.identity((50, 50)).to_screen((10.5, 20.49)) == (11, 20)
    assert HALF.to_screen((10.0, 20.0)) == HALF.to_screen((10, 20))


def test_width_scales_x_and_height_scales_y():
    assert CoordMap((100, 200), (300, 200)).to_screen((10, 10)) == (10, 31)


def test_shapes_and_types_of_points():
    assert type(HALF.to_screen([3, 4])[0]) is int
    assert HALF.to_screen(np.array([3, 4])).dtype == np.int32
    grid = np.arange(24).reshape(3, 4, 2)
    mapped = HALF.to_screen(grid)
    assert mapped.dtype == np.int32
    np.testing.assert_array_equal(mapped, grid * 2)
    np.testing.assert_array_equal(grid, np.arange(24).reshape(3, 4, 2))
    assert HALF.to_screen([]).shape == (0, 2)
    assert HALF.to_screen(np.zeros((0, 2))).shape == (0, 2)
    np.testing.assert_array_equal(HALF.to_screen([[1, 2], [3, 4]]), [[2, 4], [6, 8]])


@pytest.mark.parametrize(
    "points",
    [
        (math.nan, 1),
        (1, math.inf),
        [[1, 2], [3, math.nan]],
        (1, 2, 3),
        5,
        None,
        "12",
        ("1", "2"),
        (True, False),
        (None, 1),
        [[1, 2], [3]],
        (10**400, 1),
        (1 + 2j, 1),
        [[[]]],
    ],
)
def test_what_is_no_point_is_an_action_error(points):
    with pytest.raises(ActionError, match="points must"):
        HALF.to_screen(points)


@given(maps_and_points())
def test_results_are_on_the_target_and_agree_with_exact_arithmetic(case):
    coords, point = case
    for value, item, size, screen in zip(
        point,
        coords.to_observation(point),
        coords.observation[::-1],
        coords.screen[::-1],
        strict=True,
    ):
        centre = Fraction(2 * value + 1, 2) * size / screen
        assert item == math.ceil(centre) - 1


@given(SIZES, st.integers(-(2**31), 2**31), st.integers(-(2**31), 2**31))
def test_the_identity_only_clamps(size, x, y):
    coords = CoordMap.identity(size)
    assert coords.is_identity
    assert coords.to_screen((x, y)) == (min(max(x, 0), size[1] - 1), min(max(y, 0), size[0] - 1))


@given(maps_and_points(), st.data())
def test_the_array_and_the_single_point_agree(case, data):
    coords, _ = case
    points = data.draw(
        st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=5)
    )
    assert coords.to_screen(np.array(points)).tolist() == [
        list(coords.to_screen(p)) for p in points
    ]


def test_boxes_scale_by_their_edges():
    np.testing.assert_array_equal(
        HALF.boxes_to_screen([[1, 2, 3, 4], [0, 0, 960, 540]]), [[2, 4, 6, 8], [0, 0, 1920, 1080]]
    )
    assert HALF.boxes_to_observation([[1, 1, 2, 2], [1, 2, 5, 8]]).tolist() == [
        [0, 0, 1, 1],
        [0, 1, 3, 4],
    ]
    assert HALF.boxes_to_screen(None).shape == (0, 4)
    assert HALF.boxes_to_screen([[-10, -10, 2000, 2000]]).tolist() == [[0, 0, 1920, 1080]]


def test_a_box_at_the_far_corner_keeps_a_pixel():
    tiny = CoordMap((1000, 1000), (3, 3))
    assert tiny.boxes_to_screen([[999, 999, 1000, 1000], [0, 0, 1, 1]]).tolist() == [
        [2, 2, 3, 3],
        [0, 0, 1, 1],
    ]


def test_empty_and_absent_boxes_stay_empty():
    tiny = CoordMap((1000, 1000), (3, 3))
    for box in ([5, 5, 5, 9], [2000, 5, 2100, 9], [-9, 5, -3, 9]):
        x1, y1, x2, y2 = tiny.boxes_to_screen([box])[0]
        assert x2 - x1 == 0 or y2 - y1 == 0


@given(SIZES, SIZES, st.data())
def test_a_box_on_the_screen_never_vanishes(observation, screen, data):
    height, width = screen
    x1, y1 = data.draw(st.integers(0, width - 1)), data.draw(st.integers(0, height - 1))
    x2, y2 = data.draw(st.integers(x1 + 1, width)), data.draw(st.integers(y1 + 1, height))
    coords = CoordMap(observation, screen)
    a, b, c, d = coords.boxes_to_observation([[x1, y1, x2, y2]])[0].tolist()
    x, y = coords.to_observation((x1, y1))
    assert a <= x < c
    assert b <= y < d
    assert 0 <= a < c <= observation[1]
    assert 0 <= b < d <= observation[0]
    exact = [
        v * o / s
        for v, o, s in zip((x1, y1, x2, y2), observation[::-1] * 2, screen[::-1] * 2, strict=True)
    ]
    assert all(abs(value - e) < 1 for value, e in zip((a, b, c, d), exact, strict=True))


def test_vectors_scale_keep_their_sign_and_are_not_clamped():
    assert HALF.vector_to_screen(-5000, 3) == (-10000, 6)
    assert HALF.vector_to_observation(-3, 3) == (-2, 2)
    assert HALF.vector_to_observation(0, -1) == (0, -1)


@st.composite
def boxes_with_a_point(draw):
    """A map, a box of pixels on its screen and a pixel in the box: x1, y1, x2, y2 and x, y."""
    coords = CoordMap(draw(SIZES), draw(SIZES))
    spans = []
    for side in coords.screen[::-1]:
        low = draw(st.integers(0, side - 1))
        high = draw(st.integers(low + 1, side))
        spans.append((low, high, draw(st.integers(low, high - 1))))
    (x1, x2, x), (y1, y2, y) = spans
    return coords, (x1, y1, x2, y2), (x, y)


def holds(box, point) -> bool:
    x1, y1, x2, y2 = box
    return x1 <= point[0] < x2 and y1 <= point[1] < y2


@given(boxes_with_a_point())
def test_a_point_in_a_box_maps_into_the_mapped_box(case):
    coords, box, point = case
    (calls,) = coords.boxes_to_observation([box]).tolist()
    assert holds(calls, coords.to_observation(point))
    (again,) = coords.boxes_to_screen([calls]).tolist()
    assert holds(again, coords.to_screen(coords.to_observation(point)))


@pytest.mark.parametrize("scale", [0.9, 0.75, 0.5, 0.35, 0.25, 1.3, 2, 3])
def test_every_pixel_of_a_button_maps_into_the_mapped_button(scale):
    screen = (1080, 1920)
    coords = CoordMap((round(1080 * scale), round(1920 * scale)), screen)
    for x1, y1 in ((100, 100), (101, 103), (1904, 1064), (0, 0), (777, 431)):
        (box,) = coords.boxes_to_observation([[x1, y1, x1 + 16, y1 + 16]]).tolist()
        points = [(x, y) for x in range(x1, x1 + 16) for y in range(y1, y1 + 16)]
        assert all(holds(box, p) for p in coords.to_observation(np.array(points)).tolist())


@given(maps_and_points())
def test_there_and_back_moves_by_half_a_cell_at_most(case):
    """So a click that is further than that from the edge of its element still hits it on the
    screen."""
    coords, point = case
    back = coords.to_screen(coords.to_observation(point))
    for value, again, size, screen in zip(
        point, back, coords.observation[::-1], coords.screen[::-1], strict=True
    ):
        assert abs(value - again) <= Fraction(screen, 2 * size) + Fraction(1, 2)


@given(SIZES, SIZES, st.data())
def test_the_centre_of_an_element_comes_back_inside_it(observation, screen, data):
    coords = CoordMap(observation, screen)
    box, point = [0, 0, 0, 0], [0, 0]
    for axis, (size, side) in enumerate(zip(observation[::-1], screen[::-1], strict=True)):
        # a pixel of the observation, and what rounding may cost
        least = min(side, side // size + 2)
        low = data.draw(st.integers(0, side - least))
        high = data.draw(st.integers(low + least, side))
        box[axis], box[axis + 2], point[axis] = low, high, (low + high) // 2
    assert holds(box, coords.to_screen(coords.to_observation(tuple(point))))


@given(SIZES, SIZES, st.integers(-9000, 9000), st.integers(-9000, 9000))
def test_opposite_vectors_stay_opposite(observation, screen, dx, dy):
    coords = CoordMap(observation, screen)
    x, y = coords.vector_to_screen(dx, dy)
    assert coords.vector_to_screen(-dx, -dy) == (-x, -y)


@pytest.mark.parametrize(
    "vector", [(math.nan, 0), (0, math.inf), (10**400, 0), ("1", 0), (None, 0), (0, 1e300)]
)
def test_bad_vectors_are_action_errors(vector):
    with pytest.raises(ActionError):
        HALF.vector_to_screen(*vector)


def test_actions_map_their_points_and_nothing_else():
    drag = Action("drag", 10, 20, 30, 40, keys=("shift",))
    assert HALF.action_to_screen(drag) == Action("drag", 20, 40, 60, 80, keys=("shift",))
    assert HALF.action_to_observation(HALF.action_to_screen(drag)) == drag
    assert HALF.action_to_screen(Action("scroll", 1, 2, amount=-54)) == Action(
        "scroll", 2, 4, amount=-54
    )
    typed = Action("type", text="click(10, 20)")
    assert HALF.action_to_screen(typed) == typed
    assert HALF.action_to_screen(Action("drag", x2=5, y2=6)) == Action("drag", x2=10, y2=12)
    with pytest.raises(ActionError):
        HALF.action_to_screen(Action("click", 10**400, 1))


@given(SIZES, SIZES, SIZES, st.data())
def test_composition_rounds_once_and_inverts(first, mid, last, data):
    a, b = CoordMap(first, mid), CoordMap(mid, last)
    combined = a.then(b)
    assert (combined.observation, combined.screen) == (first, last)
    assert combined.inverse() == b.inverse().then(a.inverse())
    x = data.draw(st.integers(0, first[1] - 1))
    assert (
        combined.to_screen((x, 0))[0] == math.ceil(Fraction(2 * x + 1, 2) * last[1] / first[1]) - 1
    )


def test_two_roundings_would_differ_from_one():
    a, b = CoordMap((10, 10), (3, 3)), CoordMap((3, 3), (1000, 1000))
    assert b.to_screen(a.to_screen((4, 4))) != a.then(b).to_screen((4, 4)) == (449, 449)


def test_maps_that_do_not_meet_are_refused():
    with pytest.raises(ParameterError, match=r"\(1080, 1920\).*\(540, 960\)"):
        HALF.then(HALF)


@given(SIZES, SIZES)
def test_json_round_trip(observation, screen):
    coords = CoordMap(observation, screen)
    assert CoordMap.from_json(coords.to_json()) == coords
    assert coords.to_json() == {"observation": list(observation), "screen": list(screen)}


@pytest.mark.parametrize(
    "data",
    [
        None,
        [],
        {},
        {"observation": [1, 2]},
        {"observation": [1, 2], "screen": [1]},
        {1: 2},
        {"observation": [1, 2], "screen": [0, 2]},
        {"observation": [1, 2], "screen": [1.5, 2]},
        {"observation": [1, 2], "screen": "ab"},
        {"observation": [1, 2], "screen": [10**400, 1]},
        {"observation": [1, 2], "screen": [1, 2], "more": 3},
    ],
)
def test_damaged_json_is_a_plan_error(data):
    with pytest.raises(PlanError, match="coords must be"):
        CoordMap.from_json(data)


@pytest.mark.parametrize(
    ("size", "error"),
    [
        ((0, 5), ParameterError),
        ((5,), ParameterTypeError),
        ("ab", ParameterTypeError),
        ((10**400, 5), ParameterError),
    ],
)
def test_bad_sizes_are_refused(size, error):
    with pytest.raises(error):
        CoordMap((5, 5), size)
    with pytest.raises(ParameterTypeError):
        CoordMap((math.inf, 5), (5, 5))


def test_maps_are_values():
    assert hash(CoordMap((1, 2), (3, 4))) == hash(CoordMap((1, 2), (3, 4)))
    assert CoordMap([1, 2], (3, 4)) == CoordMap((1, 2), (3, 4))


@pytest.mark.parametrize(
    ("size", "limits", "expected"),
    [
        ((1080, 1920), {}, (1092, 1932)),
        ((1080, 1920), {"max_pixels": 14 * 14 * 4 * 1280}, (728, 1316)),
        ((28, 28), {}, (56, 56)),
        ((20, 30), {}, (56, 84)),
        ((10, 10), {"min_pixels": 1}, (28, 28)),
        ((768, 1024), {}, (756, 1036)),
        ((2160, 3840), {}, (2156, 3836)),
        ((42, 700), {"min_pixels": 1}, (56, 700)),
    ],
)
def test_smart_resize(size, limits, expected):
    assert smart_resize(*size, **limits) == expected


@given(st.integers(1, 8000), st.integers(1, 8000))
def test_smart_resize_gives_multiples_within_the_limits(height, width):
    if max(height, width) > 200 * min(height, width):
        with pytest.raises(ParameterError, match="200 times"):
            smart_resize(height, width)
        return
    h, w = smart_resize(height, width)
    assert h % 28 == w % 28 == 0
    assert MIN_PIXELS <= h * w <= MAX_PIXELS


def test_smart_resize_refuses_limits_that_leave_no_size():
    for arguments in ((0, 5), (5, 5, 28, 10, 5), (5, 5, 0), (5, 5, 28, 1, 100)):
        with pytest.raises(ParameterError):
            smart_resize(*arguments)


def test_model_space_goes_straight_to_the_screen():
    model = CoordMap.model((1080, 1920))
    assert model == CoordMap((1092, 1932), (1080, 1920))
    assert model.to_screen((966, 546)) == (960, 540)
    resized = CoordMap.model((540, 960)).then(HALF)
    assert resized.screen == (1080, 1920)
    assert resized.observation == smart_resize(540, 960)


def test_unknown_dialects_get_a_suggestion():
    with pytest.raises(UnknownNameError, match="did you mean 'openai'"):
        HALF.typed_to_screen({}, "open_ai")
    with pytest.raises(UnknownNameError):
        CoordMap.identity((5, 5)).typed_to_screen("x", None)


def test_pyautogui_is_a_dialect_too():
    assert HALF.typed_to_screen("pyautogui.click(1, 2)", "pyautogui") == "pyautogui.click(2, 4)"
    assert (
        HALF.typed_to_observation("pyautogui.click(2, 4)", "pyautogui") == "pyautogui.click(1, 2)"
    )
    assert CoordMap.identity((5, 5)).typed_to_screen("not python (", "pyautogui") == "not python ("
