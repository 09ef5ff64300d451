"""Waiting for a state, not for a time: the limit is for what never comes, on a machine that is
busy, too."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import pytest

Found = TypeVar("Found")
PATIENCE = 90.0


def until(condition: Callable[[], Found], what: str = "it", *, pause: float = 0.05) -> Found:
    """The first true value of `condition`; fails the test where none comes."""
    end = time.monotonic() + PATIENCE
    while not (result := condition()):
        if time.monotonic() > end:
            pytest.fail(f"waited {PATIENCE:.0f} s in vain for {what}")
        time.sleep(pause)
    return result


def still(look: Callable[[], Any], quiet: float = 0.3) -> Any:
    """What `look` shows, a picture, once it has not changed for `quiet` seconds."""
    end = time.monotonic() + PATIENCE
    before, since = look(), time.monotonic()
    while time.monotonic() - since < quiet:
        if time.monotonic() > end:
            pytest.fail(f"waited {PATIENCE:.0f} s in vain for a screen that stands still")
        time.sleep(quiet / 4)
        now = look()
        if not np.array_equal(before, now):
            before, since = now, time.monotonic()
    return before
