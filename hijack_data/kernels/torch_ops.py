"""Paste and resample in torch operations: uint8 `[3, H, W]`, any memory format, any device.

They are used on devices that are neither the CPU nor a GPU with Triton; the conformance suite also
runs them on the CPU.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ..drawing.sprite import Sprite
from ..resample import PRECISION_BITS, Weights, columns_first, weights
from ..types import Int32Array, Size
from .stamps import Stamp, at_once


def tensor(array: npt.NDArray[Any]) -> Tensor:
    """Return a tensor that shares the memory of an array."""
    return torch.from_numpy(array)  # pyright: ignore[reportUnknownMemberType]


def paste_ops(image: Tensor, stamps: list[Stamp]) -> Tensor:
    """Stamp sprites into `image`, in order, in place; return it."""
    for stamp in stamps:
        rgb = _rgb(stamp.sprite, image.device)
        if rgb is None:
            _paste_soft(image, stamp)
        else:
            _paste_opaque(image, stamp, rgb)
    return image


def _paste_opaque(image: Tensor, stamp: Stamp, rgb: Tensor) -> None:
    h, w = stamp.sprite.size
    for y, x in zip(stamp.ys.tolist(), stamp.xs.tolist(), strict=True):
        image[:, y : y + h, x : x + w] = rgb


def _paste_soft(image: Tensor, stamp: Stamp) -> None:
    step = at_once(stamp.sprite)
    for i in range(0, len(stamp.ys), step):
        _paste_pixels(image, stamp.sprite, stamp.ys[i : i + step], stamp.xs[i : i + step])


def _rgb(sprite: Sprite, device: torch.device) -> Tensor | None:
    """Return the colours `[3, h, w]` of an opaque sprite on the device; the sprite caches them."""
    if sprite.rgb is None:
        return None
    key = ("torch-rgb", device)
    if key not in sprite.scratch:
        planes = tensor(sprite.rgb.copy()).permute(2, 0, 1).contiguous()
        sprite.scratch[key] = planes.to(device)
    return sprite.scratch[key]


def _pixels(sprite: Sprite, device: torch.device) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the painted pixels of a sprite on the device; the sprite caches them.

    They are given as `dy [n]`, `dx [n]` int64, `keep [1, n]` and `paint + 128 [3, n]` int32.
    """
    key = ("torch-pixels", device)
    if key not in sprite.scratch:
        dy, dx, keep, paint = sprite.pixels
        parts: list[npt.NDArray[Any]] = [
            dy.astype(np.int64),
            dx.astype(np.int64),
            keep[None].astype(np.int32),
            paint.T.astype(np.int32) + 128,
        ]
        contiguous = [np.ascontiguousarray(part) for part in parts]
        sprite.scratch[key] = tuple(tensor(part).to(device) for part in contiguous)
    return sprite.scratch[key]


def _paste_pixels(image: Tensor, sprite: Sprite, ys: Int32Array, xs: Int32Array) -> None:
    dy, dx, keep, paint = _pixels(sprite, image.device)
    tops = tensor(ys.astype(np.int64)).to(image.device)
    lefts = tensor(xs.astype(np.int64)).to(image.device)
    rows = (tops[:, None] + dy).reshape(-1)
    columns = (lefts[:, None] + dx).reshape(-1)
    keep = keep.repeat(1, len(ys))
    paint = paint.repeat(1, len(ys))
    below = image[:, rows, columns].to(torch.int32)
    total = below * keep + paint
    image[:, rows, columns] = ((total + (total >> 8)) >> 8).to(torch.uint8)


def resample_ops(image: Tensor, size: Size) -> Tensor:
    """Resize `image` to `size`, (height, width); a new tensor."""
    _, height, width = image.shape
    axes = (1, 2) if columns_first((height, width), size) else (2, 1)
    for axis in axes:
        side = size[axis - 1]
        if image.shape[axis] != side:
            image = _pass(image, weights(image.shape[axis], side), axis)
    return image.clone() if size == (height, width) else image


def _pass(image: Tensor, table: Weights, axis: int) -> Tensor:
    """Make one pass along `axis`: multiply-add in int32, shift, clip."""
    index = tensor(table.index.astype(np.int64)).to(image.device)
    taps = tensor(table.taps.copy()).to(image.device)
    shape = (1, 1, -1) if axis == 2 else (1, -1, 1)
    total: Tensor | int = 1 << (PRECISION_BITS - 1)
    for k in range(taps.shape[1]):
        values = image.index_select(axis, index[:, k]).to(torch.int32)
        total = values * taps[:, k].reshape(shape) + total
    rounded = torch.as_tensor(total) >> PRECISION_BITS
    return rounded.clamp(0, 255).to(torch.uint8)
