"""What is recorded, one file a kind of picture: each a function that takes a stage and yields its pictures."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ...errors import DesktopError
from ..picture import Picture


@dataclass(frozen=True)
class Refused:
    """What could not be recorded, and why."""

    what: str
    why: str

    @classmethod
    def instead(cls, what: str, pictures: "Iterable[Picture | Refused]") -> "Iterator[Picture | Refused]":
        """The pictures; where the desktop does not play along, what is lost by it, and the rest goes on."""
        try:
            yield from pictures
        except DesktopError as error:
            yield cls(what, str(error))
