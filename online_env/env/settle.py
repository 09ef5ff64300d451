"""Waiting until a screen has settled, and reading its accessibility tree meanwhile."""

import time
from dataclasses import dataclass

import numpy as np

from hijack_data.errors import ParameterError
from hijack_data.types import UInt8Array

from ..desktops.protocol import Desktop


@dataclass(frozen=True)
class Settle:
    """When a screen counts as settled, in seconds.

    Args:
        quiet: it has not changed for so long (a blinking cursor changes after 0.4 s at the earliest).
        cap: or this has passed; 0 looks once.
        look: between two looks.
    """

    quiet: float = 0.3
    cap: float = 3.0
    look: float = 0.05

    def __post_init__(self) -> None:
        if not (0 <= self.quiet <= 60 and 0 <= self.cap <= 600 and 0 < self.look <= 10):
            raise ParameterError(f"quiet is 0..60 s, cap 0..600 s, look above 0 and at most 10 s, got {self}")


@dataclass(frozen=True)
class Settled:
    """A screen, uint8 RGB `[H, W, 3]`, and its tree, which is not older; `still` where it had settled in time."""

    frame: UInt8Array
    tree: str | None
    still: bool
    tree_seconds: float = 0.0


def wait_until_settled(desktop: Desktop, rule: Settle, with_tree: bool) -> Settled:
    """Look until nothing changes any more; with `with_tree` the tree is of the screen that is returned.

    Raises `DesktopError` where the desktop does not answer.
    """
    start = since = time.monotonic()
    frame, tree, spent = desktop.screenshot(), None, 0.0
    while True:
        if with_tree and tree is None and time.monotonic() - since >= rule.quiet / 2:
            began = time.monotonic()
            tree = desktop.accessibility()
            spent += time.monotonic() - began
        last, frame = frame, desktop.screenshot() if rule.cap else frame
        now = time.monotonic()
        if last is not frame and _differ(last, frame):
            since, tree = now, None
        still = now - since >= rule.quiet and (tree is not None or not with_tree)
        if still or now - start >= rule.cap:
            break
        time.sleep(rule.look)
    if with_tree and tree is None:
        began = time.monotonic()
        tree, frame = desktop.accessibility(), desktop.screenshot()
        spent += time.monotonic() - began
    return Settled(frame, tree, still, round(spent, 4))


def _differ(one: UInt8Array, other: UInt8Array) -> bool:
    return one.shape != other.shape or not np.array_equal(one, other)
