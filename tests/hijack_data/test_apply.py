"""One `apply` for single pictures, batches, lists and every framework."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import hijack_data as hj
from hijack_data.conformance import jax_operations, picture, reference
from hijack_data.drawing.raster import png_recipe
from hijack_data.errors import ImageError, ImageTypeError, ParameterError
from hijack_data.plan import Paste, Plan, Resample

from support.resizing import resize_with_pillow

torch = pytest.importorskip("torch")
jnp = pytest.importorskip("jax.numpy")

SIZE = (216, 384)
SCREEN = hj.Scene(size=SIZE)


def plans(count=3):
    specs = [
        hj.Marks(number=9, mark_size=8),
        hj.Subtitle(font_size=14),
        hj.PopUps(width=150, height=90),
    ]
    return [specs[i % 3].plan(SCREEN, seed=2, sample=i) for i in range(count)]


def batch(count=3):
    return np.stack([np.roll(picture(SIZE), 7 * i, axis=0) for i in range(count)])


def to(image, kind):
    if kind == "numpy":
        return image
    return torch.from_numpy(image).movedim(-1, -3) if kind == "torch" else jnp.asarray(image)


def back(image, kind):
    return image.movedim(-3, -1).numpy() if kind == "torch" else np.asarray(image)


KINDS = ["numpy", "torch", "jax"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_for_each_picture_of_a_batch(kind):
    out = hj.apply(plans(), to(batch(), kind))
    assert type(out) is type(to(batch(), kind))
    expected = np.stack([reference(p, i) for p, i in zip(plans(), batch(), strict=True)])
    assert np.array_equal(back(out, kind), expected)


@pytest.mark.parametrize("kind", KINDS)
def test_sizes_that_differ_come_back_as_a_list(kind):
    mixed = [plans()[0], hj.Resolution().plan(SCREEN, seed=1), plans()[2]]
    out = hj.apply(mixed, to(batch(), kind))
    assert isinstance(out, list)
    assert [back(o, kind).shape[:2] for o in out] == [SIZE, (108, 192), SIZE]
    for plan, image, result in zip(mixed, batch(), out, strict=True):
        assert np.array_equal(back(result, kind), reference(plan, image))


@pytest.mark.parametrize("kind", KINDS)
def test_one_new_size_stays_one_array(kind):
    small = [hj.Resolution().plan(SCREEN, seed=1)] * 3
    assert back(hj.apply(small, to(batch(), kind)), kind).shape == (3, 108, 192, 3)
    plans = [hj.Resolution(restore=True).plan(SCREEN, seed=1)] * 3
    assert back(hj.apply(plans, to(batch(), kind)), kind).shape == (3, *SIZE, 3)


def test_one_plan_for_a_whole_batch_and_more_leading_axes():
    plan = plans()[0]
    images = batch(4).reshape(2, 2, *SIZE, 3)
    out = hj.apply(plan, images)
    assert out.shape == images.shape
    assert np.array_equal(out[1, 0], reference(plan, images[1, 0]))


def test_lists_may_mix_sizes_and_kinds():
    small = picture((100, 150))
    second = hj.Marks(number=3, mark_size=5).plan(hj.Scene(size=(100, 150)), seed=1)
    out = hj.apply([plans()[0], second], [torch.from_numpy(batch()[0]).permute(2, 0, 1), small])
    assert isinstance(out[0], torch.Tensor)
    assert np.array_equal(out[1], reference(second, small))


@pytest.mark.parametrize(
    "make",
    [
        np.ascontiguousarray,
        np.asfortranarray,
        lambda a: np.repeat(a, 2, 1)[:, ::2],
        lambda a: a[::-1][::-1],
    ],
)
def test_any_strides_and_the_input_is_left_alone(make):
    for plan in plans():
        image = make(picture(SIZE).copy())
        before = image.copy()
        assert np.array_equal(hj.apply(plan, image), reference(plan, before))
        assert np.array_equal(image, before)
        hj.apply(plan, image, inplace=True)
        assert np.array_equal(image, reference(plan, before))


@pytest.mark.parametrize("layout", ["contiguous", "channels_last", "sliced"])
def test_any_torch_memory_format(layout):
    image = torch.from_numpy(batch()).permute(0, 3, 1, 2)
    if layout == "contiguous":
        image = image.contiguous()
    elif layout == "sliced":
        image = torch.cat([image, image], dim=3)[:, :, :, : SIZE[1]]
    expected = np.stack([reference(p, i) for p, i in zip(plans(), batch(), strict=True)])
    out = hj.apply(plans(), image)
    assert np.array_equal(back(out, "torch"), expected)
    assert hj.apply(plans(), image, inplace=True) is image
    assert np.array_equal(back(image, "torch"), expected)


def test_pil_in_pil_out():
    out = hj.apply(plans()[0], Image.fromarray(batch()[0]))
    assert isinstance(out, Image.Image)
    assert np.array_equal(np.asarray(out), reference(plans()[0], batch()[0]))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_sprite_anywhere(data):
    """Translucent sprites that stick out, overlap and are wholly off the picture follow the
    definition everywhere."""
    h, w = data.draw(st.integers(1, 40)), data.draw(st.integers(1, 40))
    sh, sw = data.draw(st.integers(1, 20)), data.draw(st.integers(1, 20))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    rgba = rng.integers(0, 256, (sh, sw, 4), dtype=np.uint8)
    if data.draw(st.booleans()):
        rgba[..., 3] = data.draw(st.sampled_from([0, 255]))
    at = tuple(
        data.draw(
            st.lists(st.tuples(st.integers(-25, 45), st.integers(-25, 45)), min_size=1, max_size=4)
        )
    )
    plan = Plan("test-v1", (h, w), ops=(Paste(png_recipe(rgba), at),))
    image = rng.integers(0, 256, (h, w, 3), dtype=np.uint8)
    expected = reference(plan, image)
    for kind in KINDS:
        assert np.array_equal(back(hj.apply(plan, to(image.copy(), kind)), kind), expected), kind
    from hijack_data.kernels import lower
    from hijack_data.kernels.torch_ops import paste_ops

    tensor = torch.from_numpy(image.copy()).permute(2, 0, 1)
    assert np.array_equal(back(paste_ops(tensor, lower(plan.ops[0], (h, w))), "torch"), expected)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 90), st.integers(1, 90), st.integers(1, 90), st.integers(1, 90))
def test_resampling_gives_pillows_bytes(h, w, oh, ow):
    image = picture((h, w))
    plan = Plan("test-v1", (h, w), ops=(Resample((oh, ow)),))
    expected = resize_with_pillow(image, (oh, ow))
    assert np.array_equal(hj.apply(plan, image), expected)
    assert np.array_equal(back(hj.apply(plan, to(image, "torch")), "torch"), expected)
    from hijack_data.kernels.torch_ops import resample_ops

    assert np.array_equal(back(resample_ops(to(image, "torch"), (oh, ow)), "torch"), expected)


@pytest.mark.parametrize(
    ("h", "w", "oh", "ow"),
    [(90, 160, 45, 80), (45, 80, 90, 160), (37, 1, 5, 9), (1, 1, 30, 3), (50, 60, 50, 30)],
)
def test_jax_resampling_gives_pillows_bytes(h, w, oh, ow):
    image = picture((h, w))
    plan = Plan("test-v1", (h, w), ops=(Resample((oh, ow)),))
    expected = resize_with_pillow(image, (oh, ow))
    assert np.array_equal(np.asarray(hj.apply(plan, jnp.asarray(image))), expected)
    assert np.array_equal(np.asarray(jax_operations(plan, jnp.asarray(image))), expected)


def test_jax_does_not_compile_for_each_new_text():
    from hijack_data.kernels import jax_ops as kernels

    image = jnp.asarray(picture(SIZE))
    jax_operations(plans()[1], image)
    before = kernels._paste_pixels._cache_size()
    for i in range(5):
        jax_operations(
            hj.Subtitle(subtitle_text=f"text number {i}", font_size=14).plan(SCREEN, seed=1), image
        )
    assert kernels._paste_pixels._cache_size() <= before + 1


# --- refusals


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (
            np.zeros((*SIZE, 3), np.float32),
            ImageTypeError,
            r"float32; only uint8 .* use \(image \* 255\)",
        ),
        (np.zeros((*SIZE, 3), np.int64), ImageTypeError, "int64; only uint8"),
        (np.zeros((*SIZE, 3), bool), ImageTypeError, "bool; only uint8"),
        (np.zeros((3, *SIZE), np.uint8), ImageError, "other channel order"),
        (np.zeros(SIZE, np.uint8), ImageError, "grey picture"),
        (np.zeros((*SIZE, 4), np.uint8), ImageError, "drop the alpha channel"),
        (np.zeros((0, 5, 3), np.uint8), ImageError, "empty"),
        (
            np.zeros((100, 100, 3), np.uint8),
            ImageError,
            "made for 384x216 but the picture is 100x100",
        ),
        ("picture.png", ImageTypeError, "cannot corrupt a builtins.str"),
        (None, ImageTypeError, "cannot corrupt a builtins.NoneType"),
        (Image.new("L", SIZE[::-1]), ImageTypeError, "mode 'L'; use image.convert"),
    ],
)
def test_wrong_pictures(image, error, message):
    with pytest.raises(error, match=message):
        hj.apply(plans()[0], image)


def test_wrong_torch_pictures():
    with pytest.raises(ImageError, match="other channel order, move axis -1 to -3"):
        hj.apply(plans()[0], torch.zeros((*SIZE, 3), dtype=torch.uint8))
    with pytest.raises(ImageTypeError, match=r"clamp\(0, 255\)"):
        hj.apply(plans()[0], torch.zeros((3, *SIZE)))


def test_wrong_counts_and_plans():
    with pytest.raises(ImageError, match="2 plans for 3 pictures"):
        hj.apply(plans(2), batch())
    with pytest.raises(ImageTypeError, match="must be a Plan"):
        hj.apply("marks", batch())
    with pytest.raises(ImageError, match=r"plan \(plan 1\) was made for"):
        hj.apply(
            [plans()[0], hj.Marks().plan(hj.Scene(size=(50, 50)), seed=1), plans()[2]], batch()
        )


def test_inplace_refusals():
    small = hj.Resolution().plan(SCREEN, seed=1)
    with pytest.raises(ParameterError, match="changes the size"):
        hj.apply(small, batch()[0], inplace=True)
    with pytest.raises(ParameterError, match="changes the size"):
        hj.apply([small] * 3, batch(), inplace=True)
    with pytest.raises(ParameterError, match="JAX arrays"):
        hj.apply(plans()[0], jnp.asarray(batch()[0]), inplace=True)
    frozen = batch()[0]
    frozen.setflags(write=False)
    with pytest.raises(ParameterError, match="read-only"):
        hj.apply(plans()[0], frozen, inplace=True)
    assert np.array_equal(hj.apply(plans()[0], frozen), reference(plans()[0], frozen))


def test_a_clean_plan_gives_a_copy():
    image = batch()[0]
    out = hj.apply(Plan.clean(SIZE), image)
    assert np.array_equal(out, image)
    assert not np.shares_memory(out, image)
    assert hj.apply(Plan.clean(SIZE), image, inplace=True) is image


def test_what_is_refused_in_place_is_left_as_it_was():
    """The marks come before the resize: they must not be drawn when the resize is refused."""
    plan = hj.Sequence([hj.Marks(number=3, mark_size=5), hj.Resolution(scale=0.5)]).plan(
        hj.Scene((90, 120)), seed=1
    )
    image = np.full((90, 120, 3), 7, np.uint8)
    with pytest.raises(ParameterError, match="changes the size"):
        hj.apply(plan, image, inplace=True)
    assert (image == 7).all()
