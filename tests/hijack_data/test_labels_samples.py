"""Labels in samples: what is declared follows the pixels everywhere, what is not is an error."""

import copy
import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.conformance import picture
from hijack_data.errors import LabelError, ParameterError, ParameterTypeError
from hijack_data.labels import Labels
from hijack_data.safety import target_visible

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
from torchvision import tv_tensors  # noqa: E402

import hijack_data.transforms as tr  # noqa: E402

SIZE = (216, 384)
PIXELS = picture(SIZE)
HALF = hj.Resolution(scale=0.5)


def tensor():
    return torch.from_numpy(PIXELS.copy()).permute(2, 0, 1)


def half(sample, **settings):
    return tr.Resolution(scale=0.5, **settings)({"image": tensor(), "id": 1, **sample})


@dataclasses.dataclass
class Spot:
    """A label of somebody's own."""

    point: tuple[int, int]


# --- what is not declared

TELLING: dict[str, Any] = {
    "bbox": [100, 20, 300, 40],
    "boxes": torch.tensor([[10, 20, 30, 40]]),
    "gt_boxes": np.array([[10, 20, 30, 40.5]]),
    "groundTruthBox": (10, 20, 30, 40),
    "click": (100, 200),
    "click_point": [100.5, 200],
    "keypoints": [[1, 2], [30, 40], [50, 60]],
    "polygon": [10, 10, 20, 10, 20, 30],
    "segmentation": [[10, 10, 20, 10, 20, 30], [4, 4, 8, 8]],
    "x": 100,
    "cy": 50.5,
    "top": torch.tensor(30),
    "answer_xy": "unused",
    "action": {"type": "click", "x": 10, "y": 20, "button": "left"},
    "actions": [{"action": "left_click", "coordinate": [10, 20]}],
    "action_code": "click(start_box='(10,20)')",
    "tool_calls": (
        '{"name": "computer", "arguments": {"action": "left_click", "coordinate": [10, 20]}}'
    ),
    "response": "Thought: there it is.\nAction: click(start_box='(10,20)')",
    "answer": "<point>10 20</point>",
    "messages": [
        {"role": "user", "content": "click"},
        {"role": "assistant", "content": "pyautogui.click(10, 20)"},
    ],
    "conversations": [{"from": "gpt", "value": "click(x=10, y=20)"}],
    "objects": {"bbox": [[10, 20, 30, 40]], "category": [3]},
    "annotations": [{"name": "ok"}, {"bbox": [10, 20, 30, 40], "category_id": 3}],
    "click_at": {"u": 10, "v": [10, 20]},
    "gt": [10, 20],
    "xyzzy": [10, 20, 30, 40],  # under any name: four numbers that could be pixels of this picture
    "pair": torch.tensor([[10.0, 20.0]]),
    "mask": np.zeros(SIZE, bool),
    "depth": torch.zeros((1, *SIZE)),
    "image_size": [384, 216],
    "original_size": (216, 384),
}
TELLING["answer_xy"] = [10, 20]
TELLING |= {
    # as CSV files have them
    "rect": ["10", "20", "30", "40"],
    "bounds": "10 20 30 40",
    "y": "20",
    "roi": [["10", "20", "30", "40"]],
    # of kinds that NumPy does not have, or does not take apart
    "box_half": torch.tensor([10.0, 20, 30, 40], dtype=torch.bfloat16),
    "points_of": np.array([np.zeros((3, 2)), np.full((2, 2), 30.0)], dtype=object),
    "regions": np.array(["10,20", "30,40"]),
    "pts": {(10, 20)},
    "quad": torch.nested.nested_tensor(
        [torch.tensor([[10.0, 20]]), torch.ones(3, 2) * 9], layout=torch.jagged
    ),
    "later": [[], [10, 20]],
    "noted": Spot(point=(10, 20)),
    # a box's sides, not the picture's
    "w": 30,
    "height": 40,
    "object": {"width": [30, 31, 32], "kind": "button"},
    # one value for each pixel, the channel last
    "classes_of_pixels": np.zeros((*SIZE, 1), np.uint8),
    "flags": np.zeros((*SIZE, 3), bool),
    "one_hot": np.zeros((*SIZE, 7), np.uint8),
    # an action under any name
    "text": "Action: click(start_box='(10,20)')",
    "chosen": "pyautogui.click(10, 20)",
}


PICTURE_SHAPED = ("depth", "classes_of_pixels", "flags")


