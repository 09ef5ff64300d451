"""Pasting on the CPU: the bytes of the definition for every sprite, place and
memory layout."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.conformance import picture, reference
from hijack_data.drawing.raster import png_recipe
from hijack_data.drawing.sprite import Layer, Sprite
from hijack_data.kernels import Stamp, lower
from hijack_data.kernels.cpu import pixels as kernels
from hijack_data.plan import Paste, Plan

SIDE = st.one_of(st.integers(1, 20), st.integers(1, 80))
COLOR = st.sampled_from(["red", "#ffffff", "#000000", "#01fe80", "#7f8081"])
LINES = st.lists(st.text(st.sampled_from("AVow.,j"), max_size=9), min_size=1, max_size=2)
SHAPES = st.sampled_from(["star", "circle", "rectangle"])
MARK = st.fixed_dictionaries(
    {"draw": st.just("mark"), "shape": SHAPES, "size": st.integers(1, 40), "color": COLOR}
)
TEXT = st.fixed_dictionaries(
    {
        "lines": LINES,
        "size": st.integers(4, 40),
        "color": COLOR,
        "edge_color": COLOR,
        "edge": st.integers(0, 4),
    }
).map(lambda recipe: {"draw": "text", "font": "DejaVuSans", **recipe})


@st.composite
def windows(draw) -> dict:
    width, height = draw(SIDE), draw(SIDE)
    panels = [
        {
            "box": [0, y, width, y + height // 2 + 1],
            "fill": draw(COLOR),
            "lines": draw(LINES),
            "font_size": 9,
        }
        for y in (0, height // 2)
    ]
    around = {"color": draw(COLOR), "edge_color": draw(COLOR), "edge": draw(st.integers(0, 3))}
    return {
        "draw": "window",
        "size": [width, height],
        "font": "DejaVuSans",
        "panels": panels,
        **around,
    }


@st.composite
def pngs(draw) -> dict:
    """Opaque, with some alpha, or with alpha that is the same for stretches of pixels."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    rgba = rng.integers(0, 256, (draw(SIDE), draw(SIDE), 4), dtype=np.uint8)
    kind, pixels = (
        draw(st.sampled_from(["opaque", "noise", "stretches"])),
        rgba.shape[0] * rgba.shape[1],
    )
    if kind == "opaque":
        rgba[..., 3] = 255
    elif kind == "stretches":
        rgba[..., 3] = (
            rng.choice([0, 0, 90, 255], pixels // 23 + 1)
            .repeat(23)[:pixels]
            .reshape(rgba.shape[:2])
        )
    return png_recipe(rgba)


PLACES = st.lists(st.tuples(st.integers(-40, 80), st.integers(-40, 80)), min_size=1, max_size=4)
PASTES = st.builds(
    lambda recipe, at: Paste(recipe, tuple(at)), st.one_of(MARK, TEXT, windows(), pngs()), PLACES
)

# Each makes memory, and a picture `[h, w, 3]` that is a view of a part of it.
LAYOUTS = {
    "channels last": lambda h, w: (m := noise(h * w * 3 + 128), m[64:-64].reshape(h, w, 3)),
    "channels last, a part": lambda h, w: (m := noise(h + 4, w + 7, 3), m[2:-2, 3:-4]),
    "channels first": lambda h, w: (
        m := noise(h * w * 3 + 128),
        m[64:-64].reshape(3, h, w).transpose(1, 2, 0),
    ),
    "channels first, a part": lambda h, w: (
        m := noise(5, h + 4, w + 7),
        m[1:-1, 2:-2, 3:-4].transpose(1, 2, 0),
    ),
    "upside down": lambda h, w: (m := noise(h + 4, w + 7, 3), m[2:-2, 3:-4][::-1]),
    "channels first, upside down": lambda h, w: (m := noise(3, h, w), m.transpose(1, 2, 0)[::-1]),
    "mirrored": lambda h, w: (m := noise(h + 4, w + 7, 3), m[2:-2, 3:-4][:, ::-1]),
    "channels reversed": lambda h, w: (m := noise(h, w, 3), m[..., ::-1]),
    "every second row": lambda h, w: (m := noise(2 * h, w, 3), m[::2]),
    "every second pixel": lambda h, w: (m := noise(h, 2 * w, 3), m[:, ::2]),
    "of four channels": lambda h, w: (m := noise(h, w, 4), m[..., 1:]),
    "columns first": lambda h, w: (m := noise(w, h, 3), m.swapaxes(0, 1)),
    "channels, then columns first": lambda h, w: (m := noise(3, w, h), m.transpose(2, 1, 0)),
}


def noise(*shape: int) -> np.ndarray:
    return np.random.default_rng(sum(shape)).integers(0, 256, shape, dtype=np.uint8)


def check(layout: str, image: np.ndarray, stamps: list[Stamp], expected: np.ndarray) -> None:
    """The picture becomes `expected`; the memory around and between its pixels stays as it was."""
    memory, view = LAYOUTS[layout](*image.shape[:2])
    before = memory.copy()
    copied = view.copy()
    view[...] = image
    assert kernels.paste(view, stamps) is view
    np.testing.assert_array_equal(view, expected)
    view[...] = copied
    np.testing.assert_array_equal(memory, before)


@settings(max_examples=150, deadline=None)
@given(
    size=st.tuples(SIDE, SIDE),
    ops=st.lists(PASTES, min_size=1, max_size=3),
    layout=st.sampled_from(list(LAYOUTS)),
)
def test_any_sprite_anywhere_in_any_layout(size, ops, layout):
    image = noise(*size, 3)
    expected = reference(Plan("test-v1", size, ops=tuple(ops)), image)
    check(layout, image, [stamp for op in ops for stamp in lower(op, size)], expected)


def stamp(layer: Layer, y: int = 0, x: int = 0) -> Stamp:
    return Stamp(Sprite.from_layer(layer), np.array([y], np.int32), np.array([x], np.int32))


def blended(below: np.ndarray, alpha: np.ndarray, paint: np.ndarray) -> np.ndarray:
    """The nearest integer to a blend."""
    total = below.astype(np.int64) * (255 - alpha[..., None].astype(np.int64)) + paint
    return ((2 * total + 255) // 510).astype(np.uint8)


@pytest.mark.parametrize("layout", ["channels last", "channels first", "every second pixel"])
@pytest.mark.parametrize("level", [0, 1, 127, 254, 255])
def test_every_byte_under_every_opacity(layout, level):
    """All that 16 bits must hold, for one colour, for two and for a picture."""
    alpha, below = np.mgrid[0:256, 0:256].astype(np.uint8)
    image = np.stack([below, 255 - below, below], axis=-1)
    box, color, items = (0, 0, 256, 256), (level, 255, 255 - level), (255, level, level)
    first, wide_alpha = alpha // 3, alpha.astype(np.int64)[..., None]
    second = alpha - first
    value, two = (
        wide_alpha * color,
        first[..., None].astype(np.int64) * color + second[..., None].astype(np.int64) * items,
    )
    for layer, paint in (
        (Layer(box, (alpha,), (color,)), value),
        (Layer(box, (first, second), (color, items)), two),
        (Layer(box, (alpha,), picture=value.astype(np.uint16)), value),
    ):
        check(layout, image, [stamp(layer)], blended(image, alpha, paint))


def layers(width: int) -> list[Layer]:
    """One of each kind, 3 rows high, with masks that are parts of larger ones."""
    rng, box = np.random.default_rng(width), (0, 0, width, 3)
    masks = [
        rng.choice(np.array([0, 0, 100, 155, 255], np.uint8), (3, width + 9))[:, 4:-5]
        for _ in range(2)
    ]
    second = np.minimum(masks[1], 255 - masks[0])
    opaque, colors = (
        np.full((3, width), 255, np.uint8),
        rng.integers(0, 256, (3, width, 3), dtype=np.uint8),
    )
    paint = masks[0][..., None] * colors.astype(np.uint16)
    return [
        Layer(box, colors=((1, 2, 3),)),
        Layer(box, (masks[0],), ((250, 9, 77),)),
        Layer(box, (opaque,), ((250, 9, 77),)),
        Layer(box, (masks[0], second), ((3, 200, 101), (91, 255, 0))),
        Layer(box, picture=colors),
        Layer(box, (masks[0],), picture=paint),
    ]


@pytest.mark.parametrize(
    "layout", ["channels last", "channels last, a part", "channels first", "mirrored"]
)
def test_every_width(layout):
    """Narrower than a vector, its multiples and what is left over, in pictures as wide and
    wider."""
    for width in range(1, 100):
        for layer in layers(width):
            for beside in (0, 5):
                image = noise(4, width + beside, 3)
                expected, part = (
                    image.copy(),
                    (slice(1, 4), slice(beside // 2, beside // 2 + width)),
                )
                expected[part] = blended(image[part], layer.alpha, layer.paint)
                check(layout, image, [stamp(layer, 1, beside // 2)], expected)


def test_nothing_to_stamp():
    image = noise(40, 50, 3)
    mark = hj.Marks(number=1).plan(hj.Scene(size=(400, 400)), seed=1).ops[0]
    nowhere = lower(Paste(mark.sprite, ((-100, 0), (50, 3))), (40, 50))
    for stamps in ([], nowhere, [stamp for stamp in nowhere for _ in range(3)]):
        assert np.array_equal(kernels.paste(image.copy(), stamps), image)


def test_threads_share_sprites():
    size = (300, 500)
    specs = [
        hj.Marks(number=9, mark_size=8),
        hj.Subtitle(font_size=18),
        hj.PopUps(width=150, height=90),
    ]
    plans = [specs[i % 3].plan(hj.Scene(size=size), seed=5, sample=i % 6) for i in range(24)]
    images = [np.roll(picture(size), i, axis=0) for i in range(24)]
    with ThreadPoolExecutor(4) as pool:
        outs = list(
            pool.map(
                lambda plan, image: kernels.paste(image.copy(), lower(plan.ops[0], size)),
                plans,
                images,
            )
        )
    for plan, image, out in zip(plans, images, outs, strict=True):
        np.testing.assert_array_equal(out, reference(plan, image))
