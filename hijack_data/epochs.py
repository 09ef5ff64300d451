"""Notice that samples come again with the same corruption because nothing counts the epochs."""

import mmap
import warnings
import zlib

import numpy as np

from .errors import HijackWarning

_REMEMBERED = 64
_MANY = 8


class RepeatNotice:
    """Warns once when a second pass over samples without an epoch has begun.

    It remembers the first 64 samples, in memory that forked workers share, so that it notices a
    second pass of a `DataLoader` whose workers are new in each epoch. A pass has begun when all
    remembered samples came again, at least 3, or 8 of them did. Copies and pickles have seen
    nothing.

    Args:
        remedy: what the warning advises.
        stopped: notice nothing.
    """

    def __init__(self, remedy: str, stopped: bool = False) -> None:
        self._remedy = remedy
        shared = np.frombuffer(mmap.mmap(-1, 8 * (2 + 2 * _REMEMBERED)), np.int64)
        self._flags = shared[:2]  # stopped by the user; warned
        self._seen = shared[2 : 2 + _REMEMBERED]  # digests, 0 where none is
        self._again = shared[2 + _REMEMBERED :]
        self._flags[0] = stopped

    def __reduce__(self) -> "tuple[type[RepeatNotice], tuple[str, bool]]":
        return RepeatNotice, (self._remedy, bool(self._flags[0]))

    def stop(self) -> None:
        """Notice nothing any more: somebody counts the epochs."""
        self._flags[0] = True

    def note(self, key: int | str, step: object) -> None:
        """Note that a sample is corrupted, and warn if a second pass has begun."""
        if self._flags.any():
            return
        digest = zlib.crc32(f"{key}\0{step}".encode()) + 1
        places = np.flatnonzero(self._seen == digest)
        count = int(np.count_nonzero(self._seen))
        if not len(places):
            if count < _REMEMBERED:
                self._seen[count] = digest
            return
        self._again[places[0]] = 1
        if self._again.sum() < min(_MANY, max(3, count)):
            return
        self._flags[1] = True
        warnings.warn(
            f"samples come a second time, with the corruptions that they had (such as {key!r}),"
            f" because nothing counts the epochs: {self._remedy}",
            HijackWarning,
            stacklevel=2,
        )
