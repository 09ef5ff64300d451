"""Check rows with events on the machine against their plan and the asset pack.

Which recorded picture an edit chooses depends on the applications and elements of the recording,
which a dataset does not contain. But the plan names the picture and its place, and the pack
contains the action that undoes it.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from hijack_data.actions.input_faults import can_hit
from hijack_data.coords import CoordMap
from hijack_data.errors import short_repr
from hijack_data.pack import RecordedAction, find_asset
from hijack_data.plan import Op, Paste, Plan, Resample
from hijack_data.registry import is_ours
from hijack_data.types import Size

from ..dataset.sample import Sample
from ..edits import EDITS
from ..edits.base import WAIT, Edit, EditedStep
from ..edits.input_faults import fault_step, recorded_calls, unshown_reason
from ..edits.variants import Variant, step_after
from ..errors import DatasetError


def event_variant(row: Mapping[str, Any], plan: Plan, sample: Sample) -> Variant | None:
    """Return the variant that a row with an event must be.

    Args:
        row: as it is stored.
        plan: its plan.
        sample: its step.

    Returns:
        The variant, or `None` if the pack has no action that undoes the picture.

    Raises:
        DatasetError: the labels of the row contradict its plan.
        AssetError: the plan pastes a picture that the pack does not contain.
    """
    if plan.inputs:
        return _fault_variant(row, plan, sample)
    kinds = [effect.kind for effect in plan.effects]
    if len(kinds) != 1 or kinds[0] not in EDITS:
        raise DatasetError(
            f"event is {short_repr(row['event'])}, and its plan does {kinds or 'nothing'} to the"
            " machine"
        )
    edit = EDITS[kinds[0]]
    if not is_ours(edit):
        return None  # only the plug-in of an edit knows what the edit shows
    _check_labels(row, edit)
    pasted, later_ops = _parts(plan)
    if row["fidelity"] == "recorded" and len(pasted) != 1:
        raise DatasetError(
            "fidelity is 'recorded', and its screen is put together: it should be 'composited'"
        )
    response = _response(edit, row, plan, pasted)
    if response is None and edit.answer != "keep":
        return None
    edited = EditedStep(
        ops=pasted,
        event=row["event"],
        fidelity=row["fidelity"],
        response=response,
        inserted=edit.inserted,
        reminder=edit.reminder,
    )
    over = replace(plan, effects=())
    if response is not None:
        over = replace(over, ops=later_ops)
    return Variant(step_after(sample, edited), plan, over, edited)


def _fault_variant(row: Mapping[str, Any], plan: Plan, sample: Sample) -> Variant:
    """Return the variant of a row after an action that a fault of the input hit.

    Raises:
        DatasetError: the labels of the row contradict its plan.
    """
    if len(plan.inputs) != 1 or plan.ops or plan.effects:
        raise DatasetError("its plan must hold one fault of the input, and nothing else")
    (fault,) = plan.inputs
    if row["inserted"] and fault.fault != "drop":
        raise DatasetError(f"inserted is True, and only a run shows what {fault.fault!r} leads to")
    if row["inserted"]:
        is_hit = can_hit(fault, recorded_calls(sample.step))
        reason = unshown_reason(fault, sample.step) if is_hit else "the fault cannot hit its action"
        if reason:
            raise DatasetError(f"inserted is True, and {reason}")
    return Variant(sample, plan, plan, fault_step(fault, inserted=row["inserted"]))


def _check_labels(row: Mapping[str, Any], edit: Edit) -> None:
    pattern = re.escape(edit.event).replace(re.escape("{}"), ".+")
    if not re.fullmatch(pattern, row["event"]):
        raise DatasetError(
            f"event is {short_repr(row['event'])}, it should be {short_repr(edit.event)}"
        )
    for name in ("reminder", "inserted"):
        expected = getattr(edit, name)
        if row[name] != expected:
            raise DatasetError(
                f"{name} is {short_repr(row[name])}, it should be {short_repr(expected)}"
            )


def _parts(plan: Plan) -> tuple[tuple[Op, ...], tuple[Op, ...]]:
    """Return the part of the plan that an edit pasted, and the part drawn over it."""
    end = 0
    size = plan.size
    for number, op in enumerate(plan.ops, 1):
        if isinstance(op, Resample):
            size = op.size
        if _is_asset(op):
            end = number if size == plan.size else number + 1
    return plan.ops[:end], plan.ops[end:]


def _is_asset(op: Op) -> bool:
    return isinstance(op, Paste) and op.sprite.get("draw") == "asset"


def _response(
    edit: Edit, row: Mapping[str, Any], plan: Plan, pasted: tuple[Op, ...]
) -> RecordedAction | None:
    """Return the action that a row must have; of several possible ones, the one that it has."""
    if edit.answer == "wait":
        return WAIT
    if edit.answer == "keep":
        return None
    responses = list(_recoveries(plan.size, pasted))
    for response in responses:
        if _box_in(plan, response) == row["target_box"]:
            return response
    return responses[0] if responses else None


def _box_in(plan: Plan, response: RecordedAction) -> list[int] | None:
    if response.target_box is None:
        return None
    return plan.coords.boxes_to_observation([response.target_box])[0].tolist()


def _recoveries(screen: Size, pasted: tuple[Op, ...]) -> Iterator[RecordedAction]:
    """Yield the actions that undo the pasted pictures, in pixels of the screen."""
    size = screen
    for op in pasted:
        if isinstance(op, Resample):
            size = op.size
        if not isinstance(op, Paste) or not _is_asset(op):
            continue
        asset = find_asset(str(op.sprite["id"]), str(op.sprite["sha256"]))
        if asset.recover is None:
            continue
        left, top = tuple(op.sprite.get("crop", (0, 0)))[:2]
        coords = CoordMap(observation=size, screen=screen)
        for x, y in op.at:
            yield _scale_action(asset.recover.translate(x - left, y - top), coords)


def _scale_action(response: RecordedAction, coords: CoordMap) -> RecordedAction:
    box = response.target_box
    if box is not None:
        x1, y1, x2, y2 = coords.boxes_to_screen([box])[0].tolist()
        box = (x1, y1, x2, y2)
    return RecordedAction(coords.action_to_screen(response.action), box)
