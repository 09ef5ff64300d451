"""The time of each effect on a machine with GNOME over OSWorld's routes: apply, probe, undo.

gedit is in front of GNOME Terminal. `tests/support/gnome_machine.py` says how to install it.
"""

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import effects

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from support import gnome_machine  # pyright: ignore[reportMissingImports]


@contextlib.contextmanager
def gnome_windows() -> Iterator[Any]:
    """Yield a machine with GNOME and two windows."""
    start = time.perf_counter()
    with gnome_machine.gnome() as desktop:
        print(f"GNOME can be used {time.perf_counter() - start:.1f} s after its start.")
        for program in ("gnome-terminal", "gedit"):
            desktop.launch([program])
            time.sleep(4)
        yield desktop


def close_what_a_touch_opened(desktop: Any) -> None:
    """Close a menu or dialog."""
    desktop.run("pyautogui.press('esc')")
    time.sleep(1)


def main() -> None:
    """Print the table, or why there is none."""
    reason = gnome_machine.lack()
    if reason:
        print(f"Not measured: {reason}")
        return
    effects.main(gnome_windows, close_what_a_touch_opened)


if __name__ == "__main__":
    main()
