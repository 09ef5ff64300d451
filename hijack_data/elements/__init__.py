"""Find the interactive elements of a screen: in its tree, in labels, or in the picture.

`scene_from` is the usual entry point; each source also has its own function, which returns
`Elements`.
"""

from collections.abc import Iterable
from typing import Literal

from ..errors import MissingDependencyError, UnknownNameError, suggest
from ..types import Scene, as_target
from .accessibility_nodes import AccessibleNode, nodes_from_tree
from .base import Elements
from .detector import boxes_from_picture
from .interactive_nodes import boxes_from_tree, interactive_elements
from .ocr import boxes_from_ocr
from .picture_pixels import image_pixels, image_size
from .recorded_boxes import boxes_from_labels

__all__ = [
    "AccessibleNode",
    "Elements",
    "boxes_from_labels",
    "boxes_from_ocr",
    "boxes_from_picture",
    "boxes_from_tree",
    "elements_from",
    "image_pixels",
    "image_size",
    "interactive_elements",
    "nodes_from_tree",
    "scene_from",
]

_DETECTORS = {"picture": boxes_from_picture, "ocr": boxes_from_ocr}


def elements_from(
    image: object,
    tree: str | bytes | None = None,
    labels: object = None,
    detect: Literal["picture", "ocr", "none"] = "picture",
) -> Elements:
    """Find the elements of a screen: from the tree if given, else from labels, else by detection.

    Raises `ElementsError` for a bad tree or bad labels, and `ImageError` or `ImageTypeError` for a
    bad picture.

    Args:
        image: the screenshot: `[H, W, 3]` uint8 (NumPy, JAX), `[3, H, W]` (torch) or a PIL image.
            Only `detect` reads its pixels.
        tree: accessibility XML in OSWorld's dialect; boxes are clipped to the picture.
        labels: recorded boxes in pixels, as `boxes_from_labels` takes them.
        detect: how to find elements without tree and labels: `"picture"` (OpenCV), `"ocr"`
            (RapidOCR) or `"none"`.

    Raises:
        UnknownNameError: `detect` is not one of these.
        MissingDependencyError: the detector is not installed.
    """
    if detect not in (*_DETECTORS, "none"):
        raise UnknownNameError(f"unknown detect {detect!r}{suggest(detect, (*_DETECTORS, 'none'))}")
    size = image_size(image)
    if tree is not None:
        return boxes_from_tree(tree, size)
    if labels is not None:
        return boxes_from_labels(labels, size=size)
    if detect == "none":
        return Elements(notes=("no element is known: no tree, no labels, and detection is off",))
    try:
        return _DETECTORS[detect](image)
    except MissingDependencyError as error:
        raise MissingDependencyError(
            f"{error}; or give the elements as tree= or labels=; or go without them: detect='none'"
        ) from None


def scene_from(
    image: object,
    tree: str | bytes | None = None,
    labels: object = None,
    detect: Literal["picture", "ocr", "none"] = "picture",
    apps: Iterable[str] = (),
    target: object = None,
) -> Scene:
    """Make the scene of a screenshot: its size, and the elements that `elements_from` finds.

    `apps` are the applications that the task uses, `target` the point or box that the step's action
    aims at. Raises what `elements_from` raises, and `ParameterError` or `ParameterTypeError` for a
    bad target.
    """
    elements = elements_from(image, tree, labels, detect)
    names = (apps,) if isinstance(apps, str) else tuple(apps)
    return Scene(image_size(image), elements.boxes, names, as_target(target))
