"""Facts of a run that follow from the installed library: about its tasks, agents and desktops.

This is the one module of `pipelines` that asks `online_env`, and only when a run is verified.
"""

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from hijack_data.errors import HijackError, short_repr
from hijack_data.registry import is_ours
from hijack_data.runs.privileged_inputs import LIBRARY_AGENTS
from hijack_data.runs.run_log import UNTIL_RETENTION, episode_slug

PACKAGE = "agenthijack"
_TASKS = "online_env.tasks"
_STOP_RULE = "online_env.results.stop_rule"
_SETTLE = "online_env.environment.settle"
EMBEDDED = "embedded"  # the provider of this library
TASK_FIELDS = ("task", "task_seed", "sample", "instruction", "apps", "infeasible")
LIBRARY_INPUTS = ("task", "plan")  # kinds that are fixed for each agent of this library


@dataclass(frozen=True)
class Library:
    """The facts that hold for every run which this version of the library played.

    Args:
        unavailable: why there are none, in words; empty if there are.
    """

    unavailable: str = ""

    @classmethod
    def for_run(cls, versions: object) -> "Library":
        """Return the facts for a run that was played with these versions of packages."""
        run_version = versions.get(PACKAGE) if isinstance(versions, Mapping) else None
        try:
            present = version(PACKAGE)
            importlib.import_module(_SETTLE)
            importlib.import_module(_TASKS)
        except (ImportError, PackageNotFoundError) as error:
            return cls(f"tasks and agents of the library cannot be asked ({error})")
        if run_version != present:
            return cls(f"played with {PACKAGE} {short_repr(run_version)}, this is {present}")
        return cls()

    def task_fields(self, name: object, seed: object) -> Mapping[str, Any] | None:
        """Return the fields of a record that follow from a task's name and seed.

        Returns:
            `None` if the task does not come with this library.
        """
        is_known = not self.unavailable and isinstance(name, str) and isinstance(seed, int)
        return _task_fields(name, seed) if is_known else None

    def planned_episodes(
        self, config: Mapping[str, Any], labels: Sequence[str]
    ) -> list[str] | None:
        """Return the ids of all episodes of a configuration.

        Returns:
            `None` if one of its tasks does not come with this library.
        """
        seeds, names = config.get("seeds", ()), config.get("tasks", ())
        cases = [(seed, name) for seed in seeds for name in names]
        if UNTIL_RETENTION in config:
            cases = [(seed, name) for name in names for seed in seeds]
        ids: list[str] = []
        for seed, name in cases:
            fields = self.task_fields(name, seed)
            if fields is None:
                return None
            ids += [
                episode_slug(fields["task"], label, seed, str(agent), 0)
                for label in labels
                for agent in config.get("agents", ())
            ]
        return ids

    def due_episodes(
        self,
        config: Mapping[str, Any],
        episodes: Sequence[str],
        records: Sequence[Mapping[str, Any]],
    ) -> Sequence[str]:
        """Return the ids of the episodes that a run had to play: all, unless it could end early.

        Raises:
            HijackError: its rule is not one, or its tasks are not in the order that was drawn.
        """
        if UNTIL_RETENTION not in config:
            return episodes
        rule: Any = importlib.import_module(_STOP_RULE).StopRule.read(config)
        return rule.due_episodes(config, episodes, records)

    def privileged_inputs(self, agent: object) -> frozenset[str] | None:
        """Return the privileged inputs of an agent of this library; `None` for other agents."""
        kinds = LIBRARY_AGENTS.get(str(agent))
        return None if kinds is None else frozenset(kinds)

    def desktop_fields(self, provider: object) -> Iterator[tuple[str, Any]]:
        """Yield the fields of a record's `desktop` that follow from the provider."""
        if self.unavailable or provider != EMBEDDED:
            return
        yield "provider", "EmbeddedDesktop"
        yield "settle", asdict(importlib.import_module(_SETTLE).Settle())


@lru_cache(maxsize=4096)  # a task has a record for each agent and corruption
def _task_fields(name: str, seed: int) -> Mapping[str, Any] | None:
    tasks: Any = importlib.import_module(_TASKS)
    if name not in tasks.TASKS.names() or not is_ours(tasks.TASKS.get(name)):
        return None
    try:
        task = tasks.get(name, seed)
    except HijackError:
        return None
    about = (task.instruction, list(task.apps), bool(task.infeasible))
    return dict(zip(TASK_FIELDS, (task.id, seed, task.id, *about), strict=True))
