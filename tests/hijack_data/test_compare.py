"""Counting differing pixels gives the number of the plain definition."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hijack_data.kernels.cpu import compare


def planes(image):
    """The same pixels, each channel a plane of its own."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(image, -1, 0)), 0, -1)


def inside(image):
    """The same pixels inside a larger picture: rows are contiguous, the whole is not."""
    return np.pad(image, ((3, 2), (1, 5), (0, 0)), constant_values=9)[3:-2, 1:-5]


LAYOUTS = {
    "channels last": np.ascontiguousarray,
    "channels first": planes,
    "crop": inside,
    "crop, channels first": lambda image: np.moveaxis(
        np.pad(np.moveaxis(image, 2, 0), 2)[2:-2, 2:-2, 2:-2], 0, 2
    ),
    "upside down": lambda image: image[::-1].copy()[::-1],
    "planes reversed": lambda image: planes(image[:, :, ::-1])[:, :, ::-1],
    "mirrored": lambda image: image[:, ::-1].copy()[:, ::-1],
    "channels reversed": lambda image: image[:, :, ::-1].copy()[:, :, ::-1],
    "columns first": lambda image: image.swapaxes(0, 1).copy().swapaxes(0, 1),
    "every second pixel": lambda image: image.repeat(2, axis=1)[:, ::2],
    "every second byte": lambda image: image.repeat(2, axis=2)[:, :, ::2],
}
SIDE = st.one_of(st.integers(1, 30), st.integers(1, 200))
BOX = st.tuples(
    st.integers(-30, 210), st.integers(-30, 120), st.integers(0, 150), st.integers(0, 60)
)


def boxes_of(rows):
    return np.array([(x, y, x + w, y + h) for x, y, w, h in rows], np.int32).reshape(-1, 4)


def pair(seed, height, width, share):
    """Two pictures that differ in single channels, in `share` of the bytes."""
    rng = np.random.default_rng(seed)
    before = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    differs = rng.random(before.shape) < share
    return before, np.where(
        differs, before ^ rng.integers(1, 256, before.shape, dtype=np.uint8), before
    )


@settings(max_examples=300, deadline=None)
@given(
    seed=st.integers(0, 99),
    size=st.tuples(st.integers(1, 90), SIDE),
    share=st.sampled_from([0.005, 0.3, 1.0]),
    rows=st.lists(BOX, max_size=8),
    one=st.sampled_from(list(LAYOUTS)),
    two=st.one_of(st.none(), st.sampled_from(list(LAYOUTS))),
)
@example(seed=0, size=(1, 1), share=1.0, rows=[(0, 0, 1, 1)], one="channels first", two=None)
@example(seed=0, size=(3, 21), share=1.0, rows=[(0, 0, 21, 3)], one="channels last", two=None)
@example(seed=0, size=(3, 22), share=1.0, rows=[(0, 0, 22, 3)], one="channels last", two=None)
@example(seed=0, size=(3, 63), share=1.0, rows=[(0, 0, 63, 3)], one="channels first", two=None)
@example(
    seed=0,
    size=(3, 64),
    share=1.0,
    rows=[(0, 0, 64, 3), (63, 2, 9, 9)],
    one="channels first",
    two=None,
)
@example(
    seed=0,
    size=(9, 150),
    share=0.3,
    rows=[(40, 0, 9, 9), (0, 0, 50, 3), (130, 8, 60, 60)],
    one="crop",
    two=None,
)
@example(
    seed=1,
    size=(50, 100),
    share=0.3,
    rows=[(0, 0, 9, 9)] * 3,
    one="channels first",
    two="channels last",
)
def test_all_ways_count_the_same(seed, size, share, rows, one, two):
    """Where differences lie in the boxes alone they are counted once each; elsewhere both ways look
    at the same."""
    before, after = pair(seed, *size, share)
    boxes = boxes_of(rows)
    mask = np.zeros((*size, 1), bool)
    for x1, y1, x2, y2 in boxes.clip(0).tolist():
        mask[y1:y2, x1:x2] = True
    boxes_before, merged = boxes.copy(), np.where(mask, after, before)
    a, b, c = LAYOUTS[one](before), LAYOUTS[two or one](merged), LAYOUTS[two or one](after)
    assert compare.count(a, b, boxes) == int((before != merged).any(-1).sum())
    assert compare.count(a, c, boxes) == compare.count(before, after, boxes)
    assert np.array_equal(boxes, boxes_before)


def test_large_pictures_in_every_layout():
    before, after = pair(3, 700, 900, 0.2)
    whole_count, parts = (
        np.array([[0, 0, 900, 700]], np.int32),
        boxes_of([(5, 5, 800, 300), (0, 310, 40, 380)]),
    )
    for layout in LAYOUTS.values():
        first, second = layout(before), layout(after)
        assert compare.count(first, second, whole_count) == int((before != after).any(-1).sum())
        halves = (before != after).any(-1)
        assert compare.count(first, second, parts) == int(
            halves[5:305, 5:805].sum() + halves[310:690, :40].sum()
        )


def test_every_single_byte_is_seen():
    before = np.zeros((3, 70, 3), np.uint8)
    box = np.array([[1, 1, 70, 2]], np.int32)
    for layout in (np.ascontiguousarray, planes):
        for x in range(70):
            for channel in range(3):
                for value in (1, 255):
                    after = before.copy()
                    after[:, x, channel] = value
                    assert compare.count(layout(before), layout(after), box) == (x > 0)


def test_pictures_that_are_not_uint8_rgb():
    before = np.zeros((4, 90, 4), np.uint8)
    after = before.copy()
    after[2, 5:8, 1] = 1
    box = np.array([[0, 0, 90, 4]], np.int32)
    assert compare.count(planes(before), planes(after), box) == 3
    assert (
        compare.count(before[..., :3].astype(np.float32), after[..., :3].astype(np.float32), box)
        == 3
    )


def test_threads_may_count_at_once():
    pairs = [pair(seed, 90, 120, 0.1) for seed in range(16)]
    boxes = boxes_of([(0, 0, 100, 80), (90, 70, 30, 20)])
    with ThreadPoolExecutor(4) as pool:
        counts = list(pool.map(lambda both: compare.count(*both, boxes), pairs))
    assert counts == [compare.count(*both, boxes) for both in pairs]
