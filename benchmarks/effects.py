"""The time of each effect on the embedded desktop: apply, probe, undo.

Chromium is in front of Mousepad. With `--gnome` on a machine with GNOME over OSWorld's routes, with gedit
in front of GNOME Terminal (`tests/support/gnome_machine.py` says how to install it).
"""

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from common import cell, machine, table

from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.effects import perform
from online_env.embedded.desktop import EmbeddedDesktop

GNOME = "--gnome" in sys.argv
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
def desktop_with_windows() -> Iterator[Any]:
    """Yield the desktop with two windows."""
    if not GNOME:
        with EmbeddedDesktop.up(apps=("browser", "editor")) as desktop:
            desktop.execute(["wmctrl", "-a", "Chromium"])
            time.sleep(3)
            yield desktop
        return
    sys.path.append(str(Path(__file__).parents[1] / "tests"))
    from support.gnome_machine import gnome  # pyright: ignore[reportMissingImports]

    start = time.perf_counter()
    with gnome() as desktop:
        print(f"GNOME can be used {time.perf_counter() - start:.1f} s after its start.")
        for program in ("gnome-terminal", "gedit"):
            desktop.launch([program])
            time.sleep(4)
        yield desktop


def main() -> None:
    """Print the table."""
    found: dict[str, list[list[float]]] = {name: [[], [], []] for name in EFFECTS}
    bad: list[str] = []
    with desktop_with_windows() as desktop:
        for run in range(RUNS + 1):
            for name, effect in EFFECTS.items():
                bad += measure(desktop, effect, run, found[name] if run else [[], [], []])
    rows = [
        [name, *map(cell, times), cell([a + p for a, p in zip(*times[:2], strict=True)])]
        for name, times in found.items()
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
    if effect.kind == "touch" and GNOME:
        desktop.run("pyautogui.press('esc')")
        time.sleep(1)
    elif effect.kind == "touch":  # what it opened is closed, and the page is brought back
        desktop.run(
            "pyautogui.press('esc'); pyautogui.hotkey('ctrl', 'l');"
            " pyautogui.write('search.test\\n')"
        )
        time.sleep(1.5)
    return [f"{effect.kind}: {result.problem}" for result in (probe, undone) if not result.ok]


if __name__ == "__main__":
    main()