def paste(error):
    """The declarations that an error prints, as the dictionary that a user would paste."""
    text = str(error)
    return eval(text[text.index("labels={") + len("labels=") :])


def test_an_undeclared_label_is_an_error_that_names_key_and_remedy():
    for key, value in TELLING.items():
        with pytest.raises(LabelError) as caught:
            half({key: value})
        assert next(iter(paste(caught.value))).startswith(key)
        if key not in PICTURE_SHAPED:
            tr.Marks(seed=3)({"image": tensor(), "id": 1, key: value})  # moves no pixel
            tr.Resolution(scale=0.5, restore=True)({"image": tensor(), "id": 1, key: value})


def test_one_error_declares_all_entries_together():
    with pytest.raises(LabelError) as caught:
        half(TELLING)
    labels = paste(caught.value)
    assert {path.partition(".")[0] for path in labels} == set(TELLING)
    expected = {
        "bbox": "xyxy",
        "click": "xy",
        "x": "x",
        "mask": "mask",
        "image_size": "wh",
        "objects.bbox": "xyxy",
        "messages.content": "pyautogui",
        "actions.coordinate": "xy",
        "noted": "leave",
    }
    assert {path: labels[path] for path in expected} == expected
    declarations = dict.fromkeys(labels, "leave")
    assert half(TELLING, labels=declarations)["bbox"] == TELLING["bbox"]


@pytest.mark.parametrize(
    "entry",
    [
        {"instruction": "Open cell (10, 20) and type [100, 200]"},
        {"text": "Save", "thought": "at (10, 20)", "user_instruction": b"(10, 20)"},
        {"target_id": "17", "reward": 3.5, "num_steps": torch.tensor(12), "trajectory_id": "7/9"},
        {"label": 3, "category_id": 7, "target_class": torch.tensor(5)},
        {"bbox": [], "points": None, "boxes": torch.zeros((0, 4)), "none": np.array([], object)},
        {"width": 384, "height": 216},
        {"action": {"type": "wait"}, "action_code": "WAIT"},
        {
            "action": "scroll down",
            "answer": "yes",
            "tags": ["ok", "step 2"],
            "meta": {"app": "os 3"},
        },
        {"messages": [{"role": "user", "content": "Please click OK"}]},
        {"step": 3, "epoch": 1, "split": "train", "target_visible": 0.5},
        {"flag": True, "raw": b"\x00\x01", "annotations": [{"category_id": 3, "name": "a"}] * 3},
    ],
    ids=lambda entry: next(iter(entry)),
)
def test_what_is_no_label_passes(entry):
    out = half(entry)
    for key, value in entry.items():
        if key in ("width", "height"):
            assert out[key] == value // 2
        else:
            assert out[key] is value or out[key] == value


def test_items_beside_the_picture_in_a_tuple_are_declared_by_their_number():
    item = torch.tensor([[10, 20, 30, 40]])
    with pytest.raises(LabelError, match="'item 1': 'xyxy'"):
        tr.Resolution(scale=0.5, id_from="content")((tensor(), item))
    transform = tr.Resolution(scale=0.5, id_from="content", labels={"item 1": "xyxy"})
    assert transform((tensor(), item))[1].tolist() == [[5, 10, 15, 20]]
    image, entries = tr.Resolution(scale=0.5, labels={"bbox": "xywh"})(
        (tensor(), {"id": 1, "bbox": [10, 20, 30, 40]})
    )
    assert (tuple(image.shape), entries["bbox"]) == ((3, 108, 192), [5, 10, 15, 20])
    assert tr.Resolution(scale=0.5, id_from="content")((tensor(), 7))[1] == 7


# --- what is declared

DECLARED = {
    "bbox": "xywh",
    "click": "point",
    "norm": "point01",
    "act": "openai",
    "keypoints": "xy",
    "note": "leave",
    "objects.bbox": "coco",
    "objects.category": "leave",
    "mask": "mask",
    "image_size": "wh",
}
SAMPLE: dict[str, Any] = {
    "bbox": [100, 20, 30, 40],
    "click": (110, 30),
    "norm": (0.5, 0.25),
    "act": {"type": "click", "x": 110, "y": 30},
    "keypoints": [[1, 2], [30, 40]],
    "note": [10, 20],
    "objects": {"bbox": [[100, 20, 30, 40]], "category": [3]},
    "mask": np.arange(SIZE[0] * SIZE[1]).reshape(SIZE),
    "image_size": (384, 216),
    "width": 384,
    "height": 216,
    "instruction": "a",
}
EXPECTED = {
    **SAMPLE,
    "bbox": [50, 10, 15, 20],
    "click": (55, 15),
    "act": {"type": "click", "x": 55, "y": 15},
    "keypoints": [[0, 1], [15, 20]],
    "objects": {"bbox": [[50, 10, 15, 20]], "category": [3]},
    "image_size": (192, 108),
    "width": 192,
    "height": 108,
    "mask": SAMPLE["mask"][1::2, 1::2],
}


