import io
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from isal import isal_zlib
from PIL import Image

import hijack_data as hj
from hijack_data.errors import ImageTypeError
from hijack_data.picture_io import decode_image, pixel_sha256
from pipelines.dataset.image_codec import HEAD, LEVEL, BaseImage, changed_rows, deflate, encode


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1), st.booleans())
def test_what_is_encoded_decodes_to_the_same_pixels(
    height: int, width: int, seed: int, flat: bool
) -> None:
    high = 2 if flat else 256
    image = np.random.default_rng(seed).integers(0, high, (height, width, 3), dtype=np.uint8)
    data = encode(image)
    assert np.array_equal(decode_image(data, "x")[0], image)
    assert data == encode(image.copy())


def test_an_array_that_is_a_view_encodes_like_its_copy() -> None:
    image = np.random.default_rng(1).integers(0, 256, (30, 40, 3), dtype=np.uint8)[::2, ::-1]
    assert encode(image) == encode(image.copy())
    assert pixel_sha256(image) == pixel_sha256(image.copy())


def test_pillow_sees_a_plain_rgb_png() -> None:
    image = Image.open(io.BytesIO(encode(np.zeros((3, 5, 3), np.uint8))))
    image.verify()  # checks the sums of all chunks
    assert (image.mode, image.size, image.format) == ("RGB", (5, 3), "PNG")


@pytest.mark.parametrize(
    "image", [np.zeros((3, 5)), np.zeros((3, 5, 4), np.uint8), np.zeros((3, 5, 3), np.int16)]
)
def test_anything_but_uint8_rgb_is_refused(image: np.ndarray) -> None:
    with pytest.raises(ImageTypeError, match="uint8"):
        encode(image)


@given(st.integers(1, 130), st.integers(1, 20), st.integers(0, 2**32 - 1), st.data())
def test_a_part_encoded_again_is_the_whole_encoded_again(
    height: int, width: int, seed: int, data: st.DataObject
) -> None:
    numbers = np.random.default_rng(seed)
    before = numbers.integers(0, 4, (height, width, 3), dtype=np.uint8)
    after = before.copy()
    rows = []
    for _ in range(data.draw(st.integers(0, 3))):
        first = data.draw(st.integers(0, height - 1))
        end = data.draw(st.integers(first + 1, height))
        after[first:end] = numbers.integers(0, 4, (end - first, width, 3), dtype=np.uint8)
        rows.append((first, end))
    base = BaseImage(before)
    assert base.encode_variant(after, rows) == encode(after)
    assert base.hash_variant(after, rows) == pixel_sha256(after)
    assert (base.png, base.sha256) == (encode(before), pixel_sha256(before))


@pytest.mark.parametrize("name", ["pop_ups", "marks", "subtitle"])
@pytest.mark.parametrize("size", [(200, 320), (75, 640)])
def test_a_plan_changes_no_row_but_those_it_touches(name: str, size: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    small = {
        "pop_ups": {"width": 150, "height": 90},
        "marks": {"number": 3},
        "subtitle": {"font_size": 9, "padding": 5},
    }
    for sample in range(5):
        plan = hj.make_corruption(name, **small[name]).plan(hj.Scene(size), seed=1, sample=sample)
        rows = changed_rows(plan)
        assert rows
        inside = np.zeros(size[0], bool)
        for first, end in rows:
            inside[first:end] = True
        changed_mask = (hj.apply(plan, image) != image).any(axis=(1, 2))
        assert changed_mask.any()
        assert not (changed_mask & ~inside).any()


def test_what_changes_the_size_touches_everything() -> None:
    assert changed_rows(hj.Resolution().plan(hj.Scene((200, 320)), seed=1)) is None
    assert changed_rows(hj.Plan.clean((200, 320))) == []


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize("start", [0, 1, HEAD])
def test_bytes_do_not_depend_on_where_in_memory_they_are_made(turn: int, start: int) -> None:
    states = [isal_zlib.compressobj(LEVEL, isal_zlib.DEFLATED, -15) for _ in range(20)]
    value, second = (
        states[0],
        next(state for state in states if id(state) >> 17 != id(states[0]) >> 17),
    )
    register = (id((value, second)[turn]) >> 16 & 0xFFFFFFFF).to_bytes(4, "little")
    data = np.frombuffer(bytes(start) + (register + b"abcd") * 100, np.uint8)

    def lend(state: Any) -> SimpleNamespace:
        return SimpleNamespace(**{**vars(isal_zlib), "compressobj": lambda *_: state})

    assert deflate(data, lend(value)) == deflate(data, lend(second))
