"""Plans with their sprites drawn and packed, for pictures on a GPU.

Drawing takes most of the time that the host needs for a batch. A worker of the loader can do it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from . import extras
from .drawing.sprite import Sprite
from .errors import ParameterTypeError
from .kernels import Stamp, plan_stamps
from .kernels.stamp_rows import StampRows, overlapped_tiles, sprite_rows, stamp_rows
from .plan import Paste, Plan


@dataclass(frozen=True, eq=False)
class PreparedPlans:
    """Plans for a batch, and what they paste before their first resize, to be sent in one copy.

    Make it with `prepare`, and give it to `apply` in the place of the plans. It can be pickled, and
    a `DataLoader` with `pin_memory=True` pins its memory.

    Attributes:
        plans: one for each picture.
        memory: a torch tensor uint8 `[n]` with the masks and pictures of all sprites.
        rows: int64 `[n, 11]` for each plan, a row for each layer of a stamp (`kernels.stamp_rows`);
            addresses count from the beginning of `memory`.
        tiles: int32 `[n, 3]`: the pictures, of those that begin with a paste, and rows and columns
            of the tiles that their rows overlap.
    """

    plans: tuple[Plan, ...]
    memory: Any
    rows: tuple[StampRows, ...]
    tiles: npt.NDArray[np.int32]

    def __len__(self) -> int:
        """Return the number of plans."""
        return len(self.plans)

    def pin_memory(self) -> "PreparedPlans":
        """Return the same in pinned memory, from which a GPU copies while the host goes on."""
        return replace(self, memory=self.memory.pin_memory())


def prepare(plans: Sequence[Plan]) -> PreparedPlans:
    """Draw what plans paste, and pack it for a GPU; needs torch.

    Args:
        plans: one for each picture of a batch.

    Raises:
        MissingDependencyError: torch is not installed.
        ParameterTypeError: `plans` is no list of plans.
        PlanError: this machine would draw something else than was planned.
    """
    extras.require("prepare", "torch", ("torch",))
    from .kernels.gpu import device

    listed = cast("Sequence[object]", plans)
    is_list = isinstance(listed, list | tuple)
    if not is_list or not all(isinstance(plan, Plan) for plan in listed):
        raise ParameterTypeError("prepare takes a list of plans, one for each picture of a batch")

    arrays: list[npt.NDArray[Any]] = []
    starts: dict[int, int] = {}  # of the arrays, by their ids
    rows_by_sprite: dict[int, tuple[Sprite, StampRows]] = {}
    end = 0

    def address(array: npt.NDArray[Any]) -> tuple[int, int]:
        nonlocal end
        if id(array) not in starts:
            starts[id(array)] = end
            arrays.append(array)
            end += device.room(array)
        return starts[id(array)], prod(array.shape[1:])

    def rows(sprite: Sprite) -> StampRows:
        if id(sprite) not in rows_by_sprite:
            rows_by_sprite[id(sprite)] = sprite, sprite_rows(sprite, address)
        return rows_by_sprite[id(sprite)][1]

    tables = tuple(stamp_rows(_first_stamps(plan), rows) for plan in plans)
    painted = [(p.size, t) for p, t in zip(plans, tables, strict=True) if _begins_with_paste(p)]
    tiles = overlapped_tiles([size for size, _ in painted], [table for _, table in painted])
    return PreparedPlans(tuple(plans), device.pack(arrays), tables, tiles)


def _begins_with_paste(plan: Plan) -> bool:
    return bool(plan.ops) and isinstance(plan.ops[0], Paste)


def _first_stamps(plan: Plan) -> list[Stamp]:
    """Return what a plan pastes before its first resize; the pastes after it are checked, too."""
    stamps: list[Stamp] = []
    size = plan.size
    has_resized = False
    for index, op in enumerate(plan.ops):
        if not isinstance(op, Paste):
            size, has_resized = op.size, True
            continue
        op_stamps = plan_stamps(plan, index, size)
        if not has_resized:
            stamps += op_stamps
    return stamps
