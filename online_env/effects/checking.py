"""`hijack check` for effects: try the effects of a file on a desktop of their own."""

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from hijack_data.corruption import Corruption
from hijack_data.errors import HijackError
from hijack_data.plan import Effect
from hijack_data.types import Scene

from ..desktops.protocol import Desktop
from ..errors import DesktopError, MissingCapabilityError
from .base import find
from .conformance import OPEN_APPS, ParamsFor, Result, run_declared, run_live


def summary(kind: str) -> str:
    """Return the first line of the documentation of an effect."""
    return (type(find(kind)).__doc__ or "").strip().split("\n")[0]


def params_for(kind: str, corruptions: Iterable[type[Corruption]]) -> ParamsFor:
    """Return a function that gives, for a desktop, parameters with which to try an effect.

    They are those that a corruption of the same file plans for that desktop's screen, if there is
    one.
    """
    asking = [cls for cls in corruptions if kind in cls.effects]

    def params_on(desktop: Desktop) -> Mapping[str, Any]:
        for cls in asking:
            for effect in _effects_on(desktop, cls):
                if effect.kind == kind:
                    return effect.params
        return {}

    return params_on


def _effects_on(desktop: Desktop, cls: type[Corruption]) -> tuple[Effect, ...]:
    try:
        return cls().plan(Scene(desktop.size), seed=0).effects
    except (HijackError, TypeError):  # the corruption's own checks report the error
        return ()


def starter() -> Callable[[], Any]:
    """Return a function that starts a desktop for trying effects.

    Raises:
        DesktopError: this machine cannot run a desktop; the message has the reason.
    """
    from ..embedded import doctor
    from ..embedded.desktop import EmbeddedDesktop

    for required in doctor.diagnose(("core",)):
        if required.required and not required.ok:
            raise DesktopError(f"{required.name}: {required.detail}; {required.fix}")
    return functools.partial(EmbeddedDesktop.up, apps=OPEN_APPS)


def check(
    kind: str, params: Mapping[str, Any] | ParamsFor, with_desktop: bool
) -> Iterator[Result | str]:
    """Yield the results of all checks of an effect.

    Args:
        kind: the effect.
        params: the parameters to try, or a function that gives them for a desktop.
        with_desktop: whether to start desktops for the checks.

    A text among the results states what could not be checked, and why.
    """
    declaration = run_declared(kind)
    yield declaration
    if not with_desktop:
        yield "apply, probe and undo: left out (--no-desktop)"
        return
    try:
        yield from run_live(kind, params, starter())
    except MissingCapabilityError as error:
        yield f"apply, probe and undo: the desktop lacks what it needs: {error}"
    except DesktopError as error:
        yield f"apply, probe and undo: no desktop on this machine: {error}"
