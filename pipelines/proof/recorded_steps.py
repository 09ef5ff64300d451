"""Find the recorded step of rows, in the dataset itself or in the recordings."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hijack_data.actions.dialects.pyautogui_code import calls_pyautogui
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.compose import Augmentation
from hijack_data.corruption import Corruption
from hijack_data.errors import ImageError, LabelError, short_repr
from hijack_data.labels.action_formats import own_action
from hijack_data.labels.dataset_rows import detect_dialect
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner, leaves
from hijack_data.types import Action, Scene, Size, Step, Trajectory, UInt8Array, as_target

from ..building.selection import needs_boxes
from ..building.shards import ShardTask
from ..building.step_rows import RowCounts, RowSettings, decode_sample
from ..dataset.columns import BASE
from ..dataset.image_codec import BaseImage, decode
from ..dataset.lazy_rows import picture_bytes, row_plan
from ..dataset.sample import Sample
from ..dataset.shard import ShardRecord
from ..edits.variants import has_effects
from ..errors import DatasetError
from ..readers import fields
from ..readers.recorded_actions import PYAUTOGUI, RecordedStep
from ..readers.recorded_pictures import picture_name, read_picture
from ..readers.runs import Runs, altered_step

OURS = "hijack_data."
# The columns of a clean row that say which step was recorded.
STEP_COLUMNS = (
    "id",
    "trajectory_id",
    "source",
    "step",
    "corruption",
    "width",
    "height",
    "action",
    "action_code",
    "target_box",
    "extra",
)


@dataclass(frozen=True)
class RecordedFacts:
    """The recorded step of some rows, as far as it is known.

    Args:
        sample: the step and its screenshot before any corruption.
        settings: those of the build, with the planners whose plans can be made again.
        picture: whether the screenshot is known; otherwise `sample` has a black one.
        code: whether the dialect of its code is known, so that the code can be mapped.
        source_name: the name of the screenshot in reports.
        tally: counts the rows of the step, and what gave none.
    """

    sample: Sample
    settings: RowSettings
    picture: bool = True
    code: bool = True
    source_name: str = ""
    tally: RowCounts = field(default_factory=RowCounts)


def provable_settings(settings: RowSettings, *, with_inputs: bool) -> RowSettings:
    """Return settings with only the planners whose plans can be made again from a dataset.

    Args:
        settings: those of the build.
        with_inputs: whether the actions of all steps are known, which faults of the input need.
    """
    planners = [
        (label, planner)
        for label, planner in settings.planners
        if _is_provable(planner, with_inputs)
    ]
    return RowSettings(
        planners=tuple(planners),
        seed=settings.seed,
        clean=settings.clean,
        label_policy=settings.label_policy,
        lazy=settings.lazy,
    )


def _is_provable(planner: Planner, with_inputs: bool) -> bool:
    """Return whether rows depend only on parameters, seed, trajectory, step, size and target.

    Those of input faults depend on the actions of the trajectory, too.

    Corruptions of plug-ins do not count, as they may use elements and applications without
    declaring it.
    """
    for part in (planner, *leaves(planner)):
        is_ours = type(part).__module__.startswith(OURS)
        if not is_ours or not isinstance(part, Corruption | Augmentation):
            return False
    if has_effects(planner):
        return False
    # Elements decide where a slip leads on a machine, but neither its plan nor its rows.
    return with_inputs if planner.inputs else not needs_boxes(planner)


def recorded_step(
    rows: list[dict[str, Any]],
    key: str | None,
    settings: RowSettings,
    steps: tuple[RecordedStep, ...] | None = None,
) -> RecordedFacts | None:
    """Return the recorded step of some rows, or `None` if they do not contain enough of it.

    Args:
        rows: all rows of the step, as stored.
        key: the key of its random draws, if that is not the trajectory.
        settings: those of the build, with the planners whose plans can be made again.
        steps: all steps of the trajectory; `None` if they are not known.

    Raises:
        HijackError: a row is damaged.
    """
    clean = next((row for row in rows if row["corruption"] == CLEAN), None)
    row = clean or next((row for row in rows if _is_as_recorded(row)), None)
    if row is None:
        return None
    base = BaseImage(_picture(row))
    if clean is not None and base.sha256 != clean["image_sha256"]:
        return None
    has_picture = clean is not None or BASE in row
    sample, has_code = _sample(row, base, key, steps)
    return RecordedFacts(sample, settings, has_picture, has_code)


def _sample(
    row: Mapping[str, Any], base: BaseImage, key: str | None, steps: tuple[RecordedStep, ...] | None
) -> tuple[Sample, bool]:
    """Return the step of a row as recorded, and whether the dialect of its code is known."""
    size = base.image.shape[:2]
    step, has_code = _step(row, size)
    trajectory = Trajectory(
        id=row["trajectory_id"],
        source=row["source"],
        instruction=row["instruction"],
        steps=steps or (step,),
        domain=row["domain"],
        sample=key,
    )
    scene = Scene(size, target=as_target(step.target_box or step.action.point))
    return Sample(trajectory, step, base, scene), has_code


def trajectory_step(row: Mapping[str, Any]) -> RecordedStep:
    """Return the step of a clean row with everything that decides the rows of input faults.

    Args:
        row: its columns `STEP_COLUMNS`.

    Raises:
        HijackError, AttributeError, KeyError, TypeError, ValueError: the row is damaged.
    """
    step, _ = _step(row, (row["height"], row["width"]))
    if row["source"] != Runs.name or not step.extra:
        return step
    entry = fields.mapping(json.loads(step.extra), "extra").get("input")
    return altered_step(step, fields.mapping(entry, "extra.input"))


def _step(row: Mapping[str, Any], size: Size) -> tuple[RecordedStep, bool]:
    """Return the step of a row as recorded, and whether the dialect of its code is known."""
    action = own_action(row["action"])
    code = row["action_code"]
    dialect = PYAUTOGUI if calls_pyautogui(code) else _dialect(code, action, size)
    box: Any = None if row["target_box"] is None else tuple(row["target_box"])
    step = RecordedStep(
        row["step"],
        "",
        action,
        code,
        box,
        dialect=dialect or SIZELESS,
        extra=row.get("extra") or "",
    )
    return step, dialect is not None


def _is_as_recorded(row: Mapping[str, Any]) -> bool:
    """Return whether the labels of a row are those of the recording."""
    return row["event"] is None and (row["height"], row["width"]) == _size(row)


def _size(row: Mapping[str, Any]) -> tuple[int, int]:
    if BASE in row:
        return decode(picture_bytes(row[BASE]), BASE).shape[:2]
    return Plan.from_json(row["plan"]).size


def _picture(row: Mapping[str, Any]) -> UInt8Array:
    """Return the screenshot of a step, or a black one of its size."""
    if BASE in row:
        return decode(picture_bytes(row[BASE]), BASE)
    if row["corruption"] == CLEAN:
        return decode(picture_bytes(row["screenshot"]), "screenshot")
    return np.zeros((*_size(row), 3), np.uint8)


def _dialect(code: str, action: Action, size: Size) -> str | None:
    try:
        return detect_dialect(code, action, size)
    except LabelError:
        return None


def read_plan(row: Mapping[str, Any], base: UInt8Array | None) -> Plan:
    """Return the plan of a row.

    Args:
        row: as it is stored.
        base: the picture in a lazy row, uint8 RGB `[H, W, 3]`; `None` for a materialised one.

    Raises:
        HijackError: the plan is damaged.
    """
    if base is None:
        return Plan.from_json(row["plan"])
    return row_plan(row, base.shape[:2])


class Recordings:
    """The steps of one shard, read again from the source.

    Args:
        task: the trajectories of the shard.
        settings: those of the build.
    """

    def __init__(self, task: ShardTask, settings: RowSettings) -> None:
        self.task = task
        self.settings = settings
        self.tally = RowCounts()
        self.keys: set[tuple[str, int]] = set()
        for trajectory in task.trajectories:
            self.keys.update((trajectory.id, step.index) for step in trajectory)
        self.steps = self._steps()
        self._inputs = hashlib.sha256(task.records.encode())

    def _steps(self) -> Iterator[tuple[tuple[str, int], RecordedFacts | None]]:
        """Yield the key and the facts of each step in order; a rejected step has no facts."""
        for trajectory in self.task.trajectories:
            for step in trajectory:
                yield (trajectory.id, step.index), self._read_step(trajectory, step)

    def _read_step(self, trajectory: Trajectory, step: Step) -> RecordedFacts | None:
        name = picture_name(step.image, Path(self.task.root))
        try:
            data = read_picture(step.image, name)
        except ImageError as error:
            self.tally.reject(name, f"{trajectory.id}, step {step.index}", "image", error)
            return None
        self._inputs.update(hashlib.sha256(data).digest())
        sample = decode_sample(trajectory, step, data, name, self.settings, self.tally)
        if sample is None:
            return None
        return RecordedFacts(sample, self.settings, source_name=name, tally=self.tally)

    def problems(self, record: ShardRecord) -> Iterator[str]:
        """Yield the differences between manifest and shard; call it after reading all steps."""
        if self.task.records != record.records:
            yield (
                "the recordings say something else than when it was built (records, or sizes of"
                " pictures)"
            )
        elif self._inputs.hexdigest() != record.inputs:
            yield "the pictures of the recordings are not those that it was built from"
        tally = self.tally
        for name, counts in (("dropped", tally.dropped), ("not_applicable", tally.not_applicable)):
            if counts != record.counts[name]:
                yield (
                    f"the manifest counts as {name} {short_repr(record.counts[name])}, there are"
                    f" {short_repr(dict(counts))}"
                )
        rejected = tuple(entry.to_data() for entry in tally.rejected)
        if rejected != tuple(record.rejected):
            yield (
                f"the manifest has {len(record.rejected)} rejected inputs, there are"
                f" {len(rejected)} or others"
            )


def damaged_row(error: Exception) -> DatasetError:
    """Return the error for a row that lacks a column, or has an unexpected null."""
    return DatasetError(f"a column is missing or holds another kind of value ({error!r})")
