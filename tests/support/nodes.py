"""An agent for the nodes of a cluster: it clicks the dark square, and does what a test asks for.

The test writes its orders into the folder that the environment names; the nodes inherit it.
"""

import os
import signal
import time
from pathlib import Path

from support.squares import middle_of_square
from support.waiting import until

FOLDER = "AGENTHIJACK_TEST_NODES"
SEEN = "seen"
PROVIDER = "support.squares:square_desktop"
AGENT = "support.nodes:Clicker"


def raylets(folder):
    """The processes of the nodes where agents were."""
    return {int(line.split()[0]) for line in (folder / SEEN).read_text().splitlines()}


def first(flag):
    """Whether this is the first call with this path, in any process."""
    try:
        os.close(os.open(flag, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def ancestor(generations):
    """The process that started this one, or the one that started that, and so on."""
    pid = os.getpid()
    for _ in range(generations):
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return pid


class Clicker:
    """Clicks the square, once all orders are carried out."""

    def __init__(self):
        self.turn = 0

    def predict(self, instruction, obs):
        self.turn += 1
        if self.turn > 1:
            return "That was it.", ["DONE"]
        self.obey(Path(os.environ[FOLDER]))
        x, y = middle_of_square(obs["screenshot"])
        return f"It is at {x}, {y}.", [f"pyautogui.click({x}, {y})"]

    def obey(self, folder):
        parent = ancestor(
            3
        )  # above the supervisor and the process that plays: on a node its raylet
        blocked = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
        with (folder / SEEN).open("a") as file:
            file.write(f"{parent} {blocked}\n")
        if (folder / "kill_me").exists() and first(folder / "killed_me"):
            os.kill(ancestor(2), signal.SIGKILL)  # the process that plays
            time.sleep(60)  # this one ends with it
        order = folder / "kill_node"
        if order.exists():
            if parent == int(order.read_text()) and first(folder / "killed_node"):
                os.kill(parent, signal.SIGKILL)
                time.sleep(60)  # Ray ends this process with its node
            until((folder / "killed_node").exists)
        order = folder / "wait_for"
        if order.exists():
            until(lambda: int(order.read_text()) in raylets(folder))
