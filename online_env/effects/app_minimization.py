"""App minimization on a live machine: all windows are minimised at once.

The effect is that of the show-desktop key. The spec is
`hijack_data/corruptions/app_minimization.py`, its look in recordings
`pipelines/edits/app_minimization.py`.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

from ..desktops.protocol import Capability
from ..errors import MissingCapabilityError
from .base import EffectRecord, LiveEffect, Probe, Undone, register
from .guest import Guest

MINIMISE_TIMEOUT_S = 10.0  # s for the window manager to carry out a request
DESKTOP_WINDOW_TYPES = ("desktop", "dock")  # window types that are part of the desktop itself


@register
class Minimise(LiveEffect):
    """Shows the desktop."""

    kind: ClassVar[str] = "minimise"
    needs: ClassVar[frozenset[Capability]] = frozenset({"windows"})

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Ask the window manager to show the desktop; if it cannot, minimise each window.

        Raises:
            MissingCapabilityError: the guest lacks a tool, which the message names.
        """
        result = guest.x("minimise", MINIMISE_TIMEOUT_S)
        if not result.pop("managed"):
            raise MissingCapabilityError(
                "no window manager runs in the guest (EWMH): nothing can minimise its windows"
            )
        return result

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that only the desktop and its panels are mapped."""
        state = guest.x("state")
        visible_titles = [window["title"] for window in on_screen(state)]
        facts = {
            "desktop_shown": state["desktop_shown"],
            "hidden": len(record["hidden"]),
            "on_screen": visible_titles,
        }
        if visible_titles:
            return Probe(
                False, facts, f"still on the screen: {', '.join(map(repr, visible_titles))}"
            )
        if record["by"] == "show_desktop" and not state["desktop_shown"]:
            return Probe(False, facts, "the window manager does not say that it shows the desktop")
        return Probe(True, facts)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Bring back the hidden windows that still exist, with the formerly active one in front."""
        hidden = record.get("hidden")
        active = record.get("active", 0)
        result = guest.x("restore", MINIMISE_TIMEOUT_S, ids=hidden, active=active)
        still_minimised = len(result["left"])
        facts = {"restored": len(result["restored"]) - still_minimised}
        problem = f"{still_minimised} windows stay minimised" if still_minimised else ""
        return Undone(not still_minimised, facts, problem)

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return how many windows were minimised."""
        return f"no window is on the screen, {facts['hidden']} went to the panel"

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return how many windows are back."""
        return f"{facts['restored']} windows are back"


def on_screen(state: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the application windows that are mapped, bottom to top."""
    mapped = [window for window in state["windows"] if window["mapped"]]
    return [window for window in mapped if window["type"] not in DESKTOP_WINDOW_TYPES]
