"""A subtitle without an edge is Pillow's own drawing; a font is checked when it is named."""

import math

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

import hijack_data as hj
from hijack_data.config import load_config
from hijack_data.conformance import jax_operations, picture, reference
from hijack_data.drawing.text import font_file
from hijack_data.errors import FontError
from hijack_data.kernels import lower
from hijack_data.kernels.cpu.pixels import paste

SIZE = (400, 1100)
TEXTS = ["One line", "Two lines,\nthe second one is wider\n\nand a third", "Äj|g_\n(}", "_"]


def lines_by_pillow(image: np.ndarray, plan: hj.Plan) -> np.ndarray:
    """What Pillow draws when it is asked for the lines of a plan, centred, without a stroke."""
    recipe = plan.ops[0].sprite
    x, y = (side + recipe.get("margin", 0) for side in plan.ops[0].at[0])
    layout = ImageFont.Layout.BASIC
    font = ImageFont.truetype(str(font_file(recipe["font"])), recipe["size"], layout_engine=layout)
    widths = [math.ceil(font.getlength(line)) for line in recipe["lines"]]
    out = Image.fromarray(image)
    for row, (line, width) in enumerate(zip(recipe["lines"], widths, strict=True)):
        position = x + (max(widths) - width) // 2, y + row * sum(font.getmetrics())
        ImageDraw.Draw(out).text(position, line, fill=recipe["color"], font=font)
    return np.asarray(out)


@pytest.mark.parametrize("font", ["DejaVuSans", "DejaVuSansMono-Bold"])
@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("size", [5, 14, 35, 61])
def test_without_an_edge_it_is_what_pillow_draws(font, text, size):
    """Letters that stick out of their line by a pixel or two are not cut off either."""
    spec = hj.Subtitle(
        subtitle_text=text,
        font_path=font,
        font_size=size,
        edge_width=0,
        edge_color="red",
        color="#f0e442",
    )
    before = picture(SIZE)
    plan = spec.plan(hj.Scene(SIZE), seed=1)
    expected = lines_by_pillow(before, plan)
    assert (expected != before).any()
    assert np.array_equal(hj.apply(plan, before), expected)
    assert np.array_equal(reference(plan, before), expected)
    assert np.array_equal(paste(before.copy(), lower(plan.ops[0], SIZE)), expected)


def test_other_frameworks_draw_the_same():
    torch, jnp = pytest.importorskip("torch"), pytest.importorskip("jax.numpy")
    plan = hj.Subtitle(edge_width=0, font_size=20).plan(hj.Scene(SIZE), seed=1)
    expected = lines_by_pillow(picture(SIZE), plan)
    channels_first = torch.from_numpy(picture(SIZE)).permute(2, 0, 1)
    assert np.array_equal(hj.apply(plan, channels_first).permute(1, 2, 0).numpy(), expected)
    assert np.array_equal(np.asarray(hj.apply(plan, jnp.asarray(picture(SIZE)))), expected)
    assert np.array_equal(np.asarray(jax_operations(plan, jnp.asarray(picture(SIZE)))), expected)


def test_the_colour_of_an_edge_that_is_not_there_is_nowhere():
    white = np.full((1080, 1920, 3), 255, np.uint8)
    screen = hj.Scene((1080, 1920))
    spec = hj.Subtitle(color="white", edge_color="red", edge_width=0)
    assert np.array_equal(hj.apply(spec.plan(screen, seed=1), white), white)
    edged = spec.replace(edge_width=1).plan(screen, seed=1)
    assert not np.array_equal(hj.apply(edged, white), white)


@pytest.mark.parametrize(
    "path", ["/no/such.ttf", "x" * 300, "~nobody-of-this-name/x.ttf", "a\ud800", "", ".", __file__]
)
def test_a_font_that_cannot_be_loaded_is_refused_when_it_is_named(path):
    message = r"subtitle\.font_path: font .* (is not a file|cannot be loaded)"
    with pytest.raises(FontError, match=message):
        hj.Subtitle(font_path=path)
    with pytest.raises(hj.HijackError, match=r"<mapping>.*subtitle\.font_path"):
        load_config({"corruptions": {"subtitle": {"font_path": path}}})


def test_letters_that_the_font_lacks_are_named_when_they_are_written():
    with pytest.raises(FontError, match=r"subtitle\.subtitle_text: .*U\+4F60"):
        hj.Subtitle(subtitle_text="你好")
    with pytest.raises(hj.HijackError, match=r"subtitle\.subtitle_text: .*U\+4F60"):
        load_config({"corruptions": {"subtitle": {"subtitle_text": "你好"}}})
