"""torchvision transforms: what they take, what follows the pixels, what they refuse."""

import copy
import pickle

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.conformance import picture, reference
from hijack_data.corruption import make_corruption
from hijack_data.errors import (
    ImageError,
    ImageTypeError,
    ParameterError,
    ParameterTypeError,
    UnknownNameError,
)
from hijack_data.plan import Plan
from hijack_data.safety import target_visible

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
from torchvision import tv_tensors  # noqa: E402
from torchvision.transforms import v2  # noqa: E402

import hijack_data.transforms as tr  # noqa: E402

SIZE = (216, 384)


def tensor(shift=0):
    return torch.from_numpy(np.roll(picture(SIZE), shift, 1).copy()).permute(2, 0, 1).contiguous()


def three_transforms():
    return [
        tr.PopUps(width=200, height=120),
        tr.Marks(number=9, mark_size=8),
        hj.Subtitle(font_size=12),
    ]


def expected(spec, image, **key):
    plan = spec.plan(
        hj.Scene(size=SIZE, target=key.pop("target", None)), **{"seed": 3, "step": 0, **key}
    )
    return plan, torch.from_numpy(reference(plan, image.permute(1, 2, 0).numpy())).permute(2, 0, 1)


def test_the_contract():
    sample = {
        "image": tensor(),
        "id": "row-1",
        "epoch": 2,
        "target": (100, 50),
        "elements": [[1, 2, 30, 40]],
        "text": "a",
    }
    before = copy.deepcopy(sample)
    out = tr.Marks(seed=3, return_plan=True)(sample)
    plan, image = expected(hj.Marks(), sample["image"], sample="row-1", epoch=2, target=(100, 50))
    assert out["plan"] == plan
    assert torch.equal(out["image"], image)
    assert out["target_visible"] == target_visible(plan, (100, 50))
    assert {k: v for k, v in out.items() if k in before and k != "image"} == {
        k: v for k, v in before.items() if k != "image"
    }
    assert torch.equal(sample["image"], before["image"])
    assert list(out)[:6] == list(sample)


def test_no_id_is_said():
    with pytest.raises(
        ParameterError, match=r"no 'id' entry \(it has: image, key\).*id_from='content'"
    ):
        tr.Marks(seed=3)({"image": tensor(), "key": 1})
    with pytest.raises(ParameterError, match="no 'id' entry"):
        tr.Marks(seed=3)(tensor())
    assert torch.equal(
        tr.Marks(seed=3, id_key="key")({"image": tensor(), "key": 1})["image"],
        run(tr.Marks(seed=3), 1),
    )


def run(transform, key, **more):
    return transform({"image": tensor(), "id": key, **more})["image"]


def test_id_seed_epoch_and_step_decide():
    base = run(tr.Marks(seed=3), "a")
    assert torch.equal(base, run(tr.Marks(seed=3), "a", epoch=0, step=0))
    for second in (
        run(tr.Marks(seed=4), "a"),
        run(tr.Marks(seed=3), "b"),
        run(tr.Marks(seed=3), "a", epoch=1),
    ):
        assert not torch.equal(base, second)
    assert not torch.equal(base, run(tr.Marks(seed=3), "a", step=5))
    for same in (np.int64(7), torch.tensor(7), "7"):
        assert torch.equal(run(tr.Marks(seed=3), 7), run(tr.Marks(seed=3), same))
    assert torch.equal(run(tr.Marks(seed=3), b"a"), base)


def test_set_epoch_and_pictures_alone():
    by_content = tr.Marks(seed=3, id_from="content")
    first = by_content(tensor())
    assert torch.equal(first, by_content(tensor()))
    assert not torch.equal(first - tensor(), by_content(tensor(1)) - tensor(1))
    as_pil = by_content(Image.fromarray(picture(SIZE)))
    assert np.array_equal(np.asarray(as_pil), first.permute(1, 2, 0).numpy())
    by_content.set_epoch(1)
    assert not torch.equal(first, by_content(tensor()))
    transform = tr.Marks(seed=3)
    transform.set_epoch(1)
    assert torch.equal(run(transform, "a"), run(tr.Marks(seed=3), "a", epoch=1))
    assert torch.equal(run(transform, "a", epoch=0), run(tr.Marks(seed=3), "a"))