def check(out):
    for key, value in EXPECTED.items():
        assert np.array_equal(
            np.asarray(out[key], object if key == "objects" else None), np.asarray(value)
        ), key


@pytest.mark.parametrize(
    "make",
    [
        lambda **k: tr.Resolution(scale=0.5, **k),
        lambda **k: tr.Corrupt(HALF, **k),
        lambda **k: tr.OneOf([HALF], **k),
        lambda **k: tr.Sequence([HALF], **k),
        lambda **k: tr.Schedule(lambda _: HALF, **k),
        lambda **k: tr.FromConfig({"corruptions": ["resolution"]}, **k),
        lambda **k: tr.Replay(HALF.plan(hj.Scene(SIZE), seed=1), **k),
    ],
)
def test_every_transform_takes_labels(make):
    sample = {"image": tensor(), "id": 1, **copy.deepcopy(SAMPLE)}
    out = make(labels=DECLARED)(sample)
    check(out)
    assert sample["bbox"] == [100, 20, 30, 40]
    assert sample["objects"] == SAMPLE["objects"]


def test_grain_takes_labels():
    hg = pytest.importorskip("hijack_data.grain")
    for corrupt in (hg.Corrupt(HALF, labels=DECLARED), hg.RandomCorrupt(HALF, labels=DECLARED)):
        element = {"image": PIXELS, "id": 1, **copy.deepcopy(SAMPLE)}
        result = (
            corrupt.map(element)
            if hasattr(corrupt, "map")
            else corrupt.random_map(element, np.random.default_rng(1))
        )
        check(result)
    with pytest.raises(LabelError, match="'bbox'"):
        hg.Corrupt(HALF).map({"image": PIXELS, "id": 1, "bbox": [10, 20, 30, 40]})


@pytest.mark.parametrize("kind", ["lists", "tensors"])
def test_batches_take_labels(kind):
    mixed = tr.OneOf([HALF, hj.Marks(number=3)], seed=1, labels=DECLARED, return_plan=True)
    many = {key: [copy.deepcopy(value)] * 6 for key, value in SAMPLE.items()}
    batch = {"image": torch.stack([tensor()] * 6), "id": list(range(6)), **many}
    if kind == "tensors":
        batch |= {
            "bbox": torch.tensor(batch["bbox"]),
            "click": torch.tensor(batch["click"]),
            "width": torch.full((6,), 384),
        }
    out = mixed(batch)
    halved = [plan.out_size != SIZE for plan in out["plan"]]
    assert len(set(halved)) == 2
    for i, smaller in enumerate(halved):
        row = {key: out[key][i] for key in SAMPLE}
        if smaller:
            check(row)
        else:
            assert np.array_equal(row["mask"], SAMPLE["mask"])
            assert (list(row["bbox"]), tuple(row["click"]), row["width"]) == (
                SAMPLE["bbox"],
                SAMPLE["click"],
                384,
            )
    assert isinstance(out["bbox"], torch.Tensor) == (kind == "tensors")
    with pytest.raises(LabelError, match="'bbox'"):
        tr.Resolution(scale=0.5)(
            {"image": batch["image"], "id": batch["id"], "bbox": batch["bbox"]}
        )


def test_datasets_map_and_with_transform(tmp_path):
    datasets = pytest.importorskip("datasets")
    plain = {key: value for key, value in SAMPLE.items() if key != "mask"}
    rows = [{"image": Image.fromarray(PIXELS), "id": i, **copy.deepcopy(plain)} for i in range(3)]
    data = datasets.Dataset.from_list(rows)
    labels = {key: form for key, form in DECLARED.items() if key != "mask"}
    corrupt = tr.Resolution(scale=0.5, labels=labels)
    expected = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in EXPECTED.items()
        if key != "mask"
    }
    corrupt.set_epoch(0)
    for item in (data.map(corrupt), data.map(corrupt, batched=True), data.with_transform(corrupt)):
        assert len(item) == 3
        for row in item:
            assert row["image"].size == (192, 108)
            for key, value in expected.items():
                assert row[key] == value, key
    with pytest.raises(LabelError, match="'bbox'"):
        data.map(tr.Resolution(scale=0.5))
    message = data.map(tr.Resolution(scale=0.5, labels=labels, return_plan="json"))
    assert hj.Plan.from_json(message[0]["plan"]).out_size == (108, 192)


