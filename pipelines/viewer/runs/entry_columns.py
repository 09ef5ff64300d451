"""Arrange the entries of a run in columns, as the page expects them."""

from collections.abc import Mapping, Sequence
from typing import Any

from hijack_data.plan import CLEAN

from ...readers.fields import listed
from .episode_entry import OUTCOMES, EpisodeEntry
from .listing import word

TEXTS = (
    "agent",
    "task",
    "corruption",
    "outcome",
    "seed",
    "instruction",
    "note",
    "said",
    "problem",
    "given",
)
NUMBERS = ("score", "steps", "seconds", "tokens", "usd", "attempt")


def columns(entries: list[EpisodeEntry], config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries by columns: texts are coded by their values, numbers stay unchanged.

    Agents and corruptions come in the order of the configuration, as far as it names them.
    """
    first = {
        "agent": _labels(config.get("agents")),
        "corruption": [CLEAN, *_labels(config.get("corruptions"))],
        "outcome": [*OUTCOMES],
    }
    texts = {name: [getattr(entry, name) for entry in entries] for name in TEXTS}
    coded = {name: _encode(values, first.get(name, [])) for name, values in texts.items()}
    return {
        "ids": [entry.id for entry in entries],
        "counts": [int(entry.counts) for entry in entries],
        "last": _last_attempts(entries),
        "texts": coded,
        "numbers": {name: [getattr(entry, name) for entry in entries] for name in NUMBERS},
    }


def _last_attempts(entries: Sequence[EpisodeEntry]) -> list[int]:
    """Return for each entry 1 if it is the last attempt at its case, which counts, or else 0.

    Attempts are in the order of their numbers, as in the report: lines may have been sorted, and
    folders are sorted by name, `a10` before `a2`.
    """
    last: dict[tuple[str, ...], int] = {}
    for number in sorted(range(len(entries)), key=lambda number: entries[number].attempt):
        entry = entries[number]
        last[entry.agent, entry.corruption, entry.task, entry.seed] = number
    numbers = set(last.values())
    return [int(number in numbers) for number in range(len(entries))]


def _encode(values: list[str], first: list[str]) -> dict[str, Any]:
    present = set(values)
    codes_by_value = {
        value: k for k, value in enumerate(dict.fromkeys(v for v in first if v in present))
    }
    codes = [codes_by_value.setdefault(value, len(codes_by_value)) for value in values]
    return {"values": list(codes_by_value), "codes": codes}


def _labels(entries: object) -> list[str]:
    """Return the labels in a list of the configuration: `marks`, or `{marks: {as: LABEL}}`."""
    labels: list[str] = []
    for entry in listed(entries):
        if isinstance(entry, dict) and len(entry) == 1:
            ((entry, settings),) = entry.items()
            if isinstance(settings, dict):
                entry = settings.get("as", entry)
        labels.append(word(entry))
    return labels
