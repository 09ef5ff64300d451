"""What a probe or an undo found, as one line for people; the facts themselves are in the record.

Each effect words its own facts (`LiveEffect.in_words`, `LiveEffect.undone_in_words`).
"""

import json
from collections.abc import Mapping
from typing import Any, TypeAlias

from hijack_data.errors import UnknownNameError

from .base import LiveEffect, find

Facts: TypeAlias = Mapping[str, Any]
LONGEST = 60  # characters of a name or a title


def in_words(kind: str, facts: Facts, problem: str = "") -> str:
    """Return what the facts of a probe mean; of a probe that failed, its `problem`."""
    if problem:
        return problem
    live = _live(kind)
    return as_json(facts) if live is None else live.in_words(facts)


def undone_in_words(kind: str, facts: Facts, problem: str = "") -> str:
    """Return how an effect was taken back; the `problem` if it was not."""
    if problem:
        return problem
    live = _live(kind)
    return as_json(facts) if live is None else live.undone_in_words(facts)


def as_json(facts: Facts) -> str:
    """Return facts that nobody worded."""
    return json.dumps(dict(facts), ensure_ascii=False)


def short(text: str) -> str:
    """Return a name or a title in quotes, on one line and cut to `LONGEST` characters."""
    line = " ".join(text.split())
    if len(line) > LONGEST:
        line = line[: LONGEST - 3] + "..."
    return repr(line)


def _live(kind: str) -> LiveEffect | None:
    """Return the effect of a kind; `None` for one of a plug-in that is not installed here."""
    try:
        return find(kind)
    except UnknownNameError:
        return None
