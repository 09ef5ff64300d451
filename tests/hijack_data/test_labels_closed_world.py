"""A closed world: every entry of a sample follows, is harmless by its type, or is an error."""

import itertools
import subprocess
import sys
from collections import UserDict, deque
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.conformance import picture
from hijack_data.errors import HijackWarning, ImageError, LabelError, ParameterError
from hijack_data.labels import Labels

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
from torchvision import tv_tensors  # noqa: E402

import hijack_data.transforms as tr  # noqa: E402

SIZE = (216, 384)
PIXELS = picture(SIZE)
HALF = hj.Resolution(scale=0.5)


def half(sample, **settings):
    return tr.Resolution(scale=0.5, **settings)({"id": 1, **sample})


def pil(size=SIZE):
    return Image.fromarray(picture(size))


def tensor(size=SIZE):
    return torch.from_numpy(picture(size).copy()).permute(2, 0, 1)


def jax_array(size=SIZE):
    return pytest.importorskip("jax.numpy").asarray(picture(size))


CONTAINERS: dict[str, Any] = {
    "pil": pil,
    "numpy": lambda size=SIZE: picture(size),
    "tensor": tensor,
    "tv_tensor": lambda size=SIZE: tv_tensors.Image(tensor(size)),
    "jax": jax_array,
}


def pixels(image):
    """A picture of any container as an array `[..., H, W, 3]`."""
    if isinstance(image, torch.Tensor):
        return image.movedim(-3, -1).numpy()
    return np.asarray(image)


# --- pictures


@pytest.mark.parametrize(("main", "other"), list(itertools.product(CONTAINERS, CONTAINERS)))
def test_pictures_are_known_by_name_and_shape_in_every_container(main, other):
    """The type of one entry never decides what another one is."""
    transforms = [
        tr.Marks(number=9, mark_size=8, seed=3),
        tr.Resolution(scale=0.5),
        tr.Sequence([tr.Resolution(scale=0.5), tr.Marks(number=9, mark_size=8)], seed=3),
    ]
    for transform in transforms:
        alone = pixels(transform({"image": PIXELS, "id": 1})["image"])
        sample = {"image": CONTAINERS[main](), "prev_image": CONTAINERS[other](), "id": 1}
        result = transform(sample)
        assert np.array_equal(pixels(result["image"]), alone)
        assert np.array_equal(pixels(result["prev_image"]), alone)
        assert type(result["prev_image"]) is type(sample["prev_image"])
        for name, size in (("icon", (32, 32)), ("rgb", SIZE)):
            with pytest.raises(LabelError, match=f"'{name}'.*'picture'.*'mask'|'{name}'.*'leave'"):
                transform({"image": CONTAINERS[main](), name: CONTAINERS[other](size), "id": 1})
        with pytest.raises(ImageError, match="prev_image 32x32"):
            transform({**sample, "prev_image": CONTAINERS[other]((32, 32))})


@pytest.mark.parametrize(
    "history",
    [
        lambda: [pil(), pil()],
        lambda: (PIXELS, PIXELS),
        lambda: np.stack([PIXELS, PIXELS]),
        lambda: torch.stack([tensor(), tensor()]),
        lambda: tv_tensors.Video(torch.stack([tensor(), tensor()])),
    ],
)
def test_a_history_follows_the_plan_of_its_sample_alone_in_a_batch_and_in_grain(history):
    hg = pytest.importorskip("hijack_data.grain")
    spec = hj.Sequence([HALF, hj.Marks(number=9, mark_size=8)])
    labels = {"history": "picture"}
    alone = {
        key: tr.Corrupt(spec, seed=3)({"image": PIXELS, "id": key})["image"] for key in ("a", "b")
    }
    for key in alone:
        sample = {"image": PIXELS, "history": history(), "id": key}
        with pytest.raises(LabelError, match="'history': 'picture'"):
            tr.Marks()(sample)
        for item in (
            tr.Corrupt(spec, seed=3, labels=labels)(sample),
            hg.Corrupt(spec, seed=3, labels=labels).map(sample),
            tr.Corrupt(spec, seed=3)({"image": history(), "id": key}),
        ):
            for image in item.get("history", item["image"]):
                assert np.array_equal(pixels(image), alone[key])
    batch = {"image": [PIXELS] * 2, "history": [history(), history()], "id": ["a", "b"]}
    item = tr.Corrupt(spec, seed=3, labels=labels)(batch)
    for key, images in zip(("a", "b"), item["history"], strict=True):
        assert all(np.array_equal(pixels(image), alone[key]) for image in images)


