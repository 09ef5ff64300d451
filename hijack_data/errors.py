"""Every error the library raises on purpose.

Each class descends from `HijackError` and from the builtin it refines, so `except ValueError` keeps
working. A message says what is wrong, where, the value that was found, and how to fix it.
"""

import difflib
from collections.abc import Iterable, Sequence


class HijackError(Exception):
    """Base class: catch it to catch everything that AgentHijack refuses."""

    def __str__(self) -> str:  # KeyError would print the repr of its argument
        return str(self.args[0]) if self.args else ""


class UnknownNameError(HijackError, KeyError):
    """A corruption, parameter, format or backend that does not exist."""


class ParameterError(HijackError, ValueError):
    """A parameter whose value is out of range, or that the given screen cannot hold."""


class ParameterTypeError(HijackError, TypeError):
    """A parameter of the wrong type."""


class LabelError(ParameterError):
    """A label of a sample that cannot follow the pixels, or whose format is unknown."""


class ImageError(HijackError, ValueError):
    """An image that cannot be read, or whose shape or size does not match the plan."""


class ImageTypeError(HijackError, TypeError):
    """An image of the wrong kind or dtype (only uint8 RGB is accepted)."""


class PlanError(HijackError, ValueError):
    """A plan that was edited, is damaged, or was made by a newer version."""


class ActionError(HijackError, ValueError):
    """An action that cannot be parsed, or whose coordinates cannot be mapped."""


class ElementsError(HijackError, ValueError):
    """An accessibility tree or label file that is malformed or unsafe."""


class AssetError(HijackError, ValueError):
    """A pack of recorded pictures that is missing or damaged, or that lacks a picture."""


class FontError(HijackError, ValueError):
    """A font that cannot be loaded or lacks a glyph."""


class ConfigError(HijackError, ValueError):
    """A configuration with mistakes.

    `problems` lists all of them as `file:line:column: message`.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


class PlanningError(HijackError, RuntimeError):
    """The code of a corruption raised while it planned; the exception is the cause of this one."""


class PluginError(HijackError, ImportError):
    """A corruption of a plug-in, or of a file, that cannot be loaded."""


class PluginWarning(UserWarning):
    """A plug-in that cannot be loaded was left out; everything else works."""


class HijackWarning(RuntimeWarning):
    """Something works otherwise than one may expect; the message says what to do.

    An optional part failed and is not used, which takes longer with the same results; or samples
    of a second epoch get the corruptions of the first.
    """


class CheckFailed(HijackError, AssertionError):
    """A plug-in fails a conformance check; the message names the probable cause."""


class MissingDependencyError(HijackError, ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


class StorageError(HijackError, OSError):
    """A file that cannot be written because the disk is full or broken; the request is valid."""


def short_repr(value: object) -> str:
    """Return a value as an error message shows it: its `repr`, cut to 80 letters."""
    try:
        text = repr(value)
    except Exception as error:  # noqa: BLE001  (a `__repr__` may raise anything)
        return f"a {type(value).__name__} that cannot be shown ({type(error).__name__})"
    return text if len(text) <= 80 else f"{text[:80]}..."


def suggest(name: object, candidates: Iterable[str]) -> str:
    """Return `"; did you mean 'x'?"`, or the list of `candidates` when none is close."""
    options = sorted(candidates)
    text = name if isinstance(name, str) else short_repr(name)
    close = difflib.get_close_matches(text, options, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {shorten_list(options)}" if options else ""


def quantity(number: int, singular: str, plural: str = "") -> str:
    """Return a number and what it counts, for a message: `1 row`, `1,200 rows`."""
    name = singular if number == 1 else plural or f"{singular}s"
    return f"{number:,} {name}"


def shorten_list(options: Sequence[str], limit: int = 20) -> str:
    """Return options for a message: all of them, or the first `limit` and the number of others."""
    listed = ", ".join(options[:limit])
    remaining = len(options) - limit
    return f"{listed} and {remaining} more" if remaining > 0 else listed
