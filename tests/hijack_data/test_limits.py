"""A plan from elsewhere cannot ask for all memory; what is legitimate stays within the limits."""

import json
import struct
import tracemalloc
import zlib
from base64 import b64encode

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data import limits
from hijack_data.conformance import jax_operations, picture, reference
from hijack_data.drawing import sprite
from hijack_data.drawing.raster import png_recipe, render
from hijack_data.errors import ParameterError, PlanError
from hijack_data.kernels import lower
from hijack_data.kernels import stamps as stamps_module
from hijack_data.kernels.cpu import pixels as cpu
from hijack_data.plan import Paste, Plan, Resample, _digest

MIB = 2**20
FONT = {"font": "DejaVuSans", "color": "black", "edge_color": "red"}
TEXT = {"draw": "text", "lines": ["a"], "size": 20, "edge": 0, **FONT}
WINDOW = {"draw": "window", "size": [90, 60], "edge": 1, "panels": [], **FONT}


def peak(work) -> int:
    """The most memory that was taken while something was done, in bytes."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def sealed(**fields) -> str:
    data = {key: value for key, value in Plan.clean((1, 1)).to_data().items() if key != "digest"}
    data.update(fields)
    return json.dumps({**data, "digest": _digest(data)})


# --- sizes


@pytest.mark.parametrize("size", [(60_000, 60_000), (2**14, 2**14 + 1), (2**20, 257)])
def test_a_resize_beyond_the_limit_is_refused(size):
    with pytest.raises(ParameterError, match=f"limit is {limits.PICTURE_PIXELS} pixels"):
        Resample(size)
    op = {"op": "resample", "size": list(size), "filter": "bicubic"}
    with pytest.raises(PlanError, match=f"limit is {limits.PICTURE_PIXELS} pixels"):
        Plan.from_json(sealed(ops=[op]))


def test_a_plan_for_a_picture_beyond_the_limit_is_refused():
    with pytest.raises(PlanError, match=f"limit is {limits.PICTURE_PIXELS} pixels"):
        Plan.from_json(sealed(size=[2**20, 2**20]))
    with pytest.raises(ParameterError, match=f"limit is {limits.PICTURE_PIXELS} pixels"):
        hj.Marks().plan(hj.Scene((2**20, 2**20)), seed=1)


@given(st.integers(1, 9000), st.integers(1, 9000), st.floats(0.01, 16), st.booleans())
@settings(max_examples=200, deadline=None)
def test_whatever_resolution_allows_is_allowed(height, width, scale, restore):
    spec = hj.Resolution(scale=scale, restore=restore)
    try:
        plan = spec.plan(hj.Scene((height, width)), seed=1)
    except ParameterError as error:
        assert "resolution.scale" in str(error)  # noqa: PT017
        assert max(1, int(height * scale + 0.5)) * max(1, int(width * scale + 0.5)) > 2**28
        return
    assert Plan.from_json(plan.to_json()) == plan


@pytest.mark.parametrize("size", [(4320, 7680), (7680, 4320), (2160, 15360)])
def test_the_largest_screens_are_within_the_limits(size):
    screen = hj.Scene(size)
    corruption = hj.PopUps(width=100_000, height=100_000)
    for spec in (corruption, hj.Marks(mark_size=4096, number=1), hj.Resolution(scale=2)):
        plan = spec.plan(screen, seed=1)
        again = Plan.from_json(plan.to_json())
        assert again == plan
    assert size[0] * size[1] < limits.SPRITE_PIXELS
    assert render(corruption.plan(screen, seed=1).ops[0].sprite).size == size


# --- recipes


def png_of_size(width: int, height: int) -> dict:
    """A PNG whose first chunk tells of a size that it does not have."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        length, check = len(data), zlib.crc32(kind + data)
        return struct.pack(">I", length) + kind + data + struct.pack(">I", check)

    head = chunk(b"IHDR", struct.pack(">II5B", width, height, 8, 2, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(bytes(999))) + chunk(b"IEND", b"")
    return {"draw": "png", "data": b64encode(b"\x89PNG\r\n\x1a\n" + head + body).decode()}


def panel(**values) -> dict:
    return {"box": [0, 0, 90, 60], "fill": "white", "lines": [], "font_size": 9, **values}


LARGE = {
    "mark": {"draw": "mark", "shape": "star", "size": 4097, "color": "red"},
    "window": {**WINDOW, "size": [16_000, 16_000]},
    "wide window": {**WINDOW, "size": [2**20, 2**7]},
    "png": png_of_size(20_000, 20_000),
    "png of 2**31": png_of_size(2**31 - 1, 2**31 - 1),
    "text of many letters": {**TEXT, "lines": ["W" * 50_000], "size": 900},
    "text of many lines": {**TEXT, "lines": ["a"] * 50_000, "size": 4000},
    "text with an edge": {**TEXT, "edge": 4096, "lines": ["a"] * 9},
    "text with a margin": {**TEXT, "margin": 4096},
    "edge": {**TEXT, "edge": 5000},
    "negative edge": {**TEXT, "edge": -1},
    "line of a window": {**WINDOW, "panels": [panel(lines=["W" * 3000], font_size=4096)]},
    "lines of a window": {
        **WINDOW,
        "panels": [panel(lines=[chr(65 + i) * 5], font_size=4096) for i in range(20)],
    },
}


@pytest.mark.parametrize("name", LARGE)
def test_a_drawing_that_is_too_large_is_refused_before_it_is_made(name):
    def refused():
        with pytest.raises(PlanError, match=r"must hold 1 to|is not in 0\.\.4096|text has over"):
            render(LARGE[name])

    assert peak(refused) < 300 * MIB


def test_the_largest_mark_is_drawn():
    recipe = {"draw": "mark", "shape": "circle", "size": 4096, "color": "#102030"}
    plan = Plan("test-v1", (60, 80), ops=(Paste(recipe, ((-4000, -4000), (40, 40))),))
    after = np.zeros((60, 80, 3), np.uint8)
    assert peak(lambda: cpu.paste(after, lower(plan.ops[0], plan.size))) < 1200 * MIB
    assert (after == (16, 32, 48)).all()


# --- parts of sprites


@pytest.mark.parametrize("alpha", [255, 90])
def test_what_sticks_out_is_cut_off_without_a_copy(alpha):
    """However often a large sprite sticks out, its pixels are in memory once."""
    rgba = np.full((900, 900, 4), alpha, np.uint8)
    rgba[0, 0] = 7, 8, 9, alpha
    op = Paste(png_recipe(rgba), tuple((-i, -1) for i in range(1, 400)))
    render(op.sprite)
    assert peak(lambda: lower(op, (1000, 1000))) < 20 * MIB


# --- work in pieces


STAMPS = [
    {"draw": "mark", "shape": "star", "size": 9, "color": "red"},
    {**TEXT, "edge": 2, "lines": ["two", "lines"], "size": 11},
    {**WINDOW, "size": [40, 25], "panels": [panel(box=[0, 0, 40, 20], lines=["ok"])]},
    png_recipe(np.random.default_rng(0).integers(0, 256, (13, 17, 4), dtype=np.uint8)),
]


@pytest.mark.parametrize("recipe", STAMPS, ids=lambda recipe: recipe["draw"])
@pytest.mark.parametrize("pixels", [60, 200])
def test_work_in_pieces_gives_the_same_bytes(recipe, pixels, monkeypatch):
    torch, jnp = pytest.importorskip("torch"), pytest.importorskip("jax.numpy")
    from hijack_data.kernels.torch_ops import paste_ops

    at = ((3, 2), (8, 6), (-5, 30), (60, 41), (12, 20))
    plan, image = Plan("test-v1", (50, 70), ops=(Paste(recipe, at),)), picture((50, 70))
    expected = reference(plan, image)
    for module in (sprite, stamps_module, cpu):
        monkeypatch.setattr(module, "PIXELS_AT_ONCE", pixels)
    stamps = lower(plan.ops[0], plan.size)
    planar = np.ascontiguousarray(image.transpose(2, 0, 1))
    assert np.array_equal(cpu.paste(image.copy(), stamps), expected)
    assert np.array_equal(cpu.paste(planar.copy().transpose(1, 2, 0), stamps), expected)
    by_torch = paste_ops(torch.from_numpy(planar.copy()), stamps)
    assert np.array_equal(by_torch.numpy().transpose(1, 2, 0), expected)
    assert np.array_equal(np.asarray(jax_operations(plan, jnp.asarray(image))), expected)


# --- what sprites keep


def kept_by(drawn: sprite.Sprite) -> int:
    """Bytes of all arrays that a sprite keeps, in its layers, its properties and its scratch."""
    arrays: dict[int, np.ndarray] = {}

    def collect(value: object) -> None:
        if isinstance(value, np.ndarray):
            arrays[id(value)] = value
        elif isinstance(value, dict):
            collect(list(value.values()))
        elif isinstance(value, list | tuple):
            for item in value:
                collect(item)
        elif hasattr(value, "__dict__"):
            collect(vars(value))

    collect(vars(drawn))
    return sum(array.nbytes for array in arrays.values() if 0 not in array.strides)


@pytest.mark.parametrize("recipe", STAMPS, ids=lambda recipe: recipe["draw"])
def test_a_sprite_keeps_no_more_than_it_says_whatever_pictures_it_met(recipe, monkeypatch):
    from hijack_data.drawing import raster

    monkeypatch.setattr(raster, "_cache", raster._Cache(2**24))
    sprite = render(recipe)
    for width in range(60, 160):
        image = np.zeros((50, width, 3), np.uint8)
        planar = np.zeros((3, 50, width), np.uint8).transpose(1, 2, 0)
        strided = np.zeros((50, 2 * width, 3), np.uint8)[:, ::2]
        for target in (image, planar, strided):
            cpu.paste(target, lower(Paste(recipe, ((2, 3),)), target.shape[:2]))
    assert sprite.fingerprint
    assert sprite.opaque or sprite.paint.size
    assert kept_by(sprite) <= sprite.footprint
    assert raster._cache.used == sprite.footprint