@pytest.mark.parametrize(
    "kind", ["pil", "tensor", "tv", "numpy", "tuple", "channels_last", "sliced", "read_only"]
)
def test_kinds_of_pictures(kind):
    image, pixels = tensor(), picture(SIZE)
    pixels.setflags(write=False)
    result = {
        "pil": lambda: Image.fromarray(pixels),
        "tensor": lambda: image,
        "tv": lambda: tv_tensors.Image(image),
        "numpy": lambda: pixels.copy(),
        "tuple": lambda: image,
        "read_only": lambda: pixels,
        "channels_last": lambda: torch.from_numpy(pixels.copy()).permute(2, 0, 1),
        "sliced": lambda: torch.cat([image, image], 2)[:, :, : SIZE[1]],
    }[kind]()
    transform = tr.OneOf(three_transforms(), seed=3)
    if kind == "tuple":
        out, label = transform(result, {"id": "x"})
        assert label == {"id": "x"}
    else:
        out = transform({"image": result, "id": "x"})["image"]
    assert type(out) is type(result)
    array = (
        np.asarray(out) if kind in ("pil", "numpy", "read_only") else out.permute(1, 2, 0).numpy()
    )
    plan = hj.OneOf(
        [o.settings.planner if isinstance(o, tr.Corrupt) else o for o in three_transforms()]
    ).plan(hj.Scene(size=SIZE), seed=3, sample="x")
    assert np.array_equal(array, reference(plan, pixels))


def test_boxes_points_and_actions_follow_the_pixels():
    sample = {
        "screenshot": tv_tensors.Image(tensor()),
        "id": 1,
        "target": [101, 51],
        "elements": torch.tensor([[1, 2, 31, 40]]),
        "action": hj.Action("click", 100, 50),
        "action_code": "pyautogui.click(100, 50)",
        "boxes": tv_tensors.BoundingBoxes([[10, 20, 31, 41]], format="XYWH", canvas_size=SIZE),
        "float": tv_tensors.BoundingBoxes(
            [[15.0, 20.0, 5.0, 6.0]], format="CXCYWH", canvas_size=SIZE
        ),
        "points": tv_tensors.KeyPoints([[10, 21]], canvas_size=SIZE),
        "mask": tv_tensors.Mask(torch.ones(SIZE)),
        "other": 7,
    }
    out = tr.Resolution(seed=3, scale=0.5)(sample)
    assert out["screenshot"].shape == (3, 108, 192)
    assert isinstance(out["screenshot"], tv_tensors.Image)
    assert (out["target"], out["elements"].tolist()) == ([50, 25], [[0, 1, 16, 20]])
    assert (out["action"].x, out["action"].y) == (50, 25)
    assert out["action_code"] == "pyautogui.click(50, 25)"
    assert (out["boxes"].tolist(), out["boxes"].canvas_size) == ([[5, 10, 16, 21]], (108, 192))
    assert out["boxes"].format is tv_tensors.BoundingBoxFormat.XYWH
    assert out["float"].tolist() == [[7.5, 10.0, 2.5, 3.0]]
    assert (out["points"].tolist(), out["points"].canvas_size) == ([[5, 10]], (108, 192))
    assert out["mask"].shape == (108, 192)
    assert out["other"] == 7
    same = tr.Resolution(seed=3, scale=0.5, restore=True)(sample)
    assert (same["target"], same["boxes"].tolist()) == ([101, 51], [[10, 20, 31, 41]])