def test_masks_of_torchvision_are_picked_as_all_masks_are():
    mask = torch.from_numpy(np.random.default_rng(1).integers(0, 9, (2, 48, 640), np.uint8))
    sample = {"image": torch.zeros((3, 48, 640), dtype=torch.uint8), "id": 1, "mask": mask.numpy()}
    out = tr.Resolution(scale=0.77, labels={"mask": "mask"})(
        {**sample, "tv": tv_tensors.Mask(mask)}
    )
    assert isinstance(out["tv"], tv_tensors.Mask)
    # the centre of row 18 of the 37 lies on the edge of two rows of the 48
    assert np.array_equal(out["tv"].numpy(), out["mask"])


def test_tv_tensors_dictionaries_actions_and_code_agree():
    x, y = 399, 399
    screen = tv_tensors.Image(torch.zeros((3, 400, 400), dtype=torch.uint8))
    sample = {
        "image": screen,
        "id": 1,
        "target": (x, y),
        "elements": [[4, 4, 5, 5]],
        "points": tv_tensors.KeyPoints([[x, y], [0, 0]], canvas_size=(400, 400)),
        "boxes": tv_tensors.BoundingBoxes(
            [[4, 4, 5, 5], [396, 0, 400, 3]], format="XYXY", canvas_size=(400, 400)
        ),
        "exact": tv_tensors.KeyPoints([[399.5, 2.0]], canvas_size=(400, 400)),
        "mask": tv_tensors.Mask(torch.arange(160000).reshape(400, 400)),
        "action": hj.Action("click", x, y),
        "action_code": f"pyautogui.click({x}, {y})",
        "spot": [x, y],
    }
    out = tr.Resolution(scale=0.25, labels={"spot": "point"})(sample)
    assert out["target"] == out["action"].point == tuple(out["spot"]) == (99, 99)
    assert out["points"].tolist() == [[99, 99], [0, 0]]
    assert out["action_code"] == "pyautogui.click(99, 99)"
    assert out["boxes"].tolist() == [[1, 1, 2, 2], [99, 0, 100, 1]]
    assert out["elements"] == [[1, 1, 2, 2]]
    assert out["exact"].tolist() == [[99.875, 0.5]]
    assert out["mask"][0, 0] == 2 * 400 + 2
    assert out["points"].canvas_size == out["boxes"].canvas_size == (100, 100)


# --- the target


def test_declared_labels_are_targets():
    marks = {"seed": 3, "number": 60, "label_policy": "avoid", "return_plan": True}
    for labels, entries in (
        ({"bbox": "xywh"}, {"bbox": [150, 80, 80, 60]}),
        ({"bbox": "yolo"}, {"bbox": [190 / 384, 110 / 216, 80 / 384, 60 / 216]}),
        ({"target": "xywh"}, {"target": [150, 80, 80, 60]}),
        ({"objects.bbox": "coco"}, {"objects": {"bbox": [[150, 80, 80, 60]]}}),
    ):
        out = tr.Marks(labels=labels, **marks)({"image": tensor(), "id": 1, **entries})
        assert out["target_visible"] == target_visible(out["plan"], (150, 80, 230, 140)) == 1
    box_and_click = {"bbox": "xyxy", "click": "xy"}
    entries = {"bbox": [150, 80, 230, 140], "click": (30, 30)}
    with pytest.raises(LabelError, match="bbox and click could be it; say which: target='bbox'"):
        tr.Marks(labels=box_and_click, **marks)({"image": tensor(), "id": 1, **entries})
    out = tr.Marks(labels=box_and_click, target="click", **marks)(
        {"image": tensor(), "id": 1, **entries}
    )
    assert out["target_visible"] == target_visible(out["plan"], (30, 30)) == 1
    with pytest.raises(ParameterError, match="target='box' is not among the labels"):
        tr.Marks(labels=box_and_click, target="box")


