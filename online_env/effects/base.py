"""The base class of effects, which are applied, proved by a probe, and undone.

An effect of a plan (`hijack_data.plan.Effect`) is data. A `LiveEffect`, one class for each kind,
carries it out. It has no state: everything that probe and undo need is in the record, which is
JSON, so that another process can continue with it.
"""

import json
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias, TypeVar

from hijack_data.plan import Effect
from hijack_data.registry import Registry
from hijack_data.rng import Stream

from ..desktops.capability_survey import lacks
from ..desktops.protocol import Capability, Desktop
from ..errors import DesktopError, MissingCapabilityError
from .duration import Duration
from .guest import Guest

EffectRecord: TypeAlias = dict[str, Any]
PASSWORD = "password"
E = TypeVar("E", bound="LiveEffect")


class EffectError(DesktopError):
    """An effect with parameters that this desktop cannot carry out, or an effect that failed."""


@dataclass(frozen=True)
class Probe:
    """The findings of a probe on the machine itself.

    Args:
        ok: whether the machine is in the corrupted state.
        facts: the evidence, as JSON data.
        problem: why it is not, if so.
    """

    ok: bool
    facts: EffectRecord = field(default_factory=dict[str, Any])
    problem: str = ""


@dataclass(frozen=True)
class Undone:
    """The state of the machine after undoing an effect.

    Args:
        ok: whether nothing of the effect remains, or there was nothing to undo.
        facts: the evidence, as JSON data.
        problem: what remains, if anything.
    """

    ok: bool
    facts: EffectRecord = field(default_factory=dict[str, Any])
    problem: str = ""


