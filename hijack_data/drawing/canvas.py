"""Empty pictures to draw on, with a check of the size, which may come from an untrusted plan."""

from PIL import Image

from ..errors import PlanError
from ..limits import SPRITE_PIXELS


def canvas(mode: str, width: int, height: int) -> Image.Image:
    """Return an empty picture of one of Pillow's modes.

    Raises:
        PlanError: a sprite cannot have this size.
    """
    check_area(width, height)
    return Image.new(mode, (width, height))


def check_area(width: int, height: int) -> None:
    """Check the size of a sprite, in pixels.

    Raises:
        PlanError: the sprite has no pixels, or more than `limits.SPRITE_PIXELS`.
    """
    if not (width > 0 and height > 0 and width * height <= SPRITE_PIXELS):
        limit = f"it must hold 1 to {SPRITE_PIXELS}"
        raise PlanError(f"plan: a sprite of {width}x{height} pixels; {limit}")
