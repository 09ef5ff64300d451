"""How close the nodes of `layer="dom"` come to the drawn picture, and what a step costs with them.

The page's own scrollbars stay on top of the nodes: they are counted apart.

.venv/bin/python benchmarks/browser_layer.py
"""

import os
import statistics
import time

import numpy as np

from hijack_data import Marks, PopUps, Subtitle, apply
from hijack_data.types import Scene
from online_env.browser.miniwob import open_miniwob, task_class
from online_env.environment.settle import wait_until_settled

SIZE = (720, 960)
PAGES = ("enter-text", "click-checkboxes-large", "read-table", "login-user")
CORRUPTIONS = (PopUps(), PopUps(avoid_elements=False), Marks(), Subtitle(fit="shrink"))


def main() -> None:
    print("Load before:", *(f"{value:.1f}" for value in os.getloadavg()))
    print(
        f"\nOver {len(PAGES)} pages of MiniWoB++ and 3 seeds each, on 960x720 pixels, 3 for each CSS pixel.\n"
    )
    print(
        "| corruption | pixels that differ | largest difference of 255 | under a scrollbar | draw, picture and probe, ms | picture alone, ms |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    stage = open_miniwob(SIZE)
    desktop = stage.desktop
    for corruption in CORRUPTIONS:
        differing, largest, covered, drawn_s, plain_s = 0, 0, 0, [], []
        for page in PAGES:
            for seed in range(3):
                stage.reset(task_class(f"miniwob/{page}.html")(seed), seed)
                desktop.evaluate("document.activeElement?.blur()")
                wait_until_settled(desktop, desktop.settle, False)
                plan = corruption.plan(Scene(SIZE), seed=seed)
                start = time.monotonic()
                clean = desktop.screenshot()
                plain_s.append(time.monotonic() - start)
                start = time.monotonic()
                assert desktop.page_layer.draw(plan) == ""
                picture = desktop.screenshot()
                probe = desktop.page_layer.probe(plan, picture)
                assert probe.ok, probe
                desktop.page_layer.erase()
                drawn_s.append(time.monotonic() - start)
                difference = np.abs(picture.astype(np.int16) - apply(plan, clean)).max(axis=2)
                height, width = probe.facts["area"]
                inside = difference[:height, :width]
                covered += int((difference > 0).sum() - (inside > 0).sum())
                differing += int((inside > 0).sum())
                largest = max(largest, int(inside.max()))
        pixels = len(PAGES) * 3 * SIZE[0] * SIZE[1]
        name = corruption.name + (", over elements" if corruption == CORRUPTIONS[1] else "")
        times = f"{1000 * statistics.median(drawn_s):.0f} | {1000 * statistics.median(plain_s):.0f}"
        print(
            f"| {name} | {differing / pixels:.4%} | {largest} | {covered / pixels:.2%} | {times} |"
        )
    stage.close()


if __name__ == "__main__":
    main()
