"""The pictures, screens and parameters with which corruptions are tested."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from .. import params as p
from ..corruption import Corruption
from ..errors import ParameterError
from ..plan import Plan
from ..types import Box, Scene, Size, UInt8Array, as_boxes
from .base import expect

SIZES: tuple[Size, ...] = ((1080, 1920), (720, 1280), (333, 517), (64, 48), (1, 1))


def picture(size: Size) -> UInt8Array:
    """A test picture without two equal neighbours, the same on every machine: uint8 `[H, W, 3]`."""
    height, width = size
    y = np.arange(height, dtype=np.uint32)[:, None]
    x = np.arange(width, dtype=np.uint32)
    mixed = x * 2654435761 + y * 2246822519
    image = np.empty((height, width, 3), np.uint8)
    image[..., 0] = (mixed >> 8) & 255
    image[..., 1] = (mixed >> 16) & 255
    image[..., 2] = (x + 3 * y) & 255
    return image


def scene(size: Size) -> Scene:
    """A screen with a toolbar, a list, a form and a target, in proportion to `size`."""
    height, width = size
    boxes: list[list[int]] = []
    for x1, y1, x2, y2 in _full_hd_boxes():
        left = x1 * width // 1920
        top = y1 * height // 1080
        right = x2 * width // 1920
        bottom = y2 * height // 1080
        boxes.append([left, top, right, bottom])
    left, top, right, bottom = boxes[-1]
    target = (left, top, right, bottom)
    if left >= right or top >= bottom:  # a screen of one pixel has no room for a box
        target = None
    return Scene(size, as_boxes(boxes), ("chrome",), target)


def _full_hd_boxes() -> Iterator[Box]:
    for i in range(12):  # a toolbar
        left = 8 + 90 * i
        yield (left, 6, left + 72, 40)
    for i in range(12):  # a list
        top = 120 + 60 * i
        yield (20, top, 420, top + 40)
    yield (1500, 200, 1860, 260)
    yield (1500, 300, 1860, 360)
    yield (1700, 980, 1860, 1040)


def unusual_scenes() -> Iterator[tuple[str, Scene]]:
    """Yield pairs of a description and an unusual screen that occurs in recordings."""
    full = scene(SIZES[0])
    height, width = full.size
    above = [-50, -50, -10, -10]
    over_the_edge = [width - 5, 20, width + 40, 60]
    empty = [30, 30, 30, 50]
    outside = [above, over_the_edge, empty, *full.boxes.tolist()]
    yield "without boxes", replace(full, boxes=as_boxes(None))
    yield "without apps", replace(full, apps=())
    yield "without a target", replace(full, target=None)
    yield "of which only the size is known", Scene(full.size)
    yield "with boxes off the screen", replace(full, boxes=as_boxes(outside))
    yield "with one box over all of it", replace(full, boxes=as_boxes([[0, 0, width, height]]))
    yield "whose target hangs over the edge", replace(full, target=(-90, -80, 30, 40))
    yield "in portrait", scene((1920, 1080))
    yield "in portrait of which only the size is known", Scene((844, 390))
    for height, width in ((1, 1), (1, 640), (480, 1)):
        what = f"of {width}x{height} pixels"
        yield what, scene((height, width))
        yield f"{what} of which only the size is known", Scene((height, width))


def levels(cls: type[Corruption]) -> list[Corruption]:
    """Return the corruption at all its severities, or with its defaults if it has none."""
    if not cls.severities:
        return [cls()]
    return [cls.at(level) for level in range(1, 6)]


def variants(cls: type[Corruption]) -> list[Corruption]:
    """Return the corruption with its defaults, at all severities, and with each value of a choice.

    The two values of a flag count as choices, too.
    """
    tried = [cls(), *levels(cls)]
    for key, (parameter, default) in p.parameters(cls).items():
        values: tuple[Any, ...] = parameter.choices
        if parameter.kind == "bool":
            values = (not default,)
        for value in values:
            with suppress(ValueError, TypeError):  # values that the class refuses in combination
                tried.append(cls(**{key: value}))
    found: list[Corruption] = []
    for spec in tried:
        if spec not in found:
            found.append(spec)
    return found


def plans(cls: type[Corruption]) -> Iterator[tuple[Plan, Size]]:
    """Yield the plans of all severities and sizes that the corruption accepts."""
    for size in SIZES:
        for spec in levels(cls):
            try:
                plan = spec.plan(scene(size), seed=3, sample="check", step=None)
            except ParameterError as error:
                expect(size != SIZES[0], f"the default must fit a 1920x1080 screen: {error}")
            else:
                yield plan, size
