"""Pictures of the gallery: how they are stored in the page, and the contact sheet."""

import base64
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.errors import FontError, ImageError, ImageTypeError, ParameterError
from hijack_data.gallery import contact_sheet, data_uris


def screen(height: int = 400, width: int = 640) -> np.ndarray:
    image = np.full((height, width, 3), (230, 232, 236), np.uint8)
    image[height // 4 : height // 2, width // 4 : width // 2] = (60, 110, 200)
    return image


def picture_of(uri: str) -> np.ndarray:
    return np.array(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB"))


def test_small_pictures_are_exact_and_large_ones_stay_close(noise: np.ndarray) -> None:
    small = data_uris.embed(noise[:20, :20], 1.0).uri
    np.testing.assert_array_equal(picture_of(small), noise[:20, :20])
    busy = np.tile(noise, (2, 2, 1))
    grey = Image.fromarray(noise[..., 0]).resize((1280, 720), Image.Resampling.BICUBIC)
    smooth = np.asarray(grey.convert("RGB"))
    assert len(data_uris.embed(busy, 1.0).uri) < busy.nbytes
    result = picture_of(data_uris.embed(smooth, 1.0).uri).astype(int)
    assert 0 < np.abs(result - smooth).mean() < 4
    tall = data_uris.embed(np.zeros((20_000, 3, 3), np.uint8), 1.0)
    assert picture_of(tall.uri).shape[0] == data_uris.WEBP_MAX_SIDE


def test_contact_sheet_shows_both_pictures_at_one_scale_with_labels() -> None:
    before = screen(300, 364)
    half = hj.apply(hj.Resolution(scale=0.5).plan(hj.Scene((300, 364)), seed=0), before)
    marked = hj.apply(hj.Marks(number=5).plan(hj.Scene((300, 364)), seed=0), before)
    sheet = contact_sheet([("Marks", before, marked), ("Resolution", before, half)], width=800)
    assert sheet.dtype == np.uint8
    assert sheet.shape == (2 * (24 + 40 + 26 + 300) + 24, 800, 3)
    top, second = 24 + 40 + 26, 24 + 24 + 40 + 26 + 300 + 66
    np.testing.assert_array_equal(sheet[top : top + 300, 24:388], before)
    np.testing.assert_array_equal(sheet[top : top + 300, 412:776], marked)
    np.testing.assert_array_equal(sheet[second : second + 150, 412:594], half)
    assert (sheet[second : second + 300, 600:] == 246).all()
    assert sheet[24:64, 24:200].min() < 60  # the title
    for left in (24, 412):
        assert sheet[64:90, left : left + 150].min() < 140  # the labels
    assert (contact_sheet([("", before, marked)], width=800)[24:64] == 246).all()


def test_contact_sheet_shrinks_wide_pictures_and_never_enlarges() -> None:
    wide = screen(1080, 1920)
    sheet = contact_sheet([("a title " * 12, wide, wide)], width=400)
    panel = (400 - 72) // 2
    assert sheet.shape[0] == 24 + 40 + 26 + round(1080 * panel / 1920) + 24
    small = contact_sheet([("x", screen(20, 30), screen(20, 30))], width=400)
    assert small.shape == (24 + 40 + 26 + 20 + 24, 400, 3)


@pytest.mark.parametrize(
    ("error", "rows", "width"),
    [
        (ParameterError, [], 800),
        (ParameterError, [("x", screen(), screen())], 100),
        (ParameterError, [("long " * 300, screen(), screen())], 400),
        (FontError, [("\u4f60", screen(), screen())], 400),
        (ImageTypeError, [("x", screen().astype(float), screen())], 400),
        (ImageTypeError, [("x", screen()[None], screen())], 400),
        (ImageError, [("x", screen()[..., :2], screen())], 400),
    ],
)
def test_contact_sheet_refuses(error: type[Exception], rows: Any, width: int) -> None:
    with pytest.raises(error):
        contact_sheet(rows, width)
