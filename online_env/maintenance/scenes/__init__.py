"""The scenes of the asset pack, one file a kind of picture.

Each has a function that takes a stage and yields its pictures.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ...errors import DesktopError
from ...recording.captured_picture import Picture


@dataclass(frozen=True)
class UnrecordedScene:
    """Something that could not be recorded, and why."""

    name: str
    reason: str

    @classmethod
    def instead(
        cls, name: str, pictures: "Iterable[Picture | UnrecordedScene]"
    ) -> "Iterator[Picture | UnrecordedScene]":
        """Yield the pictures; if the desktop fails, yield what is lost instead of raising."""
        try:
            yield from pictures
        except DesktopError as error:
            yield cls(name, str(error))
