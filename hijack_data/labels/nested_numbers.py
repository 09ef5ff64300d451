"""Take numbers out of lists, tuples, arrays and tensors, and put them back in the same form."""

from collections.abc import Callable, Iterator
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from ..errors import LabelError, short_repr
from ..sample_pictures import is_object_array, is_plain, rebuilt

Numbers: TypeAlias = npt.NDArray[Any]
NumberMap: TypeAlias = Callable[[Numbers], Numbers]


def to_host(value: Any) -> Any:
    """Return a tensor of any device as a NumPy array; any other value is returned unchanged."""
    detach = getattr(value, "detach", None)
    if detach is None:
        return value
    tensor = detach().cpu()
    try:
        return tensor.numpy()
    except TypeError:  # bfloat16, which NumPy does not have, and float32 holds exactly
        return tensor.float().numpy()


def host_array(value: Any) -> Numbers:
    """Return a value as a NumPy array; bfloat16 of JAX becomes float32.

    Raises:
        Exception: NumPy or torch cannot convert the value.
    """
    array: Numbers = np.asarray(to_host(value))
    if array.dtype.kind == "V" and array.dtype.names is None:
        return array.astype(np.float32)
    return array


def change_groups(value: Any, width: int, change: NumberMap) -> Any:
    """Apply `change` to all groups of `width` numbers in a value, and return a value of its form.

    Args:
        value: an array or tensor `[..., width]`, a flat one `[k * width]`, or lists and tuples of
            numbers or of such values, of different lengths too; `None` stays.
        width: how many numbers belong together, such as 4 for a box.
        change: takes int64 or float64 `[N, width]`, returns the same shape. A group with any
            fractional number is passed as float64.

    Raises:
        LabelError: the value does not hold such groups, or the new numbers do not fit its dtype.
    """
    if value is None:
        return None
    if is_object_array(value):
        return object_array(value, change_groups(value.tolist(), width, change))
    array = as_numbers(value)
    if array is None:
        parts = [change_groups(part, width, change) for part in value]
        return rebuilt(value, parts)
    if not array.size:
        return value
    new_groups = change(_as_groups(value, array, width))
    return put_back(value, new_groups.reshape(array.shape))


def read_groups(value: Any, width: int) -> Iterator[Numbers]:
    """Yield all groups of `width` numbers in a value, int64 or float64 `[N, width]`.

    The arguments, and what is raised, are those of `change_groups`.
    """
    if value is None:
        return
    if is_object_array(value):
        yield from read_groups(value.tolist(), width)
        return
    array = as_numbers(value)
    if array is None:
        for part in value:
            yield from read_groups(part, width)
    elif array.size:
        yield _as_groups(value, array, width)


def _as_groups(value: Any, array: Numbers, width: int) -> Numbers:
    is_flat = array.ndim == 1 and array.size % width == 0
    if not is_flat and (array.ndim == 0 or array.shape[-1] != width):
        raise LabelError(f"must hold groups of {width} numbers, got {short_repr(value)}")
    return _widest(array).reshape(-1, width)


def change_each(value: Any, change: NumberMap) -> Any:
    """Apply `change` to each number of a value, which may be a single number.

    The arguments are those of `change_groups`.

    Raises:
        LabelError: the value holds no numbers, or the new numbers do not fit its dtype.
    """
    if value is None:
        return None
    if is_object_array(value):
        return object_array(value, change_each(value.tolist(), change))
    array = as_numbers(value)
    if array is None:
        return rebuilt(value, [change_each(part, change) for part in value])
    if not array.size:
        return value
    new_numbers = change(_widest(array).reshape(-1))
    return put_back(value, new_numbers.reshape(array.shape))


def object_array(original: Any, parts: list[Any]) -> Any:
    """Return the parts of an object array as one of the same shape."""
    array = np.empty(original.shape, object)
    if original.ndim == 1:
        for index, part in enumerate(parts):
            array[index] = part
    elif original.size:
        array[...] = parts
    return array


def as_numbers(value: Any) -> Numbers | None:
    """Return the numbers of a value as one array.

    Returns `None` for a sequence whose items differ in length or contain `None`.

    Raises:
        LabelError: the value has no numbers, or some are not finite.
    """
    try:
        array = host_array(value)
    # ragged, or tensors that NumPy cannot take
    except (TypeError, ValueError, OverflowError, RuntimeError):
        array = np.empty(0, object)
    if array.dtype.kind in "iuf":
        if not np.isfinite(array).all():
            raise LabelError(f"must hold finite numbers, got {short_repr(value)}")
        return array
    if array.dtype.kind == "O" and isinstance(value, list | tuple):
        return None
    raise LabelError(f"must hold numbers, got {short_repr(value)} ({type(value).__name__})")


def put_back(original: Any, numbers: Numbers) -> Any:
    """Return numbers in the form of `original`: lists, tuples, an array, a tensor or a scalar."""
    if hasattr(original, "new_tensor"):
        tensor = original.new_tensor(numbers)
        _check_fit(numbers, to_host(tensor), original.dtype)
        return tensor
    if isinstance(original, np.ndarray):
        dtype: Any = cast(Any, original).dtype
        array = numbers.astype(dtype)
        _check_fit(numbers, array, dtype)
        return array
    if isinstance(original, np.generic):
        return _like_scalar(cast(Any, original).dtype, numbers)
    if hasattr(original, "__array_namespace__"):  # JAX
        namespace = original.__array_namespace__()
        array = namespace.asarray(numbers, dtype=original.dtype)
        _check_fit(numbers, np.asarray(array), original.dtype)
        return array
    if isinstance(original, list | tuple):
        sequence = cast("list[Any]", original)
        if is_plain(sequence):
            return _like_nested(sequence, numbers.tolist())
        pairs = zip(sequence, numbers, strict=True)
        return rebuilt(sequence, [put_back(old, new) for old, new in pairs])
    return numbers.item()


def _like_nested(original: Any, numbers: list[Any]) -> Any:
    """Return nested lists of numbers as lists and tuples like those of `original`."""
    if set(map(type, original)) & {list, tuple}:
        pairs = zip(original, numbers, strict=True)
        numbers = [_like_nested(old, new) for old, new in pairs]
    return tuple(numbers) if type(original) is tuple else numbers


def _like_scalar(dtype: Any, numbers: Numbers) -> Any:
    if dtype.kind != numbers.dtype.kind:
        return numbers[()]
    number = numbers.astype(dtype)
    _check_fit(numbers, number, dtype)
    return number[()]


def _check_fit(expected: Numbers, stored: Numbers, dtype: object) -> None:
    if stored.dtype.kind not in "fV" and not np.array_equal(expected, stored):
        raise LabelError(f"no longer fits its dtype {dtype}; give the label as int64 or a float")


def _widest(array: Numbers) -> Numbers:
    widest = np.float64 if array.dtype.kind == "f" else np.int64
    return array.astype(widest)
