"""The cases of a run: which rows of a dataset are put to an agent, and what pairs them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from hijack_data.errors import ParameterError, suggest
from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import row_slug

from .dataset_rows import DatasetRows, ExportedRows, RowData, RowFeed, is_export
from .onlookers import is_reminder
from .rules import UNSCORED

# What an agent is asked: the step, whether a reminder is needed, or what happened.
Question: TypeAlias = Literal["steps", "reminders", "summaries"]
QUESTIONS: tuple[Question, ...] = ("steps", "reminders", "summaries")
CaseKey: TypeAlias = tuple[str, str, str, int]


@dataclass(frozen=True)
class Case:
    """One row that is put to an agent.

    Args:
        number: of the row in the dataset.
        row: its id.
        task: the trajectory: rows of one resemble each other, so intervals rest on trajectories.
        variant: the step in it, and the effect that inserted it, such as `0003+touch`.
        corruption: its label.
        seed: of the build.
        needed: whether a reminder is needed.
    """

    number: int
    row: str
    task: str
    variant: str
    corruption: str
    seed: int
    needed: bool

    @property
    def key(self) -> CaseKey:
        """What tells it from the other cases of its agent."""
        return self.task, self.variant, self.corruption, self.seed

    def id(self, agent: str) -> str:
        """The id of its record."""
        return row_slug(self.task, self.variant, self.corruption, self.seed, agent)


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Which rows of a dataset are scored.

    Args:
        corruptions: labels; all by default. The clean rows are always scored with them.
        split: the split; all by default.
        limit: the first so many trajectories; all by default.
    """

    corruptions: tuple[str, ...] | None = None
    split: str | None = None
    limit: int | None = None


@dataclass(frozen=True, kw_only=True)
class CaseList:
    """The cases of a dataset.

    Args:
        cases: in the order of the dataset.
        unscored: rows that were left out because their action has no known type.
        unpaired: corrupted cases that have no clean one.
    """

    cases: tuple[Case, ...]
    unscored: int = 0
    unpaired: int = 0
    labels: tuple[str, ...] = field(default=())


def choose_question(folder: Path, asked: str | None) -> Question:
    """Return what a dataset is asked about: what the user says, or what it is made for.

    Raises:
        ParameterError: the dataset cannot answer it.
    """
    exported = is_export(folder)
    chosen: Question = "reminders" if exported else "steps"
    for name in QUESTIONS:
        if name == asked:
            chosen = name
    if chosen == "steps" and exported:
        raise ParameterError(
            f"{folder}: is an export for onlookers and holds no steps; score the dataset instead"
        )
    if chosen == "summaries" and not exported:
        raise ParameterError(
            f"{folder}: summaries are in an export: hijack export {folder} --to onlooker --out DIR"
        )
    return chosen


def open_feed(folder: Path, question: Question) -> RowFeed:
    """Open the rows of a dataset, or of a table of an export."""
    if question == "summaries":
        return ExportedRows(folder, question, ("before", "after"))
    if is_export(folder):
        return ExportedRows(folder, question, ("screenshot",))
    return DatasetRows(folder)


def select_cases(feed: RowFeed, question: Question, chosen: Selection) -> CaseList:
    """Return the cases of a dataset.

    Raises:
        ParameterError: a label or a split that the dataset lacks, or nothing is left.
    """
    found: list[Case] = []
    seen: Counter[str] = Counter()
    splits: set[str] = set()
    trajectories: set[str] = set()
    unscored = 0
    for number, (split, row) in enumerate(feed.heads()):
        splits.add(split)
        seen[row["corruption"]] += 1
        if not _is_wanted(split, row, chosen, trajectories):
            continue
        if question == "steps" and row["action"]["type"] == UNSCORED:
            unscored += 1
            continue
        found.append(_case(number, row))
    _check_names("--corruptions", chosen.corruptions or (), seen)
    _check_names("--split", (chosen.split,) if chosen.split else (), splits)
    if not found:
        raise ParameterError(f"no row is left to score ({unscored} have no action of a known type)")
    left = {case.corruption for case in found}
    for label in chosen.corruptions or ():
        if label not in left:
            raise ParameterError(
                f"--corruptions: no row of {label!r} is left to score, though the dataset has"
                f" {seen[label]}: see --split and --limit, or leave {label!r} out"
            )
    return CaseList(
        cases=tuple(found),
        unscored=unscored,
        unpaired=sum(_unpaired(found)),
        labels=tuple(dict.fromkeys(case.corruption for case in found)),
    )


def _is_wanted(split: str, row: RowData, chosen: Selection, trajectories: set[str]) -> bool:
    """Return whether a row is selected; `trajectories` collects those that are."""
    if chosen.split not in (None, split):
        return False
    trajectory = row["trajectory_id"]
    full = chosen.limit is not None and len(trajectories) >= chosen.limit
    if full and trajectory not in trajectories:
        return False
    trajectories.add(trajectory)
    label = row["corruption"]
    return chosen.corruptions is None or label == CLEAN or label in chosen.corruptions


def _case(number: int, row: RowData) -> Case:
    name = f"{row['trajectory_id']}/{row['step']:04d}/{row['corruption']}"
    effect = row["id"].removeprefix(name)  # `+touch` of a step that the effect inserted
    return Case(
        number=number,
        row=row["id"],
        task=row["trajectory_id"],
        variant=f"{row['step']:04d}{effect}",
        corruption=row["corruption"],
        seed=row["seed"],
        needed=is_reminder(row["reminder"]),
    )


def _unpaired(found: Sequence[Case]) -> Iterator[bool]:
    clean = {(case.task, case.variant) for case in found if case.corruption == CLEAN}
    for case in found:
        yield case.corruption != CLEAN and (case.task, case.variant) not in clean


def _check_names(option: str, wanted: Sequence[str], known: Counter[str] | set[str]) -> None:
    for name in wanted:
        if name not in known:
            there = ", ".join(sorted(known))
            raise ParameterError(
                f"{option}: no {name!r} in the dataset{suggest(name, known)} (it has {there})"
            )
