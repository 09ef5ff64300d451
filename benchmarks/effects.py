"""The time of each effect on the embedded desktop: apply, probe, undo.

Chromium is in front of Mousepad. `gnome.py` measures the same on a machine with GNOME.
"""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

from common import cell, machine, table

from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.effects import perform
from online_env.embedded.desktop import EmbeddedDesktop

RUNS = 7
EFFECTS = {
    "launch_app (Geany for vscode)": Effect(
        "launch_app", {"app": "vscode", "then": [], "tile": True}
    ),
    "launch_app (VLC)": Effect("launch_app", {"app": "vlc", "then": [], "tile": True}),
    "touch": Effect("touch", {"boxes": [], "without_app": True}),
    "minimise": Effect("minimise"),
    "firewall": Effect("firewall", {"allow": []}),
    "lock": Effect("lock"),
}


@contextlib.contextmanager
def embedded_windows() -> Iterator[Any]:
    """Yield an embedded desktop with two windows."""
    with EmbeddedDesktop.up(apps=("browser", "editor")) as desktop:
        desktop.execute(["wmctrl", "-a", "Chromium"])
        time.sleep(3)
        yield desktop


def close_what_a_touch_opened(desktop: Any) -> None:
    """Close a menu or dialog, and bring the page back."""
    desktop.run(
        "pyautogui.press('esc'); pyautogui.hotkey('ctrl', 'l'); pyautogui.write('search.test\\n')"
    )
    time.sleep(1.5)


def main(
    open_desktop: Callable[[], AbstractContextManager[Any]] = embedded_windows,
    clean_up: Callable[[Any], None] = close_what_a_touch_opened,
) -> None:
    """Print the table.

    Args:
        open_desktop: returns a context manager that yields a desktop with two windows.
        clean_up: called after each touch.
    """
    entries: dict[str, list[list[float]]] = {name: [[], [], []] for name in EFFECTS}
    bad: list[str] = []
    with open_desktop() as desktop:
        for run in range(RUNS + 1):
            for name, effect in EFFECTS.items():
                bad += measure(desktop, effect, run, entries[name] if run else [[], [], []])
                if effect.kind == "touch":
                    clean_up(desktop)
    rows = [
        [name, *map(cell, times), cell([a + p for a, p in zip(*times[:2], strict=True)])]
        for name, times in entries.items()
    ]
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    print(
        f"1080p, milliseconds, min / median / max of {RUNS}, after one more; load"
        f" {load}.\n\n{machine()}\n"
    )
    print(table(["effect", "apply", "probe", "undo", "apply + probe"], rows))
    print(
        f"\n{len(bad)} of {(RUNS + 1) * len(EFFECTS)} failed{': ' if bad else ''}{'; '.join(bad)}"
    )


def measure(desktop: Any, effect: Effect, run: int, into: list[list[float]]) -> list[str]:
    """Do it once and note how long each part took; returns what went wrong."""
    marks = [time.perf_counter()]
    applied = perform(effect, desktop, Stream(run, "benchmark"))
    marks.append(time.perf_counter())
    probe = applied.probe()
    marks.append(time.perf_counter())
    undone = applied.undo()
    marks.append(time.perf_counter())
    for times, start, end in zip(into, marks, marks[1:], strict=False):
        times.append((end - start) * 1e3)
    return [f"{effect.kind}: {result.problem}" for result in (probe, undone) if not result.ok]


if __name__ == "__main__":
    main()
