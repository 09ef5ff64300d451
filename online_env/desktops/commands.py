"""Helpers that run commands on a desktop: find the user's home, start and end programs."""

import time

from ..errors import DesktopError
from .protocol import Desktop, RunResult

_GRACE = 5.0  # seconds for a program to end by itself
_NONE = 1  # what pkill returns where there is no such program


def home(desktop: Desktop) -> str:
    """Return the home folder of the desktop's user.

    Raises:
        DesktopError: The desktop does not return it.
    """
    result = desktop.execute(["sh", "-c", 'printf %s "$HOME"'])
    if not result.ok or not result.output.startswith("/"):
        raise DesktopError(f"the desktop does not tell its user's home: {result}")
    return result.output.rstrip("/")


def command(desktop: Desktop, *argv: str) -> str:
    """Return the output of a command that must succeed.

    Raises:
        DesktopError: The command failed.
    """
    result = desktop.execute(list(argv))
    if not result.ok:
        raise DesktopError(
            f"{' '.join(argv)!r} failed on the desktop with {result.returncode}: "
            f"{result.error.strip()[-300:]}"
        )
    return result.output


def ran(desktop: Desktop, *argv: str) -> RunResult:
    """Return the result of a command that may say no, but must have run.

    Raises:
        DesktopError: It did not start or did not end, so it says nothing.
    """
    result = desktop.execute(list(argv))
    if result.status != "success":
        raise DesktopError(
            f"{' '.join(argv)[:200]!r} did not run on the desktop: {result.error.strip()[-300:]}"
        )
    return result


def launch(desktop: Desktop, *argv: str) -> None:
    """Start a program without waiting for its end."""
    command(desktop, "sh", "-c", 'exec setsid -f "$@" </dev/null >/dev/null 2>&1', "sh", *argv)


def end(desktop: Desktop, *programs: str) -> None:
    """End the user's programs with these names, if any, and wait until they have ended.

    Raises:
        DesktopError: One of them does not end, even when killed, or the desktop cannot tell.
    """
    for program in programs:
        signal = "-TERM"
        deadline = time.monotonic() + _GRACE
        while _signalled(desktop, signal, program):
            if time.monotonic() > deadline:
                signal = "-KILL"
            if time.monotonic() > deadline + _GRACE:
                raise DesktopError(
                    f"program {program!r} on the desktop does not end, even when killed"
                )
            time.sleep(0.1)


def _signalled(desktop: Desktop, signal: str, program: str) -> bool:
    """Signal the user's programs of a name; return whether there were any.

    Raises:
        DesktopError: The desktop cannot tell.
    """
    result = ran(desktop, "pkill", signal, "-x", program)
    if not result.ok and result.returncode != _NONE:
        raise DesktopError(
            f"the desktop cannot end program {program!r}: pkill {signal} failed with"
            f" {result.returncode}: {result.error.strip()[-300:]}"
        )
    return result.ok
