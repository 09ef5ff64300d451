"""The top-level keys of a configuration other than `corruptions`.

This is the one place that declares them: their names, values, checks and meanings.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, Protocol, cast

from ..choices import LABEL_POLICIES, OUTPUTS
from ..errors import ParameterError, ParameterTypeError
from ..params import Parameter

_SPLIT = re.compile(r"\w{1,64}")


class Option(Protocol):
    """The declaration of a top-level key."""

    @property
    def doc(self) -> str:
        """The meaning of the key, in one line."""
        ...

    def check(self, key: str, value: object) -> Any:
        """Return the value in its normal form.

        A bad value is a `ParameterTypeError` or a `ParameterError`, whose message begins with
        `key`.
        """
        ...


class SplitShares:
    """Names of splits with their shares, which sum to 1."""

    doc = "Share of the trajectories in each split, such as {train: 0.9, test: 0.1}"

    def check(self, key: str, value: object) -> dict[str, float]:
        """Return `{name: share}`.

        Raises:
            ParameterTypeError: the value is not a mapping.
            ParameterError: a name or a share is impossible, or the shares do not sum to 1.
        """
        if not isinstance(value, Mapping) or not value:
            raise ParameterTypeError(
                f"{key} must be a mapping such as {{train: 0.9, test: 0.1}}, got {value!r}"
            )
        share = Parameter("float", "", low=0, high=1)
        entries = cast("Mapping[str, object]", value)
        shares: dict[str, float] = {}
        for name, part in entries.items():
            shares[name] = cast(float, share.check(f"{key}.{name}", part))
        for name in shares:
            if not _SPLIT.fullmatch(name):
                advice = "use letters, digits and _"
                raise ParameterError(f"{key}: {name!r} cannot name a split; {advice}")
        total = sum(shares.values())
        if not math.isclose(total, 1, abs_tol=1e-9):
            raise ParameterError(f"{key}: the shares must sum to 1, got {total:g}")
        return shares


OPTIONS: Mapping[str, Option] = {
    "seed": Parameter("int", "Seed of every draw", low=0, high=2**64 - 1),
    "clean": Parameter("bool", "Keep the clean rows too"),
    "label_policy": Parameter(
        "choice", "What becomes of a step whose target is hidden", choices=LABEL_POLICIES
    ),
    "output": Parameter("choice", "Store pixels or plans", choices=OUTPUTS),
    "splits": SplitShares(),
}
