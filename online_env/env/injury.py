"""What is done to the machine in an episode: applied, proved, kept up, undone, and all of it on record."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.plan import Effect

from ..desktops.protocol import Desktop
from ..effects import Applied, find, perform, undo
from ..errors import DesktopError, MissingCapabilityError
from .script import Script


@dataclass
class _Live:
    """An effect that was applied before observation `step`.

    `active` until somebody asked for it to be undone; `clean` once that is done.
    """

    step: int
    applied: Applied
    active: bool = True
    clean: bool = False

    def undo(self) -> bool:
        """Put it back; returns whether there was something to put back, and it is."""
        self.active = False
        try:
            found = self.applied.undo()
        except DesktopError as error:
            self.applied.record["undone"].append({"ok": False, "problem": f"{type(error).__name__}: {error}"})
            return False
        self.clean = found.ok
        return found.ok and find(self.applied.effect.kind).lasting


class Injury:
    """The effects of one episode on one desktop; `password` is that of its user."""

    def __init__(self, desktop: Desktop, password: str) -> None:
        self._desktop, self._password = desktop, password
        self._live: list[_Live] = []
        self._broken: list[str] = []  # kinds of effects that broke off while they were applied
        self._events: list[dict[str, Any]] = []

    @property
    def active(self) -> bool:
        """Whether something was done that nobody has asked to undo."""
        return any(live.active for live in self._live)

    @property
    def records(self) -> list[dict[str, Any]]:
        """What was done, as the episode's record has it."""
        return [{"step": live.step, "record": live.applied.record} for live in self._live]

    def events(self) -> list[dict[str, Any]]:
        """What was done since this was last asked."""
        found, self._events = self._events, []
        return found

    def inject(self, due: Sequence[Effect], script: Script, step: int) -> str:
        """Apply and probe each effect; returns what went wrong with the first that failed, or nothing.

        Raises `MissingCapabilityError` where a tool is missing in the guest; then nothing was changed.
        """
        for effect in due:
            try:
                problem = self._prove(effect, script, step)
            except MissingCapabilityError:
                raise
            except DesktopError as error:
                problem = f"{type(error).__name__}: {error}"
            if problem:
                return f"{effect.kind} at step {step}: {problem}"
        return ""

    def _prove(self, effect: Effect, script: Script, step: int) -> str:
        self._broken.append(effect.kind)
        applied = perform(effect, self._desktop, script.stream(effect.kind, step), self._password)
        self._broken.pop()
        self._live.append(_Live(step, applied))
        self._events.append({"step": step, "effect": effect.kind, "record": applied.record})
        found = applied.probe()
        return "" if found.ok else found.problem or "its probe failed"

    def refresh(self) -> None:
        """Keep up what would fade by itself."""
        for live in self._live:
            if live.active:
                live.applied.refresh()

    def repair(self) -> bool:
        """Undo what is active, the last first; returns whether that helped."""
        undone = [live.undo() for live in reversed(self._live) if live.active]
        return all(undone)

    def forget(self) -> None:
        """The desktop was replaced by a pristine one."""
        for live in self._live:
            live.active, live.clean = False, True

    def undo(self) -> None:
        """Put back whatever is left; what cannot be is on record."""
        for live in reversed(self._live):
            if not live.clean:
                live.undo()
        for kind in self._broken:
            with contextlib.suppress(HijackError):
                undo(kind, self._desktop, self._password)
        self._broken.clear()
