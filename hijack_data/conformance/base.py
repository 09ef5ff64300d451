"""What a check is, and its outcome."""

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
        about: what it makes sure of.
        problem: the probable cause, empty when it passed.
        notes: what the author should look at, and what could not be checked.
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
    """End a check with the probable cause of its failure.

    Raises:
        CheckFailed: always.
    """
    if not condition:
        fail(problem)


def fail(problem: str) -> NoReturn:
    """Raise `CheckFailed` with the probable cause."""
    raise CheckFailed(problem)


def run_check(check: Callable[..., Sequence[str] | None], subject: Any) -> Result:
    """Run one check; whatever the code of a plug-in raises is a problem, not a crash."""
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
