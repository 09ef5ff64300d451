"""Pixel kernels: paste, resize and compare, nothing else.

* `stamps` turns a paste of a plan into stamps that lie inside the picture; `rows` writes stamps as
  rows of numbers for the compiled kernels.
* `cpu/` works on pictures in memory (NumPy, Pillow, Numba), `gpu/` on torch pictures on a GPU
  (Triton).
* `torch_ops` and `jax_ops` use the operations of their framework, for every other device.

The arithmetic is the same everywhere: gather, multiply-add in 32-bit integers, shift, clip.
"""

from .stamps import Stamp, at_once, lower, plan_stamps

__all__ = ["Stamp", "at_once", "lower", "plan_stamps"]
