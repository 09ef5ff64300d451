"""What an agent was given in addition to instruction and pictures, according to its records.

Results of an agent that was told how to do a task, or that had the task object itself, cannot be
compared with those of an agent that sees only the screen. The same holds for an agent of a user
that ran in the process of the runner, where its code can reach the task and the score. So every
record since version 3 has `given`: a list of `GIVEN_KINDS`, or `null` if it is unknown.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from .run_log import GIVEN, GIVEN_KINDS, GIVING

# What the agents of this library are given; of other agents only their records tell.
LIBRARY_AGENTS: Mapping[str, tuple[str, ...]] = {
    "oracle": ("task",),
    "recovering": ("task",),
    "pixel": ("plan",),
    "pixel_onlooker": ("plan",),
    "pixel_onlooker_no_check": ("plan",),
    "pixel_onlooker_no_summary": ("plan",),
    "do_nothing": (),
    "random": (),
    "fail": (),
}
_WORDS = {
    "task": "the task and the machine",
    "plan": "the task's plan in words",
    "process": "the runner's process (--in-process)",
}
NOTHING = "nothing more"
UNKNOWN = "not recorded"


def read_privileged_inputs(record: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return what the agent of a record was given; `None` if that is unknown."""
    if GIVEN not in record:
        version = record.get("version", 1)
        is_old = isinstance(version, int) and version < GIVING
        return LIBRARY_AGENTS.get(str(record.get("agent"))) if is_old else None
    given = record[GIVEN]
    if not isinstance(given, list):
        return None
    return tuple(kind for kind in GIVEN_KINDS if kind in given)


def collect_privileged_inputs(records: Iterable[Mapping[str, Any]]) -> set[tuple[str, ...]]:
    """Return the kinds of help that the agents of some records were given, as far as known."""
    found = (read_privileged_inputs(record) for record in records)
    return {given for given in found if given is not None}


def describe_privileged_inputs(given: Iterable[str] | None) -> str:
    """Return what was given in words, such as `the task's plan in words`."""
    if given is None:
        return UNKNOWN
    return " and ".join(_WORDS[kind] for kind in given) or NOTHING
