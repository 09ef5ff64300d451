"""The type of a check, its outcome, and how it is run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeAlias

from ..corruption import Corruption
from ..errors import CheckFailed

# A check raises `CheckFailed` with the probable cause; it may return notes for the author.
Check: TypeAlias = Callable[[type[Corruption]], Sequence[str] | None]


@dataclass(frozen=True)
class Result:
    """Outcome of one check.

    Args:
        check: its name.
        about: the property that it checks.
        problem: the probable cause of a failure; empty if the check passed.
        notes: hints for the author, and parts that could not be checked.
    """

    check: str
    about: str
    problem: str
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the check passed."""
        return not self.problem


def expect(condition: object, problem: str) -> None:
    """Fail the check unless a condition holds.

    Raises:
        CheckFailed: the condition is false; the message is `problem`, the probable cause.
    """
    if not condition:
        fail(problem)


def fail(problem: str) -> NoReturn:
    """Fail the check.

    Raises:
        CheckFailed: always; the message is `problem`, the probable cause.
    """
    raise CheckFailed(problem)


def run_check(check: Callable[..., Sequence[str] | None], subject: Any) -> Result:
    """Run one check; an exception in a plug-in becomes the problem of the result.

    Raises:
        KeyboardInterrupt: the user stopped the check.
    """
    name = check.__name__.removeprefix("check_")
    about = (check.__doc__ or "").strip().split("\n")[0]
    try:
        notes = check(subject) or ()
    except KeyboardInterrupt:
        raise
    except CheckFailed as error:
        return Result(name, about, str(error) or "failed")
    except BaseException as error:  # noqa: BLE001  (SystemExit too; the report must go on)
        return Result(name, about, f"{type(error).__name__}: {error}")
    return Result(name, about, "", tuple(notes))
