"""Labels that are `tv_tensors` of torchvision: they carry their format, and follow the pixels.

Needs torch and torchvision, and is imported when the first of these tensors arrives.
"""

import importlib
from dataclasses import replace
from typing import Any

import torch

from ..errors import LabelError, ParameterError
from ..plan import Plan
from ..safety import resized_mask
from ..types import Size
from .base import Move
from .box_formats import box_format
from .nested_numbers import put_back, to_host

tv_tensors: Any = importlib.import_module("torchvision.tv_tensors")  # torchvision is not typed
v2: Any = importlib.import_module("torchvision.transforms.v2")


def corners(boxes: Any) -> Any:
    """Return `BoundingBoxes` of any format as a plain tensor `[..., 4]`, `xyxy`."""
    return v2.functional.convert_bounding_box_format(boxes, new_format="XYXY").as_subclass(
        torch.Tensor
    )


def follow_tensor(value: Any, plans: list[Plan]) -> Any:
    """Return boxes, key points or a mask mapped to the resized picture.

    They follow the geometry of all other labels.

    Raises:
        LabelError: the labels belong to a picture of another size.
        ParameterError: the pictures of a batch get different sizes.
    """
    _check_canvas(value, plans[0].size)
    if all(plan.coords.is_identity for plan in plans):
        return value
    moves = {Move(plan.size, plan.out_size) for plan in plans}
    if len(moves) > 1:
        raise ParameterError(
            f"a {type(value).__name__} cannot follow a batch whose pictures get different sizes"
        )
    (move,) = moves
    tensor = value.as_subclass(torch.Tensor)
    if isinstance(value, tv_tensors.Mask):
        return tv_tensors.wrap(resized_mask(tensor, move.after), like=value)
    if isinstance(value, tv_tensors.KeyPoints):
        return tv_tensors.KeyPoints(_map_key_points(tensor, move), canvas_size=move.after)
    order = str(value.format.value).lower()
    if order in ("xyxy", "xywh", "cxcywh"):
        boxes = box_format(order, 0, anywhere=True).map_value(tensor, move)
        return tv_tensors.BoundingBoxes(boxes, format=value.format, canvas_size=move.after)
    # Rotated boxes: let torchvision compute their corners.
    scaled = v2.functional.resize(
        tv_tensors.wrap(tensor.to(torch.float64), like=value), list(move.after)
    )
    return tv_tensors.wrap(scaled.as_subclass(torch.Tensor).to(value.dtype), like=scaled)


def check_order(path: str, value: Any, name: str) -> None:
    """Check that a declaration does not contradict the format stored in `BoundingBoxes`.

    Raises:
        LabelError: the declaration contradicts it, or other tensors of torchvision are declared.
    """
    kind = type(value).__name__
    if not isinstance(value, tv_tensors.BoundingBoxes):
        if (kind, name) in (("Mask", "mask"), ("KeyPoints", "xy")):
            return
        raise LabelError(
            f"the sample's entry {path!r} is a {kind}, which follows the pixels as it is, and it is"
            f" declared {name!r}; leave it out of labels="
        )
    order = str(value.format.value).lower()
    if name != order:
        raise LabelError(
            f"the sample's entry {path!r} is a BoundingBoxes of format {order.upper()}, and it"
            f" is declared {name!r}; declare it {order!r}, or leave it out of labels="
        )


def _check_canvas(value: Any, size: Size) -> None:
    is_mask = isinstance(value, tv_tensors.Mask)
    canvas = tuple(value.shape[-2:]) if is_mask else tuple(value.canvas_size)
    if canvas == tuple(size):
        return
    name = type(value).__name__
    height, width = canvas
    raise LabelError(
        f"a {name} belongs to a picture of {width}x{height} pixels, and the sample's has"
        f" {size[1]}x{size[0]}; resize both with one transform, or give the {name} the canvas that"
        " it is in"
    )


def _map_key_points(points: torch.Tensor, move: Move) -> torch.Tensor:
    """Return key points after a change of size.

    Unlike clicked points, they may lie outside the picture.
    """
    numbers = to_host(points)
    if points.is_floating_point():
        return put_back(points, move.scaling.positions(numbers))
    free = replace(move.scaling, bounded=False, clamp=False)
    return put_back(points, free.points(numbers))
