"""The PNG encoder gives files that every reader reads, with isal and without it."""

import io
import sys

import numpy as np
import pytest
from PIL import Image

from hijack_data import png


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (1, 200), (48, 64)])
@pytest.mark.parametrize("isal", [True, False], ids=["isal", "zlib"])
def test_pillow_reads_the_same_pixels(monkeypatch, size, isal):
    if isal:
        pytest.importorskip("isal")
    else:
        monkeypatch.setitem(sys.modules, "isal", None)
    image = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    with Image.open(io.BytesIO(png.encode(image))) as result:
        result.verify()
    with Image.open(io.BytesIO(png.encode(image))) as result:
        assert result.mode == "RGB"
        assert np.array_equal(np.array(result), image)


def test_rows_from_the_middle_are_filtered_as_in_the_whole_picture():
    image = np.random.default_rng(1).integers(0, 256, (9, 5, 3), dtype=np.uint8)
    whole_lines = png.filtered(image, 0, 9)
    assert np.array_equal(
        np.concatenate([png.filtered(image, 0, 4), png.filtered(image, 4, 9)]), whole_lines
    )
    assert (whole_lines[:, 0] == png.UP).all()
