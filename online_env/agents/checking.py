"""Try an agent in the process that a run would start, so that one that hangs or dies is told."""

import sys
from collections.abc import Iterator
from functools import partial
from typing import Any

from hijack_data.conformance.base import Result
from hijack_data.loading import LoadedFile

from . import conformance
from .agent_calls import AgentError, RunningAgent, method_names
from .agent_process import AgentProcess
from .agent_thread import AgentThread
from .references import AgentReference, is_user_code, reference_to
from .registry import AGENTS, make

ANSWER_TIMEOUT_S = 120.0  # s for an answer


def agents_in_file(file: LoadedFile) -> list[str]:
    """Return the names of the agents in a loaded file: registered ones, and its own classes."""
    named = list(file.names.get("agent", ()))
    known = [AGENTS.get(name) for name in named]
    module = vars(sys.modules[file.module])
    for title, value in module.items():
        is_own = isinstance(value, type) and value.__module__ == file.module
        if is_own and callable(getattr(value, "predict", None)) and value not in known:
            named.append(AGENTS.find(f"{file.path}:{title}"))
    return named


def check(name: str, limit: float = ANSWER_TIMEOUT_S) -> Iterator[Result | str]:
    """Yield the outcome of each check of an agent, or the reason why it is not checked.

    Args:
        name: of an agent, or `package.module:Class`, or `path/to/file.py:Class`.
        limit: seconds for each answer of the agent.
    """
    name = AGENTS.find(name)
    entry: Any = AGENTS.get(name)
    methods = entry.methods if isinstance(entry, AgentReference) else method_names(entry)
    if "prepare" in methods:
        yield "it is given a task and a machine (prepare), so it is not a contestant"
        return
    try:
        agent = _running(entry, name, limit)
    except AgentError as error:  # an agent file whose agent cannot be made
        yield conformance.not_made(error)
        return
    try:
        yield from conformance.run_checks(agent)
    finally:
        agent.close()


def _running(entry: Any, name: str, limit: float) -> RunningAgent:
    """Return an agent where a run would have it: one of this library is in a thread."""
    if is_user_code(entry):
        return AgentProcess(reference_to(entry, name), limit)
    return AgentThread(partial(make, name), limit)
