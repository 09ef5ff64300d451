"""Stamps: the drawings of a paste, as sprites with their places inside the picture."""

from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from ..drawing.raster import render
from ..drawing.sprite import Sprite
from ..errors import PlanError, short_repr
from ..limits import PIXELS_AT_ONCE
from ..plan import Paste, Plan
from ..types import MAX_SIDE, Size


@dataclass(frozen=True, eq=False)
class Stamp:
    """A sprite and the places at which to draw it, each wholly inside the picture.

    `ys` and `xs`, int32 `[n]`, are the top-left corners in pixels.
    """

    sprite: Sprite
    ys: npt.NDArray[np.int32]
    xs: npt.NDArray[np.int32]


def plan_stamps(plan: Plan, index: int, size: Size) -> list[Stamp]:
    """Return the stamps of a plan's paste `ops[index]` on a picture of `size`, (height, width).

    Raises:
        PlanError: the recipe draws something else here than was planned, or cannot be drawn.
    """
    op = cast(Paste, plan.ops[index])
    stamps = lower(op, size)
    for stamp in stamps:
        if not op.draws_as_planned(stamp.sprite):
            raise PlanError(_drift_message(plan, index))
    return stamps


def check_drawings(plans: list[Plan]) -> None:
    """Check that every paste draws as planned, before any of them is drawn.

    Raises:
        PlanError: a recipe draws something else here than was planned, or cannot be drawn.
    """
    pastes = sum(isinstance(op, Paste) for plan in plans for op in plan.ops)
    if pastes < 2:  # a single paste is drawn, or refused, before anything is written
        return
    for plan in plans:
        size = plan.size
        for index, op in enumerate(plan.ops):
            if isinstance(op, Paste):
                plan_stamps(plan, index, size)
            else:
                size = op.size


def _drift_message(plan: Plan, index: int) -> str:
    from PIL import __version__, features

    versions = f"Pillow {__version__}, FreeType {features.version('freetype2')}"
    return (
        f"plan: ops[{index}] of {plan.corruption} draws differently here ({versions}) than where"
        " the plan was made; plan again, or install that version"
    )


def lower(op: Paste, size: Size) -> list[Stamp]:
    """Turn a paste into stamps that need no bounds checks.

    At a place where the sprite sticks out of the picture, a cropped sprite is used. The order of
    the places is kept if it can matter.

    Raises:
        PlanError: the recipe cannot be drawn, or the places are not points.
    """
    sprite = render(op.sprite)
    height, width = size
    h, w = sprite.size
    at = _places(op)
    xs = at[:, 0]
    ys = at[:, 1]
    inside = (xs >= 0) & (ys >= 0) & (xs <= width - w) & (ys <= height - h)
    if inside.all():
        return [Stamp(sprite, ys, xs)]
    if not sprite.uniform:
        return _crop_each(sprite, at, size)
    uncropped = Stamp(sprite, ys[inside], xs[inside])
    return [uncropped, *_crop_each(sprite, at[~inside], size)]


def at_once(sprite: Sprite) -> int:
    """Return the number of places, at least 1, at which one operation may paint a sprite.

    If the order of painting matters, the number is 1; otherwise memory is the limit.
    """
    if not sprite.uniform:
        return 1
    painted = max(1, len(sprite.pixels[0]))
    return max(1, PIXELS_AT_ONCE // painted)


def _places(op: Paste) -> npt.NDArray[np.int32]:
    """Return the places of a paste, (x, y) each, int32 `[n, 2]`.

    Raises:
        PlanError: the places are not points, or too far outside the picture.
    """
    if not op.at:
        return np.zeros((0, 2), np.int32)
    try:
        at = np.array(op.at)
    except ValueError:  # points of different lengths
        at = np.zeros(0)
    if at.dtype.kind not in "iu" or at.shape[1:] != (2,) or np.abs(at).max() > MAX_SIDE:
        expected = f"points (x, y), integers of at most {MAX_SIDE}"
        raise PlanError(f"plan: the places of a Paste must be {expected}, got {short_repr(op.at)}")
    return at.astype(np.int32)


def _crop_each(sprite: Sprite, at: npt.NDArray[np.int32], size: Size) -> list[Stamp]:
    """Return a stamp for each place `(x, y)` at which a part of the sprite is visible."""
    stamps: list[Stamp] = []
    for x, y in at.tolist():
        stamp = _crop_to_picture(sprite, y, x, size)
        if stamp is not None:
            stamps.append(stamp)
    return stamps


def _crop_to_picture(sprite: Sprite, y: int, x: int, size: Size) -> Stamp | None:
    """Return the part of a sprite that lies inside the picture, or `None` if there is none."""
    height, width = size
    h, w = sprite.size
    top = max(0, -y)
    left = max(0, -x)
    bottom = min(h, height - y)
    right = min(w, width - x)
    if top >= bottom or left >= right:
        return None
    fits = (top, left, bottom, right) == (0, 0, h, w)
    part = sprite if fits else sprite.crop(top, left, bottom, right)
    return Stamp(part, np.array([y + top], np.int32), np.array([x + left], np.int32))
