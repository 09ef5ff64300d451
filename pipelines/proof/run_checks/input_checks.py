"""Compute again which actions of an episode the faults of its plans changed, and how."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hijack_data.actions.agent_actions import ACTION_WORDS
from hijack_data.actions.input_faults import WaitingFaults
from hijack_data.errors import short_repr
from hijack_data.plan import Plan
from hijack_data.types import as_boxes

from ...readers import fields
from . import field_checks
from .field_checks import INPUT


class InputReplay:
    """Replays the faults of one episode; feed it the lines in their order.

    Args:
        before: the plan before the episode.
    """

    def __init__(self, before: Plan) -> None:
        self._waiting = WaitingFaults(before.size)
        self._waiting.add(before.inputs)

    def problems(self, line: Mapping[str, Any], plan: Plan) -> Iterator[str]:
        """Yield the differences between a line and what the faults make of its action.

        Args:
            line: one line of the steps.
            plan: its plan, computed again.

        Raises:
            ActionError: the code of the line is beyond the grammar.
        """
        self._waiting.add(plan.inputs)
        logged = line.get("input")
        code = line.get("code")
        altered = None
        if isinstance(code, str) and code not in ACTION_WORDS:
            altered = self._waiting.alter(code, as_boxes(fields.items(line, "boxes")))
        if altered is None:
            if logged is not None:
                yield "input is changed, and no fault was due that hits the action"
            return
        if not isinstance(logged, dict):
            yield "input is missing: a fault of the plans hits the action"
            return
        for text in field_checks.unknown_fields(logged, INPUT):
            yield f"input: {text}"
        if logged.get("sent") != altered.code:
            logged_code = short_repr(logged.get("sent"))
            yield f"input.sent is {logged_code}, by the faults it is {short_repr(altered.code)}"
        if logged.get("faults") != [fault.to_data() for fault in altered.faults]:
            yield "input.faults are not those that hit the action"


def input_problems(
    record: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], is_declared: bool
) -> Iterator[str]:
    """Yield the differences between the record's list of changed inputs and the lines.

    Args:
        record: of the episode.
        lines: its steps.
        is_declared: whether its corruption says that it changes the input.
    """
    entries = [
        {"step": line.get("step"), **line["input"]}
        for line in lines
        if isinstance(line.get("input"), dict)
    ]
    expected = entries if entries or is_declared else None
    if record.get("inputs") != expected:
        yield "inputs are not those of the lines"
    if record.get("status") != "ok":
        return
    for entry in entries:
        probe = entry.get("probe")
        if not isinstance(probe, dict) or probe.get("ok") is not True:
            yield f"the input at step {entry['step']} was not proved, and the status is 'ok'"
