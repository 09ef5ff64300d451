"""What a search varies: the corruption, its severity, time, place and text, and pairs of two.

A draw is made by Optuna's `Trial`. What a severity level sets is left to the level; of the other
parameters those vary that have a few values: choices, yes or no, texts by name, and steps.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hijack_data.compose import Sequence
from hijack_data.corruption import Corruption, find_corruption
from hijack_data.corruptions.pop_ups import TEMPLATES
from hijack_data.params import parameters
from hijack_data.planner import Planner

DEFAULT_SEVERITY = 3
MAX_STEP = 8  # the latest step at which something begins
NONE = "none"  # no second corruption
_TEXTS: Mapping[tuple[str, str], tuple[str, ...]] = {("pop_ups", "window_string"): tuple(TEMPLATES)}


@dataclass(frozen=True)
class SearchSpace:
    """The corruptions that a search tries.

    Args:
        names: Registered corruptions.
        pairs: Whether two of them may come together.
    """

    names: tuple[str, ...]
    pairs: bool = False

    def draw(self, trial: Any) -> Planner:
        """Return a corruption, or a sequence of two, drawn by a trial of Optuna."""
        first = trial.suggest_categorical("first", self.names)
        chosen = {first}
        if self.pairs:
            chosen.add(trial.suggest_categorical("second", (NONE, *self.names)))
        # In the order of the names, so that a pair is the same from both sides.
        parts = [_draw_one(trial, name) for name in self.names if name in chosen]
        return parts[0] if len(parts) == 1 else Sequence(parts)

    def defaults(self) -> list[dict[str, Any]]:
        """Return the trials that come first: each corruption alone, at its default severity."""
        alone = {"second": NONE} if self.pairs else {}
        return [
            {
                "first": name,
                **alone,
                **({f"{name}.severity": DEFAULT_SEVERITY} if _has_levels(name) else {}),
            }
            for name in self.names
        ]


def _draw_one(trial: Any, name: str) -> Corruption:
    cls = find_corruption(name)
    severity = DEFAULT_SEVERITY
    if _has_levels(name):
        severity = trial.suggest_int(f"{name}.severity", 1, 5)
    values: dict[str, Any] = {}
    set_by_levels = {key for level in cls.severities for key in level}
    for key, (parameter, _) in parameters(cls).items():
        if key in set_by_levels:
            continue
        if parameter.kind == "steps":
            low = int(parameter.low or 0)
            values[key] = trial.suggest_int(f"{name}.{key}", low, MAX_STEP)
        options = (False, True) if parameter.kind == "bool" else parameter.choices
        options = options or _TEXTS.get((name, key), ())
        if options:
            values[key] = trial.suggest_categorical(f"{name}.{key}", options)
    return cls.at(severity, **values)


def _has_levels(name: str) -> bool:
    return bool(find_corruption(name).severities)
