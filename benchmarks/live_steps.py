"""What a corruption adds to a live step, and what it takes to go from one corrupted episode to the next.

Root and an embedded desktop are needed. The tree is timed beside: it is read while the screen settles, and only for
corruptions that place things.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable

from common import cell, machine, table, times

import hijack_data as hj
from hijack_data.elements import boxes_from_tree
from hijack_data.plan import CLEAN
from hijack_data.types import UInt8Array, as_boxes
from online_env import tasks
from online_env.desktops.embedded.desktop import EmbeddedDesktop
from online_env.effects import perform
from online_env.env import Settle, SmallTasks
from online_env.env.settle import wait_until_settled
from online_env.guest.png import encode

VISUAL = ("pop_ups", "resolution", "marks", "subtitle")
AUTHORS = 2700.0  # ms a step for pop-ups: the authors' own figure, of their code on their machines
GOAL_STEP, GOAL_SWITCH = 30.0, 1.5
WARMUP = 3
APPS = ("browser", "editor", "files", "terminal")


def steps(runs: int) -> str:
    """Boxes from the tree, plan, apply, PNG; each alone and together."""
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        frame = desktop.screenshot()
        xml = desktop.accessibility()
        size = (frame.shape[0], frame.shape[1])
        boxes = boxes_from_tree(xml, size).boxes
        tree = times(desktop.accessibility, runs)
        rows = [[name, *_step(hj.get(name), frame, xml, runs)] for name in VISUAL]
        clean = times(lambda: encode(frame), runs)
    rows.append([CLEAN, "", "", "", cell(clean), "", "PNG of the frame, as it is"])
    head = ["corruption", "boxes", "plan", "apply", "PNG", "together", f"goal <= {GOAL_STEP:g} ms"]
    note = (
        f"{len(boxes)} elements of four applications. The tree, read beside while the screen settles: {cell(tree)} ms. "
        f"The authors name {AUTHORS / 1000:g} s a step for pop-ups, on their machines (not measured here)."
    )
    return f"{table(head, rows)}\n\n{note}"


def _step(spec: hj.Corruption, frame: UInt8Array, xml: str, runs: int) -> list[str]:
    """The parts of one step for `spec`; boxes only where it asks for them."""
    size = (frame.shape[0], frame.shape[1])
    spent: dict[str, list[float]] = {name: [] for name in ("boxes", "plan", "apply", "PNG", "together")}
    for run in range(runs + WARMUP):
        marks = [time.perf_counter()]
        found = boxes_from_tree(xml, size).boxes if spec.needs_elements else None
        marks.append(time.perf_counter())
        plan = spec.plan(hj.Scene(size, as_boxes(found)), seed=run, sample="benchmark", step=run)
        marks.append(time.perf_counter())
        seen = hj.apply(plan, frame)
        marks.append(time.perf_counter())
        encode(seen)
        marks.append(time.perf_counter())
        if run < WARMUP:
            continue
        for name, start, end in zip(spent, marks, marks[1:], strict=False):
            spent[name].append((end - start) * 1e3)
        spent["together"].append((marks[-1] - marks[0]) * 1e3)
    fine = statistics.median(spent["together"]) <= GOAL_STEP
    return [*(cell(values) for values in spent.values()), "yes" if fine else "no"]


def switches(runs: int) -> str:
    """From the end of an episode under one corruption to the proved beginning of one under another."""
    kinds = ("lock", "firewall")
    resets, setups, effects = list[float](), list[float](), list[float]()
    with EmbeddedDesktop.up(standby=True) as desktop:
        stage, task = SmallTasks(desktop), tasks.get("rename_file")
        for run in range(runs):
            perform(hj.Effect(kinds[run % 2]), desktop)
            desktop.wait_for_standby()
            resets.append(_timed(desktop.reset))
            setups.append(_timed(lambda: task.setup(desktop, stage.sites)))
            effects.append(_timed(lambda kind=kinds[1 - run % 2]: _prove(desktop, kind)))
    both = [one + other for one, other in zip(resets, setups, strict=True)]
    goal = "yes" if statistics.median(both) <= GOAL_SWITCH else "no"
    rows = [["reset", _seconds(resets), ""], ["setup", _seconds(setups), ""],
            ["reset and setup", _seconds(both), goal], ["effect and probe", _seconds(effects), ""]]  # fmt: skip
    return table(["what", "s, min / median / max", f"goal <= {GOAL_SWITCH} s"], rows)


def _prove(desktop: EmbeddedDesktop, kind: str) -> None:
    if not perform(hj.Effect(kind), desktop).probe().ok:
        raise SystemExit(f"{kind} could not be proved")


def _timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _seconds(values: list[float]) -> str:
    return f"{min(values):.2f} / {statistics.median(values):.2f} / {max(values):.2f}"


def settle(runs: int) -> str:
    """How long a still screen is waited for, with and without the tree."""
    works: dict[str, Callable[[EmbeddedDesktop], object]] = {
        "without the tree": lambda desktop: wait_until_settled(desktop, Settle(), False),
        "with the tree": lambda desktop: wait_until_settled(desktop, Settle(), True),
    }
    with EmbeddedDesktop.up(apps=APPS) as desktop:
        time.sleep(3)
        rows = [[name, cell(times(lambda work=work: work(desktop), runs))] for name, work in works.items()]
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
