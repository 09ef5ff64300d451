"""Counter-based random numbers: the same key gives the same plan, whatever else was drawn.

A stream is named by `(seed, corruption, sample, step, epoch)` and by nothing else, so a plan does
not depend on order, batch, worker or process count. The generator is Philox 4x64 with

* key     = (seed, hash of the corruption id),
* counter = (0, step and epoch, two words of the hash of the sample id).

Inside a combinator the sample id is a `Branch`, which also names the path to the node, so that no
two nodes of a tree share a stream; its hash cannot collide with that of a plain sample id.

Only its raw 64-bit words are used; integers and fractions are derived here, because NumPy may
change `Generator.choice` between versions but not the words of the bit generator. There is no
global state.
"""

import functools
import hashlib
from collections.abc import Sequence
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numpy.random.bit_generator import ISeedSequence

from .errors import ParameterError, ParameterTypeError

T = TypeVar("T")
_MASK = 2**64 - 1
_NO_KEY = np.zeros(2, np.uint64)
_NO_WORDS = np.zeros(4, np.uint64)


class Branch(str):
    """The key of one node of a combinator: a sample id, and the path from the root to the node.

    It is a string that differs for each node, and planners pass it on like any `sample`.
    """

    __slots__ = ("path", "sample")
    sample: str
    path: tuple[str, ...]

    def __new__(cls, sample: str, path: tuple[str, ...]) -> "Branch":
        """Make the key; planners call `branch` instead."""
        key = super().__new__(cls, f"{sample} at {'/'.join(path)}")
        key.sample = sample
        key.path = path
        return key

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the key with its parts."""
        return Branch, (self.sample, self.path)


def branch(sample: int | str, node: int | str) -> Branch:
    """Return the key for a part of a planner.

    Args:
        sample: the sample id, or the key, that the planner itself was given.
        node: the number of the part, or a short name without a slash.

    Raises:
        ParameterError: `sample` is an integer of more than 64 bits.
        ParameterTypeError: `sample` is neither an integer nor a string.
    """
    if isinstance(sample, Branch):
        return Branch(sample.sample, (*sample.path, str(node)))
    return Branch(_sample_text(sample), (str(node),))


def _sample_text(sample: object) -> str:
    """Return a sample id as text: `3` and `"3"` are the same sample.

    Raises:
        ParameterError: the id is an integer of more than 64 bits.
        ParameterTypeError: the id is neither an integer nor a string.
    """
    if isinstance(sample, str):
        return sample
    if isinstance(sample, bool) or not hasattr(sample, "__index__"):
        description = f"{sample!r} ({type(sample).__name__})"
        raise ParameterTypeError(f"sample must be an integer or a string, got {description}")
    number = cast(Any, sample).__index__()
    if abs(number) > _MASK:
        advice = "give one below 2**64, or a string"
        raise ParameterError(f"sample is an integer of {number.bit_length()} bits; {advice}")
    return str(number)


def _sample_words(sample: object) -> tuple[int, int]:
    if not isinstance(sample, Branch):
        return _words(_sample_text(sample))
    # A path holds no line break, so different branches give different texts, and `person` separates
    # them from sample ids.
    return _words("/".join(sample.path) + "\n" + sample.sample, person=b"branch")


@functools.lru_cache(maxsize=256)
def _name_word(name: str) -> int:
    return _words(name)[0]


def _words(text: str, person: bytes = b"") -> tuple[int, int]:
    data = text.encode("utf-8", "surrogatepass")
    digest = hashlib.blake2b(data, digest_size=16, person=person).digest()
    first = int.from_bytes(digest[:8], "little")
    second = int.from_bytes(digest[8:], "little")
    return first, second


def as_seed(value: object) -> int:
    """Return a seed as an integer.

    Raises:
        ParameterError: the seed is below 0, or 2**64 or more.
        ParameterTypeError: the seed is not an integer (a bool does not count as one).
    """
    return _integer(value, "seed", 0, 2**64 - 1)


def _integer(value: object, name: str, low: int, high: int) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        description = f"{value!r} ({type(value).__name__})"
        raise ParameterTypeError(f"{name} must be an integer, got {description}")
    number = cast(Any, value).__index__()
    if not low <= number <= high:
        raise ParameterError(f"{name} must be in [{low}, {high}], got {number}")
    return number


class _NoSeed(ISeedSequence):
    """A seed for a generator whose state is set next: NumPy would ask the system for entropy."""

    def generate_state(self, n_words: int, dtype: object = None) -> npt.NDArray[np.uint64]:
        return _NO_KEY


_NO_SEED = _NoSeed()


def _philox(key: npt.NDArray[np.uint64], counter: npt.NDArray[np.uint64]) -> np.random.Philox:
    """Return `Philox(key=key, counter=counter)`, in two thirds of its time."""
    bits = np.random.Philox(cast(Any, _NO_SEED))
    bits.state = {
        "bit_generator": "Philox",
        "state": {"counter": counter, "key": key},
        "buffer": _NO_WORDS,
        "buffer_pos": len(_NO_WORDS),  # nothing is drawn yet
        "has_uint32": 0,
        "uinteger": 0,
    }
    return bits


class Stream:
    """A stream of random draws.

    Args:
        seed: 0 to 2**64 - 1.
        name: corruption id, such as `"marks-v1"`.
        sample: sample id, an integer or a string (`3` and `"3"` are the same sample), or a `Branch`
            of one.
        step: step in the trajectory, -2**31 to 2**31 - 1.
        epoch: training epoch, 0 to 2**32 - 1.

    Raises:
        ParameterError: a number is out of its range.
        ParameterTypeError: a value has the wrong type.
    """

    def __init__(
        self, seed: int, name: str, sample: int | str = 0, step: int = 0, epoch: int = 0
    ) -> None:
        seed = _integer(seed, "seed", 0, _MASK)
        step = _integer(step, "step", -(2**31), 2**31 - 1)
        epoch = _integer(epoch, "epoch", 0, 2**32 - 1)
        epoch_and_step = (epoch << 32) | (step & 0xFFFFFFFF)
        key = np.array([seed, _name_word(name)], np.uint64)
        counter = np.array([0, epoch_and_step, *_sample_words(sample)], np.uint64)
        self._bits = _philox(key, counter)
        self._drawn: list[int] = []  # words that `integers` drew and did not use, in reverse order

    def word(self) -> int:
        """Return the next raw word, uniform on 0 to 2**64 - 1."""
        if self._drawn:
            return self._drawn.pop()
        return int(self._bits.random_raw())

    def random(self) -> float:
        """Return a fraction in [0, 1), a multiple of 2**-53."""
        return (self.word() >> 11) * 2.0**-53

    def integer(self, low: int, high: int) -> int:
        """Return an integer in `[low, high]`, both ends included, without bias.

        Raises:
            ParameterError: the range is empty.
        """
        span = high - low + 1
        if span < 1:
            raise ParameterError(f"empty range [{low}, {high}]")
        limit = (_MASK + 1) - (_MASK + 1) % span
        word = self.word()
        while word >= limit:
            word = self.word()
        return low + word % span

    def integers(self, ranges: Sequence[tuple[int, int]], count: int) -> npt.NDArray[np.int64]:
        """Return what `integer` would return for each of the ranges in turn, `count` times.

        The result is int64 `[count, len(ranges)]`. A hundred numbers take as long as ten drawn one
        by one.
        """
        spans = [high - low + 1 for low, high in ranges]
        words: npt.NDArray[np.uint64] = self._bits.random_raw(count * len(ranges))
        last = [_MASK - (_MASK + 1) % span if span > 0 else -1 for span in spans]
        table = words.reshape(count, len(ranges))
        # once in 10**15 words
        if self._drawn or min(last) < 0 or (table > np.array(last, np.uint64)).any():
            self._drawn = [*words[::-1].tolist(), *self._drawn]
            rows = [[self.integer(*pair) for pair in ranges] for _ in range(count)]
            return np.array(rows, np.int64)
        lows = np.array([low for low, _ in ranges], np.int64)
        return lows + (table % np.array(spans, np.uint64)).astype(np.int64)

    def choice(self, options: Sequence[T]) -> T:
        """Return one of `options`."""
        return options[self.integer(0, len(options) - 1)]
