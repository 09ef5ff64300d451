"""How long a browser takes to start, to reset and to act, alone and four side by side.

.venv/bin/python benchmarks/browser.py
"""

import statistics
import time
from concurrent.futures import ProcessPoolExecutor

SIZE = (720, 960)
STEPS = 60
PAGE = "miniwob/enter-text.html"


def measure(number: int) -> dict[str, float]:
    """Play one episode after ten resets in a browser of this process; seconds by name."""
    from online_env.browser.miniwob import open_miniwob, task_class
    from online_env.environment import CorruptedEnv

    task = task_class(PAGE)
    start = time.monotonic()
    stage = open_miniwob(SIZE)
    seconds = {"up": time.monotonic() - start}
    resets: list[float] = []
    for seed in range(10):
        start = time.monotonic()
        stage.reset(task(seed), seed)
        resets.append(time.monotonic() - start)
    desktop = stage.desktop
    for name, act in (
        ("action", lambda i: desktop.run(f"pyautogui.moveTo({100 + i}, 300)")),
        ("screenshot", lambda _: desktop.screenshot()),
        ("tree", lambda _: desktop.accessibility()),
    ):
        times: list[float] = []
        for i in range(30):
            start = time.monotonic()
            act(i)
            times.append(time.monotonic() - start)
        seconds[name] = statistics.median(times)
    env = CorruptedEnv(stage, settle=desktop.settle, max_steps=STEPS + 1)
    env.reset(seed=0, options={"task": task(0)})
    start = time.monotonic()
    for i in range(STEPS):
        env.step(f"pyautogui.moveTo({100 + i}, 300)")
    seconds["step"] = (time.monotonic() - start) / STEPS
    env.close()
    return {**seconds, "reset": statistics.median(resets)}


def main() -> None:
    for count in (1, 4):
        with ProcessPoolExecutor(count) as pool:
            rows = list(pool.map(measure, range(count)))
        print(f"{count} at a time, seconds (the slowest of them):")
        for name in rows[0]:
            print(f"  {name:10s} {max(row[name] for row in rows):.4f}")
        print(f"  steps a second, each: {min(1 / row['step'] for row in rows):.1f}")


if __name__ == "__main__":
    main()
