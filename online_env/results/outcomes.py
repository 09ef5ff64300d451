"""Results of other benchmarks and harnesses: what a reader yields, and how a run is made of it.

A reader turns one source into `EpisodeOutcome`s; `collect_run` makes a `Run` of them, which every
report, comparison and format then takes. Tasks are the cases and seeds repeat them. What is not an
outcome (an error of the harness, a missing result) has no score, and is never counted as 0.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from sys import intern
from types import MappingProxyType
from typing import Protocol

from hijack_data.choices import CLEAN
from hijack_data.entries import Lazy
from hijack_data.errors import HijackError, quantity, shorten_list, suggest

from .reading import ResultRecord, Run

RESULTS = "results"  # the kind of a run that was made of outcomes
FIELDS = ("task", "condition", "agent", "score", "seed")
READERS: Mapping[str, str] = MappingProxyType(
    {
        "table": "online_env.results.outcome_readers.table:TableReader",
        "inspect": "online_env.results.outcome_readers.inspect_log:InspectReader",
        "osworld": "online_env.results.outcome_readers.osworld:OSWorldReader",
    }
)


class OutcomeError(HijackError, ValueError):
    """Results that cannot be read or paired; the message has the remedy."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EpisodeOutcome:
    """One episode of an agent, wherever it was played.

    Attributes:
        agent: its name.
        task: the task; outcomes of one task resemble each other, and it is one case.
        condition: what was done to the agent's desktop, such as `clean` or `marks`.
        score: 0..1; `None` if the episode has no outcome.
        seed: which repetition of the task it is; `None` if the source does not say.
        problem: why there is no score; empty if there is one.
    """

    agent: str
    task: str
    condition: str
    score: float | None
    seed: int | None = None
    problem: str = ""


