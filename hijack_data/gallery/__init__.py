"""The gallery: one web page that shows what every corruption does to a few screenshots.

The page is one file that makes no network requests: it opens from a disk or an e-mail, with or
without scripts.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from ..corruption import corruption_names, make_corruption
from ..errors import ParameterError, ParameterTypeError, short_repr
from ..planner import Planner, as_planner
from ..rng import Stream
from .data_uris import WEBP_MAX_SIDE
from .page_builder import Detect, PageBuilder, sample_id
from .sheet import contact_sheet

__all__ = ["Page", "contact_sheet", "gallery", "sample_id"]


@dataclass(frozen=True)
class Page:
    """A finished page.

    Attributes:
        html: the whole page.
        problems: the messages that the page shows instead of pictures.
        pictures: the number of pictures that could be read.
    """

    html: str
    problems: tuple[str, ...] = ()
    pictures: int = 0


def gallery(
    images: Sequence[str | os.PathLike[str]],
    *,
    seed: int = 0,
    planners: Mapping[str, Planner] | None = None,
    detect: Detect = "picture",
    embed_width: int = 1280,
) -> Page:
    """Make the gallery page for picture files.

    The same arguments and files give the same bytes. Each picture is planned with its file name as
    the sample id (`sample_id`). A picture that cannot be read, or a corruption that cannot be
    placed, becomes a tile with the reason and an entry of `problems`.

    Args:
        images: paths of the pictures.
        seed: 0 to 2**64 - 1.
        planners: what to show, by title; by default every registered corruption with its default
            parameters.
        detect: how elements are found: `"picture"` (OpenCV), `"ocr"` or `"none"`.
        embed_width: wider pictures are scaled down to this many pixels for display, 16 to 16383.

    Raises:
        ParameterError: an argument is out of range, or the list of pictures is empty.
        ParameterTypeError: an argument has the wrong type.
        UnknownNameError: `detect` is unknown.
        MissingDependencyError: the detector is not installed.
    """
    Stream(seed, "gallery")  # refuses a seed that no plan could use, before any picture is read
    board = PageBuilder(_planners(planners), int(seed), detect, _width(embed_width))
    for path in _paths(images):
        board.add(path)
    return Page(board.html(), tuple(board.problems), board.readable)


def _paths(images: object) -> list[str | os.PathLike[str]]:
    if isinstance(images, str | bytes | os.PathLike) or not isinstance(images, Sequence):
        value = f"{short_repr(cast(object, images))}; for one picture give [path]"
        raise ParameterTypeError(f"images must be a list of paths, got {value}")
    paths = list(cast("Sequence[Any]", images))
    bad = [type(path).__name__ for path in paths if not isinstance(path, str | os.PathLike)]
    if bad:
        advice = "save the picture to a file first"
        raise ParameterTypeError(f"images must hold paths, got {bad[0]}; {advice}")
    if not paths:
        raise ParameterError("gallery needs at least one picture")
    return paths


def _planners(planners: object) -> dict[str, Planner]:
    if planners is None:
        return {name: make_corruption(name) for name in corruption_names()}
    if not isinstance(planners, Mapping) or not planners:
        raise ParameterTypeError(
            "planners must map titles to corruptions, such as {'marks': Marks()}, got"
            f" {planners!r}"
        )
    by_title = {
        str(title): planner for title, planner in cast("Mapping[Any, Any]", planners).items()
    }
    for title, planner in by_title.items():
        as_planner(planner, f"planners[{title!r}] must be a corruption such as Marks()")
    return by_title


def _width(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ParameterTypeError(f"embed_width must be an integer, got {value!r}")
    if not 16 <= value <= WEBP_MAX_SIDE:
        raise ParameterError(f"embed_width must be in [16, {WEBP_MAX_SIDE}] pixels, got {value}")
    return value
