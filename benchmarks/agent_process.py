"""What the process of its own costs an agent: a step of 1920x1080, against a thread of the runner.

Both ask the same agent, which looks at a few pixels, in turn within one run. "More" is the
difference of the minima: on a busy machine the rest is the wait for a free core.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from common import cell, interleaved, machine, seconds, table

from online_env.agents.agent_process import AgentProcess
from online_env.agents.agent_thread import AgentThread
from online_env.agents.registry import AGENTS, make

GOAL_MS = 5.0
SIZES = ((1080, 1920), (2160, 3840))
AGENT = """
class Looks:
    def predict(self, instruction, obs):
        return "", [f"pyautogui.click({obs['screenshot'][::200, ::200].argmax()}, 5)"]
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=201)
    runs = parser.parse_args().runs
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "looks.py"
        file.write_text(AGENT)
        name = AGENTS.find(f"{file}:Looks")
        process = AgentProcess(AGENTS.get(name), 60)
        start = seconds(process.make)
        again = seconds(process.make)
        with process, AgentThread(lambda: make(name)) as thread:
            for size in SIZES:
                obs = {"screenshot": np.full((*size, 3), 9, np.uint8)}
                asks = {
                    "thread": lambda obs=obs: thread.predict("Look.", obs),
                    "process": lambda obs=obs: process.predict("Look.", obs),
                }
                spent = interleaved(asks, runs)
                more = min(spent["process"]) - min(spent["thread"])
                goal = ("yes" if more <= GOAL_MS else "no") if size == SIZES[0] else ""
                lines = [cell(spent[key]) for key in asks]
                rows.append([f"{size[1]}x{size[0]}", *lines, f"{more:.2f}", goal])
    head = ["picture", "in a thread, ms", "own process, ms", "more", f"goal <= {GOAL_MS:g} ms"]
    print(machine())
    print()
    print(table(head, rows))
    print()
    print(f"The process starts in {start:.2f} s; another object in it takes {1e3 * again:.1f} ms.")


if __name__ == "__main__":
    main()