def test_targets_and_elements_as_bounding_boxes():
    def boxes(rows, fmt):
        return tv_tensors.BoundingBoxes(rows, format=fmt, canvas_size=SIZE)

    plain = {
        "image": tensor(),
        "id": 5,
        "target": (10, 20, 50, 60),
        "elements": [[10, 20, 50, 60], [0, 0, 200, 15]],
    }
    typed = {
        **plain,
        "target": boxes([[10, 20, 40, 40]], "XYWH"),
        "elements": boxes(plain["elements"], "XYXY"),
    }
    for transform in (
        tr.PopUps(seed=3, width=200, height=120, return_plan=True),
        tr.Resolution(return_plan=True),
    ):
        result, two = transform(plain), transform(typed)
        assert result["plan"] == two["plan"]
        assert result["target_visible"] == two["target_visible"]
    assert two["target"].tolist() == [[5, 10, 20, 20]]
    assert result["target"] == (5, 10, 25, 30)


def test_batches_get_a_plan_for_each_picture():
    batch = torch.stack([tensor(i) for i in range(6)])
    ids = [f"r{i}" for i in range(6)]
    transform = tr.OneOf(three_transforms(), seed=3, p_clean=0.2, return_plan=True)
    out = transform({"image": batch, "id": ids, "target": [(9, 9)] * 6, "epoch": 1})
    assert isinstance(out["image"], torch.Tensor)
    assert len(out["target_visible"]) == 6
    for i, key in enumerate(ids):
        result = transform({"image": batch[i], "id": key, "target": (9, 9), "epoch": 1})
        assert torch.equal(result["image"], out["image"][i])
        assert result["plan"] == out["plan"][i]
    as_list = transform(
        {
            "image": [Image.fromarray(picture(SIZE))] * 6,
            "id": ids,
            "target": [(9, 9)] * 6,
            "epoch": 1,
        }
    )
    assert as_list["plan"] == out["plan"]
    content = tr.Marks(id_from="content")
    assert torch.equal(content({"image": batch})["image"][4], content(batch[4]))


def test_batches_whose_sizes_change():
    batch = tv_tensors.Image(torch.stack([tensor(i) for i in range(4)]))
    sample = {"image": batch, "id": [0, 1, 2, 3], "target": torch.tensor([[20, 20]] * 4)}
    out = tr.Resolution(scale=0.5)(
        {**sample, "b": tv_tensors.BoundingBoxes([[2, 4, 6, 8]], format="XYXY", canvas_size=SIZE)}
    )
    assert out["image"].shape == (4, 3, 108, 192)
    assert out["target"].tolist() == [[10, 10]] * 4
    assert out["b"].tolist() == [[1, 2, 3, 4]]
    mixed = tr.OneOf([tr.Resolution(scale=0.5), tr.Marks()], seed=1)
    mixed.set_epoch(0)
    out = mixed(sample)
    assert {tuple(i.shape) for i in out["image"]} == {(3, 108, 192), (3, *SIZE)}
    assert all(isinstance(i, tv_tensors.Image) for i in out["image"])
    assert {tuple(t) for t in out["target"].tolist()} == {(10, 10), (20, 20)}
    with pytest.raises(ParameterError, match="BoundingBoxes cannot follow a batch"):
        mixed(
            {
                **sample,
                "b": tv_tensors.BoundingBoxes([[2, 4, 6, 8]], format="XYXY", canvas_size=SIZE),
            }
        )


@pytest.mark.parametrize(
    ("entry", "labels"),
    [
        ({"target": (20, 30)}, None),
        ({"bbox": (10, 20, 30, 40)}, {"bbox": "xyxy"}),
        ({"elements": [[10, 20, 30, 40]] * 4}, None),
        ({"objects": [{"bbox": [10, 20, 30, 40]}] * 4}, {"objects.bbox": "xyxy"}),
    ],
)
def test_labels_that_default_collate_transposed_are_refused(entry, labels):
    from torch.utils.data import default_collate

    (value,) = entry.values()
    rows = [{"image": tensor(i), "id": i, **entry} for i in range(len(value))]
    half = tr.Resolution(scale=0.5, labels=labels)
    with pytest.raises(ParameterError, match="one number of all pictures each"):
        half(default_collate(rows))
    (key,) = entry
    half({**default_collate(rows), key: [row[key] for row in rows]})