def test_to_avoid_nothing_is_an_error_where_something_could_be_meant():
    avoid = tr.Marks(seed=3, label_policy="avoid")
    with pytest.raises(LabelError, match="names none, but 'bbox' could be it; declare what is"):
        avoid({"image": tensor(), "id": 1, "bbox": [10, 20, 30, 40]})
    for entries in ({}, {"action": hj.Action("wait")}, {"target": None, "bbox": [10, 20, 30, 40]}):
        avoid({"image": tensor(), "id": 1, **entries})


def test_a_dictionary_of_ours_as_action_is_a_target():
    for action in ({"type": "click", "x": 190, "y": 110}, hj.Action("click", 190, 110)):
        out = tr.Marks(seed=3, number=60, label_policy="avoid", return_plan=True)(
            {"image": tensor(), "id": 1, "action": action}
        )
        assert out["target_visible"] == target_visible(out["plan"], (190, 110)) == 1


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"target": (0.5, 0.25)}, "'target'.*fractions of the picture"),
        ({"target": (5000, 10)}, "'target'.*outside the picture, whose width is 384"),
        ({"target": [0.1, 0.1, 0.3, 0.2]}, "'target'.*fractions"),
        ({"target": (5, 5, 5, 5)}, "without area"),
        ({"target": [(5, 5, 50, 50), (60, 5, 90, 50)]}, "'target' holds 2 places.*leave that one"),
        ({"target_box": [[5, 5, 50, 50], [60, 5, 90, 50]]}, "'target_box' holds 2 places"),
        ({"elements": [[0.1, 0.1, 0.3, 0.2]]}, "'elements'.*fractions"),
        ({"action": {"type": "click", "x": 5000, "y": 10}}, "outside"),
    ],
)
def test_targets_that_cannot_be_right_are_refused_by_every_corruption(entries, message):
    for transform in (tr.Marks(seed=3), tr.Resolution(scale=0.5)):
        with pytest.raises(ParameterError, match=message):
            transform({"image": tensor(), "id": 1, **entries})


def test_scenes_refuse_what_cannot_be_pixels():
    for target, message in (
        ((0.3, 0.2), "fractions"),
        ((5000, 10), "outside the 1920x1080 screen"),
        ((10, -500), "outside"),
        ([5, 5, 5, 5], "without area"),
        ((1, float("inf")), "not finite"),
        ((1, 2, 3), "got 3 numbers"),
    ):
        with pytest.raises(ParameterError, match=message):
            hj.Scene(size=(1080, 1920), target=target)
    with pytest.raises(
        ParameterError, match=r"boxes holds \[0\.1, 0\.1, 0\.3, 0\.2\], which are fractions"
    ):
        hj.Scene(size=(1080, 1920), boxes=[[5, 5, 9, 9], [0.1, 0.1, 0.3, 0.2]])
    with pytest.raises(ParameterTypeError, match="apps must be names"):
        hj.Scene(size=(1080, 1920), apps=5)
    with pytest.raises(ParameterTypeError, match="target must be a point"):
        hj.Scene(size=(1080, 1920), target=(10**400, 1))
    assert hj.Scene(size=(1080, 1920), target=(1930, 5)).target == (1911, -3, 1927, 13)
    assert hj.Scene(size=(1080, 1920), boxes=[[0, 0, 1, 1], [4.2, 4.2, 4.4, 4.4]]).boxes.tolist()[
        1
    ] == [4, 4, 5, 5]
    half = hj.OneOf([hj.Marks()])
    with pytest.raises(ParameterError, match="fractions"):
        half(PIXELS[None], ids=["a"], targets=[(0.5, 0.5)], seed=1)


# --- how often


def test_p_is_the_probability_that_a_sample_is_corrupted():
    for transform in (
        tr.Marks(seed=3, number=1, p=0.25),
        tr.OneOf([hj.Marks(number=1)], p=0.5, p_clean=0.5, seed=3),
    ):
        planner = transform.settings.planner
        clean = sum(not planner.plan(hj.Scene(SIZE), seed=3, sample=i).ops for i in range(1000))
        assert 700 < clean < 800
    assert tr.Marks(p=1).settings.planner == hj.Marks()
    hg = pytest.importorskip("hijack_data.grain")
    assert hg.Corrupt(hj.Marks(), p=0).map({"image": PIXELS, "id": 1})["image"] is not None
    for p, error in (([0.5], ParameterTypeError), (1.5, ParameterError), ("1", ParameterTypeError)):
        with pytest.raises(error, match="p "):
            tr.Marks(p=p)
    for name, value in (("p", 0.5), ("seed", 3), ("label_policy", "avoid")):
        with pytest.raises(ParameterError, match=f"it has no {name}$"):
            tr.Replay(**{name: value})


