"""torch tensors: uint8 `[..., 3, H, W]`, any memory format, any device.

On the CPU a tensor's memory is handed to the NumPy kernels without a copy. On any other device the
pictures of a batch are processed together: with Triton (`kernels.gpu`) one launch stamps all of
them and two resize them; without Triton, tensor operations do it (`kernels.torch_ops`).
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..errors import ImageTypeError
from ..kernels import Stamp, plan_stamps, torch_ops
from ..kernels.cpu import pixels
from ..kernels.gpu import device
from ..plan import Paste, Plan, Resample
from ..prepared_plans import PreparedPlans
from ..types import Size, UInt8Array
from .base import Backend, keeps_size, picture_indices


class TorchBackend(Backend):
    """torch tensors."""

    name = "torch"
    channels = -3
    to_uint8 = "(image * 255).round().clamp(0, 255).to(torch.uint8)"

    @property
    def module(self) -> Any:
        """The module `torch`."""
        return torch

    def check_memory(self, image: Tensor) -> None:
        """Check that a tensor is dense and on a device.

        Raises:
            ImageTypeError: the tensor has no pixels of its own.
        """
        kind = _without_pixels(image)
        if kind is not None:
            advice = "give a dense tensor on a device, outside of torch.vmap and torch.compile"
            raise ImageTypeError(f"{kind} holds no pixels to corrupt; {advice}")

    def strides(self, image: Tensor) -> tuple[int, ...]:
        """Return the steps in bytes along each axis."""
        return tuple(image.stride())

    def address(self, image: Tensor) -> int:
        """Return the memory address of the tensor."""
        return int(image.data_ptr())

    def from_numpy(self, image: UInt8Array) -> Tensor:
        """Return a NumPy picture `[H, W, 3]` as a tensor `[3, H, W]`."""
        return torch_ops.tensor(image).permute(2, 0, 1).contiguous()

    def to_numpy(self, image: Tensor) -> UInt8Array:
        """Return one picture as a NumPy array `[H, W, 3]`."""
        return image.permute(1, 2, 0).cpu().numpy()

    def empty_like(self, image: Tensor) -> Tensor:
        """Return a new tensor of the same shape, memory format and device, not filled.

        On the CPU the memory comes from NumPy, which asks for huge pages; this makes copying a
        batch up to five times as fast.
        """
        if image.device.type != "cpu":
            return torch.empty_like(image)
        order = list(range(image.ndim))
        if 0 not in image.stride():  # an expanded tensor has no layout to keep
            order.sort(key=lambda axis: (image.stride(axis), -axis), reverse=True)
        memory = torch_ops.tensor(np.empty([image.shape[axis] for axis in order], np.uint8))
        return memory.permute([order.index(axis) for axis in range(image.ndim)])

    def paste(self, image: Tensor, stamps: list[Stamp]) -> Tensor:
        """Stamp sprites into `image`, which is on the CPU, in order, in place; return it."""
        pixels.paste(image.permute(1, 2, 0).numpy(), stamps)
        return image

    def resample(self, image: Tensor, size: Size) -> Tensor:
        """Resize `image`, which is on the CPU, to `size` (height, width); a new tensor."""
        resized = pixels.resample(image.permute(1, 2, 0).numpy(), size)
        return torch_ops.tensor(resized).permute(2, 0, 1)

    def apply_many(
        self, plans: list[Plan], images: Tensor, lead: tuple[int, ...], *, inplace: bool = False
    ) -> Any:
        """See `Backend.apply_many`; pictures that are not on the CPU are processed together."""
        if not together(images):
            return super().apply_many(plans, images, lead, inplace=inplace)
        return self._apply_together(plans, images, lead, inplace=inplace)

    def apply_prepared(
        self,
        prepared: PreparedPlans,
        images: Tensor,
        lead: tuple[int, ...],
        *,
        inplace: bool = False,
    ) -> Any:
        """See `Backend.apply_prepared`; the kernels on a GPU paste what was prepared."""
        if not (together(images) and device.runs_on(images.device)):
            return super().apply_prepared(prepared, images, lead, inplace=inplace)
        plans = list(prepared.plans)
        return self._apply_together(plans, images, lead, inplace=inplace, prepared=prepared)

    def _apply_together(
        self,
        plans: list[Plan],
        images: Tensor,
        lead: tuple[int, ...],
        *,
        inplace: bool,
        prepared: PreparedPlans | None = None,
    ) -> Any:
        same_size = keeps_size(plans)
        out = self.copy(images) if same_size and not inplace else images
        views = (
            list(out.unbind())
            if len(lead) == 1
            else [out[index] for index in picture_indices(lead)]
        )
        results = self._run_together(plans, views, owned=same_size, prepared=prepared)
        if not same_size:
            return self.gather(results, lead)
        for view, result in zip(views, results, strict=True):
            if result is not view:
                view.copy_(result)
        return out

    def _run_together(
        self,
        plans: list[Plan],
        images: list[Tensor],
        *,
        owned: bool,
        prepared: PreparedPlans | None,
    ) -> list[Tensor]:
        """Run one plan for each of several pictures on one device, as `run` does for one picture.

        Steps alternate: all pastes up to the next resize of each picture, then all resizes.
        """
        runs = [
            _Run(plan, image, writable=owned) for plan, image in zip(plans, images, strict=True)
        ]
        while True:
            self._paste_all(runs, prepared)
            prepared = None  # it has the pastes before the first resize
            pending = [(run, op.size) for run in runs if (op := run.resize()) is not None]
            if not pending:
                return [run.image for run in runs]
            resized = resample_many(
                [run.image for run, _ in pending], [size for _, size in pending]
            )
            for (run, _), image in zip(pending, resized, strict=True):
                run.image = image
                run.writable = True
                run.next_op += 1

    def _paste_all(self, runs: list["_Run"], prepared: PreparedPlans | None) -> None:
        """Make all pastes before the next resize of each picture."""
        painted: list[int] = []
        stamps: list[list[Stamp]] = []
        for number, run in enumerate(runs):
            pending = run.take_pastes()
            if not run.writable and (pending or not run.plan.ops):
                run.image = self.copy(run.image)
                run.writable = True
            if pending:
                painted.append(number)
                if prepared is None:
                    size = self.size(run.image)
                    parts = (plan_stamps(run.plan, index, size) for index in pending)
                    stamps.append([stamp for part in parts for stamp in part])
        images = [runs[number].image for number in painted]
        if painted and prepared is not None:
            rows = [prepared.rows[number] for number in painted]
            device.paste_packed(images, prepared.memory, rows, prepared.tiles)
        elif painted:
            paste_many(images, stamps)


@dataclass
class _Run:
    """A plan that is being run on one picture; `next_op` is the index of its next operation."""

    plan: Plan
    image: Tensor
    writable: bool
    next_op: int = 0

    def take_pastes(self) -> range:
        """Return the indices of the pastes up to the next resize, and count them as done."""
        ops = self.plan.ops
        start = self.next_op
        while self.next_op < len(ops) and isinstance(ops[self.next_op], Paste):
            self.next_op += 1
        return range(start, self.next_op)

    def resize(self) -> Resample | None:
        """Return the next operation if it is a resize, otherwise `None`."""
        if self.next_op == len(self.plan.ops):
            return None
        op = self.plan.ops[self.next_op]
        return op if isinstance(op, Resample) else None


def together(image: Tensor) -> bool:
    """Return whether the pictures of a batch are processed together: on any device but the CPU."""
    return image.device.type != "cpu"


def paste_many(images: Sequence[Tensor], stamps: Sequence[list[Stamp]]) -> None:
    """Stamp each picture's own sprites into it, in place; all pictures are on one device."""
    if device.runs_on(images[0].device):
        device.paste_many(images, stamps)
        return
    for image, batch in zip(images, stamps, strict=True):
        torch_ops.paste_ops(image, batch)


def resample_many(images: Sequence[Tensor], sizes: Sequence[Size]) -> list[Tensor]:
    """Return pictures on one device resized, each to its own size (height, width)."""
    if device.runs_on(images[0].device):
        return device.resample_many(images, sizes)
    return [torch_ops.resample_ops(image, size) for image, size in zip(images, sizes, strict=True)]


def _without_pixels(image: Any) -> str | None:
    """Describe why a tensor has no dense pixels of its own, or return `None` if it has."""
    if image.is_nested:
        return "a nested tensor"
    if image.device.type == "meta":
        return "a tensor with device 'meta'"
    if image.layout is not torch.strided:
        return f"a tensor with layout {image.layout}"
    fake: Any = sys.modules.get("torch._subclasses.fake_tensor")
    if fake is not None and isinstance(image, fake.FakeTensor):
        return "a fake tensor"
    try:
        image.data_ptr()
    except RuntimeError:
        return "a tensor inside torch.vmap"
    return None


BACKEND = TorchBackend()
