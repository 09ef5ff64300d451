"""What makes planning and label safety fast changes no result: measured text, windows,
fingerprints, changed pixels."""

import copy
import math
import os
import pickle
import random
import signal
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

import hijack_data as hj
from hijack_data import safety
from hijack_data.backends import convert
from hijack_data.conformance import picture, reference, scene
from hijack_data.drawing import line_masks, raster
from hijack_data.drawing.raster import png_recipe, render
from hijack_data.drawing.sprite import draw
from hijack_data.drawing.text import FONTS, line_height, line_width, load_font
from hijack_data.errors import ParameterTypeError
from hijack_data.kernels.cpu import compare
from hijack_data.kernels.cpu import pixels as numpy_kernels
from hijack_data.params import rgb
from hijack_data.plan import Paste, Plan

LETTERS = st.text(
    st.one_of(
        st.sampled_from("AVTWaovyPFL.,(ij "), st.characters(min_codepoint=32, max_codepoint=0x500)
    ),
    max_size=25,
)


@settings(max_examples=200, deadline=None)
@given(LETTERS, st.sampled_from(sorted(p.stem for p in FONTS.glob("*.ttf"))), st.integers(1, 120))
def test_widths_are_those_of_freetype(line, font, size):
    loaded_font = load_font(font, size)
    assert line_width(line, loaded_font) == loaded_font.getlength(line)


@settings(max_examples=300, deadline=None)
@given(LETTERS, st.sampled_from(sorted(p.stem for p in FONTS.glob("*.ttf"))), st.integers(1, 60))
def test_lines_of_remembered_letters_are_those_that_pillow_draws(line, font, size):
    mask, (left, top) = line_masks.line_mask(line, font, size)
    loaded_font, at = load_font(font, size), (70, 70)
    image = Image.new("L", (math.ceil(loaded_font.getlength(line)) + 200, 300))
    expected = np.array(image)
    ImageDraw.Draw(image).text(at, line, fill=255, font=loaded_font)
    h, w = mask.shape
    expected[at[1] + top : at[1] + top + h, at[0] + left : at[0] + left + w] = mask
    assert np.array_equal(expected, np.array(image))


def test_kerning_is_part_of_the_width():
    font = load_font("DejaVuSans", 97)
    assert line_width("AV", font) != line_width("A", font) + line_width("V", font)


def whole_window(recipe):
    """The window by its definition, drawn by Pillow on one canvas."""
    image = Image.new("RGB", tuple(recipe["size"]), rgb(recipe["edge_color"]))
    draw, edge = ImageDraw.Draw(image), recipe["edge"]
    for panel in recipe["panels"]:
        x1, y1, x2, y2 = panel["box"]
        if x2 - x1 > 2 * edge and y2 - y1 > 2 * edge:
            draw.rectangle(
                (x1 + edge, y1 + edge, x2 - edge - 1, y2 - edge - 1), fill=rgb(panel["fill"])
            )
        font = load_font(recipe["font"], panel["font_size"])
        top = (y1 + y2 - line_height(font) * len(panel["lines"])) // 2
        for row, line in enumerate(panel["lines"]):
            left = (x1 + x2 - math.ceil(font.getlength(line))) // 2
            draw.text(
                (left, top + row * line_height(font)), line, fill=rgb(recipe["color"]), font=font
            )
    return np.array(image)


def random_window(seed):
    r = random.Random(seed)
    letters = [chr(c) for c in range(32, 0x180)] + list("jÅǺŷfJ|_,;")
    width, height = r.randint(1, 300), r.randint(1, 200)
    cut = r.randint(0, height)

    def panel(y1, y2, fill):
        shift = r.choice([0, 0, -15, 15])
        lines = [
            "".join(r.choice(letters) for _ in range(r.randint(0, 20)))
            for _ in range(r.randint(0, 4))
        ]
        return {
            "box": [shift, y1, width + shift, y2],
            "fill": fill,
            "lines": lines,
            "font_size": r.randint(1, 60),
        }

    return {
        "draw": "window",
        "size": [width, height],
        "edge": r.randint(0, 9),
        "font": "DejaVuSans",
        "color": r.choice(["#1a1a1a", "red"]),
        "edge_color": "#334455",
        "panels": [panel(0, cut, "#ffffff"), panel(cut, height, "#e6e607")],
    }


def test_windows_are_those_that_pillow_draws():
    """Texts that are too long, too tall, or stick out of the window included."""
    for seed in range(150):
        recipe = random_window(seed)
        expected = whole_window(recipe)
        assert np.array_equal(render(recipe).rgb, expected), recipe
        planar = np.zeros((3, *expected.shape[:2]), np.uint8).transpose(1, 2, 0)
        draw(render(recipe).layers, planar)
        assert np.array_equal(planar, expected), recipe