def test_batches_of_stacks_and_lists():
    stacks = torch.stack([torch.stack([tensor()] * 3)] * 2)
    assert half({"image": stacks, "id": [1, 2]})["image"].shape == (2, 3, 3, 108, 192)
    with pytest.raises(ParameterError, match="6 ids for 2 pictures under 'image'"):
        half({"image": stacks, "id": list(range(6))})
    with pytest.raises(ParameterError, match="2 ids for 3 pictures"):
        half({"images": [pil()] * 3, "id": [1, 2]})
    with pytest.raises(ImageError, match="must be a batch"):
        half({"image": tensor(), "id": [1, 2, 3]})
    steps = tr.Marks(seed=3)({"image": [pil()] * 2, "id": ["a", "a"], "step": [0, 1]})
    assert not np.array_equal(pixels(steps["image"][0]), pixels(steps["image"][1]))


def test_rows_of_several_pictures_in_datasets_are_the_same_in_batches():
    datasets = pytest.importorskip("datasets")
    rows = [
        {"images": [pil()] * (1 + i % 3), "id": f"r{i}", "bbox": [[20, 30, 9, 9]] * i}
        | {"target": [100, 50]}
        for i in range(5)
    ]
    data = datasets.Dataset.from_list(rows)
    spec = hj.OneOf([hj.Marks(number=9, mark_size=8), HALF])
    corrupt = tr.Corrupt(spec, seed=2, labels={"bbox": "xywh"}, return_plan="json")
    corrupt.set_epoch(0)
    alone = list(data.map(corrupt))
    assert {row["images"][0].size for row in alone} == {(384, 216), (192, 108)}
    for size in (2, 5):
        batched = list(data.map(corrupt, batched=True, batch_size=size))
        for value, second in zip(alone, batched, strict=True):
            assert {k: v for k, v in value.items() if k != "images"} == {
                k: v for k, v in second.items() if k != "images"
            }
            pairs = zip(value["images"], second["images"], strict=True)
            assert all(np.array_equal(np.asarray(a), np.asarray(b)) for a, b in pairs)
    for form in ("numpy", "torch", "jax"):
        rows_of_form = data.with_format(form)
        for i, row in enumerate(rows_of_form):
            result = corrupt(row)
            assert np.asarray(result["bbox"]).tolist() == alone[i]["bbox"]
            assert np.array_equal(pixels(result["images"][0]), np.asarray(alone[i]["images"][0]))


def test_image_key_names_the_picture_everywhere():
    hg = pytest.importorskip("hijack_data.grain")
    sample = {"png": PIXELS, "id": 1}
    for corrupt in (
        tr.Resolution(scale=0.5, image_key="png"),
        hg.Corrupt(HALF, image_key="png").map,
    ):
        assert corrupt(sample)["png"].shape == (108, 192, 3)
        with pytest.raises(LabelError, match=r"'png'.*matches nothing"):
            corrupt({"image": PIXELS, "id": 1})
    with pytest.raises(ImageError, match="image_key='png'"):
        tr.Marks()(sample)
    with pytest.raises(ParameterError, match="labels= declares it 'mask'"):
        tr.Marks(image_key="png", labels={"png": "mask"})


# --- entries

