"""Which tasks of the suite an oracle solves under which corruption: the page `docs/results/suite.md`.

    python benchmarks/suite_results.py [RUNS ...]

Every finished episode of the given runs of `hijack bench embedded --agent oracle` (or
`recovering`) is added to `docs/results/suite/AGENT.csv`, then the page is made from those files.
The runs take hours, so they are made one corruption at a time. Of the episodes of one task,
corruption and seed the page counts the latest, which the latest code played; the files keep all.
"""

import argparse
import csv
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from common import table

from hijack_data import corruption_names
from hijack_data.file_io import write_atomic
from online_env.results import records
from online_env.results.scores import task_name
from online_env.tasks import get, suite
from online_env.tasks.base import Task

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
AGENTS = ("oracle", "recovering")
COLUMNS = ("clean", *corruption_names())
SOLVED, FAILED, UNSOLVABLE, OPEN = "✓", "✗", "–", ""


STARRED = "the touch gives a star to a mail, which a careful user notices only by chance"
# Seen in the pictures of the episodes.
REASONS = {
    ("count_articles", "network_error"): "everything was read before the network went",
    ("delete_newsletter", "accidental_touch"): STARRED,
    ("mail_wiki_fact", "accidental_touch"): STARRED,
}


@dataclass(frozen=True, order=True)
class Played:
    """One finished episode: who, what, how it ended, and the commit of the code that played it."""

    task: str
    corruption: str
    seed: int
    begun: int
    score: float
    actions: int
    seconds: float
    commit: str


def episodes(folder: Path) -> dict[str, list[Played]]:
    """Read the finished episodes of a run, by agent."""
    run = records.read(folder)
    head = records.read_head(folder)
    commit = str(head["git"]["agenthijack"]["commit"])[:7]
    result: dict[str, list[Played]] = defaultdict(list)
    for record in run.records:
        if record["status"] != "ok":
            continue
        result[record["agent"]].append(
            Played(
                task=task_name(record["task"], record["task_seed"]),
                corruption=record["corruption"],
                seed=record["task_seed"],
                begun=int(head["created"]),
                score=record["score"],
                actions=record["steps"] - 1,
                seconds=round(record["seconds"], 1),
                commit=commit,
            )
        )
    return result


def kept_episodes(agent: str) -> list[Played]:
    """Read what earlier runs have left."""
    path = RESULTS / "suite" / f"{agent}.csv"
    if not path.exists():
        return []
    types = {field.name: field.type for field in fields(Played)}
    with path.open(newline="") as lines:
        return [
            Played(**{name: _typed(value, types[name]) for name, value in row.items()})
            for row in csv.DictReader(lines)
        ]


def _typed(value: str, kind: object) -> Any:
    if kind is int:
        return int(value)
    return float(value) if kind is float else value


def keep(agent: str, played: Iterable[Played]) -> None:
    """Write the episodes of an agent, sorted and each once."""
    lines = [[field.name for field in fields(Played)]]
    lines += [[str(value) for value in astuple(item)] for item in sorted(set(played))]
    text = "".join(",".join(line) + "\n" for line in lines)
    folder = RESULTS / "suite"
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / f"{agent}.csv", text.encode())


def cell(task: Task, corruption: str, scores: Sequence[float]) -> str:
    """Return what the table says of one task under one corruption."""
    is_unsolvable = corruption in task.unsolvable
    if not scores:
        return UNSOLVABLE if is_unsolvable else OPEN
    solved = sum(score == 1.0 for score in scores)
    if is_unsolvable and not solved:
        return UNSOLVABLE
    if solved == len(scores):
        return SOLVED
    if not solved:
        return FAILED
    return f"{solved}/{len(scores)}"


def latest(played: Iterable[Played]) -> list[Played]:
    """Return the last episode of each task, corruption and seed."""
    entries: dict[tuple[str, str, int], Played] = {}
    for item in sorted(played, key=lambda item: item.begun):
        entries[item.task, item.corruption, item.seed] = item
    return list(entries.values())


def by_case(played: Iterable[Played]) -> dict[tuple[str, str], list[float]]:
    """Return the scores of each task under each corruption."""
    result: dict[tuple[str, str], list[float]] = defaultdict(list)
    for item in played:
        result[item.task, item.corruption].append(item.score)
    return result


def totals(agents: Mapping[str, Sequence[Played]], tasks: Mapping[str, Task]) -> str:
    """Return the table of all agents: solved of played episodes, below what was declared."""
    counts = [
        str(sum(corruption not in task.unsolvable for task in tasks.values()))
        for corruption in COLUMNS
    ]
    rows = [[f"tasks declared solvable, of {len(tasks)}", *counts]]
    for agent, agent_records in agents.items():
        row = [f"`{agent}`, solved of played"]
        for corruption in COLUMNS:
            scores = [item.score for item in agent_records if item.corruption == corruption]
            solved = sum(score == 1.0 for score in scores)
            row.append(f"{solved} of {len(scores)}" if scores else "not run")
        rows.append(row)
    return table(["", *COLUMNS], rows)


