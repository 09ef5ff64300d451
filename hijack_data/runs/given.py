"""What an agent was given beside instruction and pictures, as its records say.

Results of an agent that was told how to do a task, or was handed the task itself, mean something
else than those of one that sees the screen alone. So every record since version 3 has `given`: a
list of `GIVEN_KINDS`, or `null` where nobody knows.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from .run_log import GIVEN, GIVEN_KINDS, GIVING

# The agents of this library, in records before version 3; those of others are not known.
_BEFORE: Mapping[str, tuple[str, ...]] = {
    "oracle": ("task",),
    "recovering": ("task",),
    "pixel": ("plan",),
    "pixel_onlooker": ("plan",),
    "pixel_onlooker_no_check": ("plan",),
    "pixel_onlooker_no_summaries": ("plan",),
    "do_nothing": (),
    "random": (),
    "fail": (),
}
_WORDS = {"task": "the task and the machine", "plan": "the task's plan in words"}
NOTHING = "nothing more"
UNKNOWN = "not recorded"


def given_of(record: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return what the agent of a record was given; `None` if the record does not tell."""
    if GIVEN not in record:
        version = record.get("version", 1)
        is_old = isinstance(version, int) and version < GIVING
        return _BEFORE.get(str(record.get("agent"))) if is_old else None
    given = record[GIVEN]
    if not isinstance(given, list):
        return None
    return tuple(kind for kind in GIVEN_KINDS if kind in given)


def given_to(records: Iterable[Mapping[str, Any]]) -> set[tuple[str, ...]]:
    """Return what the agents of some records were given, without what is not known."""
    found = (given_of(record) for record in records)
    return {given for given in found if given is not None}


def given_words(given: Iterable[str] | None) -> str:
    """Return what was given in words, such as `the task's plan in words`."""
    if given is None:
        return UNKNOWN
    return " and ".join(_WORDS[kind] for kind in given) or NOTHING
