"""Agents of users in the registry, described by another process: their code does not run here."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hijack_data.errors import ParameterError
from hijack_data.loading import SUFFIX, find_loaded_file, find_source, load_reference
from hijack_data.registry import OURS, is_ours

from .base import Agent


@dataclass(frozen=True, kw_only=True)
class AgentReference:
    """An agent that another process imports: the entry of `file.py:Class` and `module:Class`.

    Args:
        place: `package.module:Name` or `/path/to/file.py:Name`.
        source: `path` and `sha256` of the file that defines it; empty if it has none.
        methods: the methods of a class that the library calls; of a function, those are not known.
        is_class: whether it is a class, not a function that makes agents.
        settings: what its `settings()` returned, for the record of a run; `None` without it.
    """

    place: str
    source: Mapping[str, str] = field(default_factory=dict[str, str])
    methods: tuple[str, ...] = ()
    is_class: bool = False
    settings: Mapping[str, Any] | None = None

    def __call__(self) -> Agent:
        """Make the agent in this process (`--in-process`), which imports its code."""
        return load_reference(self.place)()


def is_foreign(text: str) -> bool:
    """Return whether a reference names code from outside this library."""
    source = text.rpartition(":")[0]
    return source.endswith(SUFFIX) or source.partition(".")[0] not in OURS


def absolute_reference(text: str) -> str:
    """Return a reference that holds in any working folder."""
    source, _, name = text.rpartition(":")
    if not source.endswith(SUFFIX):
        return text
    return f"{os.path.abspath(os.path.expanduser(source))}:{name}"


def reference_to(entry: Any, name: str) -> AgentReference:
    """Return a reference to an entry of the registry: to itself, or to its class or function.

    Raises:
        ParameterError: the entry is an object, or not at the top of its module.
    """
    if isinstance(entry, AgentReference):
        return entry
    title = getattr(entry, "__qualname__", "")
    if not title or "." in title:
        raise ParameterError(
            f"agent {name!r}: another process cannot import it; name a class or a function at the"
            " top of a module or file, or use --in-process"
        )
    file = find_loaded_file(entry)
    source = entry.__module__ if file is None else file.path
    return AgentReference(place=f"{source}:{title}", source=find_source(entry) or {})


def is_user_code(entry: Any) -> bool:
    """Return whether an entry of the registry is Python code from outside this library."""
    return isinstance(entry, AgentReference) or not is_ours(entry)
