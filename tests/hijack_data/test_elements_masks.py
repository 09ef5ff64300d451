"""Parts and straight lines of a mask are those of OpenCV's statistics and openings, whatever the
picture."""

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hijack_data.elements.mask_parts import Parts, straight_lines

cv2 = pytest.importorskip("cv2", reason="needs the extra 'vision'")


@st.composite
def masks(draw: Any) -> np.ndarray:
    """Blocks, which make rows and long lines that repeat, or single pixels, which hang together by
    corners."""
    height, width, block = (draw(st.integers(1, limit)) for limit in (70, 70, 9))
    share = draw(st.sampled_from([0.0, 0.1, 0.4, 0.6, 0.9, 1.0]))
    cells = np.random.default_rng(draw(st.integers(0, 2**32))).random((height, width)) < share
    cells = cells.repeat(draw(st.integers(1, block)), 0).repeat(draw(st.integers(1, block)), 1)[
        :height, :width
    ]
    return np.ascontiguousarray(cells, np.uint8) * 255


def with_stats(mask: np.ndarray, connectivity: int) -> tuple[np.ndarray, np.ndarray]:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=connectivity)
    return labels, stats[1:]


def columns(parts: Parts) -> np.ndarray:
    return np.stack([parts.x, parts.y, parts.w, parts.h, parts.area], 1)


def in_order(rows: np.ndarray) -> list[list[int]]:
    return sorted(rows.tolist())


@given(masks(), st.sampled_from([4, 8]))
@example(np.zeros((1, 1), np.uint8), 8)
@example(np.full((1, 1), 255, np.uint8), 4)
@example(np.eye(9, dtype=np.uint8), 8)
@example(np.eye(9, dtype=np.uint8), 4)
def test_boxes_and_areas_are_those_of_opencv(mask: np.ndarray, connectivity: int) -> None:
    assert in_order(columns(Parts(cv2, mask, connectivity))) == in_order(
        with_stats(mask, connectivity)[1]
    )


@given(masks(), st.sampled_from([4, 8]), st.integers(1, 200))
def test_parts_are_taken_away_whole(mask: np.ndarray, connectivity: int, area: int) -> None:
    parts = Parts(cv2, mask, connectivity)
    labels, stats = with_stats(mask, connectivity)
    expected = np.concatenate([[False], stats[:, 4] >= area])
    assert np.array_equal(parts.without(parts.area < area), expected[labels] * np.uint8(255))


@given(masks(), st.sampled_from([4, 8]), st.integers(0, 2**32))
def test_what_another_mask_touches(mask: np.ndarray, connectivity: int, seed: int) -> None:
    second = (np.random.default_rng(seed).random(mask.shape) < 0.02) * np.uint8(255)
    parts = Parts(cv2, mask, connectivity)
    labels, stats = with_stats(mask, connectivity)
    touched = np.isin(np.arange(len(stats)) + 1, labels[second > 0])
    result = parts.touching(second)
    assert in_order(columns(parts)[result]) == in_order(stats[touched])
    assert in_order(columns(parts)[~result]) == in_order(stats[~touched])


@given(masks(), st.integers(0, 45).map(lambda half: 2 * half + 1))
@example(np.full((5, 3), 255, np.uint8), 91)
def test_straight_lines_are_those_of_opencv(mask: np.ndarray, length: int) -> None:
    """At the edge of the picture too, where half a line is enough."""
    across, down = (np.ones(shape, np.uint8) for shape in ((1, length), (length, 1)))
    opened_masks = [cv2.morphologyEx(mask, cv2.MORPH_OPEN, block) for block in (across, down)]
    assert np.array_equal(straight_lines(cv2, mask, length), cv2.max(*opened_masks))
