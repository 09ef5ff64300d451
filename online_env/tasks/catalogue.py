"""What there is: the tasks of the suite as data, and the page `docs/suite.md`."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from hijack_data.corruption import corruption_names

from . import get, task_sets
from .base import Task
from .suite import listed

_HEAD = """\
# The tasks of the embedded suite

<!-- Made by `hijack tasks --suite -o docs/suite.md`: change the tasks, not this page. -->

{count} tasks in {domains} domains, on real applications of the embedded desktop. `hijack bench
embedded_small` runs {small} of them, `embedded_core` {core}, `embedded` all. Every task has an
oracle that solves it, wrong results that its validator refuses, and variants: the seed draws names,
numbers, texts and one of three wordings. The instruction below is that of seed 0.

`make test` tries the judgement of all tasks on right and wrong results in a folder. The oracle of
all tasks takes about {minutes} minutes on one desktop (`hijack bench embedded --agent oracle
--corruptions clean`), so there it plays a sample on a desktop, the set `sample`:
{sample}.

What counts is the result: files, settings and what the sites stored, never how it came about.
Whatever the instruction does not name must stay as it was. *Scores 0* names the wrong results that
the validator was tried against, besides doing nothing.

*Length* is the number of actions of the oracle. *Not under* names the corruptions under which not
even a careful user can do the task, as its author declared;
[what was played](results/suite.md) is set beside it. *Set* is `training` or `held_out`: what learns
must not see the held-out tasks.
"""


def rows(names: Iterable[str] | None = None) -> list[dict[str, Any]]:
    """Return the tasks as JSON data, by domain and name.

    Args:
        names: Which tasks; all of the suite if omitted.
    """
    known = task_sets.read_measurements()
    held_out = set(task_sets.members("held_out"))
    found: list[dict[str, Any]] = []
    for name in listed() if names is None else names:
        task = get(name)
        measured = known.get(name)
        found.append(
            {
                "name": name,
                "domain": task.domain,
                "apps": list(task.apps),
                "instruction": task.instruction,
                "what": summary(task),
                "infeasible": task.infeasible,
                "wrong": list(task.wrong_results()),
                "actions": measured.actions if measured else None,
                "seconds": measured.seconds if measured else None,
                "unsolvable": dict(task.unsolvable),
                "solvable": [name for name in corruption_names() if name not in task.unsolvable],
                "set": "held_out" if name in held_out else "training",
            }
        )
    return sorted(found, key=lambda row: (row["domain"], row["name"]))


def summary(task: Task) -> str:
    """Return the first sentence about a task, from its class."""
    return (type(task).__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " ")


def page(found: Sequence[Mapping[str, Any]], pictures: str = "") -> str:
    """Return the catalogue in Markdown.

    Args:
        found: The result of `rows`.
        pictures: The folder of the first screens, relative to the page; "" for none.
    """
    domains = Counter(row["domain"] for row in found)
    head = _HEAD.format(
        count=len(found),
        domains=len(domains),
        small=len(task_sets.members("small")),
        core=len(task_sets.members("core")),
        minutes=round(sum(found.seconds for found in task_sets.read_measurements().values()) / 60),
        sample=", ".join(f"`{name}`" for name in task_sets.members("sample")),
    )
    parts = [head, _table(found, domains)]
    for domain in sorted(domains):
        parts.append(f"## {domain}\n")
        parts += [_section(row, pictures) for row in found if row["domain"] == domain]
    return "\n".join(parts)


def _table(found: Sequence[Mapping[str, Any]], domains: Mapping[str, int]) -> str:
    lines = ["| domain | tasks | median length | longest |", "|---|---|---|---|"]
    for domain in sorted(domains):
        lengths = [row["actions"] for row in found if row["domain"] == domain and row["actions"]]
        middle = f"{median(lengths):g}" if lengths else ""
        longest = max(lengths, default="")
        lines.append(f"| [{domain}](#{domain}) | {domains[domain]} | {middle} | {longest} |")
    return "\n".join(lines) + "\n"


def _section(row: Mapping[str, Any], pictures: str) -> str:
    """Return one task of the page."""
    facts = [f"Applications: {', '.join(row['apps']) or 'none'}"]
    if row["actions"]:
        facts.append(f"length {row['actions']}")
    if row["unsolvable"]:
        facts.append(f"not under {', '.join(sorted(row['unsolvable']))}")
    if row["infeasible"]:
        facts.append(f"cannot be done ({row['infeasible']}): `FAIL` is right")
    facts.append(f"set `{row['set']}`")
    quoted = "\n".join(f"> {line}".rstrip() for line in row["instruction"].split("\n"))
    lines = [f"### {row['name']}", row["what"], "", quoted, "", "; ".join(facts) + "."]
    if row["wrong"]:
        lines += ["", f"Scores 0: {'; '.join(row['wrong'])}."]
    if pictures:
        lines += ["", f"![First screen of {row['name']}]({pictures}/{row['name']}.webp)"]
    return "\n".join(lines) + "\n"
