"""The Triton kernels: on a GPU where there is one, else run by Triton's interpreter (see conftest);
byte for byte."""

import itertools
import os
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.conformance import picture, reference, scene
from hijack_data.drawing import raster
from hijack_data.drawing.raster import png_recipe
from hijack_data.plan import Paste, Plan, Resample

torch = pytest.importorskip("torch")
pytest.importorskip("triton", reason="needs Triton, which comes with torch on Linux")

from hijack_data.backends import torch as torch_backend  # noqa: E402
from hijack_data.kernels import Stamp, lower, stamp_rows  # noqa: E402
from hijack_data.kernels.cpu import pixels as numpy_kernels  # noqa: E402
from hijack_data.kernels.gpu import device  # noqa: E402

SMALL = {"window_string": "go", "prefix_string": "", "suffix_string": ""}
SPECS = {
    "marks": hj.Marks(number=6, mark_size=5),
    "pop_ups": hj.PopUps(width=120, height=70, **SMALL),
    "subtitle": hj.Subtitle(subtitle_text="go on", font_size=11, padding=4),
    "no edge": hj.Subtitle(subtitle_text="go on", font_size=12, padding=4, edge_width=0),
    "resolution": hj.Resolution(scale=0.6),
    "restored": hj.Resolution(scale=0.6, restore=True),
    "both": hj.Sequence(
        [hj.Marks(number=3, mark_size=4), hj.Resolution(scale=0.7), hj.Marks(number=3, mark_size=4)]
    ),
}
SIZE = (50, 143)


ON_GPU = torch.cuda.is_available()


@pytest.fixture(autouse=True)
def on_a_device(monkeypatch):
    """Without a GPU, let tensors on the CPU take its way; sprites are not shared with other
    tests."""
    monkeypatch.setattr(raster, "_cache", raster._Cache(2**24))
    if not ON_GPU:
        monkeypatch.setattr(device, "runs_on", lambda _device: True)
        monkeypatch.setattr(torch_backend, "together", lambda _image: True)


def tensor(image, layout="channels first"):
    result = torch.from_numpy(image.copy()).to("cuda" if ON_GPU else "cpu").permute(2, 0, 1)
    if layout == "channels first":
        return result.contiguous()
    if layout == "inside":
        return torch.nn.functional.pad(result, (3, 2, 1, 4))[:, 1:-4, 3:-2]
    return result


def array(image):
    return image.permute(1, 2, 0).cpu().numpy()


@pytest.mark.parametrize("layout", ["channels first", "channels last", "inside"])
@pytest.mark.parametrize("name", list(SPECS))
def test_every_corruption_gives_the_bytes_of_the_definition(name, layout):
    plan = SPECS[name].plan(scene(SIZE), seed=2, sample="a")
    before = tensor(picture(SIZE), layout)
    after = hj.apply(plan, before)
    assert np.array_equal(array(after), reference(plan, picture(SIZE)))
    assert np.array_equal(array(before), picture(SIZE)), "the input was written into"


@pytest.mark.parametrize("kernels", ["Triton", "tensor operations"])
def test_a_mixed_batch_is_its_pictures_one_by_one(kernels, monkeypatch):
    if kernels != "Triton":  # a device for which there is none
        monkeypatch.setattr(device, "runs_on", lambda _device: False)
    names = [*SPECS, "clean"]
    plans = [
        SPECS[name].plan(scene(SIZE), seed=5, sample=name) if name in SPECS else Plan.clean(SIZE)
        for name in names
    ]
    pictures = [np.roll(picture(SIZE), 7 * i, axis=1) for i in range(len(plans))]
    expected = [reference(plan, image) for plan, image in zip(plans, pictures, strict=True)]
    batch = torch.stack([tensor(image) for image in pictures])
    out = hj.apply(plans, batch)
    assert isinstance(out, list)
    for after, right in zip(out, expected, strict=True):
        assert np.array_equal(array(after), right)
    assert np.array_equal(array(batch[0]), pictures[0])
    for after in out:
        after.zero_()  # the results are the caller's own
    assert np.array_equal(array(batch[-1]), pictures[-1])


