"""Wait until a screen has settled, and read its accessibility tree meanwhile."""

import time
from dataclasses import dataclass

import numpy as np

from hijack_data.errors import ParameterError
from hijack_data.types import UInt8Array

from ..desktops.protocol import Desktop


@dataclass(frozen=True)
class Settle:
    """When a screen counts as settled; all values are in seconds.

    Args:
        quiet: The screen has not changed for this long, 0..60 (a blinking cursor changes after
            0.4 s at the earliest).
        cap: Or this has passed, 0..600; 0 takes a single screenshot.
        look: The pause between two screenshots, above 0 and at most 10.

    Raises:
        ParameterError: A value is out of range.
    """

    quiet: float = 0.3
    cap: float = 3.0
    look: float = 0.05

    def __post_init__(self) -> None:
        if not (0 <= self.quiet <= 60 and 0 <= self.cap <= 600 and 0 < self.look <= 10):
            raise ParameterError(
                f"quiet is 0..60 s, cap 0..600 s, look above 0 and at most 10 s, got {self}"
            )


@dataclass(frozen=True, kw_only=True)
class Settled:
    """A settled screen, and its accessibility tree, which was read after the last change.

    Args:
        frame: The screenshot, uint8 RGB `[H, W, 3]`.
        tree: The tree as XML, or `None` if it was not asked for.
        in_time: Whether the screen settled before `Settle.cap`.
        tree_seconds: How long reading trees took.
    """

    frame: UInt8Array
    tree: str | None
    in_time: bool
    tree_seconds: float = 0.0


def wait_until_settled(desktop: Desktop, rule: Settle, with_tree: bool) -> Settled:
    """Take screenshots until nothing changes any more.

    Args:
        desktop: The machine.
        rule: When the screen counts as settled.
        with_tree: Whether to read the tree as well; it is the tree of the returned screen.

    Raises:
        DesktopError: The desktop fails.
    """
    watch = _Watch(desktop)
    while True:
        quiet_for = time.monotonic() - watch.changed
        if with_tree and watch.tree is None and quiet_for >= rule.quiet / 2:
            watch.read_tree()
        if rule.cap:
            watch.look()
        now = time.monotonic()
        has_tree = watch.tree is not None or not with_tree
        settled = now - watch.changed >= rule.quiet and has_tree
        if settled or now - watch.start >= rule.cap:
            break
        time.sleep(rule.look)
    if not has_tree:
        watch.read_tree()
        watch.frame = desktop.screenshot()
    return Settled(
        frame=watch.frame,
        tree=watch.tree,
        in_time=settled,
        tree_seconds=round(watch.tree_seconds, 4),
    )


class _Watch:
    """The latest screenshot, the time of the last change, and the tree if it was read."""

    def __init__(self, desktop: Desktop) -> None:
        self.start = time.monotonic()
        self.changed = self.start
        self.tree: str | None = None
        self.tree_seconds = 0.0
        self._desktop = desktop
        self.frame = desktop.screenshot()

    def look(self) -> None:
        """Take a screenshot; a tree of another screen is dropped."""
        frame = self._desktop.screenshot()
        now = time.monotonic()
        if not _equal(self.frame, frame):
            self.changed = now
            self.tree = None
        self.frame = frame

    def read_tree(self) -> None:
        start = time.monotonic()
        self.tree = self._desktop.accessibility()
        self.tree_seconds += time.monotonic() - start


def _equal(first: UInt8Array, second: UInt8Array) -> bool:
    return first.shape == second.shape and np.array_equal(first, second)