class LiveEffect(ABC):
    """One kind of effect. Subclass it, set `kind` and `needs`, and register the class.

    `apply` raises `MissingCapabilityError` if the machine lacks something, before it changes
    anything; the probe finds later failures. Applying twice and undoing twice must be harmless.

    Class attributes:
        kind: the name of the kind in plans.
        needs: the capabilities that a desktop must have.
        lasting: False for an event, such as a click, which cannot be undone.
        before_setup: True for an error of the environment that the set-up of a task should meet,
            such as a network that is gone when the browser opens its page; see
            `EvalSettings.environment_errors`.
        conflicts: kinds that cannot be in force together with this one, each with the reason.
    """

    kind: ClassVar[str]
    needs: ClassVar[frozenset[Capability]] = frozenset()
    lasting: ClassVar[bool] = True
    before_setup: ClassVar[bool] = False
    conflicts: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Apply the effect, and return JSON data with everything that `probe` and `undo` need.

        Args:
            guest: the desktop.
            params: the parameters of the effect, from the plan.

        Raises:
            MissingCapabilityError: the machine lacks something; nothing was changed.
            EffectError: this desktop cannot carry out the parameters.
        """

    @abstractmethod
    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Examine the machine rather than the notes of `apply`, and make no lasting change.

        Args:
            guest: the desktop.
            record: the data that `apply` returned.
        """

    @abstractmethod
    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Put everything back.

        Args:
            guest: the desktop.
            record: the data that `apply` returned; empty if they are lost. Then find out from the
                machine what to undo.
        """

    def require(self, guest: Guest) -> None:
        """Check on the machine what no capability says, before a run begins; change nothing.

        By default there is nothing to check.

        Raises:
            MissingCapabilityError: the machine lacks something.
        """
        return

    def can_be_lifted(self, guest: Guest) -> bool:
        """Return whether an agent may end the effect on the desktop (close, restore, unlock).

        Effects that it cannot lift are probed again at the end of the episode; all others only
        until the agent sees them.
        """
        return True

    def refresh(self, guest: Guest, record: EffectRecord) -> None:
        """Refresh an effect that would fade by itself; called before each observation."""
        return

    def has_ended(
        self, guest: Guest, params: Mapping[str, Any], steps: int, seconds: float
    ) -> bool:
        """Return whether the effect is over, so that it is to be undone now.

        By default the parameter `lasts` decides: `{"steps": n}` or `{"seconds": s}`.

        Args:
            guest: the desktop.
            params: the parameters of the effect, from the plan.
            steps: observations that showed it.
            seconds: since it was applied.
        """
        return Duration.read(params).is_over(steps, seconds)

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return the facts of a successful probe as one sentence."""
        return json.dumps(dict(facts), ensure_ascii=False)

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return the facts of `undo` as one sentence."""
        return json.dumps(dict(facts), ensure_ascii=False)


class Applied:
    """An effect that was applied to a desktop.

    `record` is JSON data and grows with each `probe` and `undo`.
    """

    def __init__(self, effect: Effect, guest: Guest, record: EffectRecord) -> None:
        self.effect = effect
        self.record = record
        self._guest = guest
        self._live = find(effect.kind, guest.desktop)

    def probe(self) -> Probe:
        """Probe whether the machine is in the corrupted state now, and record the result."""
        start = time.monotonic()
        probe = self._live.probe(self._guest, self.record["did"])
        _check_json(probe.facts, f"the facts of the probe of {self.effect.kind!r}")
        self.record["probes"].append({**vars(probe), "seconds": _since(start)})
        return probe

    def holds(self) -> bool:
        """Return whether the machine is in the corrupted state now, without recording it."""
        return self._live.probe(self._guest, self.record["did"]).ok

    @property
    def can_be_lifted(self) -> bool:
        """Whether an agent may end the effect by its actions on this desktop."""
        return self._live.can_be_lifted(self._guest)

    def has_ended(self, steps: int) -> bool:
        """Return whether the effect is over after `steps` observations that showed it."""
        seconds = time.time() - self.record["at"]
        return self._live.has_ended(self._guest, self.effect.params, steps, seconds)

    def refresh(self) -> None:
        """Refresh an effect that would fade by itself: call this before each observation."""
        self._live.refresh(self._guest, self.record["did"])

    def undo(self) -> Undone:
        """Undo the effect; calling this twice is allowed."""
        start = time.monotonic()
        undone = self._live.undo(self._guest, self.record["did"])
        _check_json(undone.facts, f"the facts of the undo of {self.effect.kind!r}")
        self.record["undone"].append({**vars(undone), "seconds": _since(start)})
        return undone


def _problems(cls: Any, kind: str) -> Iterator[str]:
    """Yield what is wrong with the class of an effect."""
    if not isinstance(cls, type) or not issubclass(cls, LiveEffect):
        yield "it is not a subclass of online_env.effects.LiveEffect"
        return
    if cls.__abstractmethods__:
        yield f"{', '.join(sorted(cls.__abstractmethods__))} is missing"
    elif not kind or kind != getattr(cls, "kind", None):
        yield "kind is not set"


EFFECTS = Registry[LiveEffect](
    "effect",
    "effects",
    own_name="kind",
    problems=_problems,
    prepare=lambda cls: cls(),
    related=("corruptions",),
)


def register(cls: type[E]) -> type[E]:
    """Class decorator: register an effect under its `kind`.

    Raises:
        ParameterError: the class is incomplete, or another one has that kind.
    """
    EFFECTS.add(cls)
    return cls


def kinds() -> list[str]:
    """Return the kinds that can be performed: built-in ones, then those of plug-ins."""
    return EFFECTS.names()


def find(kind: str, desktop: Desktop | None = None) -> LiveEffect:
    """Return the object that carries out effects of `kind`.

    Args:
        kind: the kind of the effect.
        desktop: where; one that is no machine with windows, such as a browser, has `effects` of its
            own by kind, with the same `needs` and `lasting`.

    Raises:
        UnknownNameError: no effect of this kind is registered.
        PluginError: the plug-in that should register it cannot be loaded.
    """
    desktop_effects: Mapping[str, LiveEffect] = getattr(desktop, "effects", {})
    return desktop_effects.get(kind) or EFFECTS.get(kind)


def perform(
    effect: Effect, desktop: Desktop, stream: Stream | None = None, password: str = PASSWORD
) -> Applied:
    """Apply `effect` to `desktop`; only the `probe` of the result proves that it is there.

    Args:
        effect: of a plan.
        desktop: any desktop; the tools that the effect needs are looked for in the guest.
        stream: random draws that depend on the live desktop (which element is touched).
        password: of the desktop's user, for sudo and for the lock screen.

    Raises:
        UnknownNameError: The kind is not registered.
        MissingCapabilityError: The desktop lacks something, which is named; nothing was changed.
        EffectError: The parameters are wrong, or the record is not JSON.
        ParameterError: The parameter `lasts` is wrong.
        DesktopError: The desktop does not answer.
    """
    live = find(effect.kind, desktop)
    guest = Guest(desktop, password, stream)
    _check(live, desktop)
    Duration.read(effect.params)  # a wrong one must not show in the middle of an episode
    start = time.monotonic()
    did = live.apply(guest, effect.params)
    _check_json(did, f"the record of the effect {effect.kind!r}")
    record: EffectRecord = {
        "effect": effect.kind,
        "params": dict(effect.params),
        "at": time.time(),
        "did": did,
        "seconds": _since(start),
        "probes": [],
        "undone": [],
    }
    return Applied(effect, guest, record)


def resume(record: EffectRecord, desktop: Desktop, password: str = PASSWORD) -> Applied:
    """Continue with an effect that another process applied, from its record.

    Raises:
        EffectError: the record is damaged.
    """
    try:
        effect = Effect(str(record["effect"]), dict(record["params"]))
        fields = {
            **record,
            "did": dict(record["did"]),
            "probes": list(record["probes"]),
            "undone": list(record["undone"]),
        }
    except (KeyError, TypeError, ValueError) as error:
        raise EffectError(
            f"this is not the record of an applied effect: {type(error).__name__}: {error}"
        ) from None
    return Applied(effect, Guest(desktop, password, None), fields)


def undo(kind: str, desktop: Desktop, password: str = PASSWORD) -> Undone:
    """Undo an effect whose record is lost: unlock, open the firewall, and so on.

    Raises:
        UnknownNameError: The kind is not registered.
    """
    return find(kind, desktop).undo(Guest(desktop, password, None), {})


def _check(live: LiveEffect, desktop: Desktop) -> None:
    missing = sorted(live.needs - desktop.capabilities)
    if missing:
        raise MissingCapabilityError(
            f"the effect {live.kind!r} needs {', '.join(missing)}, {lacks(desktop, missing)}"
        )


def _check_json(data: EffectRecord, description: str) -> None:
    """Check what an effect gives for the log of an episode, which is JSON.

    Raises:
        EffectError: It cannot be written there.
    """
    try:
        json.dumps(data, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise EffectError(
            f"{description} must be JSON data, of plain numbers, texts, lists and dicts: {error}"
        ) from None


def _since(start: float) -> float:
    return round(time.monotonic() - start, 4)
