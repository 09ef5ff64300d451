"""Plans as pytrees: inside `jax.jit` they give the bytes of `apply`, and compile a bounded number
of programs."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.conformance import picture, scene
from hijack_data.errors import (
    ImageError,
    ImageTypeError,
    ParameterError,
    ParameterTypeError,
    PlanError,
)
from hijack_data.plan import Paste, Plan, Resample

jax = pytest.importorskip("jax")
from hijack_data import jax_plans  # noqa: E402
from hijack_data.jax_plans import Packer, apply_arrays  # noqa: E402

SIZE = (180, 260)
WORDS = {"window_string": "go", "prefix_string": "", "suffix_string": ""}
POP_UP = hj.PopUps(width=150, height=100, size="uniform", **WORDS)
MARKS, SUBTITLE = hj.Marks(number=9, mark_size=6), hj.Subtitle(font_size=9)
HALF = hj.Resolution(scale=0.5, restore=True)
PARTS = [
    POP_UP,
    MARKS,
    SUBTITLE,
    HALF,
    hj.Marks(number=3, mark_size=9),
    hj.Resolution(scale=1.5, restore=True),
]


def batch(count):
    return np.stack([np.roll(picture(SIZE), 7 * i, axis=1) for i in range(count)])


def same_as_apply(plans, packer=None):
    images = batch(len(plans))
    out = jax.jit(apply_arrays)((packer or Packer(SIZE)).pack(plans), jax.numpy.asarray(images))
    assert np.array_equal(np.asarray(out), hj.apply(plans, images))


def plan(parts, sample):
    return hj.Sequence(parts).plan(scene(SIZE), seed=5, sample=sample)


@given(
    st.lists(st.lists(st.sampled_from(PARTS), min_size=1, max_size=4), min_size=1, max_size=3),
    st.integers(0, 999),
)
@settings(max_examples=12, deadline=None)
def test_any_sequence_gives_the_bytes_of_apply(rows, sample):
    same_as_apply([plan(parts, sample) for parts in rows])


def test_clean_and_corrupted_pictures_share_a_batch():
    same_as_apply(
        [Plan.clean(SIZE), plan([POP_UP, SUBTITLE], 1), Plan.clean(SIZE), plan([HALF], 2)]
    )
    same_as_apply([Plan.clean(SIZE)])


def test_what_is_painted_before_a_block_stays_below_it():
    block, soft = plan([POP_UP], 3).ops[0], plan([SUBTITLE], 3).ops[0]
    (x, y), (h, w) = block.at[0], (60, 100)
    # inside the block, and across its edge
    under = Paste(soft.sprite, ((x + 5, y + 5), (x - 40, y - 3)))
    assert h
    assert w
    for ops in ((under, block), (block, under), (under, block, under), (under, under)):
        same_as_apply([Plan("test-v1", SIZE, ops=ops)])


def test_columns_first_where_the_picture_gets_much_less_tall():
    low = Resample((40, 250))
    same_as_apply([Plan("test-v1", SIZE, ops=(low, Resample(SIZE))), Plan.clean(SIZE)])


def test_plans_travel_as_arguments_of_ones_own_program():
    @partial(jax.jit, donate_argnums=1)
    def step(bias, images, plans):
        images = apply_arrays(plans, images)
        return images, images.astype("float32").mean(axis=(1, 2, 3)) + bias

    plans = [plan([MARKS], i) for i in range(3)]
    _, value = step(1.0, jax.numpy.asarray(batch(3)), Packer(SIZE).pack(plans))
    expected = hj.apply(plans, batch(3)).mean(axis=(1, 2, 3)) + 1
    assert np.allclose(np.asarray(value), expected, atol=1e-2)


def test_a_thousand_random_batches_compile_a_few_programs():
    images, packer = jax.numpy.asarray(batch(2)), Packer(SIZE)
    program = jax.jit(lambda plans, images: apply_arrays(plans, images))  # a cache of its own
    aug = hj.OneOf([POP_UP, *(hj.Marks(number=n, mark_size=5) for n in (5, 20)), HALF], p_clean=0.1)

    def run(first, last):
        for i in range(first, last):
            text = hj.Subtitle(
                subtitle_text=f"sample {i * 7919}", font_size=8 + i % 9, fit="shrink"
            )
            plans = [
                (text if (i + k) % 5 == 0 else aug).plan(hj.Scene(SIZE), seed=1, sample=f"{i}-{k}")
                for k in (0, 1)
            ]
            program(packer.pack(plans), images).block_until_ready()
        return program._cache_size()

    early = run(0, 100)
    assert early <= 8
    assert run(100, 1000) == early


def test_what_does_not_fit_a_batch_of_one_shape():
    with pytest.raises(
        ParameterError, match=r"plan 0 \(resolution-v2\) gives 130x90.*restore=True"
    ):
        Packer(SIZE).pack([hj.Resolution(scale=0.5).plan(hj.Scene(SIZE), seed=1)])
    with pytest.raises(ParameterError, match="plan 1 was made for 20x10, not for 260x180"):
        Packer(SIZE).pack([Plan.clean(SIZE), Plan.clean((10, 20))])


@pytest.mark.parametrize(
    ("plans", "error", "message"),
    [
        ([], ParameterError, "no plans"),
        (["x"], ParameterTypeError, "item 0 is 'x'"),
        ([Plan.clean(SIZE), None], ParameterTypeError, "item 1 is None"),
        (Plan.clean(SIZE), ParameterTypeError, "takes a list of plans, got Plan"),
        ("plans", ParameterTypeError, "takes a list of plans, got str"),
    ],
)
def test_what_is_no_list_of_plans(plans, error, message):
    with pytest.raises(error, match=message):
        Packer(SIZE).pack(plans)


def test_plans_that_need_too_much_memory_are_refused(monkeypatch):
    mark = {"draw": "mark", "shape": "circle", "size": 30, "color": "red"}
    window = {"draw": "window", "size": [60, 60], "edge": 1, "panels": [], "font": "DejaVuSans"}
    window = {**window, "color": "red", "edge_color": "blue"}
    monkeypatch.setattr(jax_plans, "PICTURE_PIXELS", 500_000)
    packer = Packer(SIZE)
    for recipe in (mark, window):
        large = Plan("test-v1", SIZE, ops=(Paste(recipe, ((1, 1),) * 200),))
        with pytest.raises(ParameterError, match="test-v1 paints too many pixels"):
            packer.pack([large])
    small = Plan("test-v1", SIZE, ops=(Paste(window, ((1, 1),) * 20),))
    blocks = packer.pack([small]).pastes[0].colors.shape[0]
    assert blocks == 32, "a plan that was refused left its mark"


@pytest.mark.parametrize(
    ("images", "error", "message"),
    [
        (
            np.zeros((2, 100, 100, 3), np.uint8),
            ImageError,
            r"2 pictures of 260x180.*\[2, 100, 100, 3\]",
        ),
        (np.zeros((2, 182, 260, 3), np.uint8), ImageError, r"\[2, 182, 260, 3\]"),
        (np.zeros((1, *SIZE, 3), np.uint8), ImageError, r"\[1, 180, 260, 3\]"),
        (np.zeros((3, *SIZE, 3), np.uint8), ImageError, r"\[3, 180, 260, 3\]"),
        (np.zeros((*SIZE, 3), np.uint8), ImageError, r"\[180, 260, 3\]"),
        (np.zeros((1, 2, *SIZE, 3), np.uint8), ImageError, r"\[1, 2, 180, 260, 3\]"),
        (np.zeros((2, *SIZE, 3), np.float32), ImageTypeError, "float32; only uint8"),
        (np.zeros((2, *SIZE, 3), np.int8), ImageTypeError, "int8; only uint8"),
        (np.zeros((2, 3, *SIZE), np.uint8), ImageError, "other channel order"),
        ([1, 2], ImageTypeError, "cannot corrupt a builtins.list"),
    ],
)
@pytest.mark.parametrize(
    "wrap", [lambda f: f, lambda f: lambda p, i: jax.jit(f)(p, i)], ids=["", "jit"]
)
def test_pictures_that_the_plans_are_not_for(images, error, message, wrap):
    plans = Packer(SIZE).pack([plan([MARKS], i) for i in range(2)])
    if not isinstance(images, list):
        with pytest.raises(error, match=message):
            wrap(apply_arrays)(plans, jax.numpy.asarray(images))
    with pytest.raises(error, match=message):
        apply_arrays(plans, images)


def test_what_is_not_packed():
    with pytest.raises(ParameterTypeError, match=r"takes what Packer\.pack returned, got list"):
        apply_arrays([Plan.clean(SIZE)], batch(1))


def test_a_sprite_that_draws_differently_here_is_refused():
    op = plan([SUBTITLE], 1).ops[0]
    with pytest.raises(PlanError, match="draws differently here"):
        Packer(SIZE).pack([Plan("subtitle-v1", SIZE, ops=(Paste(op.sprite, op.at, "0" * 16),))])
