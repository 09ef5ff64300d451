"""Send the agent's actions to the machine through the faults of the plans, and prove each fault."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hijack_data.actions.input_faults import WaitingFaults, first_press
from hijack_data.plan import Plan
from hijack_data.types import BoxArray, Size

from ..desktops.protocol import Desktop, RunResult
from ..effects.base import Probe
from ..errors import DesktopTimeoutError, GuestError

TOOL_TIMEOUT_S = 30.0
MAX_ERROR_CHARS = 300
_Events = list[dict[str, Any]]
_DOWN = ("key_down", "button_down")


class InputChannel:
    """Runs the agent's code on the machine, changed by the faults that wait for it.

    A machine whose guest server records what the X server gets proves each fault by those events.
    On any other the log itself is the proof: the machine got nothing but what was sent.

    Args:
        desktop: The machine.
        size: `(height, width)` of its screen.
    """

    def __init__(self, desktop: Desktop, size: Size) -> None:
        self._desktop = desktop
        self._size = size
        self._waiting = WaitingFaults(size)
        self.records: list[dict[str, Any]] = []

    @property
    def needs_elements(self) -> bool:
        """Whether a fault waits that depends on where the elements are."""
        return self._waiting.needs_elements

    def add(self, plan: Plan) -> None:
        """Let the faults of a plan wait for the next actions."""
        self._waiting.add(plan.inputs)

    def send(self, code: str, line: dict[str, Any], boxes: BoxArray) -> tuple[RunResult, str]:
        """Run the agent's code, or what the faults make of it.

        Args:
            code: The action, in pixels of the screen.
            line: The line of the log; it receives `input` if a fault hits the action.
            boxes: The elements of the observation that the agent saw, int32 `[N, 4]`, `xyxy`.

        Returns:
            What the machine answered, and why a fault is not proved, or "".
        """
        altered = self._waiting.alter(code, boxes)
        if altered is None:
            return self._run(code), ""
        entry: dict[str, Any] = {
            "sent": altered.code,
            "faults": [fault.to_data() for fault in altered.faults],
            "probe": vars(Probe(False, {}, "the machine failed before it was proved")),
        }
        # Noted first: the machine may fail at any point below.
        line["input"] = entry
        self.records.append({"step": line["step"], **entry})
        is_watched = self._watch("start") is not None
        result = self._run(altered.code)
        events = self._watch("stop") if is_watched else None
        kinds = {fault.fault for fault in altered.faults}
        problem = result.error[-MAX_ERROR_CHARS:] if "drop" in kinds and not result.ok else ""
        probe = Probe(not problem, {"by": "result", "ok": result.ok}, problem)
        if is_watched and events is None:
            probe = Probe(False, {}, "the guest's record of its input was lost")
        elif events is not None:
            times = [fault.times for fault in altered.faults if fault.fault == "repeat"]
            probe = _prove(events, kinds, times, first_press(altered.code, self._size), result)
        entry["probe"] = self.records[-1]["probe"] = vars(probe)
        names = ", ".join(fault.fault for fault in altered.faults)
        problem = "" if probe.ok else f"{names} at step {line['step']}: {probe.problem}"
        return result, problem

    def _run(self, code: str) -> RunResult:
        try:
            # Begin with a new line, because some guests put other code before it on the same line.
            return self._desktop.run(f"\n{code}")
        except (GuestError, DesktopTimeoutError) as error:
            # The code never ends, or the guest is dead; then the next screenshot raises.
            return RunResult("error", "", str(error))

    def _watch(self, operation: str) -> _Events | None:
        """Start or stop the guest's record of its input; `None` if the machine has none."""
        tool = getattr(self._desktop, "tool", None)
        if tool is None or not getattr(self._desktop, "is_ours", True):
            return None
        answer = cast("Mapping[str, Any]", tool("inputtool", operation, {}, TOOL_TIMEOUT_S))
        return answer.get("events") if operation == "stop" else []


def _prove(
    events: Sequence[Mapping[str, Any]],
    kinds: set[str],
    times: Sequence[int],
    point: tuple[int, int] | None,
    result: RunResult,
) -> Probe:
    """Compare what the X server got with what the faults should let through.

    Args:
        events: Those of pointer and keyboard, in their order.
        kinds: The kinds of the faults.
        times: How often each `repeat` repeats.
        point: Where the sent code first presses a button; `None` if it does not say.
        result: What the machine answered.
    """
    names = [_name(event) for event in events]
    downs = [event for event in events if event["event"] in _DOWN]
    facts: dict[str, Any] = {"by": "events", "down": len(downs), "events": len(events)}
    if "drop" in kinds:
        problem = f"the X server got {len(events)} events, none was sent" if events else ""
        return Probe(not problem, facts, problem)
    if not result.ok:  # the agent's code failed by itself, maybe in the middle
        return Probe(True, {**facts, "failed": result.error[-MAX_ERROR_CHARS:]})
    if not downs:
        return Probe(False, facts, "the X server got no press of a button or key")
    if "offset" in kinds and point is not None:
        first = next((event["at"] for event in downs if event["event"] == "button_down"), None)
        facts["at"] = first
        if first != list(point):
            return Probe(False, facts, f"the button went down at {first}, not at {list(point)}")
    for count in times:
        part = len(names) // count
        if names != names[:part] * count:
            problem = f"the X server got {len(events)} events, which are not {count} times the same"
            return Probe(False, facts, problem)
        names = names[:part]
        facts["once"] = part
    return Probe(True, facts)


def _name(event: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what must be the same when an input is repeated: a key may get another code."""
    is_button = str(event["event"]).startswith("button")
    return (event["event"], event["code"]) if is_button else (event["event"],)
