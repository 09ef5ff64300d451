"""The properties that every agent must have, checked by trying it (`hijack check my_agent.py`).

A check raises `CheckFailed` with the probable cause, and may return notes for the author. The
pictures are drawn here and show no real desktop, so the checks do not measure how good an agent is.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from hijack_data.actions import parse_pyautogui, read_action
from hijack_data.conformance.base import Result, expect, fail, run_check
from hijack_data.errors import HijackError
from hijack_data.types import Action, Size, UInt8Array, size_text

from .agent_calls import AgentError, RunningAgent

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
TextAnswer: TypeAlias = tuple[str, list[str]]
AgentCheck: TypeAlias = "Callable[[AgentTrial], Sequence[str] | None]"


class AgentTrial:
    """The agent under test, in a process of its own as `hijack bench` and `hijack score` run it.

    Args:
        agent: the agent.
    """

    def __init__(self, agent: RunningAgent) -> None:
        self.agent = agent

    def fresh(self) -> RunningAgent:
        """Return the agent with a new object, ready for an episode."""
        try:
            self.agent.make()
            self.agent.reset()
        except AgentError as error:
            fail(_with_location(error))
        return self.agent


def screen(size: Size, number: int = 0) -> UInt8Array:
    """Return a drawn picture with a few windows, different for each number."""
    height, width = size
    picture = np.full((height, width, 3), 210, np.uint8)
    random = np.random.default_rng(number)
    for _ in range(6):
        x, y = int(random.integers(0, width)), int(random.integers(0, height))
        picture[y : y + height // 3, x : x + width // 3] = random.integers(0, 256, 3)
    return picture


def ask(agent: RunningAgent, picture: UInt8Array, task: str = TASK) -> TextAnswer:
    """Ask an agent once; fail the check unless the answer is a text or a list of texts."""
    try:
        words, actions = agent.predict(task, {"screenshot": picture})
    except AgentError as error:
        fail(_with_location(error))
    texts = [action for action in actions if isinstance(action, str)]
    if len(texts) < len(actions):
        fail(f"an action must be a text, got {actions!r:.200}")
    return words, texts


def check_made(trial: AgentTrial) -> Sequence[str]:
    """It is made without arguments, and a second object after the first."""
    start = time.perf_counter()
    agent = trial.fresh()
    first = time.perf_counter() - start
    expect("predict" in agent.traits.methods, "it has no predict")
    trial.fresh()
    second = time.perf_counter() - start - first
    if second < 2 or second < first / 2:
        return ()
    advice = "keep weights and connections in the class or the module"
    return (f"each episode makes a new object, which takes {second:.1f} s; {advice}",)


def check_answer(trial: AgentTrial) -> Sequence[str]:
    """`predict(instruction, obs)` returns a text and a list of actions."""
    _, actions = ask(trial.fresh(), screen(SIZE))
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
    agent = trial.fresh()
    for number in range(4):
        ask(agent, screen(SIZE, number))


def check_repeats(trial: AgentTrial) -> Sequence[str]:
    """After `reset` it answers as it did before, and so does another object."""
    agent = trial.fresh()
    answer = ask(agent, screen(SIZE))
    ask(agent, screen(SIZE, 1))
    notes: tuple[str, ...] = ()
    if "reset" in agent.traits.methods:
        try:
            agent.reset()
        except AgentError as error:
            fail(_with_location(error))
        _same(agent, answer, ask(agent, screen(SIZE)), "reset", "the object")
    else:
        notes = ("it has no reset, so each row of `hijack score` makes a new object",)
    other_answer = ask(trial.fresh(), screen(SIZE))
    _same(agent, answer, other_answer, "another object", "the class or the module")
    if agent.traits.is_deterministic:
        return notes
    unsure = "it says that it does not repeat (deterministic = False), so this was not compared"
    return (*notes, unsure)


def check_sizes(trial: AgentTrial) -> Sequence[str]:
    """It takes small, large and upright pictures, and its points are inside them."""
    for size in SIZES:
        _, actions = ask(trial.fresh(), screen(size))
        for action in actions:
            for x, y in _points(action):
                inside = 0 <= x < size[1] and 0 <= y < size[0]
                problem = f"({x}, {y}) is outside a picture of {size_text(size)}"
                expect(inside, f"{problem}: actions are in pixels of obs['screenshot']")
    return ()


def check_instructions(trial: AgentTrial) -> None:
    """It takes any instruction: empty, long, in any script."""
    for task in TASKS:
        ask(trial.fresh(), screen(SIZE), task)


def check_batch(trial: AgentTrial) -> None:
    """Where it has `predict_batch`, that answers as `predict` does."""
    agent = trial.fresh()
    if "predict_batch" not in agent.traits.methods:
        return
    pictures = [screen(SIZE, number) for number in range(3)]
    singles = [ask(trial.fresh(), picture) for picture in pictures]
    try:
        answers = trial.fresh().predict_batch([TASK] * 3, pictures)
    except AgentError as error:
        fail(_with_location(error))
    for single, (words, actions) in zip(singles, answers, strict=True):
        texts = [str(action) for action in actions]
        _same(agent, single, (words, texts), "predict_batch", "the batch")


def check_onlooker(trial: AgentTrial) -> None:
    """Where it has `check(picture)`, that returns a reminder or None."""
    agent = trial.fresh()
    if "check" not in agent.traits.methods:
        return
    try:
        agent.check(screen(SIZE))
    except AgentError as error:
        fail(_with_location(error))


CHECKS: tuple[AgentCheck, ...] = (
    check_made,
    check_answer,
    check_steps,
    check_repeats,
    check_sizes,
    check_instructions,
    check_batch,
    check_onlooker,
)


def run_checks(agent: RunningAgent) -> Iterator[Result]:
    """Yield the outcome of each check.

    If the agent cannot be made, or its process ends or hangs, the other checks are left out.
    """
    trial = AgentTrial(agent)
    for check in CHECKS:
        result = run_check(check, trial)
        yield result
        if not result.ok and (check is check_made or not agent.alive):
            return


def not_made(error: AgentError) -> Result:
    """Return the outcome of `check_made` for an agent that cannot be made."""
    about = (check_made.__doc__ or "").partition("\n")[0]
    return Result("made", about, _with_location(error))


def _same(
    agent: RunningAgent, before: TextAnswer, after: TextAnswer, after_what: str, keeper: str
) -> None:
    if agent.traits.is_deterministic and before[1] != after[1]:
        cause = f"it keeps something in {keeper}, or draws random numbers without a seed"
        remedy = "an agent whose model samples says deterministic = False"
        fail(f"{after_what} gives {after[1]!r:.80}, not {before[1]!r:.80}: {cause}; {remedy}")


def _points(action: str) -> Iterator[tuple[int, int]]:
    try:
        request = read_action(action)
        action_read = (
            parse_pyautogui(request.code, None) if request.kind == "code" else Action("wait")
        )
    except HijackError:
        return
    for point in (action_read.point, action_read.end):
        if point is not None:
            yield point


def _with_location(error: AgentError) -> str:
    location = error.frames[-1] if error.frames else ""
    return f"{error} ({os.path.basename(location)})" if location else str(error)
