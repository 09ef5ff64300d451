"""Limits on the memory that an untrusted picture, plan or recipe may ask for.

A plan of two hundred bytes can name any size. These limits are larger than every existing screen
(8K is 33 million pixels) and small enough for a machine with a few GB of free memory.
"""

from typing import TYPE_CHECKING

from .errors import ParameterError

if TYPE_CHECKING:
    from .types import Size

# Pixels of a picture that is read, resized or planned for: 16384x16384, the most that `Resolution`
# makes, which is 0.8 GB of RGB.
PICTURE_PIXELS = 2**28
# Pixels of a sprite: 8192x8192, the largest mark.
SPRITE_PIXELS = 2**26
# Pixels of a sprite that are prepared or blended at once if each takes many bytes.
PIXELS_AT_ONCE = 2**22


def check_area(size: "Size", name: str) -> "Size":
    """Return `size`, (height, width) in pixels, if it is not too large.

    Raises:
        ParameterError: the area is more than `PICTURE_PIXELS`.
    """
    height, width = size
    if height * width > PICTURE_PIXELS:
        limit = f"the limit is {PICTURE_PIXELS} pixels, use a smaller one"
        raise ParameterError(f"{name} ({height}, {width}) is too large: {limit}")
    return size
