"""Memory between two pages that may not be touched, and a process of its own to use it in."""

import ctypes
import mmap
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


def guarded(pages: int) -> np.ndarray:
    """`pages` pages of memory, uint8; reading or writing a byte before or after them ends the
    process."""
    page = mmap.PAGESIZE
    memory = np.frombuffer(mmap.mmap(-1, (pages + 2) * page), np.uint8)
    for at in (0, (pages + 1) * page):
        assert (
            ctypes.CDLL(None).mprotect(
                ctypes.c_void_p(memory.ctypes.data + at), ctypes.c_size_t(page), 0
            )
            == 0
        )
    return memory[page:-page]


def run(code: str, cache: Path) -> str:
    """Run `code` in a new process in which warnings are errors and Numba caches in `cache`; return
    what it prints."""
    environment = {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(
        command, env=environment, check=True, capture_output=True, text=True
    ).stdout
