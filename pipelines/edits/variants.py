"""The rows of a step under a planner: the corrupted picture, or the steps after its effects.

Effects happen to the machine, so they come first: a picture corruption that acts at the same step
is planned again on the screen after the effect, and drawn over it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import hijack_data as hj
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.pack import AssetPack
from hijack_data.plan import Effect, Plan
from hijack_data.planner import Planner
from hijack_data.rng import Stream
from hijack_data.types import Trajectory, as_boxes, as_target

from ..dataset.sample import Sample
from ..errors import BuildError
from ..fidelity import row_fidelity
from ..readers.recorded_actions import RecordedStep
from . import EDITS
from .base import EditedStep, Frame, NotApplicable, check_each_once
from .input_faults import fault_steps, is_held

BEFORE = -1  # the step number of effects before the first step
AVOIDING = ("avoid", "recover")
HELD = (
    "an earlier action holds a button or a key down, which would change what undoes the event does"
)


@dataclass(frozen=True)
class Variant:
    """A planned row.

    Args:
        sample: the step with the action and the scene that the row has.
        plan: all that is done to the clean screenshot.
        over: the part of the plan that can hide the target: all of it, unless the target is in the
            pastes of an edit.
        edit: the event, if the row shows one.
    """

    sample: Sample
    plan: Plan
    over: Plan
    edit: EditedStep | None = None


@dataclass(frozen=True)
class VariantPlanner:
    """Settings for planning rows.

    Args:
        seed: 0 to 2**64 - 1.
        label_policy: the treatment of a row whose target is hidden.
        pack: the recorded pictures; `None` if no planner acts on the machine.
        allow_platform_mismatch: whether they may be shown on recordings of other platforms.
    """

    seed: int
    label_policy: str
    pack: AssetPack | None
    allow_platform_mismatch: bool = False

    def variants(self, sample: Sample, planner: Planner) -> Iterator[Variant | None]:
        """Yield the rows of a step under a planner; `None` for one that the label policy drops.

        A step at which the planner does not act yields nothing. Nothing is drawn for faults of the
        input, so no label policy drops their rows.

        Raises:
            NotApplicable: an effect cannot be shown realistically.
            BuildError: the plan has an effect that no edit shows, or that the planner does not
                declare.
            HijackError: the picture cannot be corrupted.
        """
        if planner.inputs:
            for plan, edit in fault_steps(sample, planner, self.seed):
                yield Variant(sample, plan, plan, edit)
            return
        numbers = step_numbers(sample.trajectory, sample.position, planner)
        if not is_due(planner, numbers):
            return
        if not has_effects(planner):
            yield self._picture_variant(sample, planner, numbers[-1])
            return
        first = self._first_plan(sample, planner, numbers)
        if not first.effects:
            yield self._picture_variant(sample, planner, numbers[-1])
            return
        yield from self._with_effects(sample, planner, first, numbers[-1])

    def _with_effects(
        self, sample: Sample, planner: Planner, first: Plan, number: int
    ) -> Iterator[Variant | None]:
        """Yield the rows of a plan with effects: inserted steps come before the recorded one.

        Raises:
            NotApplicable: the event cannot be shown realistically; the message is the reason.
            BuildError: the plan has one kind of effect twice, whose rows would have the same id, or
                one that begins at a second, which no recording has.
        """
        delayed = next((effect.kind for effect in first.effects if effect.is_delayed), None)
        if delayed is not None:
            raise BuildError(
                f"{first.corruption}: {delayed} begins at a second (begins), and a recording has"
                " steps alone: leave it out, and give the corruption a step"
            )
        check_each_once(first)
        edits = [
            (self._apply_edit(sample, first, effect, number), effect) for effect in first.effects
        ]
        changing = [edit for edit, _ in edits if not edit.inserted]
        if len(changing) > 1:
            raise NotApplicable(
                "two effects change this screen, and what both leave was never recorded"
            )
        edits.sort(key=lambda pair: not pair[0].inserted)
        for edit, effect in edits:
            plan = replace(first, effects=(effect,))
            yield self._edited_variant(sample, planner, plan, edit, number)
        if not changing and first.ops:
            yield self._picture_variant(sample, planner, number)

    def _first_plan(self, sample: Sample, planner: Planner, numbers: list[int]) -> Plan:
        """Return the plan of a step; that of the first step includes effects before the episode."""
        plans = [
            planner.plan(sample.scene, seed=self.seed, sample=sample.key, step=number)
            for number in numbers
        ]
        plan = plans[-1]
        for before in plans[:-1]:
            if before.effects:  # pictures are corrupted from the first step on, not before it
                plan = _join_plans(replace(before, ops=()), plan)
        return plan

    def _plan_pictures(self, sample: Sample, planner: Planner, number: int) -> Plan | None:
        """Return a plan for pictures under the label policy, or `None` if it drops the row."""
        scene = sample.scene
        if self.label_policy not in AVOIDING:
            return planner.plan(scene, seed=self.seed, sample=sample.key, step=number)
        end = sample.step.action.end
        return hj.plugin.plan_avoiding(
            planner, scene, seed=self.seed, sample=sample.key, step=number, end=end
        )

    def _picture_variant(self, sample: Sample, planner: Planner, number: int) -> Variant | None:
        plan = self._plan_pictures(sample, planner, number)
        if plan is None:
            return None
        _check_declared(plan, planner)
        if plan.effects:
            plan = replace(plan, effects=())
        return Variant(sample, plan, plan)

    def _apply_edit(self, sample: Sample, plan: Plan, effect: Effect, number: int) -> EditedStep:
        if effect.kind not in EDITS or self.pack is None:
            raise BuildError(
                f"{plan.corruption} gave a plan with the effect {effect.kind!r}, which no edit"
                " shows"
            )
        edit = EDITS[effect.kind]
        if edit.inserted and is_held(sample.trajectory.steps[: sample.position]):
            raise NotApplicable(HELD)
        stream = Stream(self.seed, f"edit-{effect.kind}-v{edit.version}", sample.key, number)
        frame = Frame(
            trajectory=sample.trajectory,
            step=sample.step,
            scene=sample.scene,
            image=sample.image,
            pack=self.pack,
            stream=stream,
            allow_platform_mismatch=self.allow_platform_mismatch,
        )
        edited = edit.apply(frame, effect)
        return replace(edited, fidelity=row_fidelity(edited.fidelity, is_foreign=frame.is_foreign))

    def _edited_variant(
        self, sample: Sample, planner: Planner, plan: Plan, edit: EditedStep, number: int
    ) -> Variant | None:
        """Return the row of an edit, with the picture operations of `plan` drawn over it."""
        after = step_after(sample, edit)
        over: Plan | None = replace(plan, ops=(), effects=())
        if plan.ops:
            over = self._plan_pictures(after, planner, number)
        if over is None:
            return None
        edit = replace(edit, fidelity=row_fidelity(edit.fidelity, is_drawn_over=bool(over.ops)))
        notes = over.notes if plan.ops else plan.notes
        full_plan = replace(plan, ops=edit.ops + over.ops, notes=notes + edit.notes)
        hiding = full_plan if edit.response is None else replace(over, effects=())
        return Variant(after, full_plan, hiding, edit)


def _check_declared(plan: Plan, planner: Planner) -> None:
    """Refuse effects on the machine and faults of the input that a planner does not declare.

    Raises:
        BuildError: the plan has one of them.
    """
    if plan.inputs:
        kinds = ", ".join(dict.fromkeys(fault.fault for fault in plan.inputs))
        raise BuildError(
            f"{plan.corruption} gave a plan with faults of the input ({kinds}), which"
            f" {type(planner).__name__}.inputs does not declare"
        )
    if plan.effects and not has_effects(planner):
        kinds = ", ".join(dict.fromkeys(effect.kind for effect in plan.effects))
        raise BuildError(
            f"{plan.corruption} gave a plan with effects on the machine ({kinds}), which"
            f" {type(planner).__name__}.effects does not declare"
        )


def _join_plans(before: Plan, first: Plan) -> Plan:
    """Return the plan of the first step joined with the effects before the episode."""
    if not first.ops and not first.effects:
        return before
    new = tuple(effect for effect in first.effects if effect not in before.effects)
    if before.corruption == first.corruption:
        return replace(first, effects=before.effects + new)
    return before.then(replace(first, effects=new))


def step_after(sample: Sample, edit: EditedStep) -> Sample:
    """Return the step after an edit: its action, its target and the clickable elements."""
    scene = sample.scene
    step = sample.step
    if edit.response is None:
        boxes = [*scene.boxes.tolist(), *edit.boxes]
        return replace(sample, scene=replace(scene, boxes=as_boxes(boxes)))
    action = edit.response.action
    box = edit.response.target_box
    target = as_target(box or action.point)
    recorded = RecordedStep(
        step.index, step.image, action, write_pyautogui(action), box, edit.boxes, step.id
    )
    scene = replace(scene, boxes=as_boxes(edit.boxes), target=target)
    return replace(sample, step=recorded, scene=scene)


def has_effects(planner: Planner) -> bool:
    """Return whether a planner may have effects on the machine."""
    return bool(planner.effects)


def is_due(planner: Planner, numbers: list[int]) -> bool:
    """Return whether a planner may act at any of these steps."""
    return any(planner.is_due(number) for number in numbers)


def step_numbers(trajectory: Trajectory, position: int, planner: Planner) -> list[int]:
    """Return the step numbers that a planner sees at `position`; the last is the step's own.

    Corruptions of the machine and of the input count steps from 0, as in a live episode, with -1
    before the first; recordings number their steps from 0 or 1, with gaps. Corruptions of the
    picture use the recorded number.
    """
    if not has_effects(planner) and not planner.inputs:
        return [trajectory.steps[position].index]
    return [BEFORE, 0] if position == 0 else [position]


def is_ever_due(trajectory: Trajectory, planner: Planner) -> bool:
    """Return whether a planner may act at any step of a recording."""
    positions = range(len(trajectory.steps))
    return any(is_due(planner, step_numbers(trajectory, k, planner)) for k in positions)
