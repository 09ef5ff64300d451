"""The properties that every agent must have, checked by trying it (`hijack check my_agent.py`).

A check raises `CheckFailed` with the probable cause, and may return notes for the author. The
pictures are drawn here and show no real desktop, so the checks do not measure how good an agent is.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from hijack_data.actions import parse_pyautogui, read_action
from hijack_data.conformance.base import Result, expect, fail, run_check
from hijack_data.errors import HijackError
from hijack_data.types import Action, Size, UInt8Array, size_text

from .apart import AgentError, Apart
from .registry import make

SIZES: tuple[Size, ...] = ((1080, 1920), (2160, 3840), (800, 360), (200, 320), (32, 32))
SIZE: Size = (720, 1280)
TASK = "Open the settings and switch the sound off."
TASKS = (
    "",
    "Öffne die Einstellungen — 設定を開く 🙂",
    "first line\nsecond line\twith a tab",
    "a very long task " * 1000,
    "{braces} %s <image> <|im_end|> \\n '\"",
)
TriedAnswer: TypeAlias = tuple[str, list[str]]
AgentCheck: TypeAlias = "Callable[[AgentTrial], Sequence[str] | None]"


@dataclass
class AgentTrial:
    """The agent under test.

    Args:
        name: of the agent.
        printed: returns how many bytes this process wrote to standard output.
    """

    name: str
    printed: Callable[[], int]
    _apart: Apart | None = None

    @property
    def apart(self) -> Apart:
        """The agent, in its own thread; if it cannot be made, the check fails with the reason."""
        if self._apart is None:
            self._apart = self.fresh()
        return self._apart

    def fresh(self) -> Apart:
        """Return a new object of the agent, ready for an episode."""
        try:
            made = Apart(partial(make, self.name))
            made.reset()
        except AgentError as error:
            fail(_with_place(error))
        return made

    @property
    def repeats(self) -> bool:
        """Whether the agent claims to repeat its answers (not `deterministic = False`)."""
        return bool(getattr(self.apart.agent, "deterministic", True))


def screen(size: Size, number: int = 0) -> UInt8Array:
    """Return a drawn picture with a few windows, different for each number."""
    height, width = size
    picture = np.full((height, width, 3), 210, np.uint8)
    random = np.random.default_rng(number)
    for _ in range(6):
        x, y = int(random.integers(0, width)), int(random.integers(0, height))
        picture[y : y + height // 3, x : x + width // 3] = random.integers(0, 256, 3)
    return picture


def ask(apart: Apart, picture: UInt8Array, task: str = TASK) -> TriedAnswer:
    """Ask an agent once; fail the check unless the answer is a text or a list of texts."""
    try:
        said, actions = apart.predict(task, {"screenshot": picture})
        listed: list[object] = apart.call(list, actions)
    except AgentError as error:
        fail(_with_place(error))
    texts = [action for action in listed if isinstance(action, str)]
    if len(texts) < len(listed):
        fail(f"an action must be a text, got {listed!r:.200}")
    return said, texts


def check_made(trial: AgentTrial) -> Sequence[str]:
    """It is made without arguments, and a second object beside the first."""
    start = time.perf_counter()
    expect(callable(getattr(trial.apart.agent, "predict", None)), "it has no predict")
    first = time.perf_counter() - start
    trial.fresh().close()
    second = time.perf_counter() - start - first
    if second < 2 or second < first / 2:
        return ()
    advice = "keep weights and connections in the class or the module"
    return (f"each episode makes a new object, which takes {second:.1f} s; {advice}",)


def check_answer(trial: AgentTrial) -> Sequence[str]:
    """`predict(instruction, obs)` returns a text and a list of actions."""
    _, actions = ask(trial.apart, screen(SIZE))
    if not actions:
        return ("it gave no action, which counts as a malformed one",)
    notes: list[str] = []
    for action in actions:
        try:
            read_action(action)
        except HijackError as error:
            notes.append(f"no action: {action!r:.80}: {error}")
    return notes


def check_steps(trial: AgentTrial) -> None:
    """It takes several steps of one episode."""
    with trial.fresh() as apart:
        for number in range(4):
            ask(apart, screen(SIZE, number))


def check_repeats(trial: AgentTrial) -> Sequence[str]:
    """After `reset` it answers as it did before, and so does another object."""
    first = trial.fresh()
    answer = ask(first, screen(SIZE))
    ask(first, screen(SIZE, 1))
    with trial.fresh() as other:
        _same(trial, answer, ask(other, screen(SIZE)), "another object", "the class or the module")
    if not hasattr(first.agent, "reset"):
        return ("it has no reset, so each row of `hijack score` makes a new object",)
    try:
        first.reset()
    except AgentError as error:
        fail(_with_place(error))
    _same(trial, answer, ask(first, screen(SIZE)), "reset", "the object")
    if trial.repeats:
        return ()
    return ("it says that it does not repeat (deterministic = False), so this was not compared",)


def check_observation(trial: AgentTrial) -> None:
    """It does not change its observation."""
    picture = screen(SIZE)
    before = picture.copy()
    obs = {"screenshot": picture}
    try:
        trial.apart.predict(TASK, obs)
    except AgentError as error:
        fail(_with_place(error))
    same = np.array_equal(picture, before)
    expect(same, "it draws on obs['screenshot']; draw on a copy: obs['screenshot'].copy()")
    expect(list(obs) == ["screenshot"], f"it changes the keys of obs: {list(obs)}")


def check_quiet(trial: AgentTrial) -> None:
    """It prints nothing to standard output."""
    before = trial.printed()
    with trial.fresh() as apart:
        ask(apart, screen(SIZE))
    count = trial.printed() - before
    expect(
        not count,
        f"it printed {count} bytes; standard output belongs to the command: use"
        " logging, or print(..., file=sys.stderr)",
    )


def check_sizes(trial: AgentTrial) -> Sequence[str]:
    """It takes small, large and upright pictures, and its points are inside them."""
    notes: list[str] = []
    for size in SIZES:
        with trial.fresh() as apart:
            _, actions = ask(apart, screen(size))
        for action in actions:
            for x, y in _points(action):
                inside = 0 <= x < size[1] and 0 <= y < size[0]
                where = f"({x}, {y}) is outside a picture of {size_text(size)}"
                expect(inside, f"{where}: actions are in pixels of obs['screenshot']")
    return notes


def check_instructions(trial: AgentTrial) -> None:
    """It takes any instruction: empty, long, in any script."""
    for task in TASKS:
        with trial.fresh() as apart:
            ask(apart, screen(SIZE), task)


def check_batch(trial: AgentTrial) -> None:
    """Where it has `predict_batch`, that answers as `predict` does."""
    if not hasattr(trial.apart.agent, "predict_batch"):
        return
    pictures = [screen(SIZE, number) for number in range(3)]
    singles: list[TriedAnswer] = []
    for picture in pictures:
        with trial.fresh() as apart:
            singles.append(ask(apart, picture))
    with trial.fresh() as apart:
        agent: Any = apart.agent
        observations = [{"screenshot": picture} for picture in pictures]
        try:
            answers: Any = apart.call(agent.predict_batch, [TASK] * 3, observations)
            answers = apart.call(list, answers)
        except AgentError as error:
            fail(_with_place(error))
    expect(len(answers) == 3, f"predict_batch gave {len(answers)} answers for 3 rows")
    for single, answer in zip(singles, answers, strict=True):
        match answer:
            case (str() as said, Sequence() as actions) if not isinstance(actions, str):
                _same(trial, single, (said, list(actions)), "predict_batch", "the batch")
            case _:
                fail(f"predict_batch must return (text, [actions]) a row, got {answer!r:.200}")


def check_onlooker(trial: AgentTrial) -> None:
    """Where it has `check(picture)`, that returns a reminder or None."""
    looks = getattr(trial.apart.agent, "check", None)
    if looks is None:
        return
    try:
        reminder = trial.apart.call(looks, screen(SIZE))
    except AgentError as error:
        fail(_with_place(error))
    fits = reminder is None or isinstance(reminder, str)
    expect(fits, f"check must return a text or None, got {reminder!r:.200}")


CHECKS: tuple[AgentCheck, ...] = (
    check_made,
    check_answer,
    check_steps,
    check_repeats,
    check_observation,
    check_quiet,
    check_sizes,
    check_instructions,
    check_batch,
    check_onlooker,
)


def run_checks(name: str, printed: Callable[[], int]) -> Iterator[Result]:
    """Yield the outcome of each check; if the agent cannot be made, the others are left out."""
    trial = AgentTrial(name, printed)
    for check in CHECKS:
        result = run_check(check, trial)
        yield result
        if check is check_made and not result.ok:
            return


def names_of_checks() -> list[str]:
    """Return the names of the checks, in their order."""
    return [check.__name__.removeprefix("check_") for check in CHECKS]


def about(name: str) -> str:
    """Return the property that a check tests."""
    check = next(check for check in CHECKS if check.__name__ == f"check_{name}")
    return (check.__doc__ or "").strip().split("\n")[0]


def _same(
    trial: AgentTrial, before: TriedAnswer, after: TriedAnswer, after_what: str, where: str
) -> None:
    if trial.repeats and before[1] != after[1]:
        why = f"it keeps something in {where}, or draws random numbers without a seed"
        remedy = "an agent whose model samples says deterministic = False"
        fail(f"{after_what} gives {after[1]!r:.80}, not {before[1]!r:.80}: {why}; {remedy}")


def _points(action: str) -> Iterator[tuple[int, int]]:
    try:
        request = read_action(action)
        found = parse_pyautogui(request.code, None) if request.kind == "code" else Action("wait")
    except HijackError:
        return
    for point in (found.point, found.end):
        if point is not None:
            yield point


def _with_place(error: AgentError) -> str:
    place = error.where[-1] if error.where else ""
    return f"{error} ({os.path.basename(place)})" if place else str(error)
