"""The geometry against plain references: every pixel on small screens, every strip on large
ones."""

import time
import tracemalloc
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.geometry import free, intersection_area, largest_free_rectangle, place_disjoint
from hijack_data.rng import Stream
from hijack_data.types import as_boxes

LIMIT = 9  # sides of the screens whose every pixel is looked at

sizes = st.tuples(st.integers(1, LIMIT), st.integers(1, LIMIT))


def one_box(low=-3, high=LIMIT + 3):
    pair = st.tuples(st.integers(low, high), st.integers(low, high)).map(sorted)
    return st.tuples(pair, pair).map(lambda p: (p[0][0], p[1][0], p[0][1], p[1][1]))


def box_rows(low=-3, high=LIMIT + 3, most=8):
    return st.lists(one_box(low, high), max_size=most)


def painted(size, rows):
    """A boolean picture of the pixels that the boxes cover."""
    height, width = size
    picture = np.zeros(size, bool)
    for x1, y1, x2, y2 in rows:
        picture[
            np.clip(y1, 0, height) : np.clip(y2, 0, height),
            np.clip(x1, 0, width) : np.clip(x2, 0, width),
        ] = True
    return picture


def picture_of(rows):
    """The same with a margin, so that the boxes that `one_box` draws stay inside."""
    return painted((LIMIT + 8, LIMIT + 8), [tuple(v + 4 for v in row) for row in rows])


def by_pixels(size, rows):
    """Every rectangle of the screen, every pixel of it; the tie-break as documented."""
    height, width = size
    covered = np.pad(painted(size, rows).cumsum(0).cumsum(1), ((1, 0), (1, 0))).tolist()
    best = (0, 0, 0, 0, 0)
    for y1, y2 in combinations(range(height + 1), 2):
        for x1, x2 in combinations(range(width + 1), 2):
            if covered[y2][x2] - covered[y1][x2] - covered[y2][x1] + covered[y1][x1] == 0:
                best = min(best, (-(y2 - y1) * (x2 - x1), y1, x1, y2, x2))
    _, y1, x1, y2, x2 = best
    return x1, y1, x2, y2


def area_by_strips(size, boxes):
    """The area of the largest free rectangle: the widest gap between every two horizontal edges."""
    height, width = size
    boxes = np.clip(boxes.astype(np.int64), 0, [width, height, width, height])
    x1, y1, x2, y2 = np.array(sorted([*boxes.tolist(), [width, 0, width, height]])).T
    best = 0
    for top in {0, *y2.tolist()} - {height}:
        bottoms = np.array(sorted(b for b in {height, *y1.tolist()} if b > top))
        inside = (y1 < bottoms[:, None]) & (y2 > top)
        reach = np.maximum.accumulate(np.where(inside, x2, 0), axis=1)
        before = np.pad(reach, ((0, 0), (1, 0)))[:, :-1]
        best = max(best, int(((x1 - before).max(axis=1) * (bottoms - top)).max()))
    return best


def area(box):
    return (box[2] - box[0]) * (box[3] - box[1])


def random_boxes(seed, count, size, largest):
    rng = np.random.default_rng(seed)
    corners = rng.integers(-largest, [size[1], size[0]], (count, 2))
    return as_boxes(
        np.concatenate([corners, corners + rng.integers(1, largest, (count, 2))], axis=1)
    )


def hang_from_bars(count, pitch, bar):
    """`count` bars across and `count` down a square screen: its holes touch no corner of any
    box."""
    starts, side = np.arange(count) * pitch, count * pitch
    zeros, ends = np.zeros(count, int), np.full(count, side)
    across = np.stack([zeros, starts, ends, starts + bar], axis=1)
    return (side, side), as_boxes(np.concatenate([across, across[:, [1, 0, 3, 2]]]))


@settings(max_examples=600, deadline=None)
@given(sizes, box_rows())
def test_largest_free_rectangle_is_the_best_of_all_rectangles(size, rows):
    assert largest_free_rectangle(size, as_boxes(rows)) == by_pixels(size, rows)


@settings(max_examples=150, deadline=None)
@given(sizes, box_rows(0, LIMIT, 24))
def test_largest_free_rectangle_in_a_crowd(size, rows):
    # else nothing would be left
    thin = [(x1, y1, min(x2, x1 + 2), min(y2, y1 + 2)) for x1, y1, x2, y2 in rows]
    assert largest_free_rectangle(size, as_boxes(thin)) == by_pixels(size, thin)


