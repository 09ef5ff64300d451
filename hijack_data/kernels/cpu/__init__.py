"""Kernels for pictures in this process's memory: NumPy and Pillow, or Numba where it is faster."""
