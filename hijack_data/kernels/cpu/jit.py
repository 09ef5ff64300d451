"""Decide when to use Numba, if it is installed, and compile the kernels of this folder.

Numba is imported and each kernel compiled (or loaded from Numba's cache on disk) when the kernel is
first needed: once the time saved so far would have paid for it, or at the first picture after
`start()`. If importing, compiling or the first call fails, one `HijackWarning` names the cause, and
this process continues with the plain NumPy kernels, which give the same bytes.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import _lru_cache_wrapper, cache  # pyright: ignore[reportPrivateUsage]
from importlib import import_module
from typing import Any, TypeVar, cast

from ... import extras
from ...errors import HijackError, HijackWarning

T = TypeVar("T")

NUMBA_LOADING_MS = 600.0  # milliseconds that Numba and the kernels take to load, once in a process


@dataclass
class _State:
    """`forgone`: milliseconds that Numba would have saved; `failed`: whether it broke here."""

    forgone: float = 0.0
    failed: bool = False


_state = _State()


def worthwhile(milliseconds: float) -> bool:
    """Return whether to use a compiled kernel, which would save this many milliseconds.

    Using it is worthwhile once the time that it would have saved so far exceeds the time for
    loading Numba. A command that corrupts a few pictures ends before that; a training run soon gets
    there.
    """
    if _state.forgone < NUMBA_LOADING_MS:
        _state.forgone += milliseconds
        return False
    return available()


def start() -> None:
    """Use compiled kernels from the next picture on, whether or not the loading time pays off."""
    _state.forgone = NUMBA_LOADING_MS


def available() -> bool:
    """Return whether Numba can be used; the first call imports it."""
    return not _state.failed and _importable()


@cache
def _importable() -> bool:
    try:
        import_module("numba")
    except ModuleNotFoundError as error:
        if error.name != "numba":
            give_up(error)
        return False
    except Exception as error:  # noqa: BLE001 (too old for this NumPy, or a damaged installation)
        give_up(error)
        return False
    return True


def give_up(error: Exception) -> None:
    """Stop using Numba in this process, and warn about it once."""
    if _state.failed:
        return
    _state.failed = True
    cause = f"{type(error).__name__}: {error}"
    remedy = f"install the versions that are tested together: {extras.remedy('fast')}"
    message = (
        f"Numba failed ({cause}), so pictures are drawn by the plain NumPy kernels from now on,"
        f" with the same bytes but more slowly; {remedy}; or uninstall numba"
    )
    warnings.warn(message, HijackWarning, stacklevel=3)


def call_with_fallback(compiled: Callable[[], T], plain: Callable[[], T]) -> T:
    """Return the result of a compiled kernel, or of the plain one if Numba fails.

    Errors of this library (a picture of the wrong shape, for example) are raised unchanged.
    """
    try:
        return compiled()
    except HijackError:
        raise
    except Exception as error:  # noqa: BLE001 (Numba and LLVM may raise anything)
        give_up(error)
    return plain()


def compiled_on_first_use(what: str) -> Callable[[Callable[[Any], T]], "_lru_cache_wrapper[T]"]:
    """Decorate a function that compiles a kernel, so that it runs once, on first use.

    The function takes the module `numba` and returns the kernel. The decorated function takes no
    arguments, returns the kernel, and raises `MissingDependencyError` without Numba.

    Args:
        what: the name of the kernel in that error.
    """

    def decorate(build: Callable[[Any], T]) -> "_lru_cache_wrapper[T]":
        @cache
        def kernel() -> T:
            if not available():
                raise extras.missing(f"{what} needs Numba", "fast")
            return build(import_module("numba"))

        return kernel

    return decorate


def compile_now(njit: Any, function: Callable[..., Any], signature: object) -> Callable[..., Any]:
    """Compile a function for one signature, or load it from Numba's cache on disk.

    The kernel runs without holding Python's global lock.
    """
    try:
        compiled = njit(signature, nogil=True, cache=True)(function)
    except RuntimeError:  # no folder is writable: compile without the cache
        compiled = njit(signature, nogil=True)(function)
    return cast(Callable[..., Any], compiled)
