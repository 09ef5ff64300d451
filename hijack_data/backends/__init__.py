"""Array frameworks: one object for each, with all operations of the library on its arrays.

`find_backend` finds the backend of an array. A framework is looked up among the modules already
imported (a caller with a tensor has imported torch), and the module of its backend is imported when
its first array arrives.
"""

import sys
from functools import cache
from importlib import import_module
from typing import Any, cast

import numpy as np
from PIL import Image

from .. import extras
from ..choices import BACKENDS
from ..errors import ImageTypeError, UnknownNameError, short_repr, suggest
from .base import Backend

__all__ = ["Backend", "convert", "find_backend", "to_numpy"]


def find_backend(image: object) -> Backend:
    """Return the backend of an array.

    Raises:
        ImageTypeError: `image` is not an array of NumPy, torch or JAX.
    """
    if isinstance(image, np.ndarray):
        return _backend("numpy")
    torch = cast(Any, sys.modules.get("torch"))
    if torch is not None and isinstance(image, torch.Tensor):
        return _backend("torch")
    jax = cast(Any, sys.modules.get("jax"))
    if jax is not None and isinstance(image, jax.Array):
        return _backend("jax")
    if isinstance(image, Image.Image):
        advice = "give np.asarray(picture), or make a plan and call hijack_data.apply"
        raise ImageTypeError(f"got a PIL image where an array is needed; {advice}")
    kind = type(image)
    remedy = "give a NumPy array, torch tensor, JAX array or PIL image"
    raise ImageTypeError(f"cannot corrupt a {kind.__module__}.{kind.__qualname__}; {remedy}")


@cache
def _backend(name: str) -> Backend:
    """Return the backend with a name; its file imports the framework."""
    return import_module(f".{name}", __name__).BACKEND


def convert(image: np.ndarray[Any, Any], name: str) -> Any:
    """Return a NumPy picture `[H, W, 3]` as an array of the named framework, in its layout.

    Raises:
        UnknownNameError: `name` is not in `choices.BACKENDS`.
        MissingDependencyError: the framework is not installed.
    """
    if not isinstance(cast(object, name), str) or name not in BACKENDS:
        raise UnknownNameError(f"unknown backend {short_repr(name)}{suggest(name, BACKENDS)}")
    try:
        backend = _backend(name)
    except ImportError:
        problem = extras.missing(f"backend {name!r} is not installed", name)
        raise problem from None
    return backend.from_numpy(image)


def to_numpy(image: Any) -> np.ndarray[Any, Any]:
    """Return one picture of any framework as a NumPy array `[H, W, 3]`.

    Raises:
        ImageTypeError: `image` is not an array of NumPy, torch or JAX, or JAX is tracing it.
    """
    return find_backend(image).to_numpy(image)
