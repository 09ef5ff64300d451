"""The providers of the desktops of a benchmark, by name.

To add a provider, write a function in an installed package (entry points `agenthijack.providers`).
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Any, TypeAlias

from hijack_data.errors import ParameterError, shorten_list
from hijack_data.registry import Registry
from hijack_data.types import Size

from ..desktops.protocol import Desktop
from ..errors import DesktopError, DesktopTimeoutError, MissingPackageError
from ..tasks import TASKS
from ..tasks.task_apps import APPS

# Called with the size (height, width) in pixels; the desktop exists inside the context. Its `reset`
# restores the pristine state. A desktop with a `record["sites"]` has a local internet.
DesktopProvider: TypeAlias = Callable[..., AbstractContextManager[Desktop]]
EMBEDDED = "embedded"
BROWSER = "browser"
OSWORLD = "osworld"  # machines of the user; called with their settings, too
MAX_STARTS = 3  # tries to start a desktop


def embedded(size: Size) -> AbstractContextManager[Desktop]:
    """Yield an embedded desktop, with a second one on standby for resets.

    A failed start is retried, because one killed process must not end a run. Errors that a retry
    cannot fix (a missing package, a missing right) are raised at once.

    Raises:
        DesktopError: The desktop cannot be started.
    """
    from ..embedded.desktop import EmbeddedDesktop

    for _ in range(MAX_STARTS - 1):
        try:
            return EmbeddedDesktop.up(size, standby=True)
        except DesktopError as error:
            if type(error) not in (DesktopError, DesktopTimeoutError):
                raise
    return EmbeddedDesktop.up(size, standby=True)


def _problems(provider: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with a provider."""
    if not callable(provider):
        yield "a provider is a function of (size) that returns a context with a desktop"


PROVIDERS = Registry[DesktopProvider](
    "desktop provider",
    "providers",
    builtin={
        EMBEDDED: "online_env.bench.providers:embedded",
        OSWORLD: "online_env.osworld.machines:machine",
        BROWSER: "online_env.browser.desktop:browser",
    },
    problems=_problems,
)
register = PROVIDERS.register


def check_installed(provider: str, names: Iterable[str]) -> None:
    """Check that an embedded desktop or a browser of this machine has what some tasks use.

    Args:
        provider: The name of the provider; the desktops of other providers are not checked.
        names: Names of tasks.

    Raises:
        MissingPackageError: Packages of a profile are missing, and the message names the task that
            needs them; or there is no browser.
        ParameterError: A task needs more than a browser.
    """
    if provider == BROWSER:
        _check_browser(names)
    if provider != EMBEDDED:
        return
    from ..embedded.image.image_setup import lacking

    task_by_profile: dict[str, str] = {}
    for name in names:
        for app in TASKS.get(name).apps:
            if app in APPS:
                task_by_profile.setdefault(APPS[app].profile, name)
    for profile, name in task_by_profile.items():
        absent = lacking(profile)
        if absent:
            listed = shorten_list(absent, 4)
            raise MissingPackageError(
                f"task {name} needs packages that are not installed ({listed}): hijack desktop"
                f" install --profile {profile}, or leave the task out with --tasks"
            )


def _check_browser(names: Iterable[str]) -> None:
    from ..browser.chromium import find_program

    find_program()
    unplayable = [name for name in names if not TASKS.get(name).in_browser]
    if unplayable:
        playable = sorted(name for name in TASKS.entries if TASKS.get(name).in_browser)
        raise ParameterError(
            f"these tasks need more than a browser: {shorten_list(unplayable, 4)}; play them on a"
            f" desktop (desktop: {{provider: {EMBEDDED}}}), or choose of"
            f" {shorten_list(playable, 40)}"
        )
