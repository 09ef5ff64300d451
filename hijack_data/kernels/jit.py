"""Numba, where it is installed: when it is used, and how the kernels of this folder are compiled with it."""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any, cast

START = 600.0  # milliseconds that Numba and the kernels take to load, once in a process
_forgone = 0.0  # milliseconds that kernels would have saved so far


def worthwhile(milliseconds: float) -> bool:
    """Tell whether to run a kernel that saves so much: from when loading Numba would have paid off.

    A command that corrupts a few pictures is done before Numba would have been loaded; a training run soon loads it.
    """
    global _forgone
    if _forgone < START:
        _forgone += milliseconds
        return False
    return available()


def start() -> None:
    """Use kernels from now on, where there are any, however few pictures there will be."""
    global _forgone
    _forgone = START


@cache
def available() -> bool:
    """Tell whether Numba can be used; the first call imports it."""
    try:
        importlib.import_module("numba")
    except ImportError:  # absent, or too old for this NumPy
        return False
    return True


def compile_now(njit: Any, function: Callable[..., Any], signature: object) -> Callable[..., Any]:
    """Compile for one signature, or load that from Numba's cache on disk. The kernel runs without Python's lock."""
    try:
        compiled = njit(signature, nogil=True, cache=True)(function)
    except RuntimeError:  # no folder is writable: do without the cache
        compiled = njit(signature, nogil=True)(function)
    return cast(Callable[..., Any], compiled)