def test_labels_in_bfloat16_follow():
    for value in (
        torch.tensor([[100, 20, 130, 40]], dtype=torch.bfloat16),
        np.asarray([[100, 20, 130, 40]], pytest.importorskip("ml_dtypes").bfloat16),
    ):
        box_after = half({"bbox": value}, labels={"bbox": "xyxy"})["bbox"]
        assert (box_after.dtype, box_after.tolist()) == (value.dtype, [[50, 10, 65, 20]])
    points = torch.tensor([[100, 20]], dtype=torch.bfloat16)
    box_after = half({"kp": tv_tensors.KeyPoints(points, canvas_size=SIZE)})["kp"]
    assert (box_after.dtype, box_after.tolist()) == (torch.bfloat16, [[50, 10]])


def test_a_transform_with_labels_goes_to_workers_that_are_spawned():
    corrupt = tr.Resolution(scale=0.5, labels={"bbox": "coco", "note": None}, target="bbox")
    again = pickle.loads(pickle.dumps(corrupt))
    sample = {"image": tensor(), "id": 1, "bbox": [100, 20, 30, 40], "note": [3, 1]}
    assert again(sample)["bbox"] == corrupt(sample)["bbox"] == [50, 10, 15, 20]
    assert again.settings.labels.target == "bbox"


# --- boxes of torchvision beside declared labels


def boxes(order="XYXY"):
    numbers = torch.tensor([[100, 20, 130, 40]])
    return tv_tensors.BoundingBoxes(numbers, format=order, canvas_size=SIZE)


def test_boxes_beside_a_declared_label_follow_too():
    sample = {"objects": {"click": [100, 20], "box": boxes(), "more": [boxes(), "a"]}}
    objects = half(sample, labels={"objects.click": "xy"})["objects"]
    assert objects["click"] == [50, 10]
    for item in (objects["box"], objects["more"][0]):
        assert (item.tolist(), item.canvas_size) == ([[50, 10, 65, 20]], (108, 192))
    assert sample["objects"]["box"].tolist() == [[100, 20, 130, 40]]


def test_the_targets_of_torchvisions_detection_models():
    target = {"boxes": boxes(), "labels": torch.tensor([3]), "image_id": 7}
    labels = {"target.labels": "leave"}
    value = half({"target": target}, labels=labels)["target"]
    assert value["boxes"].tolist() == [[50, 10, 65, 20]]
    assert (value["labels"].tolist(), value["image_id"]) == ([3], 7)
    with pytest.raises(LabelError, match=r"'target\.keypoints'"):
        half({"target": {**target, "keypoints": [[10, 20]]}}, labels=labels)


def test_boxes_that_are_left_stay_and_a_wrong_declaration_is_an_error():
    boxes_after = half({"box": boxes()}, labels={"box": "leave"})["box"]
    assert (boxes_after.tolist(), boxes_after.canvas_size) == ([[100, 20, 130, 40]], SIZE)
    with pytest.raises(LabelError, match=r"'box' is a BoundingBoxes of format XYWH.*'xyxy'"):
        half({"box": boxes("XYWH")}, labels={"box": "xyxy"})


# --- what has to show


@pytest.mark.parametrize(
    "entry",
    [
        {"box": "boxes"},
        {"action_code": "pyautogui.click(100, 20)"},
        {"action": {"type": "click", "x": 100, "y": 20, "button": "left"}},
    ],
    ids=lambda entry: next(iter(entry)),
)
def test_avoiding_is_never_silently_nothing(entry):
    ((key, value),) = entry.items()
    sample = {"image": tensor(), "id": 1, key: boxes() if value == "boxes" else value}
    form = {"box": "xyxy", "action_code": "pyautogui", "action": "openai"}[key]
    with pytest.raises(LabelError, match=f"target of a sample in sight.*'{key}"):
        tr.Marks(label_policy="avoid")(sample)
    message = tr.Marks(label_policy="avoid", labels={key: form}, return_plan=True)(sample)
    assert message["target_visible"] == 1.0
    assert "target_visible" in tr.Marks(target="action_code", return_plan=True)(
        {"image": tensor(), "id": 1, "action_code": "pyautogui.click(100, 20)"}
    )


def test_labels_have_a_repr():
    assert repr(Labels({"a": "coco", "b": None})) == "{'a': 'xywh', 'b': 'leave'}"
