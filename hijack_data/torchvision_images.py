"""Pictures that are `tv_tensors` of torchvision.

Needs torch and torchvision, and is imported when the first of these pictures arrives.
"""

import importlib
from collections.abc import Callable
from typing import Any, cast

import torch

_tv_tensors: Any = importlib.import_module("torchvision.tv_tensors")  # torchvision is not typed


def change_pixels(image: Any, change: Callable[[Any], Any]) -> Any:
    """Change an `Image` or `Video` as a plain tensor, and wrap the result as the same kind.

    Args:
        image: uint8 `[..., 3, H, W]`.
        change: returns a tensor, or a list of tensors, from a plain tensor.

    Returns:
        an `Image` or `Video`, or a list of them where `change` returns a list.
    """
    out = change(image.as_subclass(torch.Tensor))
    if isinstance(out, list):
        return [_tv_tensors.wrap(part, like=image) for part in cast("list[Any]", out)]
    return _tv_tensors.wrap(out, like=image)
