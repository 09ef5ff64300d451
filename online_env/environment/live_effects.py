"""Apply, verify, maintain and undo live effects during an episode, and record each of these."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.plan import Effect

from ..desktops.protocol import Desktop
from ..effects import Applied, EffectError, Probe, find, perform, undo
from ..effects.duration import read_delay
from ..errors import DesktopError, MissingCapabilityError
from .script import Script


@dataclass
class _Live:
    """An effect that was applied before observation `step`.

    It is `fresh` until the agent has seen it, `active` until it is to be undone, and `clean` once
    it is undone. `held_at_end` says whether it still held when the episode had been judged; `None`
    if that was not probed.
    """

    step: int
    applied: Applied
    fresh: bool = True
    active: bool = True
    clean: bool = False
    held_at_end: bool | None = None

    @property
    def kind(self) -> str:
        return self.applied.effect.kind

    @property
    def lasting(self) -> bool:
        return find(self.kind).lasting

    @property
    def to_confirm(self) -> bool:
        """Whether the effect must still hold when the next observation has been taken."""
        if not (self.fresh and self.active):
            return False
        return self.lasting and self.applied.can_be_lifted

    def probe(self) -> str:
        """Return why its probe fails, or ""."""
        with _guarded(self.kind):
            probe = self.applied.probe()
        if probe.ok:
            return ""
        return probe.problem or "its probe failed"

    def undo(self) -> bool:
        """Undo the effect; return whether there was something to undo and undoing it worked."""
        self.active = False
        self.fresh = False
        try:
            with _guarded(self.kind):
                undone = self.applied.undo()
        except DesktopError as error:
            problem = f"{type(error).__name__}: {error}"
            self.applied.record["undone"].append({"ok": False, "problem": problem})
            return False
        self.clean = undone.ok
        return undone.ok and self.lasting


class EpisodeEffects:
    """The effects of one episode on one desktop.

    Args:
        desktop: The machine.
        password: The password of its user.
    """

    def __init__(self, desktop: Desktop, password: str) -> None:
        self._desktop = desktop
        self._password = password
        self._live: list[_Live] = []
        self._broken: list[str] = []  # kinds of effects that failed while they were applied
        self._events: list[dict[str, Any]] = []
        self._failed: tuple[Effect, int] | None = None
        self._delayed: list[tuple[float, Effect]] = []  # each with the time at which it begins

    @property
    def active(self) -> bool:
        """Whether there is an applied effect that is not to be undone yet."""
        return any(live.active for live in self._live)

    @property
    def records(self) -> list[dict[str, Any]]:
        """The effects in the form of the episode's record."""
        return [
            {"step": live.step, "record": live.applied.record}
            | ({} if live.held_at_end is None else {"held_at_end": live.held_at_end})
            for live in self._live
        ]

    def events(self) -> list[dict[str, Any]]:
        """Return the effects that were applied since the last call."""
        events = self._events
        self._events = []
        return events

    def inject(self, effects: Sequence[Effect], script: Script, step: int) -> str:
        """Apply and probe each effect, up to the first that fails.

        Those that begin at a second wait until then, and are applied by a later call.

        Args:
            effects: Those of the plan of this step.
            script: The plans of the episode.
            step: The number of the next observation.

        Returns:
            Why that one failed, or "".

        Raises:
            MissingCapabilityError: A tool is missing in the guest; then nothing was changed.
        """
        due = self._take_due()
        for effect in effects:
            delay = read_delay(effect.params)
            if delay:
                self._delayed.append((time.monotonic() + delay, effect))
            else:
                due.append(effect)
        for effect in due:
            try:
                problem = self._prove(effect, script, step)
            except MissingCapabilityError:
                self._failed = effect, step
                raise
            except DesktopError as error:
                problem = f"{type(error).__name__}: {error}"
            if problem:
                self._failed = effect, step
                return f"{effect.kind} at step {step}: {problem}"
        self._skip_covered()
        return ""

    def has_due(self) -> bool:
        """Return whether an effect that waited for its second is to be applied now."""
        return any(begin <= time.monotonic() for begin, _ in self._delayed)

    def _take_due(self) -> list[Effect]:
        now = time.monotonic()
        due = [effect for begin, effect in self._delayed if begin <= now]
        self._delayed = [(begin, effect) for begin, effect in self._delayed if begin > now]
        return due

    def _prove(self, effect: Effect, script: Script, step: int) -> str:
        self._broken.append(effect.kind)
        applied = self._perform(effect, script, step)
        self._broken.pop()
        live = _Live(step, applied)
        self._live.append(live)
        self._events.append({"step": step, "effect": effect.kind, "record": applied.record})
        return live.probe()

    def _perform(self, effect: Effect, script: Script, step: int) -> Applied:
        stream = script.stream(effect.kind, step)
        with _guarded(effect.kind):
            return perform(effect, self._desktop, stream, self._password)

    def _skip_covered(self) -> None:
        """Skip the confirmation of effects that a later effect of the same step hides."""
        to_confirm = [live for live in self._live if live.to_confirm]
        for live in to_confirm[:-1]:
            with _guarded(live.kind):
                live.fresh = live.applied.holds()

    def confirm(self) -> str:
        """Probe the effects since the last observation again, after the next one was taken.

        Returns:
            Why an effect was gone before the agent saw it, or "".
        """
        if self._failed is not None:  # the failure is known already
            return ""
        for live in self._live:
            if not live.to_confirm:
                continue
            problem = self._again(live)
            if problem:
                name = f"{live.kind} at step {live.step}"
                return f"{name} was gone before the agent saw it: {problem}"
        for live in self._live:
            live.fresh = False
        return ""

    def repeat(self, script: Script) -> str:
        """Apply the effect that `confirm` found gone once more, with the same draws.

        What an agent's action sets off may come late: a dialog that opens after the windows were
        minimised is no doing of the agent's.

        Returns:
            Why it fails again, or "".
        """
        if self._failed is None:
            return ""
        effect, step = self._failed
        self._failed = None
        for live in self._live:
            if live.active and (live.applied.effect, live.step) == (effect, step):
                live.undo()
        try:
            problem = self._prove(effect, script, step)
            self._skip_covered()
        except DesktopError as error:
            problem = f"{type(error).__name__}: {error}"
        if problem:
            self._failed = effect, step
        return problem

    def confirm_lasting(self) -> str:
        """At the end, probe again the effects that no agent can lift.

        Returns:
            Why one of them was gone, or "".
        """
        for live in self._live:
            if not live.active or not live.lasting or live.applied.can_be_lifted:
                continue
            problem = self._again(live)
            if problem:
                name = f"{live.kind} of step {live.step}"
                return f"{name}, which no agent can lift, was gone at the end: {problem}"
        return ""

    def note_held(self) -> None:
        """Note which lasting effects the agent has left in place, of those that none but it ended.

        Where the probe fails, that stays unknown.
        """
        for live in self._live:
            if live.lasting and live.active:
                with contextlib.suppress(DesktopError), _guarded(live.kind):
                    live.held_at_end = live.applied.holds()

    def _again(self, live: _Live) -> str:
        try:
            problem = live.probe()
        except DesktopError as error:
            problem = f"{type(error).__name__}: {error}"
            live.applied.record["probes"].append({**vars(Probe(False, {}, problem)), "seconds": 0})
        if problem:
            self._failed = live.applied.effect, live.step
        return problem

    def holds_elsewhere(self, script: Script, look: Callable[[], object]) -> bool:
        """Return whether the failed effect holds on a desktop that no agent has used.

        The effect is undone afterwards and not recorded, since it is not part of the episode.

        Args:
            script: The plans of the episode.
            look: Takes the picture, which is taken between two probes, as in an episode.
        """
        if self._failed is None:
            return False
        effect, step = self._failed
        try:
            applied = self._perform(effect, script, step)
            with _guarded(effect.kind):
                probe = applied.holds()
                look()
                if probe and find(effect.kind).lasting:
                    probe = applied.holds()
                applied.undo()
        except DesktopError:
            return False
        return probe

    def end_due(self, step: int) -> bool:
        """Undo the effects that are over, the latest first; return whether there were any.

        Args:
            step: The number of the next observation.

        Raises:
            EffectError: One cannot be undone, so it would last longer than planned.
        """
        any_over = False
        for live in reversed(self._live):
            with _guarded(live.kind):
                is_over = live.active and live.applied.has_ended(step - max(live.step, 0))
            if is_over:
                any_over = True
                live.undo()
                if not live.clean:
                    problem = live.applied.record["undone"][-1]["problem"]
                    raise EffectError(
                        f"{live.kind} of step {live.step} is over, and cannot be undone: {problem}"
                    )
        return any_over

    def refresh(self) -> None:
        """Refresh effects that would fade by themselves."""
        for live in self._live:
            if live.active:
                with _guarded(live.kind):
                    live.applied.refresh()

    def repair(self) -> bool:
        """Undo the active effects, the latest first; return whether all were undone."""
        active = [live for live in reversed(self._live) if live.active]
        undone = [live.undo() for live in active]
        return all(undone)

    def forget(self) -> None:
        """Note that the desktop was replaced by a pristine one."""
        for live in self._live:
            live.active = False
            live.fresh = False
            live.clean = True

    def undo(self) -> None:
        """Undo all remaining effects; failures are recorded."""
        for live in reversed(self._live):
            if not live.clean:
                live.undo()
        for kind in self._broken:
            with contextlib.suppress(DesktopError), _guarded(kind):
                undo(kind, self._desktop, self._password)
        self._broken.clear()


@contextlib.contextmanager
def _guarded(kind: str) -> Iterator[None]:
    """Turn any exception of an effect into an error that ends its episode, but not the run.

    An effect of a plug-in may raise anything.

    Raises:
        DesktopError: Raised by the block.
        EffectError: The block raised anything else.
    """
    try:
        yield
    except DesktopError:
        raise
    except Exception as error:
        raise EffectError(f"the effect {kind!r} raised {type(error).__name__}: {error}") from error
