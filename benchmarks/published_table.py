"""The tables of a published page, from the records of its run.

A page marks the place of each table with two comments, between which nothing is written by hand.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any, TypeAlias

from hijack_data.file_io import write_atomic
from hijack_data.plan import CLEAN
from online_env import tasks
from online_env.report import formatting
from online_env.report.cells import compute_cells
from online_env.report.comparison import compare_runs
from online_env.report.identity import corruptions_by_label
from online_env.report.model import Cell
from online_env.results import reading, scores
from online_env.results.reading import Run

Table: TypeAlias = Callable[[Run], str]
RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
END = "<!-- end of the table -->\n"


def differences(run: Run, *agents: str) -> str:
    """Return success, difference to clean and p of some agents, as Markdown.

    Args:
        run: the run, with records of each agent, clean and corrupted.
        agents: the agents, in the order of the columns.
    """
    cells = compute_cells(run, scores.group_records(run.records))
    by_key = {(cell.agent, cell.corruption): cell for cell in cells}
    titles = ["corruption"]
    for agent in agents:
        titles += [f"`{agent.rpartition(':')[2]}`", "to clean, 95 %", "p"]
    table: list[list[str]] = []
    for label in dict.fromkeys(cell.corruption for cell in cells):
        row = [label]
        for agent in agents:
            row += _columns(by_key[agent, label])
        table.append(row)
    return _markdown(titles, table)


def domains(run: Run, agent: str) -> str:
    """Return the success of an agent in each domain of the suite, in percent, as Markdown.

    Args:
        run: a run of tasks of the suite.
        agent: whose success it is.
    """
    groups = scores.group_records(run.records)
    labels = [
        label for label in corruptions_by_label(run.config) if (agent, label) in groups.scored
    ]
    domain_of = {task: tasks.get(task).domain for task in tasks.names()}
    entries: dict[str, dict[str, list[float]]] = {}
    cases_by_cell: dict[str, set[str]] = {}
    for label in labels:
        scored = groups.scored[agent, label]
        for task, score in zip(scores.task_names(scored), scored.values(), strict=True):
            domain = domain_of[task]
            entries.setdefault(domain, {}).setdefault(label, []).append(score)
            cases_by_cell.setdefault(domain, set()).add(task)
    table = [
        [
            domain,
            str(len(cases_by_cell[domain])),
            *(f"{100 * fmean(value[label]):.0f}" if label in value else "" for label in labels),
        ]
        for domain, value in sorted(entries.items())
    ]
    return _markdown(["domain", "tasks", *labels], table)


def faults(run: Run, *agents: str) -> str:
    """Return how often the faults of a run hit, and the mean steps clean and under each.

    Only episodes whose clean partner has a score, too, count.

    Args:
        run: the run, with records of each agent, clean and corrupted.
        agents: the agents, in the order of the columns.
    """
    scored = [record for record in run.last_attempts if record["score"] is not None]
    by_case = {
        (record["agent"], record["corruption"], record["task"], record["seed"]): record
        for record in scored
    }
    titles = ["corruption", *(f"`{agent}`: hit, steps" for agent in agents)]
    table: list[list[str]] = []
    for label in dict.fromkeys(record["corruption"] for record in scored):
        row = [label]
        for agent in agents:
            pairs = [
                (by_case[agent, CLEAN, task, seed], record)
                for (name, corruption, task, seed), record in by_case.items()
                if (name, corruption) == (agent, label) and (agent, CLEAN, task, seed) in by_case
            ]
            row.append(_hits_and_steps(label, pairs))
        table.append(row)
    return _markdown(titles, table)


def _hits_and_steps(
    label: str, pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]
) -> str:
    if not pairs:
        return ""
    clean, steps = (fmean(pair[side]["steps"] for pair in pairs) for side in (0, 1))
    if label == CLEAN:
        return f"{steps:.1f}"
    hit = sum(bool(record.get("inputs") or record.get("effects")) for _, record in pairs)
    return f"{hit} of {len(pairs)}, {clean:.1f} → {steps:.1f}"


def levels(run: Run, agent: str) -> str:
    """Return how many tasks an agent solved at each severity, of those that were played.

    Args:
        run: a run with `--severities 1-5`.
        agent: whose episodes they are.
    """
    scores_at: dict[str, dict[str, list[float]]] = {}
    for record in run.last_attempts:
        label, _, level = record["corruption"].rpartition("_s")
        if record["agent"] == agent and record["score"] is not None and label:
            scores_at.setdefault(label, {}).setdefault(level, []).append(record["score"])
    columns = sorted({level for by_level in scores_at.values() for level in by_level})
    table = [
        [label, *(f"{sum(s == 1.0 for s in by[level])} of {len(by[level])}" for level in columns)]
        for label, by in scores_at.items()
    ]
    return _markdown(["corruption", *(f"severity {level}" for level in columns)], table)


def gain(guarded: Run, plain: str) -> str:
    """Return what a guard changes: success without and with it, the difference, and its acts.

    Args:
        guarded: the run with the guard.
        plain: the published result with the same episodes without it.
    """
    table: list[list[str]] = []
    for cell in compare_runs(reading.read(RESULTS / plain / "run"), guarded).cells:
        if not cell.n:
            continue
        acts = [
            record["guard"]["interventions"]
            for record in guarded.last_attempts
            if (record["agent"], record["corruption"]) == (cell.after, cell.corruption)
        ]
        acted = sum(any(intervention["actions"] for intervention in act) for act in acts)
        change = formatting.percent(cell.difference, "+")
        row = [
            f"`{cell.after}`",
            cell.corruption,
            str(cell.n),
            formatting.percent(cell.success_before),
            formatting.percent(cell.success_after),
            f"{change} {formatting.interval(cell.low, cell.high, '+')}",
            formatting.p_value(cell.p),
            f"{acted} of {len(acts)}",
            str(sum(len(act) for act in acts)),
        ]
        table.append(row)
    titles = ["agent", "corruption", "pairs", "without", "guarded", "difference, 95 %", "p"]
    return _markdown([*titles, "the guard acted in", "interventions"], table)


# The tables of a result, by what the comment on its page calls them.
TABLES: Mapping[str, Mapping[str, Table]] = {
    "all_tasks": {
        "differences": lambda run: differences(run, "pixel"),
        "domains": lambda run: domains(run, "pixel"),
    },
    "miniwob": {
        "differences": lambda run: differences(run, "oracle", "benchmarks/dom_agent.py:DomAgent")
    },
    "miniwob_pixel": {"differences": lambda run: differences(run, "pixel")},
    "reference_agents": {"differences": lambda run: differences(run, "pixel", "pixel_onlooker")},
    "everyday": {
        "differences": lambda run: differences(run, "oracle", "recovering", "pixel"),
        "faults": lambda run: faults(run, "oracle", "recovering", "pixel"),
    },
    "everyday_levels": {"levels": lambda run: levels(run, "oracle")},
    "everyday_guarded": {"gain": lambda run: gain(run, "everyday")},
}


def begin(kind: str) -> str:
    """Return the comment before a table."""
    return f"<!-- benchmarks/published.py makes the table of {kind} -->\n"


def rewrite(page: Path, name: str, run: Run) -> None:
    """Write the tables of a result between the comments of its page.

    Args:
        page: the page.
        name: of the result, a key of `TABLES`.
        run: its run.

    Raises:
        ValueError: the page lacks a comment.
    """
    text = page.read_text(encoding="utf-8")
    for kind, value in TABLES[name].items():
        text = _with_table(text, begin(kind), value(run), page)
    write_atomic(page, text)


def read_block(text: str, kind: str) -> str:
    """Return a table of a page, without its comments."""
    return text.partition(begin(kind))[2].partition(END)[0].strip("\n")


def _with_table(text: str, comment: str, table: str, page: Path) -> str:
    before, value, tail = text.partition(comment)
    _, end, after = tail.partition(END)
    if not (value and end):
        raise ValueError(f"{page}: has no place for a table; write {comment}{END}where it belongs")
    return f"{before}{comment}\n{table}\n{END}{after}"


def _columns(cell: Cell) -> list[str]:
    success = formatting.percent(cell.success)
    if cell.corruption == CLEAN:
        return [success, "", ""]
    change = formatting.percent(cell.delta, "+")
    return [
        success,
        f"{change} {formatting.interval(cell.delta_low, cell.delta_high, '+')}",
        formatting.p_value(cell.p),
    ]


def _markdown(titles: list[str], table: list[list[str]]) -> str:
    rule = "|---" * len(titles) + "|"
    lines = [_line(titles), rule, *map(_line, table)]
    return "".join(f"{line}\n" for line in lines)


def _line(row: list[str]) -> str:
    return f"| {' | '.join(row)} |"
