"""Refuse a transform that would draw as an earlier one of the same seed did on the same picture.

A `OneOf` draws from a stream that the seed, the sample and its place in the tree of planners name.
Two transforms of one seed in a row thus draw alike: with `p=0.5` each, both act on the same half of
the samples, and neither on the rest. What a transform returned is remembered while it lives; a
picture that was copied or changed in between is a new one.
"""

import weakref
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from .compose import OneOf, Schedule, Sequence
from .errors import ParameterError
from .planner import Planner


@dataclass(frozen=True)
class Draws:
    """The choices that a transform draws for a sample.

    Args:
        seed: 0 to 2**64 - 1.
        ids: where the ids of samples come from.
        choices: what each `OneOf` draws: `"whether"` or `"which"`, with its place in the tree. A
            tuple, because the fingerprints of `datasets` depend on the order of a set.
    """

    seed: int
    ids: str
    choices: tuple[tuple[str, tuple[int, ...]], ...]


NO_DRAWS = Draws(0, "", ())
_by_picture: dict[int, tuple["weakref.ref[Any]", tuple[Draws, ...]]] = {}


def find_draws(planner: Planner, seed: int, ids: str) -> Draws:
    """Return the choices that a planner draws."""
    return Draws(seed, ids, tuple(_choices(planner, ())))


def _choices(planner: Planner, place: tuple[int, ...]) -> Iterator[tuple[str, tuple[int, ...]]]:
    if isinstance(planner, OneOf):
        if 0 < planner.p_clean < 1:
            yield "whether", place
        if sum(weight > 0 for weight in planner.weights) > 1:
            yield "which", place
    has_places = isinstance(planner, OneOf | Schedule | Sequence)
    for number, part in enumerate(planner.parts):
        yield from _choices(part, (*place, number) if has_places else place)


def check_chain(draws: Draws, pictures: Iterable[Any]) -> tuple[Draws, ...]:
    """Return these draws and those of all transforms that made these pictures.

    Raises:
        ParameterError: one of them drew as these draws will.
    """
    earlier = dict.fromkeys(each for picture in pictures for each in _earlier(picture))
    for each in earlier:
        is_shared = not set(each.choices).isdisjoint(draws.choices)
        if is_shared and (each.seed, each.ids) == (draws.seed, draws.ids):
            raise ParameterError(
                f"an earlier transform with seed={draws.seed} made this picture, and both draw"
                " alike: they act on the same samples, or choose alike; give each a seed of its"
                " own, or put both into one Sequence"
            )
    return (*earlier, draws) if draws.choices else tuple(earlier)


def note_chain(chain: tuple[Draws, ...], pictures: Iterable[Any]) -> None:
    """Remember which draws made these pictures."""
    for picture in pictures if chain else ():
        key = id(picture)
        forget = partial(_forget, key)
        _by_picture[key] = weakref.ref(picture, forget), chain


def _forget(key: int, _: object) -> None:
    _by_picture.pop(key, None)


def _earlier(picture: Any) -> tuple[Draws, ...]:
    reference, draws = _by_picture.get(id(picture), (None, ()))
    return draws if reference is not None and reference() is picture else ()
