"""The time that a corruption adds to a live step, and between two corrupted episodes.

Root and an embedded desktop are needed. The tree is timed apart: it is read while the screen
settles, and only for corruptions that place things.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable

from common import cell, machine, seconds, spread, table, times

import hijack_data as hj
from hijack_data.elements import boxes_from_tree
from hijack_data.plan import CLEAN
from hijack_data.png import encode
from hijack_data.types import UInt8Array, as_boxes
from online_env import tasks
from online_env.effects import perform
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.environment import Settle, SmallTasks
from online_env.environment.settle import wait_until_settled
from online_env.tasks import Machine

VISUAL = ("pop_ups", "resolution", "marks", "subtitle")
PARTS = ("boxes", "plan", "apply", "PNG", "together")
AUTHORS = 2700.0  # ms a step for pop-ups: the authors' own figure, of their code on their machines
GOAL_STEP = 30.0
GOAL_SWITCH = 1.5
WARMUP = 3
APPS = ("browser", "editor", "files", "terminal")


def steps(runs: int) -> str:
    """Return a table of boxes from the tree, plan, apply and PNG, each alone and together."""
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        frame = desktop.screenshot()
        xml = desktop.accessibility()
        size = (frame.shape[0], frame.shape[1])
        boxes = boxes_from_tree(xml, size).boxes
        tree = times(desktop.accessibility, runs)
        rows = [_row(name, frame, xml, runs) for name in VISUAL]
        clean = times(lambda: encode(frame), runs)
    rows.append([CLEAN, "", "", "", cell(clean), "", "PNG of the frame, as it is"])
    head = ["corruption", "boxes", "plan", "apply", "PNG", "together", f"goal <= {GOAL_STEP:g} ms"]
    note = (
        f"{len(boxes)} elements of four applications. The tree, read beside while the screen"
        f" settles: {cell(tree)} ms. The authors name {AUTHORS / 1000:g} s a step for pop-ups, on"
        " their machines (not measured here)."
    )
    return f"{table(head, rows)}\n\n{note}"


def _row(name: str, frame: UInt8Array, xml: str, runs: int) -> list[str]:
    """Return the line of a corruption: the parts of a step, and whether the goal is met."""
    spec = hj.make_corruption(name)
    spent: dict[str, list[float]] = {part: [] for part in PARTS}
    for run in range(runs + WARMUP):
        marks = _step(spec, frame, xml, run)
        if run < WARMUP:
            continue
        for part, start, end in zip(PARTS, marks, marks[1:], strict=False):
            spent[part].append((end - start) * 1e3)
        spent["together"].append((marks[-1] - marks[0]) * 1e3)
    meets_goal = statistics.median(spent["together"]) <= GOAL_STEP
    cells = [cell(values) for values in spent.values()]
    return [name, *cells, "yes" if meets_goal else "no"]


def _step(spec: hj.plugin.Corruption, frame: UInt8Array, xml: str, run: int) -> list[float]:
    """Return the times in seconds before, between and after the parts of one step."""
    size = (frame.shape[0], frame.shape[1])
    marks = [time.perf_counter()]
    boxes = None
    if spec.needs_elements:
        boxes = boxes_from_tree(xml, size).boxes
    marks.append(time.perf_counter())
    scene = hj.Scene(size, as_boxes(boxes))
    plan = spec.plan(scene, seed=run, sample="benchmark", step=run)
    marks.append(time.perf_counter())
    calls = hj.apply(plan, frame)
    marks.append(time.perf_counter())
    encode(calls)
    marks.append(time.perf_counter())
    return marks


def switches(runs: int) -> str:
    """Return a table of the time from one corrupted episode to the next, whose effect is proved."""
    kinds = ("lock", "firewall")
    resets: list[float] = []
    setups: list[float] = []
    effects: list[float] = []
    with EmbeddedDesktop.up(standby=True) as desktop:
        stage = SmallTasks(desktop)
        task = tasks.get("rename_file")
        for run in range(runs):
            last = kinds[run % 2]
            following = kinds[1 - run % 2]
            perform(hj.plugin.Effect(last), desktop)
            desktop.wait_for_standby()
            resets.append(seconds(desktop.reset))
            setups.append(seconds(lambda: task.setup(Machine(desktop, stage.sites))))
            effects.append(seconds(lambda kind=following: _prove(desktop, kind)))
    totals = [value + second for value, second in zip(resets, setups, strict=True)]
    goal = "yes" if statistics.median(totals) <= GOAL_SWITCH else "no"
    rows = [
        ["reset", spread(resets, 2), ""],
        ["setup", spread(setups, 2), ""],
        ["reset and setup", spread(totals, 2), goal],
        ["effect and probe", spread(effects, 2), ""],
    ]
    return table(["what", "s, min / median / max", f"goal <= {GOAL_SWITCH} s"], rows)


def _prove(desktop: EmbeddedDesktop, kind: str) -> None:
    if not perform(hj.plugin.Effect(kind), desktop).probe().ok:
        raise SystemExit(f"{kind} could not be proved")


def settle(runs: int) -> str:
    """Return a table of the time until the screen has settled, with and without the tree."""
    works: dict[str, Callable[[EmbeddedDesktop], object]] = {
        "without the tree": lambda desktop: wait_until_settled(desktop, Settle(), False),
        "with the tree": lambda desktop: wait_until_settled(desktop, Settle(), True),
    }
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        rows: list[list[str]] = []
        for name, work in works.items():
            waits = times(lambda work=work: work(desktop), runs)
            rows.append([name, cell(waits)])
    return table(["waiting for a still screen", "ms"], rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=15)
    runs = parser.parse_args().runs
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"1920x1080, min / median / max of {runs}; load {load}.\n\n{machine()}\n")
    print("What a corruption adds to a live step, ms:\n")
    print(steps(runs))
    print("\nFrom one corrupted episode to the next (rename_file; a standby desktop is ready):\n")
    print(switches(max(4, runs // 2)))
    print("\nWaiting, for comparison:\n")
    print(settle(max(3, runs // 4)))


if __name__ == "__main__":
    main()
