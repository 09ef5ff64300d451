"""Process many torch pictures on a GPU at once: send tables there, launch each kernel once.

Nothing waits for the device: tables and sprites are copied from pinned memory while it still does
earlier work. The masks of a sprite stay on the device as long as the sprite stays in the cache of
`raster`.
"""

import importlib.util
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ...cache import Cache
from ...drawing.sprite import Sprite
from ...resample import TABLE_BYTES, columns_first, weights
from ...types import Size
from .. import Stamp
from ..stamp_rows import ADDRESSES, PASTE_TILE, StampRows, overlapped_tiles, sprite_rows, stamp_rows

Array: TypeAlias = npt.NDArray[Any]
ALIGNMENT_BYTES = 16


def runs_on(device: torch.device) -> bool:
    """Return whether these kernels run on a device.

    They do on a GPU if Triton is installed, as it is with torch for CUDA and ROCm on Linux.
    """
    return device.type == "cuda" and _has_triton()


@cache
def _has_triton() -> bool:
    return importlib.util.find_spec("triton") is not None


def _kernels() -> Any:
    from . import triton

    return triton


def paste_many(images: Sequence[Tensor], stamps: Sequence[list[Stamp]]) -> None:
    """Stamp each picture's own sprites into it, in place; all pictures are on one device.

    The pictures are uint8 `[3, H, W]`, of any size and strides.
    """
    device = images[0].device
    with _current_device(device):
        key = ("device-rows", device, _stream(device))

        def rows(sprite: Sprite) -> StampRows:
            if key not in sprite.scratch:
                sprite.scratch[key] = _upload(sprite, key=key, device=device)
            return sprite.scratch[key]

        tables = [stamp_rows(picture_stamps, rows) for picture_stamps in stamps]
        sizes = [(image.shape[1], image.shape[2]) for image in images]
        _paste(images, tables, overlapped_tiles(sizes, tables))


def paste_packed(
    images: Sequence[Tensor],
    memory: Tensor,
    tables: Sequence[StampRows],
    tiles: npt.NDArray[np.int32],
) -> None:
    """As `paste_many`, with the rows of each picture, the memory in which they count, and tiles."""
    with _current_device(images[0].device):
        on_device = memory.to(images[0].device, non_blocking=True)
        placed_tables = [table.copy() for table in tables]
        for table in placed_tables:
            table[:, ADDRESSES] += on_device.data_ptr()
        _paste(images, placed_tables, tiles)


def _paste(
    images: Sequence[Tensor], tables: Sequence[StampRows], tiles: npt.NDArray[np.int32]
) -> None:
    if not len(tiles):
        return
    ends = np.cumsum([len(table) for table in tables])
    jobs: list[tuple[int, ...]] = []
    for image, table, end in zip(images, tables, ends.tolist(), strict=True):
        first = end - len(table)
        jobs.append((image.data_ptr(), *image.shape[1:], *image.stride(), first, end))
    tall, wide = PASTE_TILE
    numbers = [np.array(jobs, np.int64), np.concatenate(tables), tiles]
    arguments = _send(numbers, images[0].device)
    _kernels().paste[(len(tiles),)](*arguments, TALL=tall, WIDE=wide)


def resample_many(images: Sequence[Tensor], sizes: Sequence[Size]) -> list[Tensor]:
    """Resize uint8 pictures `[3, H, W]` on one device, each to a size of its own.

    The sizes are (height, width); the results are new tensors.
    """
    out = list(images)
    orders = [_order(image, size) for image, size in zip(images, sizes, strict=True)]
    with _current_device(images[0].device):
        for number in range(2):
            for axis in (1, 2):
                indices = [i for i, order in enumerate(orders) if order[number] == axis]
                _resize_along(out, sizes, indices, axis)
    return [new.clone() if new is old else new for new, old in zip(out, images, strict=True)]


def _order(image: Tensor, size: Size) -> tuple[int, int]:
    """Return the axes of the two passes of a resize, in order."""
    _, height, width = image.shape
    return (1, 2) if columns_first((height, width), size) else (2, 1)


def _resize_along(
    images: list[Tensor], sizes: Sequence[Size], indices: list[int], axis: int
) -> None:
    """Resize, in the list, the pictures at `indices` whose side along an axis must change."""
    changing = [i for i in indices if images[i].shape[axis] != sizes[i][axis - 1]]
    if not changing:
        return
    resized = _pass([images[i] for i in changing], [sizes[i][axis - 1] for i in changing], axis)
    for i, image in zip(changing, resized, strict=True):
        images[i] = image