@pytest.mark.parametrize("inplace", [False, True])
def test_a_batch_of_one_size_stays_one_tensor(inplace):
    plans = [
        SPECS[name].plan(scene(SIZE), seed=5, sample=name)
        for name in ("marks", "restored", "pop_ups", "subtitle")
    ]
    batch = torch.stack([tensor(np.roll(picture(SIZE), 7 * i, axis=1)) for i in range(4)]).reshape(
        2, 2, 3, *SIZE
    )
    before = batch.clone()
    out = hj.apply(plans, batch, inplace=inplace)
    assert (out is batch) == inplace
    assert out.shape == batch.shape
    assert inplace or torch.equal(batch, before)
    for i, plan in enumerate(plans):
        expected = reference(plan, np.roll(picture(SIZE), 7 * i, axis=1))
        assert np.array_equal(array(out[i // 2, i % 2]), expected), plan.corruption


def test_prepared_plans_are_drawn_in_another_process(monkeypatch):
    names = [*SPECS, "clean", "pop_ups"]
    plans = [
        SPECS[name].plan(scene(SIZE), seed=5, sample=f"{i}") if name in SPECS else Plan.clean(SIZE)
        for i, name in enumerate(names)
    ]
    expected = [reference(plan, picture(SIZE)) for plan in plans]
    sent = pickle.loads(pickle.dumps(hj.prepare(plans)))
    batch = torch.stack([tensor(picture(SIZE))] * len(plans))
    for after, right in zip(hj.apply(sent, batch), expected, strict=True):
        assert np.array_equal(array(after), right)
    with pytest.raises(hj.HijackError, match="9 plans for 2 pictures"):
        hj.apply(sent, batch[:2])
    with pytest.raises(hj.HijackError, match="a list of plans"):
        hj.prepare(plans[0])
    clean = hj.prepare(plans[-2:-1])
    assert torch.equal(hj.apply(clean, batch[:1]), batch[:1])
    same_size = hj.prepare(plans[:4])
    assert len(same_size) == 4
    monkeypatch.setattr(raster, "_cache", raster._Cache(2**24))
    monkeypatch.setattr(raster, "_draw", lambda _recipe: pytest.fail("drawn again"))
    for after, right in zip(hj.apply(same_size, batch[:4]), expected, strict=False):
        assert np.array_equal(array(after), right)


def test_prepared_plans_are_drawn_again_without_a_gpu_and_nothing_is_written_before():
    good = SPECS["subtitle"].plan(scene(SIZE), seed=5, sample=0)
    (op,) = good.ops
    bad = Plan("subtitle-v1", SIZE, {}, (Paste(op.sprite, op.at, "0" * 16),))
    prepared = hj.prepare([good, good])
    batch = np.stack([picture(SIZE)] * 2)
    assert np.array_equal(hj.apply(prepared, batch), hj.apply([good, good], batch))
    with pytest.raises(hj.HijackError, match="draws differently here"):
        hj.apply(replace(prepared, plans=(good, bad)), batch, inplace=True)
    assert np.array_equal(batch, np.stack([picture(SIZE)] * 2))
    after_resize = Plan("both-v1", SIZE, {}, (Resample(SIZE), *bad.ops))
    with pytest.raises(hj.HijackError, match="draws differently here"):
        hj.prepare([after_resize])


def test_in_place_is_refused_where_the_size_changes():
    plan = SPECS["resolution"].plan(scene(SIZE), seed=5, sample=0)
    with pytest.raises(hj.HijackError, match=r"inplace=True: .*resolution.* changes the size"):
        hj.apply(plan, tensor(picture(SIZE)), inplace=True)


def test_a_plan_that_draws_differently_here_is_refused():
    (op,) = SPECS["subtitle"].plan(scene(SIZE), seed=5, sample=0).ops
    plan = Plan("subtitle-v1", SIZE, {}, (Paste(op.sprite, op.at, "0" * 16),))
    with pytest.raises(hj.HijackError, match="draws differently here"):
        hj.apply([plan], tensor(picture(SIZE))[None])


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_any_sprites_anywhere(data):
    """Transparent and opaque pictures, partly outside and over each other."""
    size = data.draw(st.integers(1, 40)), data.draw(st.integers(1, 90))
    rng, ops = np.random.default_rng(data.draw(st.integers(0, 10**6))), []
    for _ in range(data.draw(st.integers(1, 3))):
        rgba = rng.integers(
            0,
            256,
            (data.draw(st.integers(1, 20)), data.draw(st.integers(1, 20)), 4),
            dtype=np.uint8,
        )
        if data.draw(st.booleans()):
            rgba[..., 3] = data.draw(st.sampled_from([0, 255]))
        at = tuple(
            (int(x), int(y)) for x, y in rng.integers(-15, 90, (data.draw(st.integers(1, 5)), 2))
        )
        ops.append(Paste(png_recipe(rgba), at))
    plan, image = Plan("test-v1", size, {}, tuple(ops)), picture(size)
    assert np.array_equal(array(hj.apply(plan, tensor(image))), reference(plan, image))


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_the_tiles_of_a_launch_are_those_that_a_row_meets(data):
    (tall, wide), sizes, tables, expected = stamp_rows.PASTE_TILE, [], [], set()
    for picture_number in range(data.draw(st.integers(1, 3))):
        height, width = data.draw(st.integers(1, 40)), data.draw(st.integers(1, 300))
        table = np.zeros((data.draw(st.integers(0, 4)), stamp_rows.COLUMNS), np.int64)
        for row in table:
            y, x = data.draw(st.integers(0, height - 1)), data.draw(st.integers(0, width - 1))
            h, w = data.draw(st.integers(1, height - y)), data.draw(st.integers(1, width - x))
            row[:4] = y, x, h, w
            expected |= {
                (picture_number, i // tall, j // wide)
                for i in range(y, y + h)
                for j in range(x, x + w)
            }
        sizes.append((height, width))
        tables.append(table)
    assert sorted(map(tuple, stamp_rows.overlapped_tiles(sizes, tables).tolist())) == sorted(
        expected
    )


@settings(max_examples=10, deadline=None)
@given(*[st.integers(1, 60)] * 4)
def test_any_resize_gives_the_bytes_of_the_cpu(height, width, h, w):
    image = picture((height, width))
    for layout in ("channels first", "channels last"):
        out = device.resample_many([tensor(image, layout)], [(h, w)])[0]
        assert np.array_equal(array(out), numpy_kernels.resample(image, (h, w)))


def test_a_sprite_is_sent_once_and_goes_with_the_cache(monkeypatch):
    sent_arrays = []
    monkeypatch.setattr(
        device,
        "_send",
        lambda arrays, to, right=device._send: sent_arrays.append(arrays) or right(arrays, to),
    )
    plan = SPECS["subtitle"].plan(scene(SIZE), seed=2, sample="a")
    masks = [len(s.sprite.layers[0].covers) for op in plan.ops for s in lower(op, SIZE)]
    for _ in range(2):
        hj.apply(plan, tensor(picture(SIZE)))
    # the sprite, then twice the tables: jobs, rows and tiles
    assert [len(arrays) for arrays in sent_arrays] == [*masks, 3, 3]


def test_a_wrong_row_is_noticed():
    """Each number of a row counts: with any of them off by one, other bytes come out (so these
    tests see a mistake)."""
    plan = SPECS["subtitle"].plan(scene(SIZE), seed=2, sample="a")
    (op,), image = plan.ops, picture(SIZE)
    (stamp,) = lower(op, SIZE)
    right = reference(plan, image)
    hj.apply(plan, tensor(image))
    (key,) = (k for k in stamp.sprite.scratch if k[0] == "device-rows")
    remembered = stamp.sprite.scratch[key]
    for column in itertools.chain(range(2), (6, 8, 9, 10)):
        stamp.sprite.scratch[key] = remembered.copy()
        stamp.sprite.scratch[key][0, column] += 1 if column < 9 else -1 & 0x10101
        assert not np.array_equal(array(hj.apply(plan, tensor(image))), right), f"column {column}"
    assert remembered.shape == (1, stamp_rows.COLUMNS)
    assert isinstance(stamp, Stamp)


AHEAD = """
import triton
from triton.backends.compiler import GPUTarget
from triton.compiler import ASTSource

from hijack_data.kernels import stamp_rows
from hijack_data.kernels.gpu import triton as kernels

tile, part = (
    {"TALL": tall, "WIDE": wide} for tall, wide in (stamp_rows.PASTE_TILE, kernels.RESIZE_TILE)
)
for kernel, names, constants in (
    (kernels.paste, {"jobs": "*i64", "rows": "*i64", "tiles": "*i32"}, tile),
    (kernels.resize, {"jobs": "*i64"}, {"ALONG_ROWS": True, **part}),
    (kernels.resize, {"jobs": "*i64"}, {"ALONG_ROWS": False, **part}),
):
    signature = names | dict.fromkeys(constants, "constexpr")
    for capability in (80, 90, 100):
        source = ASTSource(fn=kernel, signature=signature, constexprs=constants)
        made = triton.compile(source, target=GPUTarget("cuda", capability, 32))
        print(capability, len(made.asm["cubin"]))
"""


def test_the_kernels_compile_for_ampere_hopper_and_blackwell():
    """Ahead of time, by Triton's own assembler: no GPU is needed."""
    environment = {k: v for k, v in os.environ.items() if k != "TRITON_INTERPRET"} | {
        "TRITON_DEFAULT_FP_FUSION": "0"
    }
    run = subprocess.run(
        [sys.executable, "-c", AHEAD], env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    sizes = [line.split() for line in run.stdout.splitlines()]
    assert [capability for capability, _ in sizes] == ["80", "90", "100"] * 3
    assert min(int(size) for _, size in sizes) > 1000
