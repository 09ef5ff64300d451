"""Find elements in the pixels of a picture: lines of text, icons, buttons and inputs.

The detector uses edges only, and no model. *Things* are connected edges after frames and long rules
are removed and small gaps are closed: lines of text, icons, small pictures. *Controls* are flat
areas of a control's height that contain a few things: buttons, inputs, tabs, rows. A thing inside a
control, or inside a larger thing, is dropped, so a button counts once.

Only integer morphology and labelling are used and boxes are sorted, so the result does not depend
on threads.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from .. import extras
from ..types import BoxArray, UInt8Array, clip_boxes
from .base import Elements
from .mask_parts import Bools, Ints, Parts, straight_lines
from .picture_pixels import image_pixels

# Larger pictures are first shrunk by an integer factor.
MAX_PIXELS = 5_000_000
# Least differences between neighbouring pixels in any channel: for the faint edge of a control, and
# for the edge of text or an icon.
FAINT_EDGE = 8
STRONG_EDGE = 28
# The largest shares of the screen's height and width for one element; anything larger is a
# photograph or a wallpaper.
MAX_HEIGHT = 0.3
MAX_WIDTH = 0.6
MAX_CONTROL_WIDTH = 0.9
# Straight edges of this length, on a screen 1000 pixels high, are rules and frames; shorter ones
# belong to icons.
RULE_LENGTH = 110
# A control with more content boxes than this is a toolbar or a panel, so they count as elements
# instead. The second number is for controls wider than `MAX_WIDTH`: an address bar has few,
# a status bar more.
MAX_CONTENT_BOXES = 4
MAX_CONTENT_BOXES_WIDE = 2
# A picture of noise or of a fine pattern has countless parts; only the largest are kept.
MAX_PARTS = 3000
# The number of boxes that are compared with all others at once.
BOXES_PER_BLOCK = 256


def boxes_from_picture(image: object) -> Elements:
    """Find the elements of a screenshot.

    Args:
        image: one uint8 RGB picture: `[H, W, 3]`, a torch tensor `[3, H, W]` or a PIL image; 1x1 to
            10000x10000.

    Returns:
        The boxes from top to bottom, with role `"control"` or `"thing"` and no names. For an empty
        picture there are no boxes, and a note.

    Raises:
        ImageError: the picture has another shape.
        ImageTypeError: the picture is of another kind or dtype.
        MissingDependencyError: OpenCV is not installed.
    """
    pixels = image_pixels(image)
    height, width = pixels.shape[:2]
    factor = max(1, int(np.ceil(np.sqrt(height * width / MAX_PIXELS))))
    finder = _Finder(_cv2(), _shrink(pixels, factor))
    content = _largest_first(finder.find_content())
    controls = _largest_first(finder.controls())
    boxes, is_control = _select(content[:MAX_PARTS], controls[:MAX_PARTS], finder)
    if not len(boxes):
        note = "nothing that looks like an element was found in the picture"
        return Elements(source="picture", notes=(note,))
    boxes = clip_boxes(boxes * np.int32(factor), (height, width))
    x1, y1, x2, y2 = boxes.T
    order = np.lexsort((x2, y2, x1, y1))
    roles = tuple("control" if control else "thing" for control in is_control[order])
    notes = (*_cut_note(content), *_cut_note(controls))
    return Elements(boxes[order], roles=roles, source="picture", notes=notes)


def _cut_note(parts: BoxArray) -> list[str]:
    if len(parts) <= MAX_PARTS:
        return []
    return [f"kept the {MAX_PARTS} largest of {len(parts)} parts"]


def _cv2() -> Any:
    try:
        import cv2
    except ImportError:
        raise extras.missing("finding elements in a picture needs OpenCV", "vision") from None
    return cv2


def _shrink(image: UInt8Array, factor: int) -> UInt8Array:
    # Averages blocks of `factor` x `factor` pixels; the last ones repeat the edge of the picture.
    if factor == 1:
        return image
    cv2 = _cv2()
    bottom_padding = -image.shape[0] % factor
    right_padding = -image.shape[1] % factor
    padded = cv2.copyMakeBorder(image, 0, bottom_padding, 0, right_padding, cv2.BORDER_REPLICATE)
    height, width = padded.shape[:2]
    size = (width // factor, height // factor)
    return cast("UInt8Array", cv2.resize(padded, size, interpolation=cv2.INTER_AREA))


@dataclass
class _Finder:
    """The two passes over one picture of at most `MAX_PIXELS`."""

    cv2: Any
    image: UInt8Array

    def __post_init__(self) -> None:
        cv2 = self.cv2
        neighbours = _block(2, 2)
        red, green, blue = [
            cv2.morphologyEx(channel, cv2.MORPH_GRADIENT, neighbours)
            for channel in cv2.split(self.image)
        ]
        self.change = cv2.max(cv2.max(red, green), blue)
        self.height, self.width = self.image.shape[:2]

    def units(self, pixels: float) -> int:
        """Scale a length that was chosen on a screen 1000 pixels high."""
        scale = min(self.height, self.width) / 1000
        limited = min(max(scale, 0.7), 2.0)
        return max(1, round(pixels * limited))

    def find_content(self) -> BoxArray:
        """Find lines of text, icons and small pictures: int32 `[N, 4]` boxes."""
        parts = Parts(self.cv2, self._edges(STRONG_EDGE), 8)
        scenery = self._scenery(parts)
        length = self.units(RULE_LENGTH) | 1
        rules = straight_lines(self.cv2, parts.without(scenery), length)
        is_whole = self._whole_outlines(parts) & ~scenery & ~parts.touching(rules)
        small_parts = parts.without(scenery | is_whole)
        small = self._joined(self.cv2.subtract(small_parts, rules), rules)
        return np.concatenate([self._boxes(parts, is_whole), small])

    def _joined(self, edges: UInt8Array, rules: UInt8Array) -> BoxArray:
        # Returns the boxes of small parts, such as letters, after closing the gaps between them.
        cv2 = self.cv2
        wide = self.units(9) | 1
        high = self.units(2) | 1
        # Without a margin, OpenCV would close the gap to the edge of the screen too.
        padded = cv2.copyMakeBorder(edges, high, high, wide, wide, cv2.BORDER_CONSTANT, value=0)
        joined = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, _block(wide, high))
        parts = Parts(cv2, joined[high:-high, wide:-wide], 8)
        at_rule = parts.touching(cv2.dilate(rules, _block(3, 3)))
        is_frame_corner = at_rule & (np.maximum(parts.w, parts.h) <= self.units(20))
        return self._boxes(parts, self._is_content(parts) & ~is_frame_corner)

    def _is_content(self, parts: Parts) -> Bools:
        w = parts.w
        h = parts.h
        large_enough = (h > self.units(6)) & (w > self.units(2))
        large_enough &= parts.area >= self.units(4) ** 2
        is_rule = (w <= self.units(4)) & (h > self.units(24))
        is_picture = (h <= MAX_HEIGHT * self.height) & (w <= MAX_WIDTH * self.width)
        is_text = h <= self.units(48)
        return large_enough & ~is_rule & (is_text | is_picture)

    def _boxes(self, parts: Parts, is_selected: Bools) -> BoxArray:
        # An edge is marked at the pixel after it, so the right and lower sides are one less.
        pad = self.units(1)
        left = parts.x - pad
        top = parts.y - pad
        right = parts.x + parts.w - 1 + pad
        bottom = parts.y + parts.h - 1 + pad
        boxes = np.stack([left, top, right, bottom], 1)
        return boxes[is_selected].astype(np.int32)

    def _whole_outlines(self, parts: Parts) -> Bools:
        # Marks outlines that are a whole button or icon and are not joined to other parts.
        w = parts.w
        h = parts.h
        is_outline = parts.area < 0.25 * w * h
        is_large = (w >= self.units(40)) & (h >= self.units(18))
        fits = (w <= MAX_WIDTH * self.width) & (h <= MAX_HEIGHT * self.height)
        return is_outline & is_large & fits

    def _scenery(self, parts: Parts) -> Bools:
        # Marks lines, and windows and tables, which enclose a large area but fill little of it.
        w = parts.w
        h = parts.h
        longer = np.maximum(w, h)
        is_empty = parts.area < 0.2 * w * h
        is_frame = (longer > self.units(RULE_LENGTH)) & (h > self.units(20)) & is_empty
        is_line = (np.minimum(w, h) <= self.units(3)) & (longer > self.units(40))
        return is_frame | is_line

    def controls(self) -> BoxArray:
        """Find flat areas as high as a button or an input: int32 `[N, 4]` boxes."""
        flat = self.cv2.bitwise_not(self._edges(FAINT_EDGE))
        parts = Parts(self.cv2, flat, 4)
        w = parts.w
        h = parts.h
        fits_height = (h >= self.units(14)) & (h <= self.units(64))
        fits_width = (w >= self.units(16)) & (w <= MAX_CONTROL_WIDTH * self.width)
        is_filled = parts.area >= 0.45 * w * h
        x = parts.x
        y = parts.y
        boxes = np.stack([x - 1, y - 1, x + w, y + h], 1)
        return boxes[fits_height & fits_width & is_filled].astype(np.int32)

    def _edges(self, least: int) -> UInt8Array:
        _, edges = self.cv2.threshold(self.change, least - 1, 255, self.cv2.THRESH_BINARY)
        return edges


def _block(width: int, height: int) -> UInt8Array:
    return np.ones((height, width), np.uint8)


def _largest_first(boxes: BoxArray) -> BoxArray:
    # Sorts by area, then by place, because the order of connected parts may depend on OpenCV's
    # threads.
    x1, y1, x2, y2 = boxes.T
    negative_area = (y1 - y2) * (x2 - x1)
    return boxes[np.lexsort((x2, x1, y1, negative_area))]


def _inside(boxes: BoxArray, outer: BoxArray, slack: int) -> Bools:
    """Return which of `boxes`, `[N, 4]`, lie in which of `outer`, `[M, 4]`: bool `[M, N]`."""
    x1, y1, x2, y2 = boxes.T
    left, top, right, bottom = outer.T[..., None]
    across = (x1 >= left - slack) & (x2 <= right + slack)
    down = (y1 >= top - slack) & (y2 <= bottom + slack)
    return across & down


def _select(content: BoxArray, controls: BoxArray, finder: _Finder) -> tuple[BoxArray, Bools]:
    """Keep the controls with little content, and the content that is inside no other box.

    Both must be sorted with the largest first, so that the content of a control inside another is
    already taken. The second result marks the boxes that are controls.
    """
    alone = np.ones(len(content), np.bool_)
    selected_controls: list[BoxArray] = []
    inside = _inside(content, controls, finder.units(3))
    for control, is_inside in zip(controls, inside, strict=True):
        is_wide = control[2] - control[0] > MAX_WIDTH * finder.width
        max_boxes = MAX_CONTENT_BOXES_WIDE if is_wide else MAX_CONTENT_BOXES
        if alone[is_inside].any() and is_inside.sum() <= max_boxes:
            selected_controls.append(control)
            alone &= ~is_inside
    control_boxes = np.array(selected_controls, np.int32).reshape(-1, 4)
    boxes = np.concatenate([control_boxes, content[alone]])
    outermost = _outermost(boxes)
    return boxes[outermost], outermost < len(selected_controls)


def _outermost(boxes: BoxArray) -> Ints:
    """Return the indices of the boxes that are not inside a larger one."""
    sizes = boxes[:, 2:] - boxes[:, :2]
    order = np.argsort(-sizes.prod(1), kind="stable")
    ordered = boxes[order]
    keep = np.ones(len(ordered), np.bool_)
    for first in range(0, len(ordered), BOXES_PER_BLOCK):
        inside = _inside(ordered, ordered[first : first + BOXES_PER_BLOCK], 1)
        for i, is_inside in enumerate(inside, first):
            if keep[i]:
                later = i + 1
                keep[later:] &= ~is_inside[later:]
    return order[keep]
