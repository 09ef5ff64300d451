"""Empty pictures to draw on, of a size that a plan from elsewhere may ask for."""

from PIL import Image

from ..errors import PlanError
from ..limits import SPRITE_PIXELS


def canvas(mode: str, width: int, height: int) -> Image.Image:
    """Return an empty picture of one of Pillow's modes.

    Raises:
        PlanError: its size is not one that a sprite may have.
    """
    check_area(width, height)
    return Image.new(mode, (width, height))


def check_area(width: int, height: int) -> None:
    """Check the size of a sprite, in pixels.

    Raises:
        PlanError: it has no pixels, or more than `limits.SPRITE_PIXELS`.
    """
    if not (width > 0 and height > 0 and width * height <= SPRITE_PIXELS):
        limit = f"it must hold 1 to {SPRITE_PIXELS}"
        raise PlanError(f"plan: a sprite of {width}x{height} pixels; {limit}")
