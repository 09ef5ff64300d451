"""The identity of a report's run: its head, and how its conditions relate to the paper's."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from hijack_data.config_files import available
from hijack_data.corruption import find_corruption, make_corruption
from hijack_data.errors import HijackError
from hijack_data.runs.amounts import is_amount
from hijack_data.runs.run_log import RUN, UNTIL_RETENTION, sha256_hex

from ..results import scores
from ..results.episode_columns import EpisodeColumns
from ..results.origin import library_commits
from ..results.outcomes import RESULTS
from ..results.reading import ResultRecord, Run, read_head
from .model import YEAR_10000, RunIdentity

# The paper's corruptions, in the order of the columns of its main table.
NINE = (
    "pop_ups",
    "resolution",
    "marks",
    "subtitle",
    "multi_apps",
    "accidental_touch",
    "app_minimization",
    "network_error",
    "verification",
)
_LABEL_KEY = "as"
FIRST_ERROR_ORDER = "after_setup"  # of the runs whose configuration does not say it
# The fields of a setting that every run has, if only as `None`.
_SETTING = (
    "kind",
    "content",
    "question",
    "split",
    "limit",
    "distance",
    "desktop",
    "tasks",
    "corruptions",
    "seeds",
    "max_steps",
    "recovery",
)
# The fields that do not decide scores, and those that `_setting` puts in its own form. All others
# belong to the setting, those that later versions add included.
_NO_SETTING = frozenset(
    {
        "source",
        "agents",
        "code",
        "environment_errors",
        "retries",
        "agent_timeout",
        "episode_timeout",
        "timeout",
        "osworld_files",
        "in_process",
        "agent_memory",
        "unscored",
        "unpaired",
        "unchanged",
        "unplayable",
        "unplayable_score",
        UNTIL_RETENTION,
    }
)


def run_identity(run: Run) -> RunIdentity:
    """Return the identity of a run."""
    head = _head(run)
    config = run.config
    names = corruptions_by_label(config)
    final = run.last_attempts
    desktop = config.get("desktop")
    created = head.get("created")
    settings = changed_parameters(config)
    return RunIdentity(
        name=run.folder.resolve().name,
        kind=str(config.get("kind", "bench")),
        source=_source_name(str(config.get("source", ""))),
        head_sha256=_head_digest(run),
        setting_sha256=_setting_digest(run),
        created=float(created) if is_amount(created) and created < YEAR_10000 else None,
        versions=_texts(head.get("versions")),
        provider=str(desktop.get("provider", "")) if isinstance(desktop, dict) else "",
        recovery=str(config.get("recovery", "")),
        guard=str(config.get("guard", "")),
        max_steps=_integer(config.get("max_steps")),
        seeds=_seeds(final),
        tasks=_count_tasks(final),
        corruptions=names,
        settings=settings,
        changed=tuple(_changed_labels(config, settings)),
        planned=run.planned,
        missing=run.missing,
        damaged=len(run.damaged),
        early=scores.count_unreached(final, parts_by_label(config)) if run.is_live else 0,
        left_out=run.left_out,
    )


def _seeds(records: Sequence[ResultRecord]) -> tuple[int, ...]:
    """Return the seeds of some records, in ascending order."""
    if isinstance(records, EpisodeColumns):
        return tuple(np.unique(records.seed).tolist())
    return tuple(sorted({record["seed"] for record in records}))


def _count_tasks(records: Sequence[ResultRecord]) -> int:
    """Return how many tasks there are, whatever their variants."""
    if isinstance(records, EpisodeColumns):
        return len(np.unique(records.task))
    return len({scores.task_name(record["task"], record.get("task_seed")) for record in records})


def corruptions_by_label(config: Mapping[str, Any]) -> dict[str, str]:
    """Return the name of the corruption of each label, in the order of a configuration."""
    return {label: name for label, name, _ in _entries(config.get("corruptions"))}


def parts_by_label(config: Mapping[str, Any]) -> dict[str, str]:
    """Return what `corruptions_by_label` does, but for a sequence its parts, joined by `+`."""
    parts: dict[str, str] = {}
    for label, name, settings in _entries(config.get("corruptions")):
        is_sequence = name == "sequence"
        names = [part for _, part, _ in _entries(settings.get("parts"))] if is_sequence else [name]
        parts[label] = "+".join(names)
    return parts


def agent_names(config: Mapping[str, Any]) -> list[str]:
    """Return the agents of a configuration, in its order."""
    return [label for label, _, _ in _entries(config.get("agents"))]


def has_all_nine(run: RunIdentity, labels: set[str]) -> bool:
    """Return whether each of the paper's nine is among `labels`, under its own name."""
    own_names = {label for label in labels if run.corruptions.get(label, label) == label}
    return own_names.issuperset(NINE)


