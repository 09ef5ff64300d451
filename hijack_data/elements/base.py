"""What every source of boxes returns, and how a picture is read."""

from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from PIL import Image

from ..backends import backend_of, to_numpy
from ..errors import ElementsError, ImageError, suggest
from ..types import BoxArray, Size, UInt8Array, as_boxes

ElementSource: TypeAlias = Literal["tree", "labels", "picture", "ocr", "none"]
SOURCES = ("tree", "labels", "picture", "ocr", "none")


@dataclass(frozen=True, eq=False)
class Elements:
    """Where the elements of one screen are, and what is known about each.

    Args:
        boxes: int32 `[N, 4]`, `xyxy`, pixels of the screen.
        names: what each element is called, `""` where it is unknown; empty for all unknown.
        roles: what each element is (`"push-button"`), `""` where it is unknown; empty for all
            unknown.
        source: where the boxes come from: `"tree" | "labels" | "picture" | "ocr" | "none"`.
        notes: what was left out, and why.

    Raises `ElementsError` if `names` or `roles` do not match the boxes, or the source is unknown.
    """

    boxes: BoxArray = field(default_factory=lambda: as_boxes(None))
    names: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    source: ElementSource = "none"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", as_boxes(self.boxes))
        if self.source not in SOURCES:
            raise ElementsError(f"unknown source {self.source!r}{suggest(self.source, SOURCES)}")
        for what in ("names", "roles"):
            texts = tuple(getattr(self, what)) or ("",) * len(self)
            if len(texts) != len(self):
                raise ElementsError(
                    f"{len(texts)} {what} for {len(self)} boxes: give one for each box, or none"
                )
            object.__setattr__(self, what, texts)

    def __len__(self) -> int:
        return len(self.boxes)


def image_size(image: object) -> Size:
    """Return `(height, width)` of one picture without reading its pixels.

    Any other kind or dtype is an `ImageTypeError`.

    `image` is uint8 RGB: `[H, W, 3]` (NumPy, JAX) or `[3, H, W]` (torch); or a PIL image of any
    mode.

    Raises:
        ImageError: the picture has another shape.
    """
    if isinstance(image, Image.Image):
        width, height = image.size
        if not width or not height:
            raise ImageError(f"image is empty: {width} x {height} pixels")
        return height, width
    backend = backend_of(image)
    backend.check(image)
    shape = tuple(cast("Any", image).shape)
    if len(shape) != 3:
        raise ImageError(
            f"image has shape {list(shape)}: elements are found in one picture at a time, not in a"
            " batch"
        )
    return backend.size(image)


def image_pixels(image: object) -> UInt8Array:
    """Return the pixels of one picture as uint8 RGB `[H, W, 3]`.

    Arguments and errors are those of `image_size`.
    """
    image_size(image)
    pixels = np.asarray(image.convert("RGB")) if isinstance(image, Image.Image) else to_numpy(image)
    return np.ascontiguousarray(pixels)
