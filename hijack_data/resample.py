"""The integer weights of Pillow's bicubic resize; no other module computes any.

Pillow resizes uint8 pictures with fixed-point weights of 22 bits, in one pass along rows and one
along columns, each rounded and clipped to uint8. The weights here are computed in the same order of
double-precision operations, so every kernel that multiplies and adds them in int32 gives Pillow's
bytes.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .cache import Cache
from .types import Size

PRECISION_BITS = 22
TABLE_BYTES = 32 * 2**20  # for halving a 1920x1080 screen, the tables take 60 KB
_A = -0.5
_SUPPORT = 2.0


def columns_first(source: Size, size: Size) -> bool:
    """Return whether the pass along columns comes first.

    It does for tall pictures that become much less tall, from `source` to `size`, (height, width).
    This is the rule of Pillow 13. Older versions always begin with the rows; this rule holds
    whichever Pillow is installed.
    """
    height, width = source
    h, w = size
    return h < height and height - h > 2 * (width - w)


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of one pass.

    Output `i` sums `taps[i, k] * input[first[i] + k]` over `k < taps.shape[1]`. `first` is int32
    `[n_out]`, `taps` int32 `[n_out, k]`; `first[i] + k` never leaves the input.
    """

    first: npt.NDArray[np.int32]
    taps: npt.NDArray[np.int32]

    @property
    def index(self) -> npt.NDArray[np.int32]:
        """Input positions of all taps, int32 `[n_out, k]`."""
        return self.first[:, None] + np.arange(self.taps.shape[1], dtype=np.int32)


def _bicubic(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    x = np.abs(x)
    near = ((_A + 2.0) * x - (_A + 3.0)) * x * x + 1
    far = (((x - 5) * x + 8) * x - 4) * _A
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))


_tables = Cache(TABLE_BYTES)


def weights(n_in: int, n_out: int) -> Weights:
    """Return the weights that resize a line of `n_in` pixels to `n_out`; recent ones are cached."""
    table = _tables.get((n_in, n_out))
    if table is None:
        table = _weights(n_in, n_out)
        nbytes = table.first.nbytes + table.taps.nbytes
        _tables.put((n_in, n_out), table, nbytes)
    return table


def _weights(n_in: int, n_out: int) -> Weights:
    scale = n_in / n_out
    stretch = max(scale, 1.0)
    support = _SUPPORT * stretch
    width = min(math.ceil(support) * 2 + 1, n_in)
    centre = (np.arange(n_out) + 0.5) * scale
    first = np.maximum((centre - support + 0.5).astype(np.int64), 0)
    last = np.minimum((centre + support + 0.5).astype(np.int64), n_in)
    taps = np.arange(width)
    distance = taps + first[:, None] - centre[:, None] + 0.5
    values = _bicubic(distance * (1.0 / stretch))
    beyond = taps >= (last - first)[:, None]
    values[beyond] = 0.0
    total = np.zeros(n_out)
    # left to right, as the C loop sums: another order would round differently
    for k in range(width):
        total += values[:, k]
    values /= np.where(total == 0.0, 1.0, total)[:, None]
    fixed = values * (1 << PRECISION_BITS)
    rounded = np.where(fixed < 0, fixed - 0.5, fixed + 0.5).astype(np.int32)
    return _trim(first, rounded, n_in)


def _trim(first: npt.NDArray[np.int64], taps: npt.NDArray[np.int32], n_in: int) -> Weights:
    """Drop columns of zeros, and move windows that stick out at the end back inside."""
    width = int(np.flatnonzero(taps.any(axis=0)).max()) + 1
    taps = taps[:, :width]
    start = np.minimum(first, n_in - width)
    shift = (first - start)[:, None]
    column = np.arange(width) - shift
    indices = np.take_along_axis(taps, np.maximum(column, 0), axis=1)
    weights = np.where(column >= 0, indices, 0)
    start32 = start.astype(np.int32)
    weights = np.ascontiguousarray(weights.astype(np.int32))
    start32.setflags(write=False)
    weights.setflags(write=False)
    return Weights(start32, weights)
