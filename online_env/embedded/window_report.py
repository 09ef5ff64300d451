"""Reports which windows of a new desktop have appeared.

Runs in a process of its own, so that Xlib stays out of process 1.
"""

import os
import time
from collections.abc import Iterable

MANAGER = "window-manager"
SETTINGS = "settings-daemon"
POLL_S = 0.01


def report(descriptor: int, wanted: Iterable[str]) -> None:
    """Write a line to `descriptor` for each of `wanted` once it is there.

    Ends after the last one; the parent kills it when its timeout ends.

    Args:
        descriptor: where to write.
        wanted: WM_CLASS names in lower case, `MANAGER` or `SETTINGS`.
    """
    from .guest.inside.ewmh import Screen

    screen = Screen.open()
    left = set(wanted)
    while left:
        found = _mapped_names(screen)
        if screen.has_manager():
            found.add(MANAGER)
        if SETTINGS in left and screen.has_settings():
            found.add(SETTINGS)
        for name in found & left:
            os.write(descriptor, f"{name}\n".encode())
        left -= found
        time.sleep(POLL_S)


def _mapped_names(screen) -> set[str]:  # type: ignore[no-untyped-def]
    from .guest.inside.ewmh import GONE

    found: set[str] = set()
    for number in screen.numbers(screen.root, "_NET_CLIENT_LIST"):
        window = screen.window(number)
        try:
            if screen.is_mapped(window):
                found.update(name.lower() for name in window.get_wm_class() or ())
        except GONE:
            continue  # closed meanwhile
    return found
