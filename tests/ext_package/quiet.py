"""A third-party corruption of the machine, with all that belongs to it in one file.

The corruption, the effect with its sentences, and the edit with the event and the reminder.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hijack_data.plugin import Corruption, Draft, Effect, Paste, param, png_recipe, register
from online_env.effects import LiveEffect, Probe, Undone
from online_env.effects import register as register_effect
from pipelines.edits import Edit
from pipelines.edits import register as register_edit

FLAG = "/tmp/quiet-hours"
SIDE = 24


@register
@dataclass(frozen=True)
class QuietHours(Corruption):
    """Turns notifications off."""

    name: ClassVar[str] = "quiet_hours"
    category: ClassVar[str] = "environment_error"
    scope: ClassVar[str] = "state"
    effects: ClassVar[tuple[str, ...]] = ("quiet",)

    step: int = param(0, "When it happens", low=0, high=1000)
    hours: int = param(8, "For how long", low=1, high=24)

    def make_plan(self, scene, stream, step):
        """One effect."""
        return Draft(effects=(Effect("quiet", {"hours": self.hours}),))


@register_effect
class Quiet(LiveEffect):
    """Leaves a flag that the machine's notifier looks for."""

    kind: ClassVar[str] = "quiet"
    needs = frozenset({"files"})

    def apply(self, guest, params):
        """Write the flag."""
        guest.desktop.write_file(FLAG, str(params["hours"]).encode())
        return {"hours": params["hours"]}

    def probe(self, guest, record):
        """Look for it."""
        value = guest.desktop.execute(["test", "-f", FLAG]).ok
        return Probe(value, {"hours": record.get("hours")}, "" if value else "there is no flag")

    def undo(self, guest, record):
        """Remove it."""
        return Undone(guest.desktop.execute(["rm", "-f", FLAG]).ok)

    def in_words(self, facts):
        """What a probe means."""
        return f"notifications are off for {facts['hours']} hours"

    def undone_in_words(self, facts):
        """How it was taken back."""
        return "notifications are on again"


@register_edit
class QuietEdit(Edit):
    """Shows a bell that is struck through, in a corner."""

    kind: ClassVar[str] = "quiet"
    event: ClassVar[str] = "Notifications were turned off for {} hours."
    reminder: ClassVar[str] = "Notifications are off: look for messages yourself."

    def apply(self, frame, effect):
        """Draw the bell."""
        rgba = np.full((SIDE, SIDE, 4), 255, np.uint8)
        rgba[np.eye(SIDE, dtype=bool)] = (200, 0, 0, 255)
        sign = Paste(png_recipe(rgba), ((frame.scene.size[1] - SIDE, 0),))
        return self.make_step(
            ops=(sign,), fidelity="composited", detail=str(effect.params["hours"])
        )
