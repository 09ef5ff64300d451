"""Corrupt a running desktop outside an episode, and undo that."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hijack_data._apply import apply
from hijack_data.corruption import Corruption
from hijack_data.elements import scene_from
from hijack_data.errors import ParameterError
from hijack_data.plan import Plan
from hijack_data.rng import Stream
from hijack_data.safety import changed_pixels
from hijack_data.types import UInt8Array, size_text

from ..desktops.protocol import Desktop
from ..effects import Applied, find, perform, resume, undo
from ..effects.descriptions import in_words
from ..errors import DesktopError
from .ledger import Ledger

SAMPLE = "by hand"  # the key of the random draws


@dataclass
class AppliedPlan:
    """A plan that was applied to a desktop.

    Args:
        plan: The plan.
        before: The screen before it, uint8 RGB `[H, W, 3]`.
        after: What an agent sees after it, likewise.
        records: One record for each effect.
    """

    plan: Plan
    before: UInt8Array
    after: UInt8Array
    records: list[dict[str, Any]]

    @property
    def ok(self) -> bool:
        """Whether every probe succeeded."""
        return all(record["probes"][-1]["ok"] for record in self.records)

    @property
    def saw(self) -> str:
        """What the probes found; for a corruption of the picture, how much of it changed."""
        if not self.records:
            return f"{self._change()}; the machine is as it was"
        words: list[str] = []
        for record in self.records:
            probe = record["probes"][-1]
            words.append(in_words(record["effect"], probe["facts"], probe["problem"]))
        return "; ".join(words)

    def _change(self) -> str:
        """Return how the picture differs from the screen."""
        height, width = self.before.shape[:2]
        if self.before.shape != self.after.shape:
            agent_size = size_text((self.after.shape[0], self.after.shape[1]))
            real = size_text((height, width))
            return f"the agent sees {agent_size} of the screen's {real} pixels"
        share = changed_pixels(self.before, self.after) / (height * width)
        return f"{share:.1%} of the pixels that the agent sees are changed"


def corrupt_desktop(
    desktop: Desktop,
    spec: Corruption,
    *,
    seed: int = 0,
    step: int | None = None,
    note: Callable[[list[dict[str, Any]]], object] | None = None,
) -> AppliedPlan:
    """Plan for what is on the screen, apply it to the machine and to the picture, and probe.

    Args:
        desktop: Any desktop.
        spec: The corruption.
        seed: The seed of its draws.
        step: The step of an episode; the first at which it acts if omitted.
        note: Called with the records of the effects before they are probed, to keep them.

    Raises:
        ParameterError: The corruption does not act at `step`, or changes an agent's input.
        MissingCapabilityError: The machine lacks something, which is named.
    """
    if spec.inputs:
        raise ParameterError(
            f"{spec.name} changes what an agent does, and no agent acts on this desktop; use it in"
            " hijack bench, or in hijack build for a recording"
        )
    before = desktop.screenshot()
    tree = desktop.accessibility() if spec.needs_elements else None
    scene = scene_from(before, tree=tree, detect="none")
    if step is not None and not spec.is_due(step):
        raise ParameterError(
            f"{spec.name} does not act at step {step} (step is {spec.params().get('step')}); "
            f"leave out --step, or add --set step={step}"
        )
    plan = spec.plan(scene, seed=seed, sample=SAMPLE, step=step)
    stream = Stream(seed, plan.corruption, SAMPLE, step or 0)
    applied_effects: list[Applied] = []
    try:
        for effect in plan.effects:
            applied = perform(effect, desktop, stream)
            applied_effects.append(applied)
    finally:  # those before one that fails are on the desktop, too
        if applied_effects and note is not None:
            note([applied.record for applied in applied_effects])
    for applied in applied_effects:
        applied.probe()
    after = desktop.screenshot() if applied_effects else before
    return AppliedPlan(
        plan, before, apply(plan, after), [applied.record for applied in applied_effects]
    )


def refuse_twice(desktop: Desktop, spec: Corruption, ledger: Ledger, name: str) -> None:
    """Refuse a corruption that is on the desktop already and still holds.

    Args:
        desktop: The machine.
        spec: The corruption.
        ledger: What was applied to the machine by hand.
        name: The desktop's name in the message.

    Raises:
        DesktopError: It is there, and each of its effects holds.
    """
    for entry in ledger.entries():
        if entry["corruption"] == spec.name and _holds(entry, desktop):
            age = time.time() - entry["at"]
            undo = f"hijack desktop corrupt --undo {spec.name} --on {name}"
            raise DesktopError(
                f"{spec.name} is on {name} already, since {age:.0f} s, and still holds; take it"
                f" back first: {undo}"
            )


def _holds(entry: dict[str, Any], desktop: Desktop) -> bool:
    """Return whether an entry has lasting effects, and all of them hold."""
    lasting = [record for record in entry["records"] if find(record["effect"]).lasting]
    return bool(lasting) and all(resume(record, desktop).probe().ok for record in lasting)


def undo_recorded(desktop: Desktop, name: str | None, ledger: Ledger) -> list[tuple[str, str, Any]]:
    """Undo what the ledger holds, the latest first.

    Args:
        desktop: The machine.
        name: Undo this corruption only; all if `None`.
        ledger: What was applied by hand.

    Returns:
        Corruption, kind of the effect and result (`effects.Undone`) each.
    """
    results_by_entry: list[tuple[str, str, Any]] = []
    for entry in reversed(ledger.entries()):
        if name not in (None, entry["corruption"]):
            continue
        results: list[Any] = []
        for record in reversed(entry["records"]):
            undone = resume(record, desktop).undo()
            results.append(undone)
            results_by_entry.append((entry["corruption"], record["effect"], undone))
        if all(undone.ok for undone in results):
            ledger.drop(entry)
    return results_by_entry


def undo_unrecorded(desktop: Desktop, spec: Corruption) -> list[tuple[str, str, Any]]:
    """Undo a corruption of which there is no record, as far as the machine itself shows it.

    Returns:
        As `undo_recorded`.

    Raises:
        ParameterError: The corruption changes only the picture.
    """
    plan = spec.plan(scene_from(desktop.screenshot(), detect="none"), seed=0)
    if not plan.effects:
        problem = f"{spec.name} changes only what an agent sees, not the machine"
        raise ParameterError(f"{problem}: there is nothing to undo")
    return [(spec.name, effect.kind, undo(effect.kind, desktop)) for effect in plan.effects]
