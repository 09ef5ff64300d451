"""Faults of an agent's input in a recording: rows in which an action did not arrive as it was done.

A row is made only where the recording proves its picture.

* An action that did not arrive leaves the screen that was before it, and every recording has that:
  the *lost* action, an inserted step on the same picture, whose action is the same again, and the
  step after it.
* What an action led to that arrived twice or beside its target is known only to a run that was
  played under this very fault and solved. Its steps are rows: the action as the agent did it, and
  the screen that followed with what the agent did next, if later steps show that this was right.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from hijack_data.actions.agent_actions import ACTION_WORDS
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.input_faults import FaultKind, InputFault, can_hit, moves_from_pointer
from hijack_data.actions.pyautogui_functions import KEYBOARD, POINTER, RECORDED_FUNCTIONS
from hijack_data.actions.pyautogui_grammar import PyautoguiCall, read_calls
from hijack_data.actions.python_source import ParsedSource
from hijack_data.actions.recorded_actions import holds_several
from hijack_data.errors import ActionError
from hijack_data.plan import Plan
from hijack_data.planner import Planner
from hijack_data.types import Step

from ..dataset.sample import Sample
from ..errors import BuildError
from ..readers.recorded_actions import PYAUTOGUI, AlteredStep, RecordedStep
from .base import EditedStep, NotApplicable, check_each_once

EVENTS: Mapping[FaultKind, str] = {
    "drop": "The last action did not arrive: nothing was pressed.",
    "repeat": "The last action arrived {times} times.",
    "offset": "The pointer slipped: the last action landed beside where it aimed.",
}
NEVER_HIT = "no action from the step on at which it acts presses anything that it could hit"
NO_PICTURE = (
    "only a run under this fault shows what it leads to: play it with hijack bench, and build from"
    " that run"
)
OTHER_FAULT = (
    "the run was played under another such fault: build with the parameters of its corruption and"
    " the seed of its episode"
)
NOTHING_AFTER = (
    "the run has no step after the fault: the episode ended there, or was not solved, so nothing"
    " says that what the agent did next was right"
)
NOT_REPAIRED = (
    "the run does not show that the agent put the slip right: it did not do the action again"
)
DONE_AGAIN = (
    "the run does not show that what the agent did next was right: it did the same again later"
)
RELATIVE = (
    "the action begins where the pointer is, and moves it, so doing it again would lead elsewhere"
)
SEVERAL = (
    "the reply holds several actions, and the recording shows no screen between them: what follows"
    " is that of all"
)
_BEFORE = -1


def describe_fault(fault: InputFault) -> str:
    """Return what a fault did to the last action, in a sentence."""
    return EVENTS[fault.fault].format(times=fault.times)


def fault_step(fault: InputFault, *, inserted: bool) -> EditedStep:
    """Return the step after an action that a fault hit; its picture is a recorded one."""
    event = describe_fault(fault)
    return EditedStep(ops=(), event=event, fidelity="recorded", inserted=inserted)


def fault_steps(
    sample: Sample, planner: Planner, seed: int
) -> Iterator[tuple[Plan, EditedStep | None]]:
    """Yield the plans of a step's rows under a planner of input faults, with their events.

    A step that no fault concerns yields nothing.

    Args:
        sample: the step.
        planner: its plans hold faults of the input, and nothing else.
        seed: 0 to 2**64 - 1.

    Raises:
        NotApplicable: the recording does not prove what a fault leads to.
        BuildError: a plan draws, acts on the machine, or has one kind of fault twice.
    """
    faults = _RecordingFaults(sample, planner, seed)
    steps = sample.trajectory.steps
    position = sample.position
    follows = position > 0 and steps[position - 1].index == sample.step.index - 1
    # The screen after a step that the machine received otherwise is not the one after its action.
    is_altered = follows and isinstance(steps[position - 1], AlteredStep)
    before = faults.hit(position - 1) if follows else None
    hit = faults.hit(position)
    if before is not None and before.is_recorded and not before.problem:
        yield before.plan, fault_step(before.fault, inserted=False)
    elif hit is not None and not hit.problem:
        yield hit.plan, None
    elif before is not None and not before.problem and not is_altered:
        yield before.plan, None
    if hit is not None and hit.problem:
        raise NotApplicable(hit.problem)
    if hit is not None and not hit.is_recorded:
        yield hit.plan, fault_step(hit.fault, inserted=True)
    if position == len(steps) - 1:
        faults.check_used()


@dataclass(frozen=True)
class _Hit:
    """A fault that hits a recorded action.

    Args:
        plan: holds this fault alone.
        is_recorded: whether it happened when the recording was made.
        problem: why no row shows it; `""` if rows do.
    """

    plan: Plan
    is_recorded: bool = False
    problem: str = ""

    @property
    def fault(self) -> InputFault:
        """The fault."""
        return self.plan.inputs[0]


@dataclass(frozen=True)
class _RecordingFaults:
    """The faults that a planner plans for a recording, on the screen of one of its steps.

    As in an episode, the newest planned fault waits for the next action that it can hit.
    """

    sample: Sample
    planner: Planner
    seed: int

    @property
    def _steps(self) -> Sequence[Step]:
        return self.sample.trajectory.steps

    def hit(self, position: int) -> _Hit | None:
        """Return the fault that hits the action at a position, or `None`."""
        step = self._steps[position]
        recorded = step.faults if isinstance(step, AlteredStep) else ()
        for _, plan in self._plans(step.index) if recorded else ():
            for fault in plan.inputs:
                is_recorded = any(_are_same(fault, other) for other in recorded)
                if is_recorded and fault.fault != "drop":
                    problem = self._unproved(position, fault)
                    return _Hit(replace(plan, inputs=(fault,)), is_recorded=True, problem=problem)
        for number, plan in self._newest(position):
            for fault in plan.inputs:
                if self._is_hit(fault, number, position):
                    problem = unshown_reason(fault, step, recorded)
                    return _Hit(replace(plan, inputs=(fault,)), problem=problem)
        return None

    def check_used(self) -> None:
        """Check that the last planned fault hits an action of the recording.

        Raises:
            NotApplicable: it waits in vain.
        """
        for number, plan in self._newest(len(self._steps) - 1):
            actions = [recorded_calls(step) for step in self._steps[max(0, number) :]]
            if not any(can_hit(fault, calls) for fault in plan.inputs for calls in actions):
                raise NotApplicable(NEVER_HIT)

    def _unproved(self, position: int, fault: InputFault) -> str:
        """Return why what the agent did after a recorded fault may be wrong; `""` if it was right.

        A slip is put right once the same action arrives. What the agent did next was a part of
        that, unless it had to be done again afterwards.
        """
        step, *later = self._steps[position:]
        if not later or later[0].index != step.index + 1:
            return NOTHING_AFTER
        codes = [other.action_code for other in later]
        start = 0  # the action that puts right what the fault did
        if fault.fault == "offset":
            repeats = [index for index, code in enumerate(codes) if code == step.action_code]
            arrived = [index for index in repeats if not isinstance(later[index], AlteredStep)]
            if not arrived:
                return NOT_REPAIRED
            start = arrived[0]
        return DONE_AGAIN if codes[0] in codes[start + 1 :] else ""

    def _newest(self, position: int) -> Iterator[tuple[int, Plan]]:
        """Yield the newest plan with faults at or before a position, and its step, if any."""
        yield from itertools.islice(self._plans(position), 1)

    def _plans(self, last: int) -> Iterator[tuple[int, Plan]]:
        """Yield the plans with faults, from the step `last` back to before the episode.

        Raises:
            BuildError: a plan draws, acts on the machine, or has one kind of fault twice.
        """
        sample = self.sample
        for number in range(last, _BEFORE - 1, -1):
            if not self.planner.is_due(number):
                continue
            plan = self.planner.plan(sample.scene, seed=self.seed, sample=sample.key, step=number)
            if plan.inputs and (plan.ops or plan.effects):
                raise BuildError(
                    f"{plan.corruption} plans faults of the input together with other things; in a"
                    " dataset they stand alone"
                )
            check_each_once(plan)
            if plan.inputs:
                yield number, plan

    def _is_hit(self, fault: InputFault, number: int, position: int) -> bool:
        """Return whether a fault that waits from a step on hits the action at a position."""
        # The action itself comes first: most settle it alone.
        positions = (position, *range(max(0, number), position))
        hits = (can_hit(fault, recorded_calls(self._steps[index])) for index in positions)
        return next(hits) and not any(hits)


def unshown_reason(fault: InputFault, step: Step, recorded: Sequence[InputFault] = ()) -> str:
    """Return why a fault that did not happen cannot be shown; `""` if it can.

    Args:
        fault: it would hit the action of the step.
        step: of a recording.
        recorded: the faults that hit this action when the recording was made.
    """
    if fault.fault == "drop":
        if holds_several(step.action_code, step.action):
            return SEVERAL
        return RELATIVE if moves_from_pointer(recorded_calls(step)) else ""
    is_other = any(other.fault == fault.fault for other in recorded)
    return OTHER_FAULT if is_other else NO_PICTURE


def _are_same(first: InputFault, second: InputFault) -> bool:
    """Return whether two faults do the same to one action."""
    return replace(first, actions=1) == replace(second, actions=1)


def is_held(steps: Sequence[Step]) -> bool:
    """Return whether the actions of some steps leave a button or a key pressed."""
    down: set[str] = set()
    for step in steps:
        for call in recorded_calls(step):
            is_key = call.function in ("keyDown", "keyUp")
            if not is_key and call.function not in ("mouseDown", "mouseUp"):
                continue
            arguments = call.bind(KEYBOARD[call.function] if is_key else POINTER[call.function])
            pressed = arguments.get("key" if is_key else "button")
            name = "left" if pressed is None else str(pressed.value)
            if call.function.endswith("Down"):
                down.add(name)
            else:
                down.discard(name)
    return bool(down)


def recorded_calls(step: Step) -> Sequence[PyautoguiCall]:
    """Return the calls of a recorded action; none if it does nothing, or is no such code."""
    code = step.action_code
    if isinstance(step, RecordedStep) and not step.acts:
        return ()
    try:
        if not code or (isinstance(step, RecordedStep) and step.dialect != PYAUTOGUI):
            code = write_pyautogui(step.action)
        return () if code in ACTION_WORDS else read_calls(ParsedSource(code), RECORDED_FUNCTIONS)
    except ActionError:
        return ()