def test_a_plan_in_the_sample_is_not_replaced():
    sample = {"image": tensor(), "id": "a", "target": (30, 40)}
    once = tr.PopUps(width=200, height=120, return_plan=True)(sample)
    for second in (tr.Marks(return_plan=True), tr.Marks(return_plan="json")):
        with pytest.raises(ParameterError, match="entry 'plan' already"):
            second(once)
    assert tr.Marks()(once)["plan"] == once["plan"]
    assert tr.Replay(return_plan=True)({**sample, "plan": once["plan"]})["plan"] == once["plan"]


MARKS, WORDS = hj.Marks(number=3, mark_size=4), hj.Subtitle(font_size=10)


@pytest.mark.parametrize("kind", ["tensor", "batch", "tv_tensor", "array", "PIL"])
def test_transforms_in_a_row_that_draw_alike_are_refused(kind):
    picture_kinds = {
        "tensor": lambda: tensor(),
        "batch": lambda: torch.stack([tensor(), tensor(1)]),
        "tv_tensor": lambda: tv_tensors.Image(tensor()),
        "array": lambda: picture(SIZE),
        "PIL": lambda: Image.fromarray(picture(SIZE)),
    }
    sample = {"image": picture_kinds[kind](), "id": ["a", "b"] if kind == "batch" else "a"}
    first = tr.Corrupt(MARKS, p=0.5)
    for second in (
        tr.Corrupt(WORDS, p=0.5),
        tr.OneOf([WORDS], p_clean=0.1),
        tr.Sequence([hj.Schedule(at=lambda _epoch: WORDS)], p=0.3),
        tr.Marks(color="blue"),
        tr.Sequence([MARKS]),  # the place of the first's marks in its tree
    ):
        with pytest.raises(ParameterError, match="both draw alike"):
            v2.Compose([first, tr.Marks(), tr.Resolution(restore=True), second])(sample)
    for second in (
        tr.Corrupt(WORDS, p=0.5, seed=1),
        tr.OneOf([WORDS, MARKS]),  # it draws which, not whether
        tr.Sequence([hj.OneOf([WORDS], p_clean=0.5)]),  # at another place
        tr.Sequence([WORDS, tr.Marks()]),
        tr.Corrupt(WORDS),  # which draws nothing
    ):
        v2.Compose([tr.Corrupt(WORDS), first, second])(sample)
        first(sample)  # the same picture for another one, not in a row


def test_replay():
    sample = {"image": tensor(), "id": "a"}
    result = tr.OneOf(three_transforms(), seed=3, return_plan=True)(sample)
    plan = result["plan"]
    for replay, extra in (
        (tr.Replay(plan), {}),
        (tr.Replay(plan.to_json()), {}),
        (tr.Replay({"a": plan}), {}),
        (tr.Replay({"a": plan.to_json()}), {}),
        (tr.Replay(), {"plan": plan}),
        (tr.Replay(), {"plan": plan.to_json()}),
    ):
        assert torch.equal(replay({**sample, **extra})["image"], result["image"])
    assert torch.equal(tr.Replay(plan)(tensor()), result["image"])
    with pytest.raises(ParameterError, match="no plan for the sample 'b'"):
        tr.Replay({"a": plan})({**sample, "id": "b"})
    with pytest.raises(ParameterError, match="'plan' entry, but there is none"):
        tr.Replay()(sample)
    with pytest.raises(ParameterTypeError, match="expected a Plan or its JSON text, got int"):
        tr.Replay(3)
    with pytest.raises(ImageError, match="made for 384x216 but the picture is 100x100"):
        tr.Replay(plan)(torch.zeros((3, 100, 100), dtype=torch.uint8))


def rising(epoch):
    return hj.Marks.at(min(1 + epoch, 5), mark_size=4)