@settings(max_examples=100, deadline=None)
@given(st.data(), box_rows())
def test_order_and_repetition_do_not_matter(data, rows):
    size = (LIMIT, LIMIT)
    shuffled = data.draw(
        st.permutations(rows + data.draw(st.lists(st.sampled_from(rows)) if rows else st.just([])))
    )
    assert largest_free_rectangle(size, as_boxes(shuffled)) == largest_free_rectangle(
        size, as_boxes(rows)
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 150), st.sampled_from([20, 90, 400]))
def test_on_a_real_size_it_is_free_and_cannot_be_beaten(seed, count, largest):
    size = (1080, 1920)
    boxes = random_boxes(seed, count, size, largest)
    result = largest_free_rectangle(size, boxes)
    assert 0 <= result[0] < result[2] <= 1920
    assert 0 <= result[1] < result[3] <= 1080
    assert free(result, boxes)
    assert area(result) == area_by_strips(size, boxes)


@pytest.mark.parametrize(
    ("size", "rows", "expected"),
    [
        ((1, 1), [], (0, 0, 1, 1)),
        ((1, 1), [(0, 0, 1, 1)], (0, 0, 0, 0)),
        ((1, 1), [(-5, -5, 0, 0), (1, 0, 3, 1)], (0, 0, 1, 1)),
        ((1080, 1920), [], (0, 0, 1920, 1080)),
        ((1080, 1920), [(-9, -9, 2000, 2000)], (0, 0, 0, 0)),
        ((1080, 1920), [(0, 0, 960, 1080), (960, 0, 1920, 1080)], (0, 0, 0, 0)),
        ((1080, 1920), [(5, 5, 5, 900), (7, 9, 900, 9)], (0, 0, 1920, 1080)),
        ((1080, 1920), [(0, 0, 1920, 1079)], (0, 1079, 1920, 1080)),
        ((1080, 1920), [(3000, 10, 3100, 20), (-50, 10, -40, 20)], (0, 0, 1920, 1080)),
        ((10, 10), [(-4, -4, 2, 20)], (2, 0, 10, 10)),
    ],
)
def test_edge_cases(size, rows, expected):
    assert largest_free_rectangle(size, as_boxes(rows)) == expected


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([(0, 4, 10, 6)], (0, 0, 10, 4)),  # above and below are equal: the smaller y1
        ([(4, 0, 6, 10)], (0, 0, 4, 10)),  # left and right are equal: the smaller x1
        ([(0, 0, 5, 5)], (5, 0, 10, 10)),  # right of the corner and below it: the smaller y1
        ([(5, 5, 10, 10)], (0, 0, 10, 5)),  # the same corner: the smaller y2
        ([(0, 0, 5, 5), (5, 4, 10, 10), (0, 9, 5, 10)], (5, 0, 10, 4)),  # y1 counts before x1
        # the wider one is met first: the smaller x1
        ([(3, 0, 4, 10), (0, 4, 3, 10), (4, 2, 10, 10)], (0, 0, 3, 4)),
        ([(3, 0, 4, 10), (0, 6, 2, 10), (4, 2, 10, 10), (2, 3, 3, 10)], (0, 0, 2, 6)),
        (
            [(0, 0, 10, 1), (4, 1, 5, 10), (5, 6, 10, 10), (9, 1, 10, 6), (0, 6, 4, 10)],
            (0, 1, 4, 6),
        ),
    ],
)
def test_ties_are_broken_as_documented(rows, expected):
    for order in (rows, rows[::-1]):
        assert largest_free_rectangle((10, 10), as_boxes(order)) == expected


def test_a_tie_with_a_span_that_reaches_the_floor():
    # 6 x 2 on the right is met first, 2 x 6 on the left wins
    rows = [(3, 0, 4, 6), (4, 2, 10, 6), (2, 3, 3, 6)]
    assert largest_free_rectangle((6, 10), as_boxes(rows)) == (0, 0, 2, 6)


def test_the_result_is_plain_integers():
    result = largest_free_rectangle((1080, 1920), as_boxes([(10, 10, 500, 500)]))
    assert [type(v) for v in result] == [int] * 4


def test_areas_beyond_int32():
    box = as_boxes([(0, 0, 1, 1)])
    assert largest_free_rectangle((100_000, 100_000), box) == (1, 0, 100_000, 100_000)
    assert largest_free_rectangle((2**31 - 1, 2**31 - 1), as_boxes(None)) == (
        0,
        0,
        2**31 - 1,
        2**31 - 1,
    )


def test_the_boxes_are_left_as_they_were():
    boxes = random_boxes(0, 30, (1080, 1920), 100)
    before = boxes.copy()
    boxes.flags.writeable = False
    largest_free_rectangle((1080, 1920), boxes)
    place_disjoint(Stream(0, "marks-v1"), (1080, 1920), 10, 5, 50, boxes)
    assert np.array_equal(boxes, before)


