"""How long a browser takes to start, to reset and to act, and how much four do at once.

.venv/bin/python benchmarks/browser.py [PYTHON with browsergym-miniwob, for comparison]
"""

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

from online_env.browser.miniwob import open_miniwob, task_class
from online_env.environment import CorruptedEnv

SIZE = (720, 960)
STEPS = 40
PAGE = "miniwob/enter-text.html"
BROWSERS = 4
PLAY_S = 10.0
# A step of BrowserGym without its fixed delay of half a second: an action, the picture and the trees.
BROWSERGYM = """
import json, os, statistics, sys, time
import playwright.sync_api as api
launch = api.BrowserType.launch
api.BrowserType.launch = lambda self, **options: launch(self, **{**options, "executable_path": sys.argv[1], "args": ["--no-sandbox"]})
import gymnasium, browsergym.miniwob, miniwob, pathlib
pages = pathlib.Path(miniwob.__file__).parent / "html/miniwob"
os.environ["MINIWOB_URL"] = pages.as_uri() + "/"
env = gymnasium.make("browsergym/miniwob.enter-text", pre_observation_delay=0.0)
resets, steps = [], []
for seed in range(4):
    start = time.monotonic(); env.reset(seed=seed); resets.append(time.monotonic() - start)
for number in range(30):
    start = time.monotonic(); env.step(f"mouse_move({10 + number}, 100)"); steps.append(time.monotonic() - start)
env.close()
print(json.dumps([statistics.median(resets), statistics.median(steps)]))
"""


def row(name: str, act: Callable[[int], object], times: int) -> float:
    seconds: list[float] = []
    for i in range(times):
        start = time.monotonic()
        act(i)
        seconds.append(time.monotonic() - start)
    values = [min(seconds), statistics.median(seconds), max(seconds)]
    print(f"| {name} | " + " / ".join(f"{1000 * value:.1f}" for value in values) + " |")
    return values[1]


def play(seconds: float) -> None:
    """Print the steps in this time, and those of whole episodes of five steps."""
    stage = open_miniwob(SIZE)
    env = CorruptedEnv(stage, settle=stage.desktop.settle, max_steps=STEPS + 1)
    env.reset(seed=0, options={"task": task_class(PAGE)(0)})
    print("ready", flush=True)
    sys.stdin.readline()
    steps, start = 0, time.monotonic()
    while time.monotonic() < start + seconds:
        env.reset(seed=0, options={"task": task_class(PAGE)(0)})
        for number in range(5):
            env.step(f"pyautogui.moveTo({100 + number}, 300)")
            steps += 1
    print(json.dumps([steps, time.monotonic() - start]))
    env.close()


def play_at_once() -> None:
    command = [sys.executable, __file__, "play"]
    players = [
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(BROWSERS)
    ]
    for player in players:
        assert player.stdout is not None
        player.stdout.readline()
    results = [json.loads(player.communicate("go\n")[0]) for player in players]
    values = [steps / seconds for steps, seconds in results]
    print(f"\n{BROWSERS} browsers at once, episodes of 5 steps with their resets:", end=" ")
    print(*(f"{rate:.1f}" for rate in values), f"steps/s; {sum(values) * 720:.0f} episodes an hour")


def compare(python: str, ours: tuple[float, float]) -> None:
    from online_env.browser.chromium import find_program

    process = subprocess.run(
        [python, "-c", BROWSERGYM, find_program()], capture_output=True, text=True, check=True
    )
    reset, step = json.loads(process.stdout.splitlines()[-1])
    print(
        f"\nBrowserGym in the same run: reset {1000 * reset:.0f} ms, step {1000 * step:.0f} ms;",
        end=" ",
    )
    print(f"ours {reset / ours[0]:.1f} and {step / ours[1]:.1f} times as fast")


def main() -> None:
    if sys.argv[1:] == ["play"]:
        play(PLAY_S)
        return
    print("Load before:", *(f"{value:.1f}" for value in os.getloadavg()))
    print("\n| what | ms |\n| --- | --- |")
    task = task_class(PAGE)
    row("start and end of a browser", lambda _: open_miniwob(SIZE).close(), 3)
    stage = open_miniwob(SIZE)
    desktop = stage.desktop
    reset = row("reset to a task", lambda seed: stage.reset(task(seed), seed), 12)
    row("action", lambda i: desktop.run(f"pyautogui.moveTo({100 + i}, 300)"), 40)
    row("screenshot", lambda _: desktop.screenshot(), 40)
    row("accessibility tree", lambda _: desktop.accessibility(), 40)
    env = CorruptedEnv(stage, settle=desktop.settle, max_steps=STEPS + 1)
    env.reset(seed=0, options={"task": task(0)})
    act = "step of the environment"
    step = row(act, lambda i: env.step(f"pyautogui.moveTo({100 + i}, 300)"), STEPS)
    env.close()
    play_at_once()
    if len(sys.argv) > 1:
        compare(sys.argv[1], (reset, step))


if __name__ == "__main__":
    main()
