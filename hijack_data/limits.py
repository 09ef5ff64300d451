"""How much memory a picture, a plan or a recipe from elsewhere may ask for: the home of all limits.

A plan of two hundred bytes can name any size. These limits are beyond every screen there is (8K is
33 million pixels) and within what a machine with a few GB to spare can do.
"""

from .errors import ParameterError
from .types import Size

# A picture that is read, resized or planned for: 16384x16384, what `Resolution` makes at most.
# That is 0.8 GB of RGB.
PICTURE_PIXELS = 2**28
# A drawing that is stamped: 8192x8192, the largest mark.
SPRITE_PIXELS = 2**26
# Pixels of a sprite that are prepared or blended at once where each takes many bytes.
PIXELS_AT_ONCE = 2**22


def check_area(size: Size, what: str) -> Size:
    """Return `size`, (height, width) in pixels, if it is not too large.

    Raises:
        ParameterError: it has more than `PICTURE_PIXELS`.
    """
    height, width = size
    if height * width > PICTURE_PIXELS:
        limit = f"the limit is {PICTURE_PIXELS} pixels, use a smaller one"
        raise ParameterError(f"{what} ({height}, {width}) is too large: {limit}")
    return size