SILENT: dict[str, Any] = {
    # Text of any notation, under any name.
    "action": "CLICK 960 540",
    "act": "click(start_box='<bbox>966 546 970 550</bbox>')",
    "code": "os.system('xdotool mousemove 960 540 click 1')",
    "answer": "点击（115，220）",
    "text": '{"bbox_2d": [100, 200, 160, 220]}',
    "chosen": "<point>960 540</point>",
    "rejected": b"at 960/540",
    "objects": '{"ref": [], "bbox": [[1, 2, 3, 4]]}',
    "tokens": "<loc_0123><loc_0456>",
    "html": '<a style="left:100px;top:20px">',
    # Lists, of one kind or mixed.
    "call": ["click", 115, 220],
    "steps": ["x=10", "y=20"],
    "nested": [["10"], ["20"]],
    "one": [115],
    "classes": [3],
    "array": np.array([7.0]),
    "half": torch.ones(3, dtype=torch.bfloat16),
    # Dictionaries.
    "where": {"a": 10, "b": 20},
    "pair": {"first": 10, "second": 20},
    "rect": {"left": "115"},
    "deep": {"list": [{"value": 4}]},
    "names": {"960,540": "button"},
    "spots": {(960, 540): "button"},
    "across": {960: 540},
    # A value for each pixel, or flags of objects.
    "masks": torch.ones(3, *SIZE),
    "depth": np.zeros((*SIZE, 3), np.float32),
    "seg": [np.zeros(SIZE, np.uint8)] * 3,
    "flags": [True, False],
    # What the library does not know.
    "unknown": object(),
    "boxed": np.array("CLICK 960 540"),
    "number": 1 + 2j,
    "blob": b"\x89PNG\x00",
    "area": 400,
    "x_min": "20",
}


@pytest.mark.parametrize("name", SILENT)
def test_nothing_passes_unless_it_is_harmless_by_its_type(name):
    hg = pytest.importorskip("hijack_data.grain")
    for corrupt in (tr.Resolution(scale=0.5), hg.Corrupt(HALF).map):
        with pytest.raises(LabelError, match=rf"'{name}[.\w]*': '"):
            corrupt({"image": PIXELS, "id": 1, name: SILENT[name]})


def test_files_of_pictures_that_would_stay_clean_are_said():
    for name, value in (
        ("before", b"\x89PNG\r\n..."),
        ("prev_image", b"..."),
        ("prev_image", {"bytes": b"\xff\xd8\xff...", "path": None}),
    ):
        with pytest.raises(LabelError, match=rf"'{name}[.\w]*': 'leave',  # "):
            tr.Marks()({"image": PIXELS, "id": 1, name: value})


class _DecodedAtEachLook(Mapping):
    def __getitem__(self, key):
        return {"image": np.zeros((360, 640, 3), np.uint8)}[key]

    def __iter__(self):
        return iter(["image"])

    def __len__(self):
        return 1


def test_pictures_that_a_mapping_decodes_at_each_look_are_corrupted():
    out = tr.Marks(seed=1)({"inner": _DecodedAtEachLook(), "id": 1})
    assert out["inner"]["image"].any()


def test_a_mapping_of_another_type_that_holds_its_values_stays_as_it_is():
    inputs = UserDict(tokens=[1, 2], texts={"question": "?"})
    out = tr.Marks(seed=1)({"image": np.zeros((360, 640, 3), np.uint8), "inputs": inputs, "id": 1})
    assert out["inputs"] is inputs


@pytest.mark.parametrize("scale", [1, 0.5])
@pytest.mark.parametrize(
    "entry",
    [
        {"prev_images": deque([np.zeros((360, 640, 3), np.uint8)])},
        {"frames": deque([np.zeros((360, 640, 3), np.uint8)])},
        {"prev_image": bytearray(b"\x89PNG")},
        {"prev_image": np.frombuffer(b"\x89PNG", np.uint8)},
        {"prev_image": SimpleNamespace(pixels=0)},
        {"messages": [{"image_url": {"url": "data:image/png;base64,iVBORw0KGgo="}}]},
    ],
)
def test_pictures_in_what_cannot_be_corrupted_are_said(entry, scale):
    corrupt = tr.Sequence([tr.Resolution(scale=scale), tr.Marks()], seed=1)
    sample = {"image": np.zeros((360, 640, 3), np.uint8), "id": 1, **entry}
    with pytest.raises(LabelError, match=f"'{next(iter(entry))}"):
        corrupt(sample)


