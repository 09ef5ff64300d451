"""The entries of a run in columns, the form that the page expects."""

from collections.abc import Mapping
from typing import Any

from hijack_data.plan import CLEAN

from ...readers.fields import listed
from .listing import OUTCOMES, EpisodeEntry, word

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
        "agent": _listed(config.get("agents")),
        "corruption": [CLEAN, *_listed(config.get("corruptions"))],
        "outcome": [*OUTCOMES],
    }
    texts = {name: [getattr(entry, name) for entry in entries] for name in TEXTS}
    coded = {name: _coded(values, first.get(name, [])) for name, values in texts.items()}
    return {
        "ids": [entry.id for entry in entries],
        "counts": [int(entry.counts) for entry in entries],
        "texts": coded,
        "numbers": {name: [getattr(entry, name) for entry in entries] for name in NUMBERS},
    }


def _coded(values: list[str], first: list[str]) -> dict[str, Any]:
    present = set(values)
    known = {value: k for k, value in enumerate(dict.fromkeys(v for v in first if v in present))}
    codes = [known.setdefault(value, len(known)) for value in values]
    return {"values": list(known), "codes": codes}


def _listed(entries: object) -> list[str]:
    """Return the labels in a list of the configuration: `marks`, or `{marks: {as: LABEL}}`."""
    found: list[str] = []
    for entry in listed(entries):
        if isinstance(entry, dict) and len(entry) == 1:
            ((entry, settings),) = entry.items()
            if isinstance(settings, dict):
                entry = settings.get("as", entry)
        found.append(word(entry))
    return found
