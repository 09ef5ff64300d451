"""The user's choices of what a source does not state: coordinates, boxes and episodes.

Coordinates are in one of these spaces:

| space | the numbers are |
|---|---|
| `pixels` | pixels of the picture |
| `fractions` | 0..1 of the picture's width and height |
| `thousand` | 0..1000 of the picture's width and height |
| `resized` | pixels of the smart-resized picture, as Qwen2.5-VL and UI-TARS 1.5 write them |

If a prompt states a resolution, that (height, width) is the space.
"""

from dataclasses import dataclass, replace
from typing import Any, TypeAlias, cast

from hijack_data.actions import Scaling
from hijack_data.errors import ParameterError, suggest
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Size

from ..choices import BOXES, COORDINATES, FRACTIONS, PIXELS, RESIZED, THOUSAND
from ..errors import BuildError
from .base import Reader
from .fields import FieldError

Space: TypeAlias = str | Size


@dataclass(frozen=True)
class ReaderOptions:
    """The choices of a build; `None` leaves them to the recording.

    Args:
        coordinates: one of `COORDINATES`.
        boxes: one of `BOXES`: x, y, width, height, or the two corners.
        episode_key: the field of a row that names its episode.

    Raises:
        BuildError: a choice is not known.
    """

    coordinates: str | None = None
    boxes: str | None = None
    episode_key: str | None = None

    def __post_init__(self) -> None:
        choices = {"coordinates": COORDINATES, "boxes": BOXES}
        for name, value in self.to_data().items():
            if name in choices and value not in choices[name]:
                raise BuildError(f"{name} {value!r} is not known{suggest(value, choices[name])}")

    def to_data(self) -> dict[str, str]:
        """Return the choices that are set, as JSON data."""
        values = {
            "coordinates": self.coordinates,
            "boxes": self.boxes,
            "episode_key": self.episode_key,
        }
        return {name: value for name, value in values.items() if value is not None}

    def of(self, reader: Reader) -> "ReaderOptions":
        """Return the choices that a reader accepts."""
        takes: tuple[str, ...] = getattr(reader, "takes", ())
        values = {name: value for name, value in self.to_data().items() if name in takes}
        return ReaderOptions(**values)


NO_CHOICES = ReaderOptions()


def with_choices(reader: Reader, choices: ReaderOptions) -> Reader:
    """Return a reader that follows the choices; `reader` itself if there are none.

    A reader that accepts choices is a dataclass with a field `choices`; its `takes` lists the
    accepted ones.

    Raises:
        BuildError: the format itself states what the user chose.
    """
    values = choices.to_data()
    takes: tuple[str, ...] = getattr(reader, "takes", ())
    for name, value in values.items():
        if name not in takes:
            raise BuildError(
                f"{name} {value!r}: format {reader.name!r} says itself what its"
                f" {'episodes' if name == 'episode_key' else name} are; leave the choice out"
            )
    if not values:
        return reader
    return cast("Reader", replace(cast("Any", reader), choices=choices))


def space_scaling(space: Space, size: Size) -> Scaling:
    """Return the scaling from a space to pixels of a picture of `size`, (height, width).

    A point outside the picture is moved into it by at most the slack of the space.

    Raises:
        FieldError: the model behind `resized` does not accept a picture of this size.
    """
    if space == PIXELS:
        return Scaling.pixels(None)
    if space == FRACTIONS:
        return Scaling.fractions(size)
    if space == THOUSAND:
        return Scaling.fractions(size, 1000)
    if space != RESIZED:
        return Scaling(cast("Size", space), size, bounded=True)
    try:
        return Scaling(smart_resize(*size), size, bounded=True)
    except ParameterError as error:
        raise FieldError("image", str(error)) from None
