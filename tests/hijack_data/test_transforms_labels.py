"""torchvision transforms and labels: what must show, at both ends of a drag, and whose point it
is."""

import math

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.conformance import picture
from hijack_data.errors import LabelError, ParameterError, ParameterTypeError
from hijack_data.plan import Plan
from hijack_data.safety import target_visible

torch = pytest.importorskip("torch")
tv_tensors = pytest.importorskip("torchvision.tv_tensors")

import hijack_data.transforms as tr  # noqa: E402

SIZE = (216, 384)


def tensor(shift=0):
    return torch.from_numpy(np.roll(picture(SIZE), shift, 1).copy()).permute(2, 0, 1).contiguous()


def test_label_policy_avoid():
    sample = {"image": tensor(), "target": (150, 80, 230, 140)}
    entries = {"keep": [], "avoid": []}
    for policy, shares in entries.items():
        transform = tr.Marks(seed=3, number=12, return_plan=True, label_policy=policy)
        shares += [transform({**sample, "id": i})["target_visible"] for i in range(20)]
    assert min(entries["keep"]) < 1.0
    assert min(entries["avoid"]) == 1.0


DRAG = {"action": hj.Action("drag", 190, 110, 40, 50)}
DRAG_CODE = {
    "action_code": (
        "import pyautogui\npyautogui.moveTo(190, 110)\npyautogui.dragTo(40, 50, button='left')"
    )
}


@pytest.mark.parametrize(
    "more", [DRAG, DRAG_CODE, {**DRAG, "action_code": "pyautogui.click(1, 1)"}]
)
def test_a_drag_is_judged_at_both_ends(more):
    sample, end = ({"image": tensor(), "target": (190, 110), **more}, (40, 50))
    entries = {"keep": [], "avoid": []}
    for policy, shares in entries.items():
        transform = tr.Marks(seed=3, number=12, mark_size=30, return_plan=True, label_policy=policy)
        for i in range(20):
            out = transform({**sample, "id": i})
            shares.append(out["target_visible"])
            assert out["target_visible"] == target_visible(out["plan"], (190, 110), end)
            if policy == "avoid":
                assert out["plan"] == (
                    hj.plugin.plan_avoiding(
                        transform.settings.planner,
                        hj.Scene(SIZE, target=(190, 110)),
                        seed=3,
                        sample=i,
                        step=0,
                        end=end,
                    )
                    or Plan.clean(SIZE)
                )
    assert min(entries["keep"]) < 1.0
    assert min(entries["avoid"]) == 1.0


def test_only_a_drag_with_a_target_has_an_end():
    for more in (
        {"action": hj.Action("click", 40, 50)},
        {"action": hj.Action("click", 40, 50), **DRAG_CODE},
        {"action_code": "pyautogui.click(40, 50)"},
        {"action_code": "dragged = [("},
        {"action_code": 3},
        {"action_code": "pyautogui.moveTo(1, 2); pyautogui.dragTo(x, 50)"},
        {"action": "drag"},
    ):
        for i in range(12):
            sample = {"image": tensor(), "id": i, "target": (190, 110)}
            for policy in ("keep", "avoid"):
                transform = tr.Marks(
                    seed=3, number=12, mark_size=30, return_plan=True, label_policy=policy
                )
                result, two = transform(sample), transform({**sample, **more})
                assert (result["plan"], result["target_visible"]) == (
                    two["plan"],
                    two["target_visible"],
                )


@pytest.mark.parametrize(
    "action", [DRAG["action"], hj.Action("click", 190, 110)], ids=["drag", "click"]
)
def test_without_a_target_the_point_of_the_action_is_the_target(action):
    transform = tr.Marks(seed=3, number=12, mark_size=30, return_plan=True, label_policy="avoid")
    transform.set_epoch(0)
    hidden = 0
    for i in range(12):
        sample = {"image": tensor(), "id": i, "action": action}
        alone, named = transform(sample), transform({**sample, "target": action.point})
        assert (alone["plan"], alone["target_visible"]) == (named["plan"], named["target_visible"])
        hidden += alone["plan"] != transform({"image": tensor(), "id": i})["plan"]
    assert hidden
    typed = transform({"image": tensor(), "id": 0, "action": hj.Action("type", text="a")})
    assert math.isnan(typed["target_visible"])


def test_ends_of_a_batch_and_of_resized_screens():
    batch, actions = (
        torch.stack([tensor(i) for i in range(8)]),
        [DRAG["action"], hj.Action("click", 190, 110)] * 4,
    )
    mixed = tr.Sequence(
        [tr.Resolution(scale=0.5), tr.Marks(number=25, mark_size=15)], seed=3, return_plan=True
    )
    out = mixed(
        {"image": batch, "id": list(range(8)), "target": [(190, 110)] * 8, "action": actions}
    )
    ends = [action.end for action in actions]
    assert out["target_visible"] == [
        target_visible(p, (190, 110), e) for p, e in zip(out["plan"], ends, strict=True)
    ]
    assert out["target_visible"] != [target_visible(p, (190, 110)) for p in out["plan"]]
    assert out["action"][0].end == (20, 25)


def canvases(size):
    """Everything that has a canvas, of this size."""
    return [
        tv_tensors.BoundingBoxes(torch.tensor([[4, 4, 9, 9]]), format="XYXY", canvas_size=size),
        tv_tensors.KeyPoints(torch.tensor([[4, 4]]), canvas_size=size),
        tv_tensors.Mask(torch.zeros(1, *size, dtype=torch.uint8)),
    ]


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("transform", [tr.Resolution(scale=0.5), tr.Marks(number=3, mark_size=8)])
def test_labels_of_a_picture_of_another_size_are_refused(transform, number):
    image = tv_tensors.Image(torch.zeros(3, 60, 80, dtype=torch.uint8))
    transform({"image": image, "id": 1, "label": canvases((60, 80))[number]})
    canvase = canvases((30, 40))[number]
    output = rf"a {type(canvase).__name__} belongs to a picture of 40x30 pixels, and .* has 80x60"
    with pytest.raises(LabelError, match=output):
        transform({"image": image, "id": 1, "label": canvase})


@pytest.mark.parametrize("seed", [-1, 2**64, True, 7.0])
def test_a_seed_out_of_range_is_refused_where_it_is_given(seed):
    with pytest.raises((ParameterError, ParameterTypeError), match="seed must be"):
        tr.Marks(seed=seed)