def against(tasks: Mapping[str, Task], played: Sequence[Played]) -> str:
    """Return where the careful user's result differs from what the task's author declared."""
    lines: list[str] = []
    for (name, corruption), scores in sorted(by_case(played).items()):
        if name not in tasks:
            continue
        expected = corruption not in tasks[name].unsolvable
        solved = sum(score == 1.0 for score in scores)
        if solved == (len(scores) if expected else 0):
            continue
        output = "solvable" if expected else "not solvable"
        why = REASONS.get((name, corruption))
        result = f"declared {output}, {solved} of {len(scores)}{f': {why}' if why else ''}"
        lines.append(f"* `{name}` under {corruption}: {result}")
    return "\n".join(lines) or "None."


def by_task(tasks: Mapping[str, Task], played: Sequence[Played]) -> str:
    """Return the table of all tasks under all corruptions."""
    cases = by_case(played)
    rows: list[list[str]] = []
    for name, task in sorted(tasks.items(), key=lambda item: (item[1].domain, item[0])):
        cells = [
            cell(task, corruption, cases.get((name, corruption), ())) for corruption in COLUMNS
        ]
        rows.append([task.domain, name, *cells])
    return table(["domain", "task", *COLUMNS], rows)


def all_tasks() -> dict[str, Task]:
    """Return the tasks of the suite by name."""
    return {name: get(name) for name in suite.class_references()}


def page(agents: Mapping[str, Sequence[Played]]) -> str:
    """Return the page in Markdown."""
    result = all_tasks()
    parts = [
        "# Which tasks can be solved under which corruption",
        "<!-- Made by `python benchmarks/suite_results.py`: run it again, do not edit. -->",
        "Two agents that know the solution of every task play the whole suite on the embedded"
        " desktop. `oracle` carries out its actions whatever happens; it is what a clean desktop"
        " is checked with. `recovering` looks first, and does what a careful user would: it closes"
        " what is in the way, restores the window, logs in, waits and reloads. Its score is the"
        " ceiling that reports print beside every agent's.",
        "Both read the accessibility tree and never the picture, so pop_ups, resolution, marks and"
        " subtitle, which change only the picture, should make no difference to them. They were"
        " played under these, too, to see that this is so.",
        "Seed 0 has all tasks, seed 1 the 24 of `core`: 156 episodes. On clean desktops `oracle`"
        " played all tasks with three seeds. Single episodes were added later. Under network_error"
        " the network was cut after the task's page was loaded (`--environment-errors"
        " after_setup`).",
        "The desktops shared two cores with other work, at loads up to 50: some episodes were lost"
        " to time-outs of the oracle. Of episodes with the same task, corruption and seed the last"
        " one counts; the files in `docs/results/suite` have all of them, with the commit that"
        " played each. An episode whose corruption could not be proved does not count.",
        "```sh no-run it takes half an hour\n"
        "hijack bench embedded --agent recovering --corruptions marks --out runs/recovering-marks\n"
        "python benchmarks/suite_results.py runs/recovering-marks\n```",
        "## Solved of played episodes",
        totals(agents, result),
    ]
    if agents.get("recovering"):
        parts += [
            "## Where `recovering` and the declaration differ",
            "Each task declares under which corruptions not even a careful user can do it.",
            against(result, agents["recovering"]),
        ]
    for agent, agent_records in agents.items():
        parts += [
            f"## Each task with `{agent}`",
            f"{SOLVED} solved, {FAILED} not solved, {UNSOLVABLE} declared unsolvable; a fraction"
            " where episodes of one case ended differently; empty where none was played.",
            by_task(result, agent_records),
        ]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Add the runs and make the page."""
    options = argparse.ArgumentParser()
    options.add_argument("runs", nargs="*", type=Path, help="folders of runs to add")
    args = options.parse_args()
    agents = {agent: kept_episodes(agent) for agent in AGENTS}
    for folder in args.runs:
        for agent, agent_records in episodes(folder).items():
            if agent in agents:
                agents[agent] += agent_records
    agents = {
        agent: sorted(set(agent_records))
        for agent, agent_records in agents.items()
        if agent_records
    }
    for agent, agent_records in agents.items():
        keep(agent, agent_records)
    records_by_agent = {agent: latest(agent_records) for agent, agent_records in agents.items()}
    write_atomic(RESULTS / "suite.md", page(records_by_agent).encode())
    print(totals(records_by_agent, all_tasks()))


if __name__ == "__main__":
    main()
