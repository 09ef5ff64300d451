"""Apply plans to pictures: one function for every framework, single pictures, batches and lists."""

import sys
from collections.abc import Sequence
from math import prod
from typing import Any, cast, overload

import numpy as np
from PIL import ExifTags, Image

from .backends import find_backend
from .backends.base import check_keeps_size, count_pictures
from .drawing.sprite import Sprite
from .errors import ImageError, ImageTypeError, ParameterError, ParameterTypeError, short_repr
from .kernels.cpu.pixels import paste
from .kernels.stamps import Stamp, check_drawings, plan_stamps
from .plan import Paste, Plan
from .prepared_plans import PreparedPlans
from .types import Size, size_text

PIXELS_PER_PART = 8000  # what a part of a PIL image costs beside its pixels
_NO_PIL = "inplace=True: a PIL image cannot be written into; use the returned image"


@overload
def apply(plan: Plan, image: Any, *, inplace: bool = False) -> Any: ...
@overload
def apply(plan: Sequence[Plan] | PreparedPlans, image: Any, *, inplace: bool = False) -> Any: ...
def apply(plan: Plan | Sequence[Plan] | PreparedPlans, image: Any, *, inplace: bool = False) -> Any:
    """Apply a plan to a picture, or one plan each to a batch.

    Args:
        plan: one plan, or a list of plans, one for each picture, or what `prepare` made of it.
        image: uint8 RGB. NumPy and JAX `[..., H, W, 3]`, torch `[..., 3, H, W]` (any memory format,
            any device), a PIL image in mode RGB, or a list of pictures, which may differ in size.
        inplace: write into `image` (NumPy and torch, when the size stays). By default the input is
            never modified.

    Returns:
        The same kind as `image`. Outputs of one size stay one array; a batch whose outputs differ
        in size comes back as a list, as does a list.

    Raises:
        ImageTypeError: wrong kind or dtype.
        ImageError: wrong shape, a picture whose size is not the plan's, or a batch inside a list.
        ParameterError: `inplace` is impossible for these pictures; nothing has been written.
        ParameterTypeError: `inplace` is not a bool.
        PlanError: this machine would draw something else than was planned; nothing has been
            written.
    """
    torch: Any = sys.modules.get("torch")
    if torch is not None and torch.compiler.is_compiling():
        # torch.compile runs it as it is, because it draws with the library's own kernels
        return torch.compiler.disable(_apply)(plan, image, inplace)
    return _apply(plan, image, inplace)


def _apply(plan: Plan | Sequence[Plan] | PreparedPlans, image: Any, inplace: bool) -> Any:
    prepared = plan if isinstance(plan, PreparedPlans) else None
    plans = _plans(plan)
    if not isinstance(cast(object, inplace), bool):
        raise ParameterTypeError(f"inplace must be True or False, got {short_repr(inplace)}")
    if isinstance(image, list | tuple):
        return _apply_list(plan, plans, cast("Sequence[Any]", image), inplace)
    if isinstance(image, Image.Image):
        return _apply_pil(plans, image, inplace)
    backend = find_backend(image)
    backend.check(image)
    lead = tuple(image.shape[:-3])
    plans = _plan_per_picture(plan, plans, count_pictures(lead))
    _check_sizes(plans, backend.size(image))
    if inplace:
        backend.check_writable(image)
        check_keeps_size(plans)
    if prepared is not None:
        return backend.apply_prepared(prepared, image, lead, inplace=inplace)
    if inplace:
        check_drawings(plans)
    return backend.apply_many(plans, image, lead, inplace=inplace)


def _plans(plan: object) -> list[Plan]:
    """Return a plan, or a list of plans, as a list.

    Raises:
        ImageTypeError: `plan` is neither.
    """
    listed: object = [plan] if isinstance(plan, Plan) else plan
    if isinstance(listed, PreparedPlans):
        listed = listed.plans
    if isinstance(listed, list | tuple):
        plans = cast("Sequence[object]", listed)
        if all(isinstance(candidate, Plan) for candidate in plans):
            return list(cast("Sequence[Plan]", plans))
    kind = type(plan).__name__
    raise ImageTypeError(f"the first argument must be a Plan or a list of Plans, got {kind}")


def _plan_per_picture(plan: object, plans: list[Plan], count: int) -> list[Plan]:
    """Return one plan for each of `count` pictures; a single `plan` is for all of them.

    Raises:
        ImageError: the number of plans is not that of the pictures.
    """
    if isinstance(plan, Plan):
        return plans * count
    if len(plans) != count:
        raise ImageError(f"{len(plans)} plans for {count} pictures: give one plan for each")
    return plans


