"""The properties that every effect must have, checked on a real desktop (`hijack check`).

A check raises `CheckFailed` with the probable cause. The most telling check is the sabotage: on a
fresh desktop where nothing was done, the probe must fail although the record claims that the effect
was applied.
"""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

from hijack_data.conformance import Result, expect, fail
from hijack_data.errors import CheckFailed
from hijack_data.plan import Effect
from hijack_data.rng import Stream

from ..desktops.protocol import CAPABILITIES, Desktop
from ..errors import DesktopError, MissingCapabilityError
from .base import Applied, EffectRecord, LiveEffect, find, perform, resume, undo

OPEN_APPS = ("editor",)  # the application that is open while an effect is tried
# Returns the parameters of an effect for a desktop.
ParamsFor: TypeAlias = Callable[[Desktop], Mapping[str, Any]]


class Trial:
    """One effect on one desktop, from apply to undo.

    Each check continues from the state in which the previous one ended.
    """

    def __init__(self, live: LiveEffect, params: Mapping[str, Any], desktop: Desktop) -> None:
        self.live = live
        self.desktop = desktop
        self.effect = Effect(live.kind, dict(params))
        self.applied: Applied | None = None
        self.claim: EffectRecord = {}

    def apply(self) -> Applied:
        """Apply the effect (again)."""
        return perform(self.effect, self.desktop, Stream(0, f"{self.live.kind}-v1", "check"))

    @property
    def applied_effect(self) -> Applied:
        """The applied effect; an earlier check must have applied it."""
        if self.applied is None:
            fail("not applied: see above")
        return self.applied


def check_declared(live: LiveEffect) -> None:
    """It has a kind, existing capabilities and a docstring, and has no state."""
    unknown = sorted(set(live.needs) - CAPABILITIES)
    capabilities = ", ".join(sorted(CAPABILITIES))
    expect(not unknown, f"needs names {', '.join(unknown)}; a desktop can have: {capabilities}")
    expect(isinstance(live.needs, frozenset), "needs must be a frozenset")
    if sys.flags.optimize < 2:  # python -OO has removed all docstrings
        documented = (type(live).__doc__ or "").strip()
        expect(documented, "the class needs a docstring that says what it does to the machine")
        expect(type(live).__doc__ != LiveEffect.__doc__, "the class needs a docstring of its own")
    attributes = ", ".join(vars(live))
    expect(
        not attributes,
        f"it keeps {attributes} in itself; what probe and undo need goes into the record",
    )


def check_undo_without_apply(trial: Trial) -> None:
    """Undo without apply is harmless."""
    undone = undo(trial.live.kind, trial.desktop)
    expect(undone.ok, f"undo with an empty record fails: {undone.problem or 'no problem is given'}")


def check_apply_and_probe(trial: Trial) -> None:
    """After apply the probe is true, and its facts are JSON."""
    trial.applied = trial.apply()
    probe = trial.applied.probe()
    expect(probe.ok, f"the probe is false: {probe.problem or 'and gives no problem'}")
    _as_json(dict(probe.facts), "the facts of the probe")


def check_record(trial: Trial) -> None:
    """The record is JSON, and is enough for another process to continue."""
    trial.claim = _as_json(trial.applied_effect.record, "the record")
    probe = resume(trial.claim, trial.desktop).probe()
    message = f"the probe is false from the record alone: {probe.problem}"
    expect(probe.ok, f"{message}; put what it needs into the record")
    expect(not vars(trial.live), "apply keeps something in the effect; put it into the record")


def check_apply_twice(trial: Trial) -> None:
    """Applying twice is harmless.

    The probe stays true, and one undo for each apply puts everything back.
    """
    if not trial.live.lasting:
        return
    again = trial.apply()
    probe = again.probe()
    expect(probe.ok, f"the probe of the second apply is false: {probe.problem}")
    undone = again.undo()
    expect(undone.ok, f"the second apply cannot be undone: {undone.problem}")


def check_undo(trial: Trial) -> None:
    """Undo puts everything back.

    It reports so, the probe is then false, and a second undo is harmless.
    """
    for time in ("", " a second time"):
        undone = trial.applied_effect.undo()
        expect(undone.ok, f"undo{time} fails: {undone.problem or 'no problem is given'}")
        _as_json(dict(undone.facts), "the facts of undo")
    if trial.live.lasting:
        probe = trial.applied_effect.probe()
        expect(not probe.ok, "the probe is still true after undo: one of the two is wrong")
        expect(probe.problem, "a probe that is false must give its problem")


def check_sabotage(trial: Trial) -> None:
    """On a desktop where the effect was not applied, the probe is false.

    The probe gets a fresh desktop, and a record that claims that the effect was applied.
    """
    expect(trial.claim, "no record: see above")
    probe = resume(trial.claim, trial.desktop).probe()
    expect(not probe.ok, "the probe believes the record: it must look at the machine itself")
    expect(probe.problem, "a probe that is false must give its problem")


EffectCheck: TypeAlias = Callable[[Trial], None]
LIVE_CHECKS: tuple[EffectCheck, ...] = (
    check_undo_without_apply,
    check_apply_and_probe,
    check_record,
    check_apply_twice,
    check_undo,
)


def run_declared(kind: str) -> Result:
    """Run the check that needs no desktop."""
    return _run_one(check_declared, find(kind))


def run_live(
    kind: str, params: Mapping[str, Any] | ParamsFor, start: Callable[[], Any]
) -> Iterator[Result]:
    """Run all checks that need a desktop.

    Args:
        kind: the effect.
        params: the parameters of the effect, or a function that gives them for a desktop.
        start: starts a desktop, as a context manager; called for one on which the effect is tried,
            and for a fresh one.

    Raises:
        MissingCapabilityError: The desktop lacks what the effect needs; nothing was checked.
    """
    live = find(kind)
    with start() as desktop:
        effect_params = params(desktop) if callable(params) else params
        trial = Trial(live, effect_params, desktop)
        for check in LIVE_CHECKS:
            yield _run_one(check, trial)
    with start() as desktop:
        trial.desktop = desktop
        yield _run_one(check_sabotage, trial)


def _run_one(check: Callable[[Any], None], subject: Any) -> Result:
    name = check.__name__.removeprefix("check_")
    about = (check.__doc__ or "").strip().split("\n")[0]
    try:
        check(subject)
    except CheckFailed as error:
        return Result(name, about, str(error) or "failed")
    except MissingCapabilityError:
        raise
    except DesktopError as error:
        return Result(name, about, f"{type(error).__name__}: {error}")
    except Exception as error:  # noqa: BLE001  (a plug-in may raise anything; the report must go on)
        return Result(name, about, f"{type(error).__name__}: {error}")
    return Result(name, about, "")


def _as_json(data: EffectRecord, description: str) -> EffectRecord:
    """Return the data after a JSON round trip, as another process would read them."""
    try:
        again: EffectRecord = json.loads(json.dumps(data, allow_nan=False))
    except (TypeError, ValueError, RecursionError) as error:
        fail(f"{description} is not JSON: {error}")
    message = f"{description} changes in JSON (tuples, or keys that are no texts)"
    expect(again == data, f"{message}: {_difference(data, again)}")
    return again


def _difference(first: EffectRecord, second: EffectRecord) -> str:
    keys = [key for key in first if first[key] != second.get(key)]
    return ", ".join(map(str, keys)) or "its keys"
