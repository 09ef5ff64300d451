"""`id_from="content"`: ids from the pixels tell any two pictures apart, and know no layout."""

import numpy as np
import pytest
from PIL import Image

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")

from hijack_data.conformance import picture  # noqa: E402
from hijack_data.transforms.sample_parts import content  # noqa: E402

SIZE = (33, 47)


@pytest.mark.parametrize("row", range(SIZE[0]))
def test_pictures_that_differ_in_one_byte_of_any_row_have_other_ids(row):
    changed_picture = picture(SIZE)
    changed_picture[row, row % SIZE[1], row % 3] ^= 1
    assert content(changed_picture) != content(picture(SIZE))


def test_pictures_of_the_same_bytes_and_another_shape_have_other_ids():
    flat = np.zeros((6, 8, 3), np.uint8)
    assert (
        len({content(flat), content(flat.reshape(8, 6, 3)), content(flat.reshape(2, 3, 8, 3))}) == 3
    )


def test_the_id_is_that_of_the_pixels_whatever_holds_them():
    pixels = picture(SIZE)
    channels_first = torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))
    holders = [
        pixels,
        pixels[::-1].copy()[::-1],
        np.repeat(pixels, 2, axis=1)[:, ::2],
        Image.fromarray(pixels),
        channels_first,
        torch.from_numpy(pixels).permute(2, 0, 1),
        torch.stack([channels_first, channels_first])[1],
    ]
    assert {content(holder) for holder in holders} == {content(pixels)}
    batch = torch.stack([channels_first, channels_first])
    assert content(batch) == content(np.stack([pixels, pixels]))