def test_combinators_and_configurations():
    sample = {"image": tensor(), "id": "a"}
    sequence = tr.Sequence(
        [tr.Resolution(scale=0.5), tr.Marks(number=3, mark_size=4)], seed=3, return_plan=True
    )(sample)
    assert sequence["plan"].corruption == "resolution-v2+marks-v1"
    out = tr.Schedule(rising, return_plan=True)({**sample, "epoch": 4})
    assert len(out["plan"].ops[0].at) == 200
    config = {
        "corruptions": [{"marks": {"number": 4, "mark_size": 5}}, {"subtitle": {"font_size": 10}}],
        "seed": 11,
    }
    names = {
        tr.FromConfig(config, return_plan=True)({**sample, "id": i})["plan"].corruption
        for i in range(12)
    }
    assert names == {"marks-v1", "subtitle-v2"}
    only = tr.FromConfig(config, label="marks", return_plan=True)
    assert only.settings.seed == 11
    assert {only({**sample, "id": i})["plan"].corruption for i in range(5)} == {"marks-v1"}
    assert tr.FromConfig("paper", label="subtitle", seed=5).settings.seed == 5
    with pytest.raises(ParameterError, match="no corruption 'pop'; it has marks, subtitle"):
        tr.FromConfig(config, label="pop")
    avoiding = {**config, "label_policy": "avoid"}
    assert tr.FromConfig(avoiding).settings.label_policy == "avoid"
    assert tr.FromConfig(avoiding, label_policy="keep").settings.label_policy == "keep"
    with pytest.raises(ParameterError, match="keep or avoid, got 'drop'"):
        tr.FromConfig({**config, "label_policy": "drop"})
    assert len(tr.Marks(severity=4, return_plan=True, mark_size=4)(sample)["plan"].ops[0].at) == 100


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: tr.FromConfig("paper"), "multi_apps, .*, verification"),
        (lambda: tr.OneOf([tr.Marks(), hj.Sequence([hj.NetworkError()])]), "network_error"),
        (lambda: tr.Corrupt(make_corruption("missed_input")), "missed_input"),
    ],
)
def test_what_leaves_pictures_clean_is_refused(make, names):
    with pytest.raises(ParameterError, match=f"{names}.*stay clean"):
        make()


def test_subtitles_shrink_where_they_do_not_fit():
    sequence = tr.Sequence([tr.Resolution(scale=0.5), tr.Subtitle()], return_plan=True)
    assert any("shrunk" in note for note in sequence({"image": tensor(), "id": 1})["plan"].notes)
    with pytest.raises(ParameterError, match="fit='shrink'"):
        tr.Subtitle(fit="error")({"image": tensor(), "id": 1})


def test_a_transform_that_does_not_exist_says_why():
    with pytest.raises(AttributeError, match="no Verification: it changes the machine"):
        tr.Verification  # noqa: B018
    with pytest.raises(AttributeError, match="no MissedInput: it changes the agent's input"):
        _ = tr.MissedInput
    with pytest.raises(AttributeError, match="did you mean 'Marks'"):
        tr.Mark  # noqa: B018
    assert not hasattr(tr, "__wrapped__")


def test_in_a_pipeline():
    pipeline = v2.Compose(
        [tr.OneOf(three_transforms(), seed=3), v2.ToDtype(torch.float32, scale=True)]
    )
    out = pipeline({"image": tv_tensors.Image(tensor()), "id": "a"})
    assert out["image"].dtype == torch.float32
    again = pickle.loads(pickle.dumps(pipeline))
    assert torch.equal(
        again({"image": tv_tensors.Image(tensor()), "id": "a"})["image"], out["image"]
    )
    assert "OneOf([PopUps(" in repr(pipeline)
    assert "seed=3" in repr(pipeline)