def _pass(images: list[Tensor], sides: list[int], axis: int) -> list[Tensor]:
    """Resize along one axis, 1 for columns or 2 for rows."""
    kernels = _kernels()
    device = images[0].device
    jobs: list[tuple[int, ...]] = []
    results: list[Tensor] = []
    for image, side in zip(images, sides, strict=True):
        _, height, width = image.shape
        if axis == 1:
            height = side
        else:
            width = side
        new = _new_tensor(image, height, width)
        first, taps = _table(image.shape[axis], side, device, _stream(device))
        source = (image.data_ptr(), *image.stride())
        result = (new.data_ptr(), *new.stride(), height, width)
        jobs.append((*source, *result, first.data_ptr(), taps.data_ptr(), taps.shape[1]))
        results.append(new)
    (job_table,) = _send([np.array(jobs, np.int64)], device)
    tall, wide = kernels.RESIZE_TILE
    grid = (
        max(-(-new.shape[1] // tall) * -(-new.shape[2] // wide) for new in results),
        len(results),
        3,
    )
    kernels.resize[grid](job_table, ALONG_ROWS=axis == 2, TALL=tall, WIDE=wide)
    return results


def _new_tensor(image: Tensor, height: int, width: int) -> Tensor:
    """Return a new tensor `[3, height, width]` with the channel layout of `image`."""
    channels_last = image.stride(0) == 1 and image.stride(2) != 1
    shape = (height, width, 3) if channels_last else (3, height, width)
    new = torch.empty(shape, dtype=torch.uint8, device=image.device)
    return new.permute(2, 0, 1) if channels_last else new


def _current_device(device: torch.device) -> AbstractContextManager[Any]:
    """Make `device` the current one, because Triton launches kernels there."""
    return torch.cuda.device(device) if device.type == "cuda" else nullcontext()


def _stream(device: torch.device) -> int:
    """Return the stream that orders the writing and freeing of memory on a device.

    Data that one stream was asked to write may not be ready for another stream.
    """
    return torch.cuda.current_stream(device).cuda_stream if device.type == "cuda" else 0


_tables = Cache(TABLE_BYTES)


def _table(n_in: int, n_out: int, device: torch.device, in_stream: int) -> tuple[Tensor, Tensor]:
    """Return the weights of a resize on the device, where the last ones are cached."""
    key = n_in, n_out, device, in_stream
    tensors = _tables.get(key)
    if tensors is None:
        table = weights(n_in, n_out)
        first, taps = tensors = _send([table.first, table.taps], device)
        _tables.put(key, tensors, first.nbytes + taps.nbytes)
    first, taps = tensors
    return first, taps


def _send(arrays: Sequence[Array], device: torch.device) -> list[Tensor]:
    """Send arrays to the device in one copy from pinned memory, without waiting."""
    memory = pack(arrays, pin=device.type == "cuda")
    on_device = memory.to(device, non_blocking=True)
    tensors: list[Tensor] = []
    start = 0
    for array in arrays:
        part = on_device[start : start + array.nbytes]
        tensors.append(part.view(_DTYPES[array.dtype.str]).reshape(array.shape))
        start += room(array)
    return tensors


def room(array: Array) -> int:
    """Return the bytes that an array takes in packed memory, a multiple of `ALIGNMENT_BYTES`."""
    return -(-array.nbytes // ALIGNMENT_BYTES) * ALIGNMENT_BYTES


def pack(arrays: Sequence[Array], *, pin: bool = False) -> Tensor:
    """Return memory in which arrays lie one after the other, each in its room."""
    total = max(sum(map(room, arrays)), ALIGNMENT_BYTES)
    memory = torch.empty(total, dtype=torch.uint8, pin_memory=pin)
    host = memory.numpy()
    start = 0
    for array in arrays:
        part = host[start : start + array.nbytes]
        part.view(array.dtype).reshape(array.shape)[...] = array
        start += room(array)
    return memory


_DTYPES = {
    np.dtype(name).str: getattr(torch, name) for name in ("uint8", "uint16", "int32", "int64")
}


def _upload(sprite: Sprite, key: object, device: torch.device) -> StampRows:
    """Send the masks and pictures of a sprite to the device and return its rows.

    The sprite keeps what was sent under `("memory", key)`.
    """
    arrays: list[Array] = []
    for layer in sprite.layers:
        arrays += layer.covers
        if layer.picture is not None:
            arrays.append(cast(Array, layer.picture))
    tensors = _send(arrays, device)
    sprite.scratch["memory", key] = tensors
    places: dict[int, tuple[int, int]] = {}
    for array, tensor in zip(arrays, tensors, strict=True):
        places[id(array)] = (tensor.data_ptr(), tensor.stride(0))
    return sprite_rows(sprite, lambda array: places[id(array)])
