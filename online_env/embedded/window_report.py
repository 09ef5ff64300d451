"""Reports which windows of a new desktop have appeared.

Runs in a process of its own, so that Xlib stays out of process 1.
"""

import os
import time
from collections.abc import Iterable

MANAGER = "window-manager"
SETTINGS = "settings-daemon"
POLL_S = 0.01


def report(descriptor: int, names: Iterable[str]) -> None:
    """Write a line to `descriptor` for each of `names` once it is there.

    Ends after the last one; the parent kills it when its timeout ends.

    Args:
        descriptor: where to write.
        names: WM_CLASS names in lower case, `MANAGER` or `SETTINGS`.
    """
    from .guest.inside.ewmh import Screen

    screen = Screen.open()
    missing = set(names)
    while missing:
        mapped = _mapped_names(screen)
        if screen.has_manager():
            mapped.add(MANAGER)
        if SETTINGS in missing and screen.has_settings():
            mapped.add(SETTINGS)
        for name in mapped & missing:
            os.write(descriptor, f"{name}\n".encode())
        missing -= mapped
        time.sleep(POLL_S)


def _mapped_names(screen) -> set[str]:  # type: ignore[no-untyped-def]
    from .guest.inside.ewmh import GONE

    names: set[str] = set()
    for number in screen.numbers(screen.root, "_NET_CLIENT_LIST"):
        window = screen.window(number)
        try:
            if screen.is_mapped(window):
                names.update(name.lower() for name in window.get_wm_class() or ())
        except GONE:
            continue  # closed meanwhile
    return names
