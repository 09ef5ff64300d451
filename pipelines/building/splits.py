"""Splits of whole episodes by a hash of their id, independent of the rest of the source.

A trajectory that holds a whole recording is an episode. Rows of tables are single steps: their
reader says which rows belong together, see `readers.screens.RecordedTrajectory`.
"""

import hashlib
from collections.abc import Mapping
from typing import Any

from hijack_data.config.options import OPTIONS
from hijack_data.errors import ParameterError, suggest
from hijack_data.types import Trajectory

from ..errors import BuildError
from ..readers.recording_facts import episode_id

TRAIN = "train"
# The names under which `load_dataset` finds files by itself.
NAMES = (TRAIN, "validation", "test")


class Splits:
    """Shares of the episodes by split; without shares, all of them are in `train`."""

    def __init__(self, shares: Mapping[str, float] | None = None) -> None:
        requested = shares or {}
        # in their fixed order, without shares of 0
        self.shares = {name: requested[name] for name in NAMES if requested.get(name)}

    @property
    def names(self) -> list[str]:
        """The splits in their fixed order."""
        return list(self.shares) or [TRAIN]

    def of(self, trajectory: Trajectory) -> str:
        """Return the split of a trajectory, which depends only on its episode.

        Raises:
            BuildError: there are several splits, and the episode of the trajectory is not known.
        """
        if len(self.shares) < 2:
            return self.names[0]
        episode = episode_id(trajectory)
        if not episode:
            raise BuildError(
                f"splits: {trajectory.source} row {trajectory.id!r} may be one step of a recording,"
                " and nothing says of which, so its steps could fall into several splits; name the"
                " field that does with --episode-key FIELD (in Python: episode_key), or leave"
                " splits out"
            )
        digest = hashlib.sha256(f"split:{episode}".encode()).digest()
        fraction = int.from_bytes(digest[:8], "big") / 2**64
        end = 0.0
        for name, share in self.shares.items():
            end += share
            if fraction < end:
                return name
        return self.names[-1]

    def parameters(self) -> dict[str, Any]:
        """Return the entry of the manifest; empty if all is `train`."""
        if self.names == [TRAIN]:
            return {}
        return {"splits": self.shares}


def choose_splits(option: str | Mapping[str, float] | None) -> Splits:
    """Return the splits for the option `splits`.

    Args:
        option: a mapping, or text such as `"train=0.9,test=0.1"`; `None` puts all in `train`.

    Raises:
        BuildError: `load_dataset` does not find a split of that name.
        ParameterError: the text has another form, or the shares do not sum to 1.
    """
    if option is None:
        return Splits()
    parsed = _parsed(option) if isinstance(option, str) else option
    shares = OPTIONS["splits"].check("splits", parsed)
    for name in shares:
        if name not in NAMES:
            raise BuildError(f"splits: load_dataset finds no split {name!r}{suggest(name, NAMES)}")
    return Splits(shares)


def _parsed(text: str) -> dict[str, float]:
    shares: dict[str, float] = {}
    for part in text.split(","):
        name, share = _parsed_share(part)
        if name in shares:
            raise ParameterError(f"splits: {name!r} is given twice")
        shares[name] = share
    return shares


def _parsed_share(part: str) -> tuple[str, float]:
    name, sign, share = part.partition("=")
    example = "NAME=SHARE, such as train=0.9,test=0.1"
    error = ParameterError(f"splits: {part.strip()!r} must be {example}")
    if not sign:
        raise error
    try:
        return name.strip(), float(share)
    except ValueError:
        raise error from None