class OutcomeReader(Protocol):
    """Reads the results of one format."""

    def detect(self, source: Path) -> bool:
        """Return whether a file or folder is of this format, from names alone."""
        ...

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcomes of a source.

        Args:
            source: the file or folder.
            columns: where the source has each of `FIELDS`; those left out are where the format has
                them.

        Raises:
            OutcomeError: something in it is no result; the message names the place.
        """
        ...


def find_reader(source: Path, name: str | None = None) -> OutcomeReader:
    """Return the reader of a source, or the one with a name.

    Raises:
        OutcomeError: no reader takes the source, or none has the name.
    """
    if name is not None:
        if name not in READERS:
            raise OutcomeError(f"--from: no reader {name!r}{suggest(name, READERS)}")
        return Lazy(READERS[name]).load()()
    for place in READERS.values():
        reader: OutcomeReader = Lazy(place).load()()
        if reader.detect(source):
            return reader
    report = source / "report.json"
    if report.exists():
        raise OutcomeError(f"{source}: is not the folder of a run; give {report}")
    raise OutcomeError(
        f"{source}: is not the folder of a run (hijack bench and hijack score make one), no table"
        " (.csv, .jsonl, .parquet), no log of Inspect (.eval, .json), and no folder of OSWorld with"
        " a result.txt for each task; name the columns of a table with"
        " --columns task=,condition=,agent=,score="
    )


def collect_run(
    sources: Sequence[Path],
    *,
    reader: str | None = None,
    columns: Mapping[str, str] = MappingProxyType({}),
    clean: str = CLEAN,
    common_tasks: bool = False,
) -> Run:
    """Read several sources together, and return them as one run.

    Args:
        sources: files and folders.
        reader: the name of the reader; by default each source is asked what it is.
        columns: where the sources have each of `FIELDS`.
        clean: the condition that the others are compared with.
        common_tasks: compare over the tasks that clean and corrupted conditions share, instead of
            refusing sets of tasks that differ.

    Raises:
        OutcomeError: a source cannot be read, there is no outcome, or conditions cannot be paired.
    """
    conditions: dict[str, None] = {}
    records = list(_number_repeats(_read_all(sources, reader, columns), clean, conditions))
    if not records:
        raise OutcomeError(f"{', '.join(map(str, sources))}: no results in it")
    if clean not in conditions and clean != CLEAN:
        raise OutcomeError(f"--clean: no condition {clean!r}{suggest(clean, list(conditions))}")
    if clean != CLEAN and CLEAN in conditions:
        raise OutcomeError(
            f"--clean {clean}: the results have a condition named {CLEAN}, too; leave --clean out,"
            " or rename that condition"
        )
    labels = list(dict.fromkeys(record["corruption"] for record in records))
    if len(sources) > 1:
        _check_task_names({record["task"] for record in records})
    records = _pair_tasks(records, common_tasks)
    labels.sort(key=lambda label: label != CLEAN)
    return Run(
        folder=sources[0],
        config={
            "kind": RESULTS,
            "source": " and ".join(source.name for source in sources[:2])
            + (f" and {len(sources) - 2} more" if len(sources) > 2 else ""),
            "agents": list(dict.fromkeys(record["agent"] for record in records)),
            "corruptions": labels,
        },
        records=records,
    )


def _read_all(
    sources: Sequence[Path], reader: str | None, columns: Mapping[str, str]
) -> Iterator[EpisodeOutcome]:
    for source in sources:
        if not source.exists():
            raise OutcomeError(f"{source}: is not there")
        yield from find_reader(source, reader).read(source, columns)


def parse_columns(text: str) -> dict[str, str]:
    """Return the columns in `task=ID,score=reward`, by field.

    Raises:
        OutcomeError: it has another form, or a field is unknown.
    """
    columns: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        field, sign, column = part.partition("=")
        if field not in FIELDS:
            raise OutcomeError(f"--columns: no field {field!r}{suggest(field, FIELDS)}")
        if not sign or not column:
            raise OutcomeError(f"--columns: {part!r} is not FIELD=COLUMN, such as task=task_id")
        columns[field] = column
    return columns


def _check_task_names(names: set[str]) -> None:
    """Check that tasks of several sources have names; numbers agree by chance.

    Raises:
        OutcomeError: all tasks are numbers.
    """
    if all(name.isdecimal() for name in names):
        raise OutcomeError(
            f"the tasks of the sources are numbers ({shorten_list(sorted(names), 3)}), which match"
            " by chance where they are positions in a list; name the column of their ids with"
            " --columns task=COLUMN, or put the results into one table"
        )


def _number_repeats(
    outcomes: Iterable[EpisodeOutcome], clean: str, conditions: dict[str, None]
) -> Iterator[ResultRecord]:
    """Yield records; outcomes without a seed are numbered in their order, task by task.

    Args:
        outcomes: of all sources.
        clean: the condition that is named `clean` in records.
        conditions: takes in the conditions as the sources name them.

    Raises:
        OutcomeError: an outcome is there twice.
    """
    repeats: dict[tuple[str, str, str], int] = {}
    seen: set[tuple[str, str, str, int]] = set()
    for outcome in outcomes:
        conditions[outcome.condition] = None
        label = CLEAN if outcome.condition == clean else outcome.condition
        case = outcome.agent, label, outcome.task
        seed = outcome.seed
        if seed is None:
            seed = repeats.get(case, 0)
            repeats[case] = seed + 1
        if (*case, seed) in seen:
            raise OutcomeError(
                f"{outcome.agent} has two results of the task {outcome.task} under"
                f" {outcome.condition} with seed {seed}; remove one, or name the column that tells"
                " repetitions apart with --columns seed=COLUMN"
            )
        seen.add((*case, seed))
        record: ResultRecord = {
            "agent": intern(outcome.agent),
            "task": intern(outcome.task),
            "corruption": intern(label),
            "seed": seed,
            "status": "ok",
            "score": outcome.score,
        }
        if outcome.score is None:
            record["status"] = "invalid"
            record["id"] = f"{outcome.task} under {label}, seed {seed}, {outcome.agent}"
            record["problem"] = outcome.problem
        yield record


def _pair_tasks(records: list[ResultRecord], common_tasks: bool) -> list[ResultRecord]:
    """Return the records whose conditions can be compared task by task.

    Raises:
        OutcomeError: the conditions of an agent have other tasks, and `common_tasks` is not asked
            for; or they share none.
    """
    tasks: dict[str, dict[str, set[str]]] = {}
    for record in records:
        by_label = tasks.setdefault(record["agent"], {})
        by_label.setdefault(record["corruption"], set()).add(record["task"])
    shared: dict[str, set[str]] = {}
    for agent, by_label in tasks.items():
        shared[agent] = set.intersection(*by_label.values())
        base = by_label.get(CLEAN)
        for label, names in by_label.items():
            if base is None or names == base:
                continue
            if not names & base:
                raise OutcomeError(f"{_difference(agent, label, names, base)}; they share none")
            if not common_tasks:
                raise OutcomeError(
                    f"{_difference(agent, label, names, base)}; --common-tasks reports the"
                    f" {quantity(len(shared[agent]), 'task')} that all conditions have"
                )
    if not common_tasks:
        return records
    if not all(shared.values()):
        raise OutcomeError("--common-tasks: the conditions share no task")
    return [record for record in records if record["task"] in shared[record["agent"]]]


def _difference(agent: str, label: str, names: set[str], base: set[str]) -> str:
    """Return how the tasks of a condition differ from those of the clean one."""
    parts = [
        f"{quantity(len(only), 'task')} only {where} ({shorten_list(sorted(only), 3)})"
        for only, where in ((names - base, f"under {label}"), (base - names, "clean"))
        if only
    ]
    return f"{agent} was not played on the same tasks: {', '.join(parts)}"