def _check_sizes(plans: list[Plan], size: Size) -> None:
    for i, plan in enumerate(plans):
        if plan.size == size:
            continue
        position = f" (plan {i})" if len(plans) > 1 else ""
        planned_size = f"the plan{position} was made for {size_text(plan.size)}"
        actual_size = f"but the picture is {size_text(size)}"
        raise ImageError(f"{planned_size} {actual_size}; plan again with Scene(size={size})")


def _apply_list(
    argument: object, plans: list[Plan], images: Sequence[Any], inplace: bool
) -> list[Any]:
    """Apply one plan to each picture of a list; with `inplace`, check all before changing any."""
    plans = _plan_per_picture(argument, plans, len(images))
    for i, image in enumerate(images):
        _check_item(image, i)
    if inplace:
        _check_list_writable(plans, images)
    return [apply(plan, image, inplace=inplace) for plan, image in zip(plans, images, strict=True)]


def _check_item(image: Any, index: int) -> None:
    advice = "a list holds single pictures; give a batch on its own, with one plan for each picture"
    if isinstance(image, list | tuple):
        raise ImageError(f"item {index} of the list is itself a list; {advice}")
    if isinstance(image, Image.Image):
        return
    find_backend(image)
    if len(image.shape) > 3:
        raise ImageError(f"item {index} of the list has shape {list(image.shape)}; {advice}")


def _check_list_writable(plans: list[Plan], images: Sequence[Any]) -> None:
    """Check that all pictures of a list, of any backends, can be written into.

    Raises:
        ParameterError: a picture cannot, or is in the list twice.
    """
    addresses: set[int] = set()
    for i, (plan, image) in enumerate(zip(plans, images, strict=True)):
        if isinstance(image, Image.Image):
            raise ParameterError(_NO_PIL)
        backend = find_backend(image)
        backend.check(image)
        _check_sizes([plan], backend.size(image))
        backend.check_writable(image)
        check_keeps_size([plan])
        address = backend.address(image)
        if address in addresses:
            raise ParameterError(f"inplace=True: picture {i} is in the list twice; pass a copy")
        addresses.add(address)
    check_drawings(plans)


def _apply_pil(plans: list[Plan], image: Image.Image, inplace: bool) -> Image.Image:
    if image.mode != "RGB":
        raise ImageTypeError(f"PIL image has mode {image.mode!r}; use image.convert('RGB')")
    if inplace:
        raise ParameterError(_NO_PIL)
    _check_upright(image)
    try:
        image.load()
    # Pillow decodes an opened file only now, and its decoders may raise any exception.
    except Exception as error:
        raise ImageError(f"the PIL image cannot be decoded: {error}") from error
    plans = _plan_per_picture(plans, plans, 1)
    _check_sizes(plans, (image.height, image.width))
    (plan,) = plans
    stamps = _small_stamps(plan)
    if stamps is None:
        return Image.fromarray(apply(plan, np.asarray(image)))
    result = image.copy()
    result.info = {}
    for sprite, x, y in stamps:
        height, width = sprite.size
        part = np.array(result.crop((x, y, x + width, y + height)))
        paste(part, [Stamp(sprite, _ZERO, _ZERO)])
        result.paste(Image.fromarray(part), (x, y))
    return result


_ZERO = np.zeros(1, np.int32)


def _small_stamps(plan: Plan) -> list[tuple[Sprite, int, int]] | None:
    """Return what a plan pastes, sprites and corners, in order, if that is little.

    Then it is drawn on parts of a PIL image, because converting a whole one to an array and back
    takes many times as long. Otherwise, and if a plan resizes, the result is `None`.
    """
    if not all(isinstance(op, Paste) for op in plan.ops):
        return None
    stamps: list[tuple[Sprite, int, int]] = []
    pixels = 0
    for i in range(len(plan.ops)):
        for stamp in plan_stamps(plan, i, plan.size):
            pixels += len(stamp.xs) * (prod(stamp.sprite.size) + PIXELS_PER_PART)
            corners = zip(stamp.xs.tolist(), stamp.ys.tolist(), strict=True)
            stamps += [(stamp.sprite, x, y) for x, y in corners]
    return stamps if 2 * pixels < prod(plan.size) else None


def _check_upright(image: Image.Image) -> None:
    """Check that no EXIF orientation turns a picture, because the result would lose that tag.

    Raises:
        ImageError: the picture has an EXIF orientation that turns it.
    """
    try:
        orientation = image.getexif().get(ExifTags.Base.Orientation, 1)
    except Exception:  # noqa: BLE001  (some formats are decoded here, and may raise anything)
        return  # damaged EXIF data turns nothing; damaged pixels are found when they are decoded
    if orientation in range(2, 9):
        raise ImageError(
            f"the PIL image has EXIF orientation {orientation}, so viewers and models see it turned"
            " while its pixels and labels are not; use PIL.ImageOps.exif_transpose(image)"
        )
