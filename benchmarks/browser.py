"""How long a browser takes to start, to reset and to act.

.venv/bin/python benchmarks/browser.py
"""

import os
import statistics
import time
from collections.abc import Callable

from online_env.browser.miniwob import open_miniwob, task_class
from online_env.environment import CorruptedEnv

SIZE = (720, 960)
STEPS = 40
PAGE = "miniwob/enter-text.html"


def row(name: str, act: Callable[[int], object], times: int) -> None:
    seconds: list[float] = []
    for i in range(times):
        start = time.monotonic()
        act(i)
        seconds.append(time.monotonic() - start)
    values = [min(seconds), statistics.median(seconds), max(seconds)]
    print(f"| {name} | " + " / ".join(f"{1000 * value:.1f}" for value in values) + " |")


def main() -> None:
    print("Load before:", *(f"{value:.1f}" for value in os.getloadavg()))
    print("\n| what | ms |\n| --- | --- |")
    task = task_class(PAGE)
    row("start and end of a browser", lambda _: open_miniwob(SIZE).close(), 3)
    stage = open_miniwob(SIZE)
    desktop = stage.desktop
    row("reset to a task", lambda seed: stage.reset(task(seed), seed), 12)
    row("action", lambda i: desktop.run(f"pyautogui.moveTo({100 + i}, 300)"), 40)
    row("screenshot", lambda _: desktop.screenshot(), 40)
    row("accessibility tree", lambda _: desktop.accessibility(), 40)
    env = CorruptedEnv(stage, settle=desktop.settle, max_steps=STEPS + 1)
    env.reset(seed=0, options={"task": task(0)})
    row("step of the environment", lambda i: env.step(f"pyautogui.moveTo({100 + i}, 300)"), STEPS)
    env.close()


if __name__ == "__main__":
    main()