# --- refusals


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (
            torch.zeros((*SIZE, 3), dtype=torch.uint8),
            ImageError,
            "looks like the other channel order",
        ),
        (torch.zeros((3, *SIZE)), ImageTypeError, r"float32; only uint8 .*clamp\(0, 255\)"),
        (torch.zeros((3, *SIZE), requires_grad=True), ImageTypeError, "float32; only uint8"),
        (np.zeros((3, *SIZE), np.uint8), ImageError, "looks like the other channel order"),
        (torch.zeros((4, *SIZE), dtype=torch.uint8), ImageError, "drop the alpha channel"),
        (torch.zeros(SIZE, dtype=torch.uint8), ImageError, "grey picture"),
        (Image.new("RGBA", SIZE[::-1]), ImageTypeError, "mode 'RGBA'"),
        (
            torch.zeros((3, *SIZE), dtype=torch.uint8, device="meta"),
            ImageTypeError,
            "device 'meta' holds no pixels",
        ),
        (torch.zeros((3, *SIZE), dtype=torch.uint8).to_sparse(), ImageTypeError, "sparse"),
        ("screen.png", ImageError, r"holds no picture.*image \(str\)"),
    ],
)
def test_wrong_pictures(image, error, message):
    with pytest.raises(error, match=message):
        tr.Marks()({"image": image, "id": 1})


@pytest.mark.parametrize(
    ("more", "error", "message"),
    [
        ({"id": ["a", "b"]}, ParameterError, "2 ids for 3 pictures"),
        ({"id": ["a", "b", "a"]}, ParameterError, "'a' appears twice"),
        ({"id": ["a", "b", ""]}, ParameterError, "id of a sample is empty"),
        ({}, ParameterError, "no 'id' entry"),
        (
            {"id": ["a", "b", "c"], "target": [(1, 2)]},
            ParameterError,
            "target must hold one entry for each of the 3",
        ),
        ({"id": ["a", "b", None]}, ParameterTypeError, "must be a string or an integer, got None"),
    ],
)
def test_wrong_batches(more, error, message):
    batch = torch.stack([tensor(i) for i in range(3)])
    with pytest.raises(error, match=message):
        tr.Marks()({"image": batch, **more})


@pytest.mark.parametrize(
    ("more", "error", "message"),
    [
        ({"target": (1, 2, 3)}, ParameterError, "got 3 numbers"),
        ({"elements": [[5, 5, 1, 1]]}, ParameterError, "ends before it starts"),
        ({"epoch": "first"}, ParameterTypeError, "epoch must be an integer"),
        ({"epoch": -1}, ParameterError, "epoch must be in"),
        ({"id": 1.5}, ParameterTypeError, "must be a string or an integer, got 1.5"),
    ],
)
def test_wrong_entries(more, error, message):
    with pytest.raises(error, match=message):
        tr.Marks()({"image": tensor(), "id": 1, **more})


def test_boxes_outside_are_ignored_and_noted():
    out = tr.Marks(return_plan=True)(
        {"image": tensor(), "id": 1, "elements": [[900, 900, 950, 950], [1, 1, 9, 9]]}
    )
    assert out["plan"].notes[0].startswith("1 of 2 boxes")


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: tr.Marks(nubmer=3), UnknownNameError, "did you mean 'number'"),
        (lambda: tr.Marks(severity=9), ParameterError, "1..5"),
        (lambda: tr.Marks(id_from="pixels"), ParameterError, "entry or content"),
        (lambda: tr.Marks(label_policy="drop"), ParameterError, "keep or avoid"),
        (lambda: tr.Marks(seed="x"), ParameterTypeError, "seed must be an integer"),
        (lambda: tr.OneOf([]), ParameterError, "at least one"),
        (lambda: tr.Corrupt(hj.Marks), ParameterTypeError, "a corruption such as Marks"),
        (
            lambda: tr.Marks(return_plan=True, id_from="content")(tensor()),
            ParameterError,
            "needs a dictionary",
        ),
    ],
)
def test_wrong_settings(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_plans_in_a_sample_are_collated():
    from torch.utils.data import default_collate

    sample = {"image": tensor(), "target": (9, 9)}
    rows = [tr.Marks(return_plan=True)({**sample, "id": i}) for i in range(2)]
    batch = default_collate(rows)
    assert batch["image"].shape == (2, 3, *SIZE)
    assert all(isinstance(p, Plan) for p in batch["plan"])


def test_apply_refuses_to_write_into_shared_memory():
    plan, _ = expected(hj.Marks(), tensor(), sample=1)
    with pytest.raises(ParameterError, match="share memory"):
        hj.apply(plan, tensor()[:, :1].expand(3, *SIZE), inplace=True)