def test_holes_between_crossing_bars():
    size, bars = hang_from_bars(count=30, pitch=7, bar=3)
    assert largest_free_rectangle(size, bars) == (3, 3, 7, 7)
    wider = bars.copy()
    wider[20, 1] += 1  # the upper edge of one bar across: the holes above it are one pixel higher
    assert largest_free_rectangle(size, wider) == (3, 136, 7, 141)


@pytest.mark.parametrize("largest", [20, 300, 1500])
def test_thousands_of_boxes_end_soon_and_take_little_memory(largest):
    size = (32_000, 32_000)
    boxes = random_boxes(largest, 5000, size, largest)
    start = time.process_time()
    result = largest_free_rectangle(size, boxes)
    assert time.process_time() - start < 5
    assert area(result) > 0
    assert free(result, boxes)
    for grown in np.array(result) + np.array(
        [(-1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
    ):
        leaves = grown.min() < 0 or grown.max() > 32_000
        assert leaves or not free(tuple(grown.tolist()), boxes)
    tracemalloc.start()
    largest_free_rectangle(size, boxes[:2000])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * 2**20


def test_a_thousand_crossing_bars_end_soon():
    size, bars = hang_from_bars(count=500, pitch=60, bar=30)
    start = time.process_time()
    assert largest_free_rectangle(size, bars) == (30, 30, 60, 60)
    # a quarter of a million holes: cubic time would be far beyond
    assert time.process_time() - start < 1.5


@settings(max_examples=200, deadline=None)
@given(one_box(), box_rows())
def test_overlaps_count_shared_pixels(box, rows):
    shared = [int((picture_of([box]) & picture_of([row])).sum()) for row in rows]
    areas = intersection_area(box, as_boxes(rows))
    assert areas.dtype == np.int64
    assert areas.tolist() == shared
    assert free(box, as_boxes(rows)) is (sum(shared) == 0)


def test_overlaps_beyond_int32():
    side = 2**30
    boxes = as_boxes([(-side, -side, side, side), (0, 0, 1, 1)])
    assert intersection_area((-side, -side, side, side), boxes).tolist() == [2**62, 1]


def one_by_one(stream, size, half, number, attempts, rows):
    """Algorithm "Marks" word for word, looking at pixels."""
    height, width = size
    picture = painted(size, rows)
    placed, used_attempts = [], 0
    while len(placed) < number and used_attempts < attempts:
        x = stream.integer(half, width - half)
        y = stream.integer(half, height - half)
        if not picture[y - half : y + half, x - half : x + half].any():
            placed.append((x, y))
        used_attempts += 1
    return placed, used_attempts


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 2**32),
    st.tuples(st.integers(8, 40), st.integers(8, 40)),
    st.integers(0, 4),
    st.integers(0, 30),
    st.integers(0, 60),
    box_rows(-3, 40),
)
def test_placing_equals_one_attempt_at_a_time(seed, size, half, number, attempts, rows):
    stream, plain = Stream(seed, "marks-v1"), Stream(seed, "marks-v1")
    result = place_disjoint(stream, size, half, number, attempts, as_boxes(rows))
    assert result == one_by_one(plain, size, half, number, attempts, rows)
    assert stream.word() == plain.word()  # nothing drawn ahead


@pytest.mark.parametrize("number", [50, 700])
def test_placing_on_a_crowded_screen_equals_one_attempt_at_a_time(number):
    size, boxes = (1080, 1920), random_boxes(3, 120, (1080, 1920), 160)
    stream, plain = Stream(1, "marks-v1"), Stream(1, "marks-v1")
    placed, used_attempts = place_disjoint(stream, size, 25, number, 1000, boxes)
    assert (placed, used_attempts) == one_by_one(plain, size, 25, number, 1000, boxes)
    assert stream.word() == plain.word()
    assert 0 < len(placed) < used_attempts


def test_placing_without_boxes_simply_draws():
    plain = Stream(5, "marks-v1")
    points = [(plain.integer(12, 1908), plain.integer(12, 1068)) for _ in range(600)]
    assert place_disjoint(Stream(5, "marks-v1"), (1080, 1920), 12, 600, 1000, as_boxes(None)) == (
        points,
        600,
    )


def test_placing_gives_up_after_the_attempts():
    covered = as_boxes([(0, 0, 1920, 1080)])
    assert place_disjoint(Stream(0, "marks-v1"), (1080, 1920), 10, 50, 777, covered) == ([], 777)


def test_placing_on_a_screen_that_is_too_small():
    stream = Stream(0, "marks-v1")
    assert place_disjoint(stream, (19, 100), 10, 5, 50, as_boxes(None)) == ([], 0)
    assert place_disjoint(stream, (100, 19), 10, 5, 50, as_boxes(None)) == ([], 0)
    assert stream.word() == Stream(0, "marks-v1").word()
    assert place_disjoint(stream, (20, 20), 10, 2, 50, as_boxes(None)) == ([(10, 10), (10, 10)], 2)
