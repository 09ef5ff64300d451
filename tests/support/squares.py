"""A desktop that shows a dark square, the task to click it, and what finds the square in a picture.

The desktop runs no code: it reads clicks out of it. All around it is real: stage, environment,
corruptions, records.
"""

import re
from contextlib import contextmanager

import numpy as np

from online_env import tasks
from online_env.bench.jobs import Job
from online_env.environment import CorruptedEnv, SmallTasks

from support.live import AT_ONCE, FakeDesktop

SIZE = (420, 728)  # a multiple of 28: a model that resizes pictures leaves it
SIDE = 40
DARK = 60
JOB = Job("mine", "square", "clean", 3)
_CLICK = re.compile(r"\bclick\((?:x=)?(\d+), ?(?:y=)?(\d+)")


class SquareDesktop(FakeDesktop):
    """Shows a dark square, which turns green once it was clicked."""

    def __init__(self, size=SIZE):
        super().__init__(size)
        self.place = (0, 0)
        self.hit = False

    def screenshot(self):
        super().screenshot()
        picture = np.full((*self.size, 3), 235, np.uint8)
        x, y = self.place
        picture[y : y + SIDE, x : x + SIDE] = (40, 200, 40) if self.hit else 30
        return picture

    def run(self, code):
        result = super().run(code)
        for x, y in _CLICK.findall(code):
            left, top = self.place
            self.hit |= left <= int(x) < left + SIDE and top <= int(y) < top + SIDE
        return result


class ClickSquare(tasks.Task):
    """Click the dark square."""

    name = "square"
    apps = ()
    phrasings = ("Click the dark square.",)

    def setup(self, machine):
        desktop = machine.desktop
        height, width = desktop.size
        draws = self.stream()
        desktop.hit = False
        desktop.place = (draws.integer(0, width - SIDE), draws.integer(0, height - SIDE))

    def validate(self, machine, answer="DONE"):
        hit = machine.desktop.hit
        return tasks.Verdict(float(hit), "hit" if hit else "not hit")

    def problems(self, machine):
        return iter(())

    def oracle(self, hand):
        raise NotImplementedError


def square_env(max_steps=5, size=SIZE):
    """The environment with that task, and its desktop."""
    desktop = SquareDesktop(size)
    stage = SmallTasks(desktop, ClickSquare(JOB.seed))
    return CorruptedEnv(stage, settle=AT_ONCE, max_steps=max_steps), desktop


@contextmanager
def square_desktop(size):
    """A desktop provider."""
    yield SquareDesktop(size)


def register_square(monkeypatch, provider=square_desktop):
    """Make the task, and the provider `squares`, known while a test runs."""
    from online_env.bench.providers import PROVIDERS

    tasks.names()
    PROVIDERS.names()
    monkeypatch.setitem(tasks.TASKS.entries, "square", ClickSquare)
    monkeypatch.setitem(PROVIDERS.entries, "squares", provider)


def middle_of_square(picture):
    """Where the dark square is, (x, y), or `None`."""
    rows, columns = np.nonzero(np.asarray(picture).max(axis=-1) < DARK)
    if not len(rows):
        return None
    return int(np.median(columns)), int(np.median(rows))
