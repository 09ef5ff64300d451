"""`hijack check` for effects: which ones a file registers, and the conformance checks on a desktop of their own."""

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from hijack_data.corruption import Corruption
from hijack_data.errors import HijackError
from hijack_data.types import Scene

from ..errors import DesktopError, MissingCapabilityError
from .base import find, kinds
from .conformance import OPEN, Result, run_declared, run_live

SCREEN = Scene((1080, 1920))


def kinds_of(module: str) -> list[str]:
    """The effects whose classes a module defines and registers."""
    return [kind for kind in kinds() if type(find(kind)).__module__ == module]


def summary(kind: str) -> str:
    """First line of the documentation of an effect."""
    return (type(find(kind)).__doc__ or "").strip().split("\n")[0]


def params_for(kind: str, corruptions: Iterable[type[Corruption]]) -> Mapping[str, Any]:
    """Parameters to try an effect with: those that a corruption of the same file asks for, else none."""
    for cls in corruptions:
        try:
            effects = cls().plan(SCREEN, seed=0).effects
        except (HijackError, TypeError):  # it has checks of its own
            continue
        for effect in effects:
            if effect.kind == kind:
                return effect.params
    return {}


def starter() -> Callable[[], Any]:
    """What starts a desktop to try effects on. Raises `DesktopError` with the reason where there can be none."""
    from ..desktops.embedded import doctor
    from ..desktops.embedded.desktop import EmbeddedDesktop

    lacking = next((check for check in doctor.diagnose(("core",)) if check.required and not check.ok), None)
    if lacking is not None:
        raise DesktopError(f"{lacking.name}: {lacking.detail}; {lacking.fix}")
    return functools.partial(EmbeddedDesktop.up, apps=OPEN)


def check(kind: str, params: Mapping[str, Any], with_desktop: bool) -> Iterator[Result | str]:
    """The results of all checks of an effect; a text says what could not be checked, and why."""
    declared = run_declared(kind)
    yield declared
    if not with_desktop:
        yield "apply, probe and undo: left out (--no-desktop)"
        return
    try:
        yield from run_live(kind, params, starter())
    except MissingCapabilityError as error:
        yield f"apply, probe and undo: the desktop lacks what it needs: {error}"
    except DesktopError as error:
        yield f"apply, probe and undo: no desktop on this machine: {error}"
