"""A desktop, a stage and effects that are none, for what `CorruptedEnv` does without a real
desktop."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from hijack_data.errors import ParameterTypeError
from hijack_data.plan import Effect, Plan
from hijack_data.planner import Planner
from hijack_data.types import Scene
from online_env.desktops.protocol import CAPABILITIES, RunResult
from online_env.effects import EffectError, LiveEffect, Probe, Undone, register
from online_env.environment import Setting, Settle
from online_env.errors import DesktopError, MissingCapabilityError
from online_env.tasks.base import Verdict

SIZE = (360, 640)
AT_ONCE = Settle(quiet=0, cap=0)
TREE = (
    '<desktop-frame xmlns:st="https://accessibility.ubuntu.example.org/ns/state"'
    ' xmlns:cp="https://accessibility.ubuntu.example.org/ns/component"><application'
    ' name="files"><push-button name="Open" st:showing="true" st:visible="true" st:enabled="true"'
    ' cp:screencoord="(10, 20)" cp:size="(100, 30)"/><push-button name="Save" st:showing="true"'
    ' st:visible="true" st:enabled="true" cp:screencoord="(300, 200)" cp:size="(80,'
    ' 40)"/></application></desktop-frame>'
)


RAISES = {"effect": EffectError, "desktop": DesktopError, "missing": MissingCapabilityError}


class FakeDesktop:
    """Shows how often something was run; `state` is what effects change.

    `on` says what else happens at a call, until the desktop is reset; with `faulty` for good.
    """

    def __init__(self, size=SIZE, capabilities=CAPABILITIES):
        self.size, self.capabilities = size, capabilities
        self.ran: list[str] = []
        self.calls: list[str] = []
        self.state: set[str] = set()
        self.on: dict[str, Callable[[], object]] = {}
        self.dead = self.closed = self.faulty = False
        self.answer = RunResult("success", "", "", 0)

    def happens(self, name):
        self.calls.append(name)
        self.on.get(name, lambda: None)()

    def screenshot(self):
        self.happens("screenshot")
        if self.dead:
            raise DesktopError("the desktop is gone")
        height, width = self.size
        picture = np.arange(height * width * 3, dtype=np.uint32).reshape(height, width, 3) // 97
        return (picture + 31 * len(self.ran) + 5 * len(self.state)).astype(np.uint8)

    def accessibility(self):
        self.calls.append("tree")
        return TREE

    def run(self, code):
        self.happens("run")
        if self.dead:
            raise DesktopError("the desktop is gone")
        self.ran.append(code)
        return self.answer

    def execute(self, argv, timeout=60):
        return RunResult("success", "", "", 0)

    def read_file(self, path):
        return b""

    def write_file(self, path, data):
        pass

    def reset(self, task=None):
        self.state.clear()
        if not self.faulty:
            self.on.clear()

    def close(self):
        self.closed = True


class FakeStage:
    """One task; `score` is what the evaluation says."""

    def __init__(self, desktop=None, score=1.0, infeasible=False):
        self.desktop = desktop or FakeDesktop()
        self.score, self.infeasible = score, infeasible
        self.resets: list[tuple[Any, int]] = []
        self.history: tuple[str, ...] | None = None
        self.state_at_evaluation: set[str] | None = None
        self.fails: BaseException | None = None

    def reset(self, task, seed):
        self.resets.append((task, seed))
        if task is not None and not isinstance(task, str):
            raise ParameterTypeError("a task is a name")
        if self.fails:
            raise self.fails
        self.desktop.reset()
        return Setting(f"{task or 'do'}-{seed}", "Open the file", ("files",), self.infeasible, seed)

    def evaluate(self, history):
        self.history, self.state_at_evaluation = history, set(self.desktop.state)
        if self.fails:
            raise self.fails
        return Verdict(self.score, "as wanted")

    def close(self):
        self.desktop.close()


@register
class Mark(LiveEffect):
    """Adds a word to the desktop's state."""

    kind: ClassVar[str] = "test_mark"
    needs: ClassVar[frozenset[Any]] = frozenset({"windows"})

    def apply(self, guest, params):
        guest.desktop.happens("apply")
        if params.get("raises"):
            raise RAISES[params["raises"]](params["says"])
        if not params.get("sabotaged"):
            guest.desktop.state.add("marked")
        return {"draw": guest.stream.integer(0, 10**9) if guest.stream else None}

    def probe(self, guest, record):
        guest.desktop.happens("probe")
        result = "marked" in guest.desktop.state
        return Probe(result, {}, "" if result else "nothing is marked")

    def undo(self, guest, record):
        guest.desktop.happens("undo")
        if guest.desktop.dead:
            raise DesktopError("the desktop is gone")
        guest.desktop.state.discard("marked")
        return Undone(True)

    def refresh(self, guest, record):
        guest.desktop.happens("refresh")


@register
class Fence(Mark):
    """As `Mark`, but no agent can lift it."""

    kind: ClassVar[str] = "test_fence"

    def can_be_lifted(self, guest):
        return False


class Marking(Planner):
    """A planner whose effect is due at some steps."""

    needs_elements = False

    def __init__(self, *steps, kind="test_mark", **params):
        self.steps, self.kind, self.given = steps, kind, params

    def plan(self, scene: Scene, *, seed, sample=0, step=None, epoch=0):
        due = step in self.steps
        return Plan(
            "marking-v1", scene.size, {}, (), (Effect(self.kind, self.given),) if due else ()
        )
