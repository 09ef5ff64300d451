"""Group the lost episodes of a run by what they have in common, and write a benchmark for each.

Episodes with the same condition (corruption and severity), cause and application are a group if
there are two or more; of those left over, the ones with the same corruption and cause; then the
ones with the same corruption. The rules of `report.causes` find the causes.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from hijack_data.cli.terminal import echo
from hijack_data.config import dump
from hijack_data.errors import quantity
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.runs.run_planners import read_planners

from ..bench.config import DESKTOP_KEYS, KEYS
from ..bench.providers import OSWORLD
from ..report.app_success import record_app
from ..report.causes import LostEpisode, find_lost
from ..report.identity import FIRST_ERROR_ORDER
from ..report.model import ReportError
from ..results import reading
from ..results.scores import group_records, task_name

MAX_NAME = 100  # characters of the name of a file
MIN_EPISODES = 2  # of a group that is more special than all episodes of a corruption
GroupKey: TypeAlias = tuple[str, ...]  # agent and corruption, and as far as shared cause, app


@dataclass(frozen=True, kw_only=True)
class LostGroup:
    """Lost episodes that have something in common.

    Args:
        key: What it is: agent, corruption or its label, cause and application as far as shared.
        episodes: The episodes.
        share: Their share of all lost episodes, 0 to 1.
    """

    key: GroupKey
    episodes: Sequence[LostEpisode]
    share: float

    @property
    def labels(self) -> list[str]:
        """The conditions, in the order of the episodes."""
        return list(dict.fromkeys(lost.record["corruption"] for lost in self.episodes))

    @property
    def tasks(self) -> list[str]:
        """The tasks without the seeds of their variants."""
        records = [lost.record for lost in self.episodes]
        return list(dict.fromkeys(task_name(r["task"], r.get("task_seed")) for r in records))

    @property
    def seeds(self) -> list[int]:
        """The seeds."""
        return sorted({lost.record["seed"] for lost in self.episodes})

    @property
    def description(self) -> str:
        """What the episodes have in common."""
        agent, *shared = self.key
        return ", ".join([*filter(None, shared), agent])


def group_lost(
    episodes: Sequence[LostEpisode], planners: Mapping[str, Planner | None]
) -> list[LostGroup]:
    """Group lost episodes, the largest group first.

    Args:
        episodes: The episodes.
        planners: The conditions of their run, by label.
    """

    def corruption(lost: LostEpisode) -> str:
        planner = planners.get(lost.record["corruption"])
        return lost.record["corruption"] if planner is None else planner.label

    keys: tuple[Callable[[LostEpisode], GroupKey], ...] = (
        lambda e: (e.record["agent"], e.record["corruption"], e.cause, record_app(e.record)),
        lambda e: (e.record["agent"], corruption(e), e.cause),
        lambda e: (e.record["agent"], corruption(e)),
    )
    groups: list[LostGroup] = []
    ungrouped = list(episodes)
    for number, key in enumerate(keys):
        least = MIN_EPISODES if number < len(keys) - 1 else 1
        counts = Counter(map(key, ungrouped))
        for shared in [shared for shared, count in counts.items() if count >= least]:
            members = [lost for lost in ungrouped if key(lost) == shared]
            share = len(members) / len(episodes)
            groups.append(LostGroup(key=shared, episodes=members, share=share))
        ungrouped = [lost for lost in ungrouped if counts[key(lost)] < least]
    return sorted(groups, key=lambda group: (-len(group.episodes), group.key))


def write_groups(folder: Path, out: Path) -> None:
    """Write a benchmark for each group of lost episodes of a run, and print the groups.

    Raises:
        ReportError: The run is not of `hijack bench`, or `out` is not empty.
    """
    run = reading.read(folder)
    if not run.is_live:
        raise ReportError(f"{folder}: holds no live episodes, which causes need (hijack bench)")
    if out.exists() and any(out.iterdir()):
        raise ReportError(f"{out}: is not empty; give --out a new folder")
    if "tasks" not in run.config:
        raise ReportError(f"{folder}: is the log of an environment, and says not what was played")
    planners = read_planners(run.config["corruptions"])
    counts, episodes = find_lost(run, group_records(run.records))
    disturbed = sum(count.disturbed for count in counts)
    unknown = sum(count.unknown for count in counts)
    gap = f"; of {unknown} it is not known, because their steps are not there" if unknown else ""
    echo(f"{quantity(len(episodes), 'episode')} lost of {disturbed} disturbed{gap}")
    groups = group_lost(episodes, planners)
    make_folder(out)
    for number, group in enumerate(groups, 1):
        name = re.sub("[^A-Za-z0-9+]+", "_", group.description)[:MAX_NAME]
        path = out / f"{number:02d}_{name}.yaml"
        write_atomic(path, _to_yaml(group, run.config, planners))
        size = f"{len(group.episodes)} ({100 * group.share:.0f} %)"
        echo(f"{size:>10}  {group.description}: {path}")
    options = " ".join(_options(run.config))
    if groups and options:
        echo(f"the run had {options}: give hijack bench the same again")


def _to_yaml(
    group: LostGroup, config: Mapping[str, Any], planners: Mapping[str, Planner | None]
) -> str:
    """Return the configuration of a benchmark that plays the episodes of a group again."""
    corrupting = {label: planners[label] for label in group.labels}
    listed = dump({label: planner for label, planner in corrupting.items() if planner is not None})
    settings = {"environment_errors": FIRST_ERROR_ORDER}
    settings |= {key: config[key] for key in KEYS if key in config}
    desktop = config.get("desktop", {})  # options of its machines come with --vm alone
    settings |= {
        "desktop": {key: desktop[key] for key in DESKTOP_KEYS if key in desktop},
        "agents": [group.key[0]],
        "tasks": group.tasks,
        "corruptions": [CLEAN, *yaml.safe_load(listed)["corruptions"]],
        "seeds": group.seeds,
    }
    head = (
        f"# {group.description}\n# {quantity(len(group.episodes), 'episode')},"
        f" {100 * group.share:.0f} % of those that were disturbed and lost\n"
    )
    options = " ".join(_options(config))
    if options:
        head += f"# with hijack bench {options}\n"
    return head + yaml.safe_dump(settings, sort_keys=False, allow_unicode=True, width=100)


def _options(config: Mapping[str, Any]) -> Iterator[str]:
    """Yield the options of a run that no file of a benchmark holds."""
    if config.get("guard"):
        yield f"--guard {config['guard']}"
    desktop = config.get("desktop", {})
    if desktop.get("provider") == OSWORLD:
        yield "--vm ..."
    for name, value in desktop.get("vm_options", {}).items():
        yield f"--vm-option {name}={value}"
