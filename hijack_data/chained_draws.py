"""Refuse a transform that would draw as an earlier one of the same seed did on the same picture.

A node of a planner draws from a stream that the seed, the sample, its kind and its place in the
tree name. Two transforms of one seed in a row thus draw alike: with `p=0.5` each, both act on the
same half of the samples, and two `Marks` lie at the same places. What a transform returned is
remembered while it lives; a picture that was copied or changed in between is a new one.
"""

import weakref
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, TypeAlias

from .compose import OneOf, Schedule, Sequence
from .corruption import Corruption
from .errors import HijackError, ParameterError
from .planner import Planner
from .sample_pictures import picture_size
from .types import Scene, Size

Place: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class Draws:
    """The choices that a transform draws for a sample.

    Args:
        seed: 0 to 2**64 - 1.
        ids: where the ids of samples come from.
        choices: what each `OneOf` draws, `WHETHER` or `WHICH`, and the id of each leaf, with its
            place in the tree. A tuple, because the fingerprints of `datasets` depend on the order
            of a set.
    """

    seed: int
    ids: str
    choices: tuple[tuple[str, Place], ...]


WHETHER, WHICH = "whether", "which"
SEEDS_TRIED = 4
NO_DRAWS = Draws(0, "", ())
_by_picture: dict[int, tuple["weakref.ref[Any]", tuple[Draws, ...]]] = {}


def find_draws(planner: Planner, seed: int, ids: str) -> Draws:
    """Return the choices that a planner draws."""
    return Draws(seed, ids, tuple(_choices(planner)))


def _choices(planner: Planner) -> Iterator[tuple[str, Place]]:
    for place, node in _nodes(planner, ()):
        if not node.parts:
            yield node.id, place
        elif isinstance(node, OneOf):
            if 0 < node.p_clean < 1:
                yield WHETHER, place
            if sum(weight > 0 for weight in node.weights) > 1:
                yield WHICH, place


def _nodes(planner: Planner, place: Place) -> Iterator[tuple[Place, Planner]]:
    yield place, planner
    has_places = isinstance(planner, OneOf | Schedule | Sequence)
    for number, part in enumerate(planner.parts):
        yield from _nodes(part, (*place, number) if has_places else place)


def check_chain(planner: Planner, draws: Draws, pictures: Iterable[Any]) -> tuple[Draws, ...]:
    """Return the draws of a planner, and those of all transforms that made these pictures.

    Raises:
        ParameterError: one of them drew as the planner will.
    """
    inputs = list(pictures)
    earlier = dict.fromkeys(each for picture in inputs for each in _earlier(picture))
    for each in earlier:
        if (each.seed, each.ids) != (draws.seed, draws.ids):
            continue
        shared = set(each.choices).intersection(draws.choices)
        if any(_is_drawn(planner, choice, picture_size(inputs[0])) for choice in shared):
            raise ParameterError(
                f"an earlier transform with seed={draws.seed} made this picture, and both draw"
                " alike: they act on the same samples, choose alike or draw at the same places;"
                " give each a seed of its own, or put both into one Sequence"
            )
    return (*earlier, draws) if draws.choices else tuple(earlier)


def _is_drawn(planner: Planner, choice: tuple[str, Place], size: Size) -> bool:
    """Return whether the stream decides a choice, which it does not for each corruption."""
    kind, place = choice
    if kind in (WHETHER, WHICH):
        return True
    leaf = next(node for at, node in _nodes(planner, ()) if (at, node.id) == (place, kind))
    return isinstance(leaf, Corruption) and _differs_by_seed(leaf, size)


@lru_cache(maxsize=64)
def _differs_by_seed(leaf: Corruption, size: Size) -> bool:
    try:
        plans = [leaf.plan(Scene(size), seed=seed) for seed in range(SEEDS_TRIED)]
    except HijackError:  # the plan for the sample says why
        return False
    return any(plan != plans[0] for plan in plans)


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
