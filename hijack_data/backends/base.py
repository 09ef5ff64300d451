"""The base class of backends: all operations on the arrays of one framework."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, ClassVar

import numpy as np

from ..array_overlap import overlaps
from ..errors import ImageError, ImageTypeError, ParameterError
from ..kernels import Stamp, plan_stamps
from ..kernels.stamps import check_drawings
from ..plan import Paste, Plan
from ..prepared_plans import PreparedPlans
from ..types import Size, UInt8Array, size_text


class Backend(ABC):
    """One array framework.

    Pictures are uint8 RGB, `[..., H, W, 3]` or `[..., 3, H, W]`, in any memory format and on any
    device. Every backend implements `module`, `from_numpy`, `to_numpy`, `paste` and `resample`, and
    a backend with mutable arrays also `empty_like`, `strides` and `address`. All other methods are
    built on these; a backend with a faster way overrides them.

    Attributes:
        name: the framework, as on the command line.
        channels: the axis of the colours, -1 or -3.
        mutable: whether pictures can be written into.
        to_uint8: the expression that turns a float picture `image` in 0..1 into uint8.
    """

    name: ClassVar[str]
    channels: ClassVar[int] = -1
    mutable: ClassVar[bool] = True
    to_uint8: ClassVar[str]

    @property
    @abstractmethod
    def module(self) -> Any:
        """The framework's module, with NumPy's `stack`."""

    # Looking at arrays

    def check(self, image: Any) -> None:
        """Check that `image` is uint8 RGB in this framework's layout, with pixels in memory.

        Raises:
            ImageTypeError: the dtype is not uint8, or the array has no pixels of its own.
            ImageError: the shape is wrong, the array is empty, or its memory is gone.
        """
        self.check_memory(image)
        if str(image.dtype).rpartition(".")[2] != "uint8":
            raise ImageTypeError(self._wrong_dtype(image))
        shape = tuple(image.shape)
        if len(shape) < 3 or shape[self.channels] != 3:
            layout = "[..., H, W, 3]" if self.channels == -1 else "[..., 3, H, W]"
            expected = f"but {self.name} pictures are {layout}"
            raise ImageError(f"image has shape {list(shape)}, {expected}{self._fix(shape)}")
        if 0 in shape:
            raise ImageError(f"image has shape {list(shape)}: it is empty")

    def check_memory(self, image: Any) -> None:  # noqa: B027 (subclasses may keep this default)
        """Check that `image` has pixels in memory, as most arrays always do.

        Raises:
            ImageTypeError: this kind of array has no pixels of its own.
            ImageError: the memory of the array is gone.
        """

    def check_writable(self, image: Any) -> None:
        """Check that `image` can be written into.

        Raises:
            ParameterError: the array is immutable or read-only, or its pixels share memory.
        """
        if overlaps(tuple(image.shape), self.strides(image)):
            kinds = "an expanded tensor, or a view made with as_strided"
            raise ParameterError(f"inplace=True: its pixels share memory ({kinds}); pass a copy")

    def size(self, image: Any) -> Size:
        """Return `(height, width)` of a picture or a batch."""
        height, width = image.shape[-3:-1] if self.channels == -1 else image.shape[-2:]
        return int(height), int(width)

    def strides(self, image: Any) -> tuple[int, ...]:
        """Return the steps in bytes along each axis of an array that can be written into."""
        raise NotImplementedError

    def address(self, image: Any) -> int:
        """Return the memory address of an array that can be written into."""
        raise NotImplementedError

    # Making arrays

    @abstractmethod
    def from_numpy(self, image: UInt8Array) -> Any:
        """Return a NumPy picture `[H, W, 3]` as an array of this framework, in its layout."""

    @abstractmethod
    def to_numpy(self, image: Any) -> UInt8Array:
        """Return one picture as a NumPy array `[H, W, 3]`.

        Raises:
            ImageTypeError: the array has no pixels yet.
        """

    def empty_like(self, image: Any) -> Any:
        """Return a new array of the same shape, memory format and device, not filled."""
        raise NotImplementedError

    def copy(self, image: Any) -> Any:
        """Return a copy that the caller owns, in the same memory format."""
        if not self.mutable:
            return image
        out = self.empty_like(image)
        out[...] = image
        return out

    def gather(self, pictures: Sequence[Any], lead: tuple[int, ...]) -> Any:
        """Return pictures as one array with leading axes `lead`, or as a list if sizes differ."""
        if len({self.size(picture) for picture in pictures}) > 1:
            return list(pictures)
        if not lead:
            return pictures[0]
        return self.module.stack(list(pictures)).reshape(*lead, *pictures[0].shape)

    # Drawing

    @abstractmethod
    def paste(self, image: Any, stamps: list[Stamp]) -> Any:
        """Stamp sprites, in order, and return the picture; into `image` itself if it is mutable."""

    @abstractmethod
    def resample(self, image: Any, size: Size) -> Any:
        """Return a new picture of `size` (height, width), bit for bit Pillow's bicubic result."""

    def apply_many(
        self, plans: list[Plan], images: Any, lead: tuple[int, ...], *, inplace: bool = False
    ) -> Any:
        """Apply one plan to each picture of an array; the caller has checked all arguments.

        Args:
            plans: one for each picture, in C order.
            images: one picture, or a batch with leading axes `lead`.
            lead: the leading axes; `()` for a single picture.
            inplace: write into `images`, which no plan resizes, and return it.

        Returns:
            One array, or a list of pictures if their sizes differ.
        """
        if not lead:
            return self._apply_one(plans[0], images, inplace=inplace)
        if self.mutable and keeps_size(plans):
            return self._apply_batch(plans, images, lead, inplace=inplace)
        results = [
            self._apply_one(plan, images[index], inplace=False)
            for plan, index in zip(plans, picture_indices(lead), strict=True)
        ]
        return self.gather(results, lead)

    def apply_prepared(
        self, prepared: PreparedPlans, images: Any, lead: tuple[int, ...], *, inplace: bool = False
    ) -> Any:
        """As `apply_many`; where no GPU takes what was prepared, the plans are drawn again."""
        plans = list(prepared.plans)
        if inplace:
            check_drawings(plans)
        return self.apply_many(plans, images, lead, inplace=inplace)

    def _apply_one(self, plan: Plan, image: Any, *, inplace: bool) -> Any:
        result = self.run(plan, image, owned=inplace)
        if result is image:
            return image if inplace else self.copy(image)
        if not inplace:
            return result
        image[...] = result
        return image

    def _apply_batch(
        self, plans: list[Plan], batch: Any, lead: tuple[int, ...], *, inplace: bool
    ) -> Any:
        """Apply plans that keep the size, and write the results into one array."""
        out = batch if inplace else self.empty_like(batch)
        for plan, index in zip(plans, picture_indices(lead), strict=True):
            view = out[index]
            # Copy and paint picture by picture, while the copy is still in the processor's cache.
            if not inplace:
                view[...] = batch[index]
            result = self.run(plan, view, owned=True)
            if result is not view:
                view[...] = result
        return out

    def run(self, plan: Plan, image: Any, *, owned: bool) -> Any:
        """Run the operations of a plan on one picture.

        An `owned` picture may be written into; any other is copied before the first write.
        """
        for index, op in enumerate(plan.ops):
            if isinstance(op, Paste):
                stamps = plan_stamps(plan, index, self.size(image))
                if not owned:
                    image = self.copy(image)
                image = self.paste(image, stamps)
            else:
                image = self.resample(image, op.size)
            owned = True
        return image

    # Error messages

    def _wrong_dtype(self, image: Any) -> str:
        message = f"image has dtype {image.dtype}; only uint8 RGB in 0..255 is accepted"
        if "float" not in str(image.dtype):
            return message
        return f"{message}; for values in 0..1 use {self.to_uint8}"

    def _fix(self, shape: tuple[int, ...]) -> str:
        """Return advice on a wrong shape, to append to the error message."""
        if len(shape) == 2:
            return "; a grey picture needs its channel three times"
        if len(shape) < 3:
            return ""
        if shape[self.channels] == 4:
            return "; drop the alpha channel"
        other_axis = -3 if self.channels == -1 else -1
        if shape[other_axis] != 3:
            return ""
        return (
            f"; this looks like the other channel order, move axis {other_axis} to {self.channels}"
        )


def picture_indices(lead: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Return the indices of the pictures of a batch with leading axes `lead`, in C order."""
    return product(*(range(count) for count in lead))


def keeps_size(plans: Sequence[Plan]) -> bool:
    """Return whether no plan changes the size of its picture."""
    return all(plan.out_size == plan.size for plan in plans)


def check_keeps_size(plans: Sequence[Plan]) -> None:
    """Check that no plan changes the size of its picture, for `inplace=True`.

    Raises:
        ParameterError: a plan changes the size.
    """
    for plan in plans:
        if plan.out_size != plan.size:
            size = size_text(plan.out_size)
            raise ParameterError(f"inplace=True: {plan.corruption} changes the size to {size}")


def count_pictures(lead: tuple[int, ...]) -> int:
    """Return how many pictures an array with leading axes `lead` holds."""
    return int(np.prod(lead)) if lead else 1
