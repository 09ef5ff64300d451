"""The cases of a run: which rows of a dataset are put to an agent, and what pairs them."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from hijack_data.config import dump
from hijack_data.errors import ParameterError, suggest
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.runs.run_log import row_slug

from ..choices import QUESTIONS, Question
from .dataset_rows import DatasetRows, ExportedRows, RowData, RowFeed, is_export
from .onlookers import is_reminder
from .planned_rows import PlannedRows, RowPart
from .rules import UNSCORED

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
        unchanged: corrupted rows that were left out because their picture is the clean one: what
            happened, a fault of the input, shows with the step before only.
        unpaired: corrupted cases that have no clean one.
    """

    cases: tuple[Case, ...]
    unscored: int = 0
    unchanged: int = 0
    unpaired: int = 0
    labels: tuple[str, ...] = field(default=())


def choose_question(folder: Path, requested: str | None) -> Question:
    """Return what a dataset is asked about: what the user says, or what it is made for.

    Raises:
        ParameterError: the dataset cannot answer it.
    """
    exported = is_export(folder)
    question: Question = "reminders" if exported else "steps"
    for name in QUESTIONS:
        if name == requested:
            question = name
    if question == "steps" and exported:
        raise ParameterError(
            f"{folder}: is an export for onlookers and holds no steps; score the dataset instead"
        )
    if question == "summaries" and not exported:
        raise ParameterError(
            f"{folder}: summaries are in an export: hijack export {folder} --to onlooker --out DIR"
        )
    return question


@dataclass(frozen=True, kw_only=True)
class RowPlans:
    """Corruptions that are applied to the clean rows of a dataset while they are read.

    Args:
        planners: by label; `None` is the clean condition.
        seed: of all draws.
        part: which trajectories.
    """

    planners: Mapping[str, Planner | None]
    seed: int = 0
    part: RowPart = "all"

    def to_data(self) -> dict[str, Any]:
        """Return the corruptions with all parameters, and what else decides the rows."""
        planners = {label: one for label, one in self.planners.items() if one is not None}
        entries = yaml.safe_load(dump(planners))["corruptions"] if planners else []
        return {"corruptions": entries, "seed": self.seed, "part": self.part}


def open_feed(folder: Path, question: Question, plans: RowPlans | None = None) -> RowFeed:
    """Open the rows of a dataset, or of a table of an export.

    Raises:
        ParameterError: the rows cannot be corrupted by `plans`.
    """
    if plans is not None:
        if question != "steps" or is_export(folder):
            raise ParameterError("--plans corrupts the rows of a dataset whose steps are scored")
        return PlannedRows(folder, plans.planners, plans.seed, plans.part)
    if question == "summaries":
        return ExportedRows(folder, question, ("before", "after"))
    if is_export(folder):
        return ExportedRows(folder, question, ("screenshot",))
    return DatasetRows(folder)


def select_cases(feed: RowFeed, question: Question, selection: Selection) -> CaseList:
    """Return the cases of a dataset.

    Raises:
        ParameterError: a label or a split that the dataset lacks, or nothing is left.
    """
    cases: list[Case] = []
    rows_by_label: Counter[str] = Counter()
    splits: set[str] = set()
    trajectories: set[str] = set()
    unscored = unchanged = 0
    for number, (split, row) in enumerate(feed.heads()):
        splits.add(split)
        rows_by_label[row["corruption"]] += 1
        if not _is_wanted(split, row, selection, trajectories):
            continue
        if question == "steps" and row["action"]["type"] == UNSCORED:
            unscored += 1
            continue
        if question == "steps" and row["corruption"] != CLEAN and row["changed_pixels"] == 0:
            unchanged += 1
            continue
        cases.append(_case(number, row))
    _check_names("--corruptions", selection.corruptions or (), rows_by_label)
    _check_names("--split", (selection.split,) if selection.split else (), splits)
    if not cases:
        raise ParameterError(
            f"no row is left to score ({unscored} have no action of a known type, {unchanged} the"
            " picture of a clean row)"
        )
    labels_left = {case.corruption for case in cases}
    for label in selection.corruptions or ():
        if label not in labels_left:
            raise ParameterError(
                f"--corruptions: no row of {label!r} is left to score, though the dataset has"
                f" {rows_by_label[label]}: see --split and --limit, or leave {label!r} out"
                " (a fault of the input does not show on one picture)"
            )
    return CaseList(
        cases=tuple(cases),
        unscored=unscored,
        unchanged=unchanged,
        unpaired=sum(_unpaired(cases)),
        labels=tuple(dict.fromkeys(case.corruption for case in cases)),
    )


def _is_wanted(split: str, row: RowData, selection: Selection, trajectories: set[str]) -> bool:
    """Return whether a row is selected; `trajectories` collects those that are."""
    if selection.split not in (None, split):
        return False
    trajectory = row["trajectory_id"]
    full = selection.limit is not None and len(trajectories) >= selection.limit
    if full and trajectory not in trajectories:
        return False
    trajectories.add(trajectory)
    label = row["corruption"]
    return selection.corruptions is None or label == CLEAN or label in selection.corruptions


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


def _unpaired(cases: Sequence[Case]) -> Iterator[bool]:
    clean = {(case.task, case.variant) for case in cases if case.corruption == CLEAN}
    for case in cases:
        yield case.corruption != CLEAN and (case.task, case.variant) not in clean


def _check_names(option: str, names: Sequence[str], available: Counter[str] | set[str]) -> None:
    for name in names:
        if name not in available:
            listed = ", ".join(sorted(available))
            raise ParameterError(
                f"{option}: no {name!r} in the dataset{suggest(name, available)} (it has {listed})"
            )
