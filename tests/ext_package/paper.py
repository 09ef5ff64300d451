"""Third-party parts of the benchmark: a desktop of paper, a task on it, and an agent."""

import re
from contextlib import contextmanager

import numpy as np

from online_env.desktops.protocol import CAPABILITIES, RunResult
from online_env.errors import GuestError
from online_env.tasks import Task, Verdict

PRESSED = "/tmp/pressed"
GREEN = (0, 160, 0)


class PaperDesktop:
    """A white screen with a green button, and a few files."""

    capabilities = CAPABILITIES

    def __init__(self, size):
        self.size = size
        self.files = {}
        self.ok = (40, 60, 100, 80)  # x1, y1, x2, y2

    def screenshot(self):
        """The button; it grows dark when it was pressed."""
        picture = np.full((*self.size, 3), 255, np.uint8)
        x1, y1, x2, y2 = self.ok
        picture[y1:y2, x1:x2] = (0, 60, 0) if PRESSED in self.files else GREEN
        return picture

    def accessibility(self):
        """Nothing is named."""
        return "<desktop-frame/>"

    def run(self, code):
        """Clicks alone do something."""
        result = re.search(r"click\((\d+), (\d+)\)", code)
        if result:
            x, y = map(int, result.groups())
            x1, y1, x2, y2 = self.ok
            if x1 <= x < x2 and y1 <= y < y2:
                self.files[PRESSED] = b"yes"
        return RunResult("success", returncode=0)

    def execute(self, argv, timeout=60):
        """`test -f` and `rm -f`."""
        if argv[0] == "rm":
            self.files.pop(argv[-1], None)
        return RunResult(
            "success", returncode=int(argv[0] == "test" and argv[-1] not in self.files)
        )

    def read_file(self, path):
        """One of the files."""
        if path not in self.files:
            raise GuestError(f"{path}: no such file", 404)
        return self.files[path]

    def write_file(self, path, data):
        """Keep it."""
        self.files[path] = data

    def reset(self, task=None):
        """Forget all files."""
        self.files.clear()

    def close(self):
        """Nothing to end."""


@contextmanager
def provider(size):
    """A desktop of paper."""
    yield PaperDesktop(size)


class PressOk(Task):
    """Press the green button."""

    name = "press_ok"
    apps = ("paper",)
    phrasings = ("Press the green button.",)

    def setup(self, machine):
        """It is there; a desktop of paper has no home folder to note."""

    def validate(self, machine, answer="DONE"):
        """By the file."""
        pressed = machine.desktop.execute(["test", "-f", PRESSED]).ok
        return Verdict(float(pressed), "pressed" if pressed else "not pressed")

    def problems(self, machine):
        """Nothing else is judged."""
        return iter(())

    def oracle(self, hand):
        """Press it."""
        hand.run("pyautogui.click(70, 70)")


class Presser:
    """Clicks on what is green."""

    def predict(self, instruction, obs):
        """Click until nothing is."""
        ys, xs = np.nonzero((obs["screenshot"] == GREEN).all(axis=-1))
        if not len(xs):
            return "Nothing is green.", ["DONE"]
        return "There it is.", [f"pyautogui.click({int(xs.mean())}, {int(ys.mean())})"]