def test_ids_that_are_no_text_are_refused():
    with pytest.raises(ParameterError, match="no UTF-8 text"):
        tr.Marks(seed=1)({"image": np.zeros((360, 640, 3), np.uint8), "id": b"\xff"})


def test_declarations_must_match_the_sample():
    sample = {"image": PIXELS, "id": 1, "ann": [{"bboxes": [[1, 2, 30, 40]]}], "note": None}
    for labels, message in (
        ({"ann.bxes": "xyxy"}, "'ann.bxes'.*did you mean 'bboxes'.*'ann.bxes\\?'"),
        ({"ann.bboxes": "xyxy", "nte": "xy"}, "'nte'.*did you mean 'note'"),
        ({"ann.bboxes.x": "x"}, "'ann.bboxes.x'.*matches nothing"),
    ):
        for transform in (tr.Marks(labels=labels), tr.Resolution(scale=0.5, labels=labels)):
            with pytest.raises(LabelError, match=message):
                transform(sample)
    result = half(sample, labels={"ann.bboxes": "xyxy", "click?": "xy", "note.at": "xy"})
    assert result["ann"] == [{"bboxes": [[0, 1, 15, 20]]}]
    assert half({**sample, "click": (9, 9)}, labels={"ann.bboxes": "xyxy", "click?": "xy"})[
        "click"
    ] == (4, 4)
    with pytest.raises(ParameterError, match="declared twice"):
        Labels({"a": "xy", "a?": "xy"})
    twice = {"a": {"b": [1, 2]}, "a.b": [3, 4], "image": PIXELS, "id": 1}
    with pytest.raises(LabelError, match="means two entries"):
        half(twice, labels={"a.b": "xy"})


MASK = (np.arange(SIZE[0] * SIZE[1]).reshape(SIZE) % 251).astype(np.uint8)
MASKS: dict[str, Any] = {
    "L": Image.fromarray(MASK),
    "P": Image.fromarray(MASK).convert("P"),
    "1": Image.fromarray(MASK > 9),
    "I": Image.fromarray(MASK.astype(np.int32)),
    "array": MASK,
    "bool": MASK > 9,
    "stack": np.stack([MASK, MASK]),
    "tensor": torch.from_numpy(MASK > 9),
    "lists": (MASK > 9).tolist(),
    "images": [Image.fromarray(MASK)] * 2,
    "none": np.empty(0, object),
}


@pytest.mark.parametrize("kind", MASKS)
def test_masks_of_every_container_take_the_value_under_the_centre(kind):
    mask = MASKS[kind]
    value = half({"image": pil(), "mask": mask}, labels={"mask": "mask"})["mask"]
    assert type(value) is type(mask)
    if isinstance(mask, Image.Image):
        assert value.mode == mask.mode
    assert getattr(value, "dtype", None) == getattr(mask, "dtype", None)
    if kind == "images":
        assert all(np.array_equal(np.asarray(item), MASK[1::2, 1::2]) for item in value)
    elif kind != "none":
        assert np.array_equal(np.asarray(value), np.asarray(mask)[..., 1::2, 1::2])
    with pytest.raises(LabelError, match="must have one value for each pixel"):
        half({"image": pil(), "m": Image.new("L", (9, 9))}, labels={"m": "mask"})


def test_object_arrays_of_ragged_and_empty_boxes():
    ragged = np.empty(2, object)
    ragged[0] = np.array([[10, 20, 30, 40], [2, 4, 6, 8]])
    ragged[1] = np.array([], object)
    value = half({"image": PIXELS, "b": ragged}, labels={"b": "xyxy"})["b"]
    assert value.dtype == object
    assert value[0].tolist() == [[5, 10, 15, 20], [1, 2, 3, 4]]
    assert value[1].size == 0
    empty = np.array([], object)
    assert half({"image": PIXELS, "b": empty}, labels={"b": "xyxy"})["b"].size == 0