def test_a_window_is_drawn_once(monkeypatch):
    plan = hj.PopUps().plan(scene((1080, 1920)), seed=7, sample="once")
    image = picture((1080, 1920))
    outs = [hj.apply(plan, image)]
    monkeypatch.setattr(numpy_kernels, "draw", lambda *_: pytest.fail("drawn once more"))
    outs.append(hj.apply(plan, image))
    assert all(np.array_equal(out, reference(plan, image)) for out in outs)


def test_planning_draws_no_window(monkeypatch):
    def never(_recipe):
        raise AssertionError("drawn while planning")

    monkeypatch.setitem(raster._DRAW, "window", never)
    plan = hj.PopUps().plan(scene((1080, 1920)), seed=7, sample="never drawn before")
    with pytest.raises(AssertionError, match="drawn while planning"):
        plan.digest()


def test_a_fingerprint_is_fixed_when_a_plan_is_written_down_or_pickled():
    plan = hj.PopUps().plan(scene((1080, 1920)), seed=7, sample="f")
    (op,) = plan.ops
    assert "fingerprint" not in vars(op)
    assert "fingerprint" in vars(pickle.loads(pickle.dumps(op)))
    assert op.fingerprint == render(op.sprite).fingerprint == op.to_data()["fingerprint"]
    assert copy.deepcopy(plan) == plan == Plan.from_json(plan.to_json())
    assert Paste(op.sprite, op.at, "") == op
    assert Paste(op.sprite, op.at, "0" * 16) != op
    second = Plan(plan.corruption, plan.size, plan.params, (Paste(op.sprite, op.at, "0" * 16),))
    with pytest.raises(hj.HijackError, match="draws differently here"):
        hj.apply(second, picture((1080, 1920)))


def test_a_part_of_a_sprite_has_the_fingerprint_of_the_whole():
    sprite = render({"draw": "mark", "shape": "star", "size": 20, "color": "red"})
    assert sprite.crop(3, 4, 20, 30).crop(0, 0, 5, 5).fingerprint == sprite.fingerprint


def test_the_sprite_cache_is_bounded_and_shared_by_threads():
    cache = raster._Cache(1000)

    def work(start):
        for i in range(start, start + 400):
            cache.put(i % 50, bytes(60), 60)
            assert len(cache.get(i % 50) or bytes(60)) == 60

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    assert cache.used == sum(size for _, size in cache.items.values()) <= 1000


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning", "ignore:.*fork.*:RuntimeWarning")
def test_a_lock_that_is_held_at_a_fork_does_not_stop_the_child():
    with raster._cache.lock, line_masks._masks.lock:
        child = os.fork()
        if child == 0:
            signal.alarm(20)
            plan = hj.PopUps().plan(hj.Scene(size=(1080, 1920)), seed=1, sample="in the child")
            hj.apply(plan, picture((1080, 1920)))
            os._exit(0)
    assert os.waitpid(child, 0)[1] == 0


# --- label safety


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_safety_is_that_of_whole_masks(data):
    """Shares, covered boxes and changed pixels equal those from masks and differences of the whole
    picture."""
    h, w = data.draw(st.integers(30, 200)), data.draw(st.integers(30, 200))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    ops = []
    for _ in range(data.draw(st.integers(0, 3))):
        rgba = rng.integers(0, 256, (*rng.integers(1, 60, 2), 4), dtype=np.uint8)
        rgba[..., 3] = (
            rng.choice([0, 100, 128, 255], rgba.shape[:2]) if data.draw(st.booleans()) else 255
        )
        at = tuple(
            (int(x), int(y)) for x, y in rng.integers(-40, 200, (data.draw(st.integers(1, 6)), 2))
        )
        ops.append(Paste(png_recipe(rgba), at))
    if data.draw(st.booleans()):
        size = (int(rng.integers(10, 200)), int(rng.integers(10, 200)))
        ops.insert(int(rng.integers(0, len(ops) + 1)), hj.plugin.Resample(size))
    plan = Plan("test-v1", (h, w), ops=tuple(ops))
    boxes = np.sort(rng.integers(-20, 220, (7, 2, 2)), axis=1).reshape(7, 4)
    boxes[0, 2:] += 1  # the target: a box without area would be refused
    before = rng.integers(0, 2, (h, w, 3), dtype=np.uint8) * 200
    after = hj.apply(plan, before)

    mask, moved_mask = (
        safety.hidden(plan),
        plan.coords.boxes_to_observation(safety.clip_boxes(boxes.astype(np.int32), (h, w))),
    )
    expected = []
    for box, (x1, y1, x2, y2) in zip(
        boxes.clip(0, [w, h, w, h]).tolist(), moved_mask.tolist(), strict=True
    ):
        empty = box[2] <= box[0] or box[3] <= box[1] or mask[y1:y2, x1:x2].size == 0
        expected.append(0.0 if empty else 1.0 - float(mask[y1:y2, x1:x2].mean()))
    changed_mask = (
        int((before != after).any(-1).sum()) if after.shape == before.shape else after[..., 0].size
    )
    result = hj.judge(plan, before, after, target=boxes[0], boxes=boxes)
    assert safety.visible_share(plan, boxes) == pytest.approx(expected, abs=1e-12)
    assert result.target_visible == pytest.approx(expected[0], abs=1e-12)
    assert result.covered == tuple(i for i, share in enumerate(expected) if share < 0.5)
    assert result.changed_pixels == changed_mask == safety.changed_pixels(before, after)
    planar = [
        np.ascontiguousarray(a.transpose(2, 0, 1)).transpose(1, 2, 0) for a in (before, after)
    ]
    assert safety.changed_pixels(*planar, plan) == changed_mask


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            *[st.integers(0, 60), st.integers(0, 60), st.integers(1, 25), st.integers(1, 25)]
        ),
        max_size=25,
    )
)
def test_disjoint_boxes_hold_all_pixels_once(rows):
    boxes = np.array([(x, y, x + w, y + h) for x, y, w, h in rows], np.int32).reshape(-1, 4)
    times = np.zeros((90, 90), int)
    for x1, y1, x2, y2 in compare._disjoint(boxes).tolist():
        times[y1:y2, x1:x2] += 1
    assert times.max() <= 1
    for x1, y1, x2, y2 in boxes.tolist():
        assert (times[y1:y2, x1:x2] == 1).all()


