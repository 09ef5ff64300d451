"""Whatever is given as an argument: it is taken, or one of our errors says what is wrong with
it."""

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.backends import convert
from hijack_data.config import dump, load_config, specs_from
from hijack_data.errors import (
    HijackError,
    ImageError,
    ImageTypeError,
    ParameterError,
    ParameterTypeError,
    short_repr,
)
from hijack_data.file_io import write_atomic
from hijack_data.gallery import gallery
from hijack_data.limits import SPRITE_PIXELS
from hijack_data.pack import AssetPack
from hijack_data.picture_io import load_image

PICTURE = np.zeros((90, 120, 3), np.uint8)
PLAN = hj.Marks(number=2, mark_size=5).plan(hj.Scene((90, 120)), seed=1)


class Unshowable:
    def __repr__(self) -> str:
        raise RuntimeError("no")


STRANGE = {
    "None": None,
    "bytes": b"x",
    "object": object(),
    "NaN": float("nan"),
    "infinity": float("inf"),
    "a number of many digits": 10**400,
    "a number of more digits than Python prints": 10**5000,
    "an array": np.zeros(3),
    "an empty array": np.zeros(0),
    "an array of texts": np.array(["a", "b"]),
    "a list of nothing": [None],
    "a set": {1},
    "a dict": {"a": 1},
    "a class": int,
    "a function": len,
    "half a surrogate": "\ud800",
    "unshowable": Unshowable(),
}
TAKE = {
    "apply, as a plan": lambda value: hj.apply(value, PICTURE),
    "apply, as a picture": lambda value: hj.apply(PLAN, value),
    "apply, in place": lambda value: hj.apply(PLAN, PICTURE.copy(), inplace=value),
    "Plan.from_json": hj.Plan.from_json,
    "Plan.from_data": hj.Plan.from_data,
    "Plan.then": PLAN.then,
    "specs_from": specs_from,
    "load_config": load_config,
    "dump": dump,
    "load_image": load_image,
    "write_atomic": lambda value: write_atomic(value, "x"),
    "png_recipe": hj.plugin.png_recipe,
    "gallery": gallery,
    "gallery of": lambda value: gallery([5 if isinstance(value, str) else value]),
    "convert": lambda value: convert(PICTURE, value),
    "an integer": lambda value: hj.Marks(number=value),
    "a float": lambda value: hj.Resolution(scale=value),
    "a boolean": lambda value: hj.Resolution(restore=value),
    "a text": lambda value: hj.Subtitle(subtitle_text=value),
    "a font": lambda value: hj.Subtitle(font_path=value),
    "a choice": lambda value: hj.Marks(mark_type=value),
    "a colour": lambda value: hj.Marks(color=value),
    "a channel": lambda value: hj.Marks(color=[1, 2, value]),
    "every": lambda value: hj.NetworkError(step={"each": value}),
    "steps": lambda value: hj.NetworkError(step=[value, "x"]),
    "an address": lambda value: hj.NetworkError(local_ip=5 if value is None else value),
}


@pytest.mark.parametrize("value", STRANGE.values(), ids=STRANGE)
@pytest.mark.parametrize("take", TAKE)
def test_what_is_strange_is_refused(take, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HijackError) as caught:
        TAKE[take](value)
    assert str(caught.value)


@pytest.mark.parametrize("folder", [5, [], [None], {}, object(), b"x", np.zeros(3)])
def test_an_asset_pack_that_is_no_folder(folder):
    with pytest.raises(ParameterTypeError, match="an asset pack is a folder's path"):
        AssetPack.load(folder)


@pytest.mark.parametrize(
    ("rgba", "error", "message"),
    [
        (np.zeros((4, 4), np.uint8), ImageError, r"RGBA.*got the shape \[4, 4\]"),
        (np.zeros((4, 4, 3), np.uint8), ImageError, r"RGBA.*got the shape \[4, 4, 3\]"),
        (np.zeros((0, 4, 4), np.uint8), ImageError, r"RGBA.*got the shape \[0, 4, 4\]"),
        (np.zeros((4, 4, 4), np.float32), ImageTypeError, "uint8 array, got float32"),
        ([[1]], ImageTypeError, "uint8 array, got list"),
        (
            np.broadcast_to(np.uint8(0), (2**13, 2**13 + 1, 4)),
            ImageError,
            f"{SPRITE_PIXELS} pixels",
        ),
    ],
)
def test_what_is_no_sprite(rgba, error, message):
    with pytest.raises(error, match=message):
        hj.plugin.png_recipe(rgba)


@pytest.mark.parametrize("path", ["a\0b", "a\ud800", "x" * 5000, "no/such/folder/x"])
def test_a_file_that_cannot_be_written(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HijackError, match="cannot be written"):
        write_atomic(path, "x")
    assert list(tmp_path.iterdir()) == []


def test_a_text_that_cannot_be_written(tmp_path):
    with pytest.raises(HijackError, match=r"x: cannot be written, the text is not Unicode"):
        write_atomic(tmp_path / "x", "\ud800")


@pytest.mark.parametrize("value", [5, 0.5, np.int64(5), np.float32(0.5), np.array(7)])
def test_numbers_of_any_kind_are_taken(value):
    if int(value) == value:
        assert hj.Marks(number=value).number == int(value)
    assert hj.Resolution(scale=value).scale == float(value)


def test_values_are_shown_whatever_they_are():
    assert short_repr("a") == "'a'"
    assert short_repr("a" * 200) == "'" + "a" * 79 + "..."
    assert short_repr(10**5000).startswith("a int that cannot be shown")
    assert short_repr(Unshowable()) == "a Unshowable that cannot be shown (RuntimeError)"


def test_a_large_number_is_out_of_range_in_words():
    with pytest.raises(
        ParameterError, match=r"marks\.number must be int in \[0, 100000\], got a int"
    ):
        hj.Marks(number=10**5000)


@pytest.mark.parametrize(
    "boxes", [[[10**400, 0, 1, 1]], np.zeros((2, 4), bool), [[False, True, True, True]]]
)
def test_what_is_no_boxes_is_said(boxes):
    with pytest.raises(ParameterTypeError, match="boxes must be rows of x1, y1, x2, y2, got"):
        hj.Scene(size=(10, 10), boxes=boxes)