def test_the_keys_of_the_output_do_not_depend_on_the_sample():
    labels = {"objects.bbox": "xywh", "click": "point", "objects.n": None}
    corrupt = tr.OneOf([HALF, hj.Marks()], p_clean=0.3, labels=labels, return_plan="json")
    keys = set()
    for i, click in enumerate([None, (9, 9)] * 6):
        objects = {"bbox": [[1, 2, 3, 4]] * (i % 3), "n": [1] * (i % 3)}
        sample = {"image": PIXELS, "id": i, "objects": objects, "click": click}
        keys.add(tuple(corrupt(sample)))
    assert keys == {("image", "id", "objects", "click", "plan", "target_visible")}


# --- settings


@pytest.mark.parametrize(
    "setting",
    [
        {"label_policy": "avoid"},
        {"target": "target"},
        {"return_plan": True},
        {"seed": 1},
        {"id_key": "key"},
        {"id_from": "content"},
        {"image_key": "png"},
        {"labels": {"a": "xy"}},
    ],
    ids=lambda setting: next(iter(setting)),
)
def test_settings_of_inner_transforms_are_refused_by_name(setting):
    (name,) = setting
    for outer in (lambda t: tr.OneOf([t]), lambda t: tr.Sequence([t]), tr.Corrupt):
        with pytest.raises(ParameterError, match=f"Marks with {name}=.*outer transform"):
            outer(tr.Marks(**setting))
    with pytest.raises(ParameterError, match="Replay applies given plans"):
        tr.OneOf([tr.Replay()])
    assert tr.OneOf([tr.Marks(p=0.5)])  # the odds are the planner's


def test_a_box_without_area_is_an_ordinary_label():
    sample = {"image": PIXELS, "id": 1, "b": [6, 6, 6, 10]}
    assert half(sample, labels={"b": "xyxy"})["b"] == [3, 3, 3, 5]
    with pytest.raises(LabelError, match="b is a box without area"):
        tr.Marks(label_policy="avoid", labels={"b": "xyxy"})(sample)


def test_torch_compile_runs_it_outside_of_the_graph():
    sample = {"image": tensor(), "id": 1}
    compiled = torch.compile(tr.Marks(seed=3), backend="eager")
    assert torch.equal(compiled(sample)["image"], tr.Marks(seed=3)(sample)["image"])


def test_torch_compile_applies_each_plan_that_it_is_given():
    def brightness(plan, picture):
        return hj.apply(plan, picture).float().mean()

    compiled = torch.compile(brightness, backend="eager")
    for seed in range(3):
        plan = hj.Marks(number=3).plan(hj.Scene((60, 80)), seed=seed, sample="a")
        assert compiled(plan, tensor((60, 80))) == brightness(plan, tensor((60, 80)))


# --- epochs


class Rows(torch.utils.data.Dataset):
    """Twelve screens."""

    def __init__(self, transform):
        self.transform = transform

    def __len__(self):
        return 12

    def __getitem__(self, index):
        return self.transform({"image": tensor((60, 80)), "id": index})


def passes(transform, epochs=3, count_epochs=False, **options):
    loader = torch.utils.data.DataLoader(Rows(transform), shuffle=True, **options)
    for epoch in range(epochs):
        if count_epochs:
            transform.set_epoch(epoch)
        list(loader)


def test_a_second_epoch_without_set_epoch_is_said_once():
    silent = tr.Marks(number=3, mark_size=4)
    passes(silent, epochs=2, count_epochs=True)
    passes(tr.Marks(number=3, mark_size=4), epochs=1)
    assert silent._repeats._flags.tolist() == [1, 0]
    with pytest.warns(HijackWarning, match=r"set_epoch\(epoch\)") as output:
        passes(tr.Marks(number=3, mark_size=4))
    assert len(output) == 1


# The workers are forks of a process with nothing else in it: torch's handler of SIGCHLD raises
# wherever the parent is when one of them ends, and here that would be in the test runner.
LOADED_BY_FORKS = """
import torch
import hijack_data.transforms as tr

class Rows(torch.utils.data.Dataset):
    def __init__(self, transform):
        self.transform = transform
    def __len__(self):
        return 12
    def __getitem__(self, index):
        return self.transform({"image": torch.zeros(3, 60, 80, dtype=torch.uint8), "id": index})

loader = torch.utils.data.DataLoader(
    Rows(tr.Marks(number=3, mark_size=4)),
    shuffle=True, num_workers=2, multiprocessing_context="fork")
for epoch in range(3):
    list(loader)
"""