def _entries(listed: Any) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield label, name and settings of the entries of a list in the configuration."""
    if not isinstance(listed, list):
        return
    for entry in listed:
        name: Any = entry
        settings: Any = {}
        if isinstance(entry, dict) and len(entry) == 1:
            ((name, settings),) = entry.items()
        parameters: dict[str, Any] = settings if isinstance(settings, dict) else {}
        yield str(parameters.get(_LABEL_KEY, name)), str(name), parameters


def changed_parameters(config: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the parameters of each label that are not the corruption's defaults.

    Labels of corruptions that are not installed here are left out.
    """
    changes: dict[str, dict[str, Any]] = {}
    for label, name, parameters in corruption_entries(config):
        with suppress(HijackError):
            default = make_corruption(name).params()
            changes[label] = {
                key: parameters[key] for key in parameters if default.get(key) != parameters[key]
            }
    return changes


def corruption_entries(config: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield label, name and parameters of the conditions of a configuration, in its order."""
    for label, name, settings in _entries(config.get("corruptions")):
        yield label, name, {key: value for key, value in settings.items() if key != _LABEL_KEY}


def severity_level(name: str, parameters: Mapping[str, Any]) -> int | None:
    """Return the level of a corruption, 1 to 5, that has these parameters.

    Args:
        name: of the corruption.
        parameters: those that are set; the others are at their defaults.

    Returns:
        `None` if no level has them, or the corruption has no levels.
    """
    with suppress(HijackError):
        kind = find_corruption(name)
        values = json.loads(json.dumps({**kind().params(), **parameters}))
        levels = [
            level
            for level in range(1, len(kind.severities) + 1)
            if json.loads(json.dumps(kind.at(level).params())) == values
        ]
        return levels[0] if len(levels) == 1 else None
    return None


def _changed_labels(
    config: Mapping[str, Any], settings: Mapping[str, Mapping[str, Any]]
) -> Iterator[str]:
    """Yield the labels of the nine whose parameters are not the paper's defaults."""
    for label, name, _ in _entries(config.get("corruptions")):
        if label in NINE and name == label and settings.get(label):
            yield label


def _source_name(source: str) -> str:
    """Return a source without the folders that it lies in, which are those of one machine.

    A packaged configuration keeps its folder: `ablations/marks_number` is its name.
    """
    if source in available():
        return source
    last = re.split(r"[/\\]", source)[-1]
    return "" if last in (".", "..") else last


def played_commits(run: Run) -> list[tuple[int, str]]:
    """Return which commits of this library played a run, each with the number of episodes before.

    None of a log without a head and of results of other harnesses.
    """
    return library_commits(run.folder, _head(run)) if _has_head(run) else []


def _head(run: Run) -> Mapping[str, Any]:
    return read_head(run.folder) if _has_head(run) else {}


def _head_digest(run: Run) -> str:
    return sha256_hex((run.folder / RUN).read_bytes()) if _has_head(run) else ""


def _has_head(run: Run) -> bool:
    return run.config.get("kind") != RESULTS and (run.folder / RUN).exists()


def _setting_digest(run: Run) -> str:
    return sha256_hex(json.dumps(_setting(run), sort_keys=True).encode())


def _setting(run: Run) -> dict[str, Any]:
    """Return what decides the scores of a run apart from its agents, as JSON data."""
    config = run.config
    setting = {key: config.get(key) for key in _SETTING}
    setting |= {
        key: value
        for key, value in config.items()
        if value and key not in (*_SETTING, *_NO_SETTING)
    }
    order = config.get("environment_errors", FIRST_ERROR_ORDER)
    if order != FIRST_ERROR_ORDER:
        setting["environment_errors"] = order
    if config.get("unplayable_score") is not None:  # these tasks are in all denominators
        tasks = config.get("unplayable")
        setting["unplayable"] = sorted(tasks) if isinstance(tasks, dict) else tasks
        setting["unplayable_score"] = config["unplayable_score"]
    if config.get(UNTIL_RETENTION):  # the end decides which tasks were played
        setting[UNTIL_RETENTION] = [config[UNTIL_RETENTION], len(run.episodes)]
    code = task_code(config)
    if code:
        setting["code"] = code
    return setting


def task_code(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the SHA-256 of each file that a task or the provider is in, by name.

    Two runs may have tasks of one name from files that differ.
    """
    listed = config.get("code")
    if not isinstance(listed, dict):
        return {}
    agents = agent_names(config)
    files = {name: file for name, file in listed.items() if name not in agents}
    return {
        name: file.get("sha256") if isinstance(file, dict) else file for name, file in files.items()
    }


def _texts(data: Any) -> dict[str, str]:
    if not isinstance(data, dict):
        return {}
    return {str(key): str(value) for key, value in data.items()}


def _integer(value: Any) -> int | None:
    return value if isinstance(value, int) else None
