"""JAX arrays: uint8 `[..., H, W, 3]`; immutable, so every operation returns a new array.

On the CPU, the NumPy backend works on the array's memory, and JAX takes over the result, both
without a copy. Other devices and traced code run compiled programs (`kernels.jax_ops`).
"""

from typing import Any, cast

import jax.numpy
import numpy as np
from jax.core import Tracer

from ..errors import ImageError, ImageTypeError, ParameterError
from ..kernels import Stamp, jax_ops
from ..plan import Plan
from ..types import Size, UInt8Array
from . import numpy as host_backend
from .base import Backend

_jnp = cast(Any, jax.numpy)  # JAX leaves many types unknown


class JaxBackend(Backend):
    """JAX arrays."""

    name = "jax"
    mutable = False
    to_uint8 = "(image * 255).round().clip(0, 255).astype(jnp.uint8)"

    @property
    def module(self) -> Any:
        """The module `jax.numpy`."""
        return _jnp

    def check_memory(self, image: Any) -> None:
        """Check that the memory of an array is still there.

        Raises:
            ImageError: it was deleted, or donated to a program.
        """
        if not _is_traced(image) and image.is_deleted():
            advice = "use the array that the program returned"
            raise ImageError(f"the JAX array was deleted, or donated to a program; {advice}")

    def check_writable(self, image: Any) -> None:
        """JAX arrays cannot be written into.

        Raises:
            ParameterError: always.
        """
        message = "inplace=True: JAX arrays cannot be written into; use the returned array"
        raise ParameterError(message)

    def from_numpy(self, image: UInt8Array) -> Any:
        """Return a NumPy picture as a JAX array `[H, W, 3]`."""
        return _jnp.asarray(image)

    def to_numpy(self, image: Any) -> UInt8Array:
        """Return one picture as a NumPy array `[H, W, 3]`.

        Raises:
            ImageTypeError: the array is traced.
        """
        if _is_traced(image):
            advice = "call this outside, or apply packed plans inside (hijack_data.jax_plans)"
            raise ImageTypeError(f"inside jax.jit a picture has no pixels yet; {advice}")
        return np.asarray(image)

    def paste(self, image: Any, stamps: list[Stamp]) -> Any:
        """Stamp sprites, in order; return a new array."""
        return jax_ops.paste(image, stamps)

    def resample(self, image: Any, size: Size) -> Any:
        """Return a new picture of `size`, (height, width)."""
        return jax_ops.resample(image, size)

    def apply_many(
        self, plans: list[Plan], images: Any, lead: tuple[int, ...], *, inplace: bool = False
    ) -> Any:
        """See `Backend.apply_many`; the NumPy backend runs plans for arrays on the CPU."""
        memory = _on_host(images)
        if memory is None:
            return super().apply_many(plans, images, lead, inplace=inplace)
        result: Any = host_backend.BACKEND.apply_many(plans, memory, lead)
        if isinstance(result, list):
            return [_jnp.from_dlpack(single) for single in cast("list[Any]", result)]
        # JAX takes over this memory, which nothing else writes into.
        return _jnp.from_dlpack(result)


def _is_traced(image: Any) -> bool:
    """Return whether an array is a placeholder without values, as inside `jax.jit`."""
    return isinstance(image, Tracer)


def _on_host(image: Any) -> UInt8Array | None:
    """Return the memory of an array on the CPU, read-only.

    Returns `None` for an array that is on another device, sharded or traced.
    """
    if _is_traced(image) or len(image.devices()) != 1:
        return None
    device = next(iter(image.devices()))
    return np.asarray(image) if device.platform == "cpu" else None


BACKEND = JaxBackend()