def test_wide_areas_are_compared_whole():
    before = picture((700, 900))
    after = before.copy()
    after[5:600:7, 3:880:5, 1] ^= 1
    expected = int((before != after).any(-1).sum())
    assert safety.changed_pixels(before, after) == expected > 1000


def test_many_stamps_are_judged_alike():
    plan = hj.Marks(number=700, mark_size=3).plan(hj.Scene(size=(300, 400)), seed=1)
    before = picture((300, 400))
    after = hj.apply(plan, before)
    assert safety.changed_pixels(before, after, plan) == safety.changed_pixels(before, after)


@pytest.mark.parametrize("kind", ["torch", "jax"])
def test_counting_on_a_device(kind):
    """What runs on an accelerator, run here on the CPU."""
    pytest.importorskip(kind)
    before = picture((90, 120))
    after = before.copy()
    after[5:60:7, 3:80:5, 1] ^= 1
    pair = [convert(a, kind) for a in (before, after)]
    assert int(safety.count_on_device(*pair)) == int((before != after).any(-1).sum()) > 100
    assert safety._device(pair[0]) == safety._device(before) == "cpu"


@pytest.mark.parametrize(
    "layout", ["contiguous", "channels_last", "sliced", "expanded", "transposed"]
)
def test_copies_keep_the_memory_format(layout):
    torch = pytest.importorskip("torch")
    batch = torch.from_numpy(
        np.stack([np.roll(picture((60, 80)), i, 0) for i in range(3)])
    ).permute(0, 3, 1, 2)
    image = {
        "contiguous": batch.contiguous(),
        "channels_last": batch,
        "sliced": torch.cat([batch, batch], dim=3)[:, :, :, 5:85],
        "expanded": batch[:1].expand(3, -1, -1, -1),
        "transposed": batch.contiguous().permute(0, 1, 3, 2),
    }[layout]
    size = (int(image.shape[2]), int(image.shape[3]))
    plans = [
        hj.Marks(number=5, mark_size=4).plan(hj.Scene(size=size), seed=1, sample=i)
        for i in range(3)
    ]
    before = image.clone()
    out = hj.apply(plans, image)
    assert torch.equal(image, before)
    if layout != "expanded":  # which has no memory format to keep
        assert out.stride() == torch.empty_like(image).stride()
    for plan, value, result in zip(plans, image, out, strict=True):
        assert np.array_equal(
            result.permute(1, 2, 0).numpy(), reference(plan, value.permute(1, 2, 0).numpy())
        )


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: hj.judge(None, None, None), "judge needs the Plan"),
        (
            lambda: hj.plugin.plan_avoiding(None, hj.Scene((9, 9)), seed=1),
            "a planner is a corruption",
        ),
        (
            lambda: hj.plugin.plan_avoiding(hj.Marks(), None, seed=1),
            r"scene must be a hijack_data\.Scene",
        ),
        (lambda: hj.plugin.register(5), "register decorates a class"),
    ],
)
def test_what_is_of_another_kind_is_told(call, told):
    with pytest.raises(ParameterTypeError, match=told):
        call()