def test_forked_workers_that_are_new_in_each_epoch_notice_the_second():
    run = subprocess.run(
        [sys.executable, "-c", LOADED_BY_FORKS], capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr.count("HijackWarning") == 1
    assert "set_epoch(epoch)" in run.stderr


# --- layouts of other projects


def test_grounding_lines_as_ms_swift_reads_them():
    row = {
        "id": 7,
        "messages": [
            {"role": "user", "content": "<image>Task: find the <ref-object>"},
            {"role": "assistant", "content": "<bbox>"},
        ],
        "images": [pil()],
        "objects": {"ref": ["the search box"], "bbox": [[90.5, 160.0, 135.0, 212.5]]},
    }
    with pytest.raises(LabelError, match=r"pixels: 'objects\.bbox'\."):
        half(row)
    result = half(row, labels={"objects.bbox": "xyxy"})
    assert result["objects"]["bbox"] == [[45.25, 80.0, 67.5, 106.25]]
    assert (result["images"][0].size, result["messages"]) == ((192, 108), row["messages"])
    entries = {**row, "messages": [*row["messages"], {"role": "assistant", "content": "(90, 160)"}]}
    with pytest.raises(LabelError, match=r"'messages\.content': 'leave'"):
        half(entries, labels={"objects.bbox": "xyxy"})


def test_preferences_as_trl_reads_them():
    def turn(role, *parts):
        return [{"role": role, "content": [{"type": "text", "text": part} for part in parts]}]

    row = {
        "id": 7,
        "images": [pil()],
        "prompt": turn("user", "Where is Save?"),
        "chosen": turn("assistant", "pyautogui.click(100, 50)"),
        "rejected": turn("assistant", "pyautogui.click(300, 20)"),
    }
    with pytest.raises(LabelError) as caught:
        half(row)
    for path in ("chosen.content.text", "rejected.content.text"):
        assert f"'{path}': 'pyautogui'" in str(caught.value)
    assert "prompt" not in str(caught.value)
    labels = {"chosen.content.text": "pyautogui", "rejected.content.text": "pyautogui"}
    result = half(row, labels=labels)
    assert result["chosen"] == turn("assistant", "pyautogui.click(50, 25)")
    assert result["rejected"] == turn("assistant", "pyautogui.click(150, 10)")
    assert result["prompt"] == row["prompt"]
    strings = {
        "id": 7,
        "images": [pil()],
        "prompt": "Save?",
        "chosen": "at 100,50",
        "rejected": "no",
    }
    with pytest.raises(LabelError, match="pixels: 'chosen'"):
        half(strings)


def test_a_grain_pipeline_with_history():
    grain = pytest.importorskip("grain.python")
    import hijack_data.grain as hg

    rows = [
        {"observation": {"image": PIXELS, "history": np.stack([PIXELS] * 2)}, "uid": f"e{i}/0/1"}
        | {"action": {"type": "click", "x": 100 + i, "y": 50}, "language_instruction": "(1, 2)"}
        for i in range(4)
    ]
    labels = {"observation.history": "picture"}
    spec = hj.Sequence([HALF, hj.Marks(number=9, mark_size=8)])
    source = grain.MapDataset.source(rows).seed(3).shuffle()
    items = list(source.map(hg.Corrupt(spec, id_key="uid", labels=labels)))
    assert sorted(row["action"]["x"] for row in items) == [50, 50, 51, 51]
    for row in items:
        for image in row["observation"]["history"]:
            assert np.array_equal(image, row["observation"]["image"])
        assert row["language_instruction"] == "(1, 2)"
    with pytest.raises(Exception, match=r"'observation\.history': 'picture'"):
        list(source.map(hg.Corrupt(spec, id_key="uid")))
