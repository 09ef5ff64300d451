"""What an agent was given in addition to instruction and pictures, according to its records.

Results of an agent that was told how to do a task, or that had the task object itself, cannot be
compared with those of an agent that sees only the screen. The same holds for an agent of a user
that ran in the process of the runner, where its code can reach the task and the score. So every
record has `given`: a list of `GIVEN_KINDS`, or `null` if it is unknown.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from .run_log import GIVEN, GIVEN_KINDS

# What the agents of this library are given. `hijack verify` compares it with their records.
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
    "tree": "the accessibility tree",
    "devtools": "the browser's DevTools, which reach the page's own judge",
}
NOTHING = "nothing more"
UNKNOWN = "not recorded"


def read_privileged_inputs(record: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return what the agent of a record was given; `None` if that is unknown."""
    kinds = record.get(GIVEN)
    if not isinstance(kinds, list):
        return None
    return tuple(kind for kind in GIVEN_KINDS if kind in kinds)


def collect_privileged_inputs(records: Iterable[Mapping[str, Any]]) -> set[tuple[str, ...]]:
    """Return the kinds of help that the agents of some records were given, as far as known."""
    recorded = (read_privileged_inputs(record) for record in records)
    return {kinds for kinds in recorded if kinds is not None}


def describe_privileged_inputs(kinds: Iterable[str] | None) -> str:
    """Return what was given in words, such as `the task's plan in words`."""
    if kinds is None:
        return UNKNOWN
    return " and ".join(_WORDS[kind] for kind in kinds) or NOTHING
