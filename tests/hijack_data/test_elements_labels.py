"""Recorded labels: every shape that is read, every mistake that is named."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.elements import boxes_from_labels
from hijack_data.errors import ElementsError

SIZE = (1000, 2000)


@pytest.mark.parametrize(
    "data",
    [
        [[10, 20, 110, 70]],
        [(10.2, 19.6, 109.5, 70.4)],
        np.array([[10, 20, 110, 70]], np.float32),
        [np.array([10, 20, 110, 70])],
        [{"bbox": [10, 20, 110, 70]}],
        [{"box": (10, 20, 110, 70), "score": 0.5}],
        [{"x": 10, "y": 20, "width": 100, "height": 50}],
        [{"rel_bbox": [0.005, 0.02, 0.05, 0.05], "abs_bbox": [9, 9, 9, 9]}],
        {"bboxes": [[10, 20, 110, 70]]},
        {"elements": [{"bbox": [10, 20, 110, 70]}]},
        {"type": "click", "metadata": {"bboxes": [{"rel_bbox": [0.005, 0.02, 0.05, 0.05]}]}},
    ],
)
def test_every_shape_gives_the_same_box(data: object) -> None:
    result = boxes_from_labels(data, size=SIZE)
    assert result.boxes.tolist() == [[10, 20, 110, 70]]
    assert result.boxes.dtype == np.int32
    assert result.source == "labels"


def test_fractions() -> None:
    data = [[0.005, 0.02, 0.055, 0.07], {"x": 0.5, "y": 0.5, "width": 0.5, "height": 0.5}]
    result = boxes_from_labels(data, normalized=True, size=SIZE)
    assert result.boxes.tolist() == [[10, 20, 110, 70], [1000, 500, 2000, 1000]]


def test_names_and_roles() -> None:
    data = [
        {"bbox": [0, 0, 1, 1], "text": "OK", "type": "button"},
        [0, 0, 2, 2],
        {"box": [0, 0, 3, 3], "name": 7},
    ]
    result = boxes_from_labels(data)
    assert result.names == ("OK", "", "")
    assert result.roles == ("button", "", "")


@pytest.mark.parametrize("data", [[], (), np.zeros((0, 4)), {}, {"metadata": {}}, {"bboxes": []}])
def test_no_labels(data: object) -> None:
    assert boxes_from_labels(data).boxes.shape == (0, 4)


def test_empty_and_overhanging_boxes_keep_their_place() -> None:
    data = [[5, 5, 5, 9], [-10, -10, 5000, 5000], [1, 2, 3, 4]]
    assert boxes_from_labels(data, size=SIZE).boxes.tolist() == data


GIANT = 10**5000


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "labels must be a list"),
        ("[[1, 2, 3, 4]]", "labels must be a list"),
        (7, "labels must be a list"),
        ({"foo": 1}, "labels must be a list"),
        ({"bboxes": 3}, "labels must be a list"),
        ([1, 2, 3, 4], r"labels\[0\] must be a list of 4 numbers"),
        ([[1, 2, 3]], r"labels\[0\] must have 4 numbers, got 3"),
        ([[0, 0, 1, 1], [0, 0, 1, 1, 1]], r"labels\[1\] must have 4 numbers, got 5"),
        ([[1, 2, 3, "4"]], r"labels\[0\]\[3\] must be a number, got '4'"),
        ([{"bbox": [1, 2, None, 4]}], r"labels\[0\]\.bbox\[2\] must be a number, got None"),
        ([{"bbox": [1, 2, True, 4]}], r"labels\[0\]\.bbox\[2\] must be a number, got True"),
        ([[0, 0, 1, float("nan")]], r"labels\[0\]\[3\] must be .*nan"),
        ([[0, 0, 1, float("inf")]], r"labels\[0\]\[3\] must be .*inf"),
        ([[0, 0, 1, GIANT]], r"labels\[0\]\[3\] must be .*inf"),
        ([[0, 0, GIANT]], "too many digits"),
        ([{"x": 1, "y": 2, "width": 3}], r"labels\[0\] has no 'height'"),
        ([{"x": 1, "y": 2, "width": 3, "height": "a"}], r"labels\[0\]\.height must be a number"),
        ([{"x": 1, "y": 2, "width": -3, "height": 4}], r"labels\[0\] = .*must not be negative"),
        ([{}], r"labels\[0\] has no 'x'"),
        ([[10, 10, 5, 20]], r"labels\[0\] = .*ends before it starts"),
        ([{"bbox": "1234"}], r"labels\[0\]\.bbox must be a list"),
        ([{"rel_bbox": [0.5, 0.5, 0.6, 0.1]}], r"labels\[0\]\.rel_bbox = .*leaves the screen"),
        ([{"rel_bbox": [0.5, 0.5, 0.5]}], r"labels\[0\]\.rel_bbox must have 4 numbers"),
    ],
)
def test_mistakes_name_index_and_field(data: object, message: str) -> None:
    with pytest.raises(ElementsError, match=message) as caught:
        boxes_from_labels(data, size=SIZE)
    assert len(str(caught.value)) < 400


def test_fractions_need_a_size_and_stay_in_range() -> None:
    with pytest.raises(ElementsError, match="give size="):
        boxes_from_labels([[0, 0, 1, 1]], normalized=True)
    with pytest.raises(ElementsError, match="give size="):
        boxes_from_labels([{"rel_bbox": [0, 0, 1, 1]}])
    with pytest.raises(ElementsError, match="0 to 1"):
        boxes_from_labels([[10, 20, 110, 70]], normalized=True, size=SIZE)


def test_agentnetbench(shared_data: Path) -> None:
    """The recorded point of each click lies in the box that its metadata holds."""
    clicks = 0
    for path in sorted((shared_data / "trajectories" / "agentnetbench").glob("*.json")):
        for step in json.loads(path.read_text())["steps"]:
            for action in step["ground_truth_actions"]:
                result = boxes_from_labels(action, size=(1080, 1920))
                assert len(result) == len(action["metadata"].get("bboxes", ()))
                if action["type"] == "click":
                    position = action["params"]["position"]
                    x1, y1, x2, y2 = result.boxes[0].tolist()
                    assert x1 - 1 <= position["x"] * 1920 <= x2 + 1
                    assert y1 - 1 <= position["y"] * 1080 <= y2 + 1
                    clicks += 1
    assert clicks > 10


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(
            st.sampled_from(["bbox", "x", "y", "width", "height", "rel_bbox", "bboxes", "text"]),
            inner,
        )
    ),
    max_leaves=12,
)


@given(json_like, st.booleans())
def test_any_json_raises_nothing_else(data: object, normalized: bool) -> None:
    try:
        result = boxes_from_labels(data, normalized, SIZE)
    except ElementsError:
        return
    assert result.boxes.shape == (len(result.names), 4)
    assert (result.boxes[:, 2:] >= result.boxes[:, :2]).all()


@given(st.lists(st.tuples(*[st.integers(-(2**20), 2**20)] * 4), max_size=5))
def test_whole_pixels_come_back_unchanged(rows: list[tuple[int, int, int, int]]) -> None:
    boxes = [[min(a, c), min(b, d), max(a, c), max(b, d)] for a, b, c, d in rows]
    assert boxes_from_labels(boxes).boxes.tolist() == boxes
    sized = [{"x": a, "y": b, "width": c - a, "height": d - b} for a, b, c, d in boxes]
    assert boxes_from_labels(sized).boxes.tolist() == boxes
