"""Formats of labels: each follows the pixels, agrees with every other one, and comes back as it was
written."""

import json
from collections import namedtuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.coords import CoordMap, smart_resize
from hijack_data.errors import LabelError, ParameterTypeError, UnknownNameError
from hijack_data.labels import ALIASES, FORMATS, Labels, Move, find_format

SIZE = (1080, 1920)
HALF = hj.Resolution(scale=0.5).plan(hj.Scene(SIZE), seed=1)
Point = namedtuple("Point", "x y")


def follow(labels, plan=HALF, **sample):
    return Labels(labels).follow(plan, sample)


@pytest.mark.parametrize(
    ("form", "value", "expected"),
    [
        ("xyxy", [100, 200, 300, 401], [50, 100, 150, 201]),
        ("pascal_voc", [100, 200, 300, 401], [50, 100, 150, 201]),
        ("xywh", [100, 200, 200, 201], [50, 100, 100, 101]),
        ("coco", (101, 200, 200, 200), (50, 100, 101, 100)),
        ("cxcywh", [200, 300, 200, 200], [100, 150, 100, 100]),
        ("yxyx", [200, 100, 400, 300], [100, 50, 200, 150]),
        ("xyxy", [100.5, 200.25, 300.0, 400.0], [50.25, 100.125, 150.0, 200.0]),
        ("xywh", [[100.5, 200.25, 30.0, 40.0]], [[50.25, 100.125, 15.0, 20.0]]),
        ("cxcywh", [15.0, 20.0, 5.0, 6.0], [7.5, 10.0, 2.5, 3.0]),
        ("xyxy", [4, 4, 5, 5], [2, 2, 3, 3]),
        ("xyxy", [-10, -10, 30, 40], [-5, -5, 15, 20]),
        ("xyxy", [], []),
        ("xyxy", None, None),
        ("yolo", [0.5, 0.5, 0.1, 0.2], [0.5, 0.5, 0.1, 0.2]),
        ("albumentations", [0.1, 0.2, 0.3, 0.4], [0.1, 0.2, 0.3, 0.4]),
        ("xyxy1000", [100, 200, 300, 400], [100, 200, 300, 400]),
        ("point", (101, 51), (50, 25)),
        ("point", (101.5, 203.25), (50.75, 101.625)),
        ("xy", [[101, 51], [0, 0], [1919, 1079]], [[50, 25], [0, 0], [959, 539]]),
        ("xy", [101, 51, 1919, 1079], [50, 25, 959, 539]),
        ("xy", Point(101, 51), Point(50, 25)),
        ("xy", [(101, 51), None, (3, 5)], [(50, 25), None, (1, 2)]),
        (
            "polygon",
            [[10, 10, 20, 10, 20, 30], [4, 4, 8, 8]],
            [[5, 5, 10, 5, 10, 15], [2, 2, 4, 4]],
        ),
        ("yx", [51, 101], [25, 50]),
        ("xy", (1930, 540), (959, 270)),  # within 5 % of the side: at the edge
        ("point01", (0.5, 0.25), (0.5, 0.25)),
        ("point1000", (500, 250), (500, 250)),
        ("xyv", [101, 51, 2, 0, 0, 0], [50, 25, 2, 0, 0, 0]),
        ("xyv", [[101, 51, 1], [-1, -1, 0]], [[50, 25, 1], [-1, -1, 0]]),
        ("x", 101, 50),
        ("y", [51, 1.5], [25.5, 0.75]),
        ("dx", -31, -16),
        ("dy", 30.0, 15.0),
        ("width", 1920, 960),
        ("hw", [1080, 1920], [540, 960]),
        ("wh", (1920, 1080), (960, 540)),
        ("leave", [100, 200, 300, 400], [100, 200, 300, 400]),
        (None, "click(100, 200)", "click(100, 200)"),
        ("action", hj.Action("drag", 101, 51, 10, 20), hj.Action("drag", 50, 25, 5, 10)),
        ("action", {"type": "click", "x": 101, "y": 51}, {"type": "click", "x": 50, "y": 25}),
        ("action", {"type": "wait", "x": None, "y": None}, {"type": "wait", "x": None, "y": None}),
        ("pyautogui", "pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
        ("pyautogui", b"pyautogui.click(100, 50)", b"pyautogui.click(50, 25)"),
        ("pyautogui", ["pyautogui.click(100, 50)", "DONE"], ["pyautogui.click(50, 25)", "DONE"]),
        ("openai", {"type": "click", "x": 100, "y": 50}, {"type": "click", "x": 50, "y": 25}),
        ("openai", '{"type": "click", "x": 100, "y": 50}', '{"type": "click", "x": 50, "y": 25}'),
        (
            "anthropic",
            [
                {"action": "left_click", "coordinate": [100, 50]},
                {"action": "type", "text": "click(100, 50)"},
            ],
            [
                {"action": "left_click", "coordinate": [50, 25]},
                {"action": "type", "text": "click(100, 50)"},
            ],
        ),
        (
            "computer_13",
            {"action_type": "CLICK", "parameters": {"x": 100, "y": 50}},
            {"action_type": "CLICK", "parameters": {"x": 50, "y": 25}},
        ),
        ("ui_tars", "Action: click(start_box='(500,250)')", "Action: click(start_box='(500,250)')"),
    ],
)
def test_each_format(form, value, expected):
    before = repr(value)
    out = follow({"entry": form}, entry=value).get("entry", value)
    assert out == expected
    assert type(out) is type(expected)
    assert repr(value) == before


def test_ui_tars_15_is_in_pixels_of_the_smart_resized_picture():
    out = follow(
        {"reply": "ui_tars_1.5"}, reply="Thought: (3, 4)\nAction: click(start_box='(966,546)')"
    )["reply"]
    space = CoordMap(smart_resize(540, 960), smart_resize(*SIZE))
    x, y = space.to_observation((966, 546))
    assert out == f"Thought: (3, 4)\nAction: click(start_box='({x},{y})')"


@pytest.mark.parametrize(
    "kind", ["list", "tuple", "int32", "float32", "int16", "torch", "torch float", "jax"]
)
def test_values_come_back_as_what_they_came_in(kind):
    rows = [[100, 200, 300, 400], [8, 8, 16, 16]]
    if kind.startswith("torch"):
        torch = pytest.importorskip("torch")
        value = torch.tensor(rows, dtype=torch.float16 if kind == "torch float" else torch.int16)
    elif kind == "jax":
        value = pytest.importorskip("jax.numpy").asarray(rows)
    else:
        value = {"list": lambda: rows, "tuple": lambda: tuple(map(tuple, rows))}.get(
            kind, lambda: np.array(rows, kind)
        )()
    out = follow({"boxes": "xyxy"}, boxes=value)["boxes"]
    assert np.asarray(out).tolist() == [[50, 100, 150, 200], [4, 4, 8, 8]]
    assert type(out) is type(value)
    assert getattr(out, "dtype", None) == getattr(value, "dtype", None)


def test_a_dtype_that_is_too_small_is_said():
    double = hj.Resolution(scale=2).plan(hj.Scene((400, 400)), seed=1)
    with pytest.raises(LabelError, match=r"'box'.*no longer fits its dtype uint8"):
        follow({"box": "xyxy"}, double, box=np.array([100, 100, 200, 200], np.uint8))
    with pytest.raises(LabelError, match=r"'x'.*no longer fits its dtype int8"):
        follow({"x": "x"}, double, x=np.int8(100))


def test_a_dtype_that_is_too_small_is_said_by_every_framework():
    double = hj.Resolution(scale=2).plan(hj.Scene((400, 400)), seed=1)
    jax_numpy = pytest.importorskip("jax.numpy")
    with pytest.raises(LabelError, match="no longer fits its dtype uint8"):
        follow({"point": "xy"}, double, point=jax_numpy.asarray([200, 100], "uint8"))
    torch = pytest.importorskip("torch")
    tv_tensors = pytest.importorskip("torchvision.tv_tensors")
    pair = torch.tensor([[200, 100]], dtype=torch.uint8)
    points = tv_tensors.KeyPoints(pair, canvas_size=(400, 400))
    with pytest.raises(LabelError, match=r"no longer fits its dtype torch\.uint8"):
        follow({}, double, points=points)


def test_masks_follow_by_the_centres_of_pixels():
    small = hj.Resolution(scale=0.5).plan(hj.Scene((4, 8)), seed=1)
    mask = np.arange(32).reshape(4, 8)
    assert follow({"mask": "mask"}, small, mask=mask)["mask"].tolist() == mask[1::2, 1::2].tolist()
    assert follow({"mask": "mask"}, small, mask=mask.tolist())["mask"] == mask[1::2, 1::2].tolist()
    flags = np.array([mask % 2 == 0])
    assert follow({"mask": "mask"}, small, mask=flags)["mask"].dtype == bool
    with pytest.raises(LabelError, match=r"\[..., 4, 8\], got shape \[5, 8\]"):
        follow({"mask": "mask"}, small, mask=np.zeros((5, 8)))


def test_entries_inside_others():
    sample = {
        "objects": {"bbox": [[100, 200, 30, 40], [2, 4, 6, 8]], "category": [1, 2]},
        "annotations": [{"box": [100, 200, 130, 240], "name": "ok"}, {"name": "no box"}],
        "a.b": (100, 50),
    }
    labels = {"objects.bbox": "coco", "annotations.box": "xyxy", "a.b": "xy"}
    labels_after = follow({**labels, "objects.category": "leave"}, **sample)
    assert labels_after["objects"] == {
        "bbox": [[50, 100, 15, 20], [1, 2, 3, 4]],
        "category": [1, 2],
    }
    assert labels_after["annotations"] == [
        {"box": [50, 100, 65, 120], "name": "ok"},
        {"name": "no box"},
    ]
    assert labels_after["a.b"] == (50, 25)
    assert sample["objects"]["bbox"][0] == [100, 200, 30, 40]
    assert sample["annotations"][0]["box"] == [100, 200, 130, 240]


@pytest.mark.parametrize(
    ("form", "value", "message"),
    [
        ("xyxy", [0.1, 0.2, 0.3, 0.4], "fractions of the picture; formats for those end in 01"),
        ("xywh", [[0.1, 0.2, 0.3, 0.4]], "fractions of the picture"),
        ("xyxy1000", [0.1, 0.2, 0.3, 0.4], "fractions of the picture"),
        ("point", (0.5, 0.25), "fractions of the picture"),
        ("point1000", (0.5, 0.25), "fractions of the picture"),
        ("x", 0.5, "fractions of the picture"),
        ("action", {"type": "click", "x": 0.5, "y": 0.25}, "fractions"),
        (
            "xyxy",
            [100, 200, 50, 240],
            r"ends before it starts; boxes of x, y, width, height are 'xywh'",
        ),
        ("xywh", [100, 200, -50, 240], "ends before it starts"),
        ("xyxy01", [100, 200, 300, 400], r"leaves 0\.\.1; formats in pixels"),
        ("xyxy1000", [100, 200, 1900, 400], r"leaves 0\.\.1000"),
        ("point01", (960, 540), r"leaves 0\.\.1"),
        ("xyxy", [2500, 100, 2600, 200], "outside the 1920x1080 picture"),
        ("xy", (5000, 10), "coordinate 5000 is outside the picture, whose width is 1920 pixels"),
        ("xy", (10, -200), "coordinate -200 is outside the picture, whose height is 1080"),
        ("xy", (-1, -1), r"the point \(-1, -1\); where there is none, give None"),
        ("action", hj.Action("click", 5000, 10), "coordinate 5000 is outside"),
        ("pyautogui", "pyautogui.click(5000, 10)", "coordinate 5000 is outside"),
        ("openai", {"type": "click", "x": 5000, "y": 1}, "coordinate 5000 is outside"),
        ("xyxy", [1, 2, 3], "groups of 4 numbers"),
        ("xyxy", 5, "groups of 4 numbers"),
        ("xy", [[1, 2, 3]], "groups of 2 numbers"),
        ("xyxy", "100,200,300,400", "must hold numbers"),
        ("xyxy", [1, 2, 3, float("nan")], "finite"),
        ("xyxy", [True, False, True, True], "must hold numbers"),
        ("xy", {"x": 1, "y": 2}, "must hold numbers"),
        ("width", 1000, r"as width of the picture it would be \[1920\]"),
        ("hw", [1920, 1080], "as hw of the picture"),
        ("action", {"kind": "click"}, "must be an Action, or a dictionary"),
        ("action", "click", "must be an Action"),
        ("openai", "click(1, 2)", "is not JSON"),
        ("openai", {"type": "klick"}, "no action 'klick'"),
        ("pyautogui", "pyautogui.click(*f())", "a star argument is not allowed"),
        ("mask", [[1, 2], [3]], "lists of different lengths"),
    ],
)
def test_what_cannot_follow_is_an_error_that_names_key_and_remedy(form, value, message):
    with pytest.raises(LabelError, match=message) as caught:
        follow({"entry": form}, entry=value)
    assert "'entry'" in str(caught.value)
    assert "labels={'entry': ...}" in str(caught.value)


def test_declarations_that_are_none():
    with pytest.raises(
        UnknownNameError, match=r"'pascal-voc'; did you mean 'pascal_voc'\?.*known: xyxy, "
    ):
        Labels({"box": "pascal-voc"})
    with pytest.raises(ParameterTypeError, match="a name such as 'xyxy', got 5"):
        Labels({"box": 5})
    with pytest.raises(ParameterTypeError, match="labels must be a dictionary"):
        Labels(["box"])
    with pytest.raises(ParameterTypeError, match="3 is not a string"):
        Labels({3: "xyxy"})


def test_names():
    assert set(ALIASES.values()) <= set(FORMATS)
    assert all(find_format(name.upper()) is FORMATS[target] for name, target in ALIASES.items())
    assert {"pyautogui", "ui_tars", "anthropic", "openai", "leave"} <= set(FORMATS)


@st.composite
def cases(draw):
    """A move, a box of pixels and a pixel in it."""
    sides = st.integers(2, 3000)
    before, after = (draw(sides), draw(sides)), (draw(sides), draw(sides))
    corners, point = [], []
    for side in before[::-1]:
        low = draw(st.integers(0, side - 1))
        high = draw(st.integers(low + 1, side))
        corners.append((low, high))
        point.append(draw(st.integers(low, high - 1)))
    (x1, x2), (y1, y2) = corners
    return Move(before, after), (x1, y1, x2, y2), tuple(point)


def inside(box, point):
    return box[0] <= point[0] < box[2] and box[1] <= point[1] < box[3]


@given(cases())
def test_a_point_in_a_box_stays_in_it_whatever_they_are_written_as(case):
    move, (x1, y1, x2, y2), (x, y) = case
    x1n, y1n, w, h = FORMATS["xywh"].map_value([x1, y1, x2 - x1, y2 - y1], move)
    box = FORMATS["xyxy"].map_value([x1, y1, x2, y2], move)
    assert box == [x1n, y1n, x1n + w, y1n + h]
    ty1, tx1, ty2, tx2 = FORMATS["yxyx"].map_value([y1, x1, y2, x2], move)
    assert box == [tx1, ty1, tx2, ty2]
    point = FORMATS["xy"].map_value((x, y), move)
    action = FORMATS["action"].map_value(hj.Action("click", x, y), move)
    typed = FORMATS["openai"].map_value({"type": "click", "x": x, "y": y}, move)
    code = FORMATS["pyautogui"].map_value(f"pyautogui.click({x}, {y})", move)
    alone = FORMATS["x"].map_value(x, move), FORMATS["y"].map_value(y, move)
    assert inside(box, point)
    assert point == action.point == (typed["x"], typed["y"]) == alone
    assert code == f"pyautogui.click({point[0]}, {point[1]})"
    exact = FORMATS["xyxy"].map_value([float(x1), float(y1), float(x2), float(y2)], move)
    middle = FORMATS["xy"].map_value((x + 0.5, y + 0.5), move) if (x, y) != (0, 0) else point
    assert inside([v - 1e-9 for v in exact[:2]] + [v + 1e-9 for v in exact[2:]], middle)
    assert all(abs(edge - e) < 1 for edge, e in zip(box, exact, strict=True))


@given(cases())
def test_formats_say_where_they_point(case):
    move, (x1, y1, x2, y2), (x, y) = case
    size = move.before
    height, width = size
    for form, value in (
        ("xyxy", [x1, y1, x2, y2]),
        ("xywh", [x1, y1, x2 - x1, y2 - y1]),
        ("cxcywh", [(x1 + x2) / 2, (y1 + y2) / 2, float(x2 - x1), float(y2 - y1)]),
        ("xyxy01", [x1 / width, y1 / height, x2 / width, y2 / height]),
    ):
        (point,) = FORMATS[form].locate(value, size)
        assert point.target == pytest.approx((x1, y1, x2, y2))
    for form, value in (
        ("xy", (x, y)),
        ("yx", (y, x)),
        ("action", hj.Action("click", x, y)),
        ("anthropic", {"action": "left_click", "coordinate": [x, y]}),
        ("anthropic", json.dumps({"action": "left_click", "coordinate": [x, y]})),
    ):
        (point,) = FORMATS[form].locate(value, size)
        assert point.target == (x, y)
