"""Make the rows of one recorded step: the clean one, and one for each corruption."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from hijack_data import apply, scene_from
from hijack_data.errors import ActionError, HijackError, ImageError, ParameterError
from hijack_data.labels.dataset_rows import plan_columns
from hijack_data.pack import AssetPack
from hijack_data.picture_io import pixel_sha256
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner
from hijack_data.safety import changed_pixels, target_visible
from hijack_data.types import (
    Action,
    Box,
    Scene,
    Size,
    Step,
    Trajectory,
    UInt8Array,
    as_boxes,
    as_target,
    check_aim,
    size_text,
)

from ..dataset.columns import ACTION, BASE, VISIBLE
from ..dataset.image_codec import BaseImage, changed_rows, decode, encode, is_transparent
from ..dataset.lazy_rows import stored_plan
from ..dataset.sample import Sample, step_position
from ..edits.base import EditedStep
from ..edits.variants import Variant, VariantPlanner, has_effects, is_due, is_ever_due, step_numbers
from ..errors import BuildError
from ..readers import Rejected
from ..readers.fields import FieldError, check_on_screen
from ..readers.recorded_actions import observed_code
from .selection import needs_boxes

NEVER_DUE = "the recording ends before the step at which it acts"

_CHANGED = "if the picture was replaced while the build ran, build again"


@dataclass(frozen=True)
class RowSettings:
    """Everything that decides the content of a row, besides the recording.

    Args:
        planners: the corruptions by label, in the order of the build.
        seed: the seed of every draw, 0 to 2**64 - 1.
        clean: whether each step has a clean row.
        label_policy: one of `hijack_data.config.options.LABEL_POLICIES`.
        detect: whether to detect elements in pictures if none are recorded.
        lazy: whether to store plans instead of corrupted pictures.
        assets: the folder of the asset pack, if not the default one.
        allow_platform_mismatch: whether to show the desktop of the pack in recordings of other
            platforms, too.
    """

    planners: tuple[tuple[str, Planner], ...]
    seed: int = 0
    clean: bool = True
    label_policy: str = "keep"
    detect: bool = False
    lazy: bool = False
    assets: str | None = None
    allow_platform_mismatch: bool = False

    @property
    def variants(self) -> int:
        """The most rows that a step can have, not counting those inserted by edits."""
        return len(self.planners) + self.clean

    @property
    def pack(self) -> AssetPack | None:
        """The asset pack, or `None` if no corruption acts on the machine.

        Raises:
            AssetError: the pack is missing or damaged.
        """
        if any(has_effects(planner) for _, planner in self.planners):
            return AssetPack.load(self.assets)
        return None


@dataclass
class RowCounts:
    """The outcome of steps: rows by label, reasons for samples without a row, rejected inputs.

    `transparent` counts the pictures whose transparent pixels were read in their hidden colours.
    """

    rows: Counter[str] = field(default_factory=Counter[str])
    dropped: Counter[str] = field(default_factory=Counter[str])
    not_applicable: dict[str, Counter[str]] = field(default_factory=dict[str, "Counter[str]"])
    rejected: list[Rejected] = field(default_factory=list[Rejected])
    transparent: int = 0

    def skip(self, label: str, reason: str) -> None:
        """Count a sample on which a corruption cannot be placed.

        Reasons that differ only in numbers are counted as one.
        """
        reasons = self.not_applicable.setdefault(label, Counter())
        reasons[re.sub(r"\d+", "N", reason)] += 1

    def reject(self, file: str, location: str, field: str, error: Exception) -> None:
        """Record an input that cannot be used."""
        self.rejected.append(Rejected(file, location, field, str(error)))


@dataclass(frozen=True)
class DrawnRow:
    """A row before its picture is stored.

    Args:
        label: the value of the column `corruption`.
        variant: the plan, and the step for which it was made.
        picture: the picture of the row, uint8 RGB `[H, W, 3]`.
        labels: all columns of a materialised row, except the picture and its SHA-256.
    """

    label: str
    variant: Variant
    picture: UInt8Array
    labels: dict[str, Any]


def make_rows(
    trajectory: Trajectory,
    step: Step,
    data: bytes,
    image_name: str,
    settings: RowSettings,
    tally: RowCounts,
) -> Iterator[Any]:
    """Yield the rows of one step.

    Args:
        trajectory: the recording.
        step: one of its steps.
        data: the bytes of its screenshot.
        image_name: the name of the screenshot in reports.
        settings: those of the build.
        tally: counts the rows, and the samples that gave none.
    """
    sample = decode_sample(trajectory, step, data, image_name, settings, tally)
    if sample is None:
        return
    for row in draw_rows(sample, image_name, settings, tally):
        yield _stored(row, settings)


def decode_sample(
    trajectory: Trajectory,
    step: Step,
    data: bytes,
    image_name: str,
    settings: RowSettings,
    tally: RowCounts,
) -> Sample | None:
    """Return a step with its screenshot decoded, or `None` if it is rejected; see `make_rows`."""
    location = f"{trajectory.id}, step {step.index}"
    try:
        image = decode(data, image_name)
        problem = _problem(step, image.shape[:2])
        if problem is not None:
            tally.rejected.append(Rejected(image_name, location, problem.field, problem.reason))
            return None
        scene = _scene(trajectory, step, image, settings)
        tally.transparent += is_transparent(data)
        return Sample(trajectory, step, BaseImage(image), scene)
    except ImageError as error:
        tally.reject(image_name, location, "image", error)
    except ParameterError as error:  # the target has no area, is off the screen or off the action
        tally.reject(image_name, location, "target_box", error)
    return None


def draw_rows(
    sample: Sample, image_name: str, settings: RowSettings, tally: RowCounts
) -> Iterator[DrawnRow]:
    """Yield the clean row of a step and those of each corruption, in the order of the dataset."""
    counter = _Counter(sample, image_name, settings, tally)
    if settings.clean:
        plan = Plan.clean(sample.scene.size)
        yield from counter.rows(CLEAN, iter([Variant(sample, plan, plan)]))
    chooser = VariantPlanner(
        settings.seed, settings.label_policy, settings.pack, settings.allow_platform_mismatch
    )
    for label, planner in settings.planners:
        if sample.position == 0 and not is_ever_due(sample.trajectory, planner):
            tally.skip(label, NEVER_DUE)
        yield from counter.rows(label, chooser.variants(sample, planner))


@dataclass(frozen=True)
class _Counter:
    """Makes the rows of one step, and counts them and the samples without a row."""

    sample: Sample
    image_name: str
    settings: RowSettings
    tally: RowCounts

    def rows(self, label: str, variants: Iterator[Variant | None]) -> Iterator[DrawnRow]:
        # after an error, no further rows of the label are made
        try:
            for variant in variants:
                row = self._make_row(label, variant)
                if row is not None:
                    self.tally.rows[label] += 1
                    yield row
        except ActionError as error:
            location = f"{self.sample.trajectory.id}, step {self.sample.step.index}, {label}"
            self.tally.reject(self.image_name, location, "action_code", error)
        except BuildError as error:
            raise BuildError(f"corruptions: {label}: {error}") from None
        except HijackError as error:
            self.tally.skip(label, str(error))

    def _make_row(self, label: str, variant: Variant | None) -> DrawnRow | None:
        """Return the row of a variant, or count why there is none."""
        if variant is None:
            self.tally.dropped[label] += 1
            return None
        plan = variant.plan
        if label != CLEAN and not plan.ops and not plan.inputs:
            reason = "; ".join(plan.notes) or "the plan leaves the picture as it is"
            self.tally.skip(label, reason)
            return None
        row = draw_row(variant, label, self.settings.seed)
        if plan.ops and not row.labels["changed_pixels"]:
            self.tally.skip(label, "no pixel differs from the clean picture")
            return None
        if not keeps(self.settings.label_policy, plan, row.labels["target_visible"]):
            self.tally.dropped[label] += 1
            return None
        return row


def _problem(step: Step, size: Size) -> FieldError | None:
    """Return why a step does not fit its picture: a point or its target is not in it.

    The reader does not check it, or the picture was replaced since.
    """
    try:
        check_on_screen(step.action, size, "action")
    except FieldError as error:
        return FieldError(error.field, f"{error.reason}; {_CHANGED}")
    x1, y1, x2, y2 = step.target_box or (0, 0, 1, 1)
    if x1 < 0 or y1 < 0 or x2 > size[1] or y2 > size[0]:
        reason = f"{[x1, y1, x2, y2]} leaves the {size_text(size)} screenshot; {_CHANGED}"
        return FieldError("target_box", reason)
    return None


def _scene(trajectory: Trajectory, step: Step, image: UInt8Array, settings: RowSettings) -> Scene:
    check_aim(step.action, step.target_box)
    target = as_target(step.target_box or step.action.point)
    detects = not step.elements and settings.detect and _needs_scene(trajectory, step, settings)
    if detects:
        return scene_from(image, apps=trajectory.apps, target=target)
    return Scene(image.shape[:2], as_boxes(step.elements), trajectory.apps, target)


def _needs_scene(trajectory: Trajectory, step: Step, settings: RowSettings) -> bool:
    """Return whether any planner that acts at this step needs the elements."""
    position = step_position(trajectory, step)
    for _, planner in settings.planners:
        if not needs_boxes(planner):
            continue
        if is_due(planner, step_numbers(trajectory, position, planner)):
            return True
    return False


def keeps(label_policy: str, plan: Plan, visible: float | None) -> bool:
    """Return whether a label policy keeps a row of whose target the share `visible` can be seen."""
    if label_policy != "drop" or not plan.ops:
        return True
    return visible is None or visible >= VISIBLE


def draw_row(variant: Variant, label: str, seed: int) -> DrawnRow:
    """Return the row made by the plan of a variant, whether or not the label policy keeps it."""
    plan = variant.plan
    image = variant.sample.image
    picture = image
    changed_count = 0
    if plan.ops:
        picture = cast("UInt8Array", apply(plan, image))
        changed_count = changed_pixels(image, picture, plan)
    labels = row_labels(variant, label, seed)
    labels["changed_pixels"] = changed_count
    return DrawnRow(label, variant, picture, labels)


def row_labels(variant: Variant, label: str, seed: int) -> dict[str, Any]:
    """Return the columns of a materialised row that are computed from its plan and its step."""
    sample = variant.sample
    plan = variant.plan
    height, width = plan.out_size
    end = sample.step.action.end
    return {
        **_about(variant, label),
        "width": width,
        "height": height,
        "action": _action(plan.coords.action_to_observation(sample.step.action)),
        "action_code": observed_code(plan.coords, sample.step),
        "target_box": _box(plan, sample.step.target_box),
        **plan_columns(plan, seed),
        **_event_columns(variant.edit),
        "target_visible": target_visible(variant.over, sample.scene.target, end),
    }


def _stored(drawn_row: DrawnRow, settings: RowSettings) -> dict[str, Any]:
    """Return a row in the form in which it is stored."""
    sample = drawn_row.variant.sample
    stored = _picture(sample.base, drawn_row.picture, drawn_row.variant.plan, settings)
    row = {**drawn_row.labels, **stored}
    if settings.lazy:
        row["plan"] = lazy_plan(drawn_row, row, settings)
    return row


def lazy_plan(drawn_row: DrawnRow, row: Mapping[str, Any], settings: RowSettings) -> str:
    """Return the value of the column `plan` of a lazy row."""
    planner = dict(settings.planners).get(drawn_row.label)
    return stored_plan(drawn_row.variant.plan, row, drawn_row.variant.sample.key, planner)


def _about(variant: Variant, label: str) -> dict[str, Any]:
    trajectory = variant.sample.trajectory
    step = variant.sample.step
    name = f"{trajectory.id}/{step.index:04d}/{label}"
    # An inserted step has the label and the number of the recorded one; the event distinguishes
    # them.
    if variant.edit is not None and variant.edit.inserted:
        plan = variant.plan
        name += f"+{plan.inputs[0].fault if plan.inputs else plan.effects[0].kind}"
    return {
        "id": name,
        "trajectory_id": trajectory.id,
        "step": step.index,
        "source": trajectory.source,
        "domain": trajectory.domain,
        "instruction": trajectory.instruction,
        "extra": step.extra or None,
        "corruption": label,
    }


def _picture(
    base: BaseImage, picture: UInt8Array, plan: Plan, settings: RowSettings
) -> dict[str, Any]:
    """Return the stored picture and its digest.

    Parts that the picture shares with other pictures of its step are neither compressed nor hashed
    again.
    """
    digest = picture_digest(base, picture, plan)
    if settings.lazy:
        return {BASE: {"bytes": base.png, "path": None}, "image_sha256": digest}
    rows = changed_rows(plan)
    data = encode(picture) if rows is None else base.encode_variant(picture, rows)
    return {"screenshot": {"bytes": data, "path": None}, "image_sha256": digest}


def picture_digest(base: BaseImage, picture: UInt8Array, plan: Plan) -> str:
    """Return the SHA-256 of the picture that `plan` made from `base`.

    Rows at the top that both pictures share are not hashed again.
    """
    rows = changed_rows(plan)
    if rows is None:
        return pixel_sha256(picture)
    return base.hash_variant(picture, rows)


def _event_columns(edit: EditedStep | None) -> dict[str, Any]:
    if edit is None:
        return {"fidelity": "exact", "event": None, "reminder": None, "inserted": False}
    return {
        "fidelity": edit.fidelity,
        "event": edit.event,
        "reminder": edit.reminder,
        "inserted": edit.inserted,
    }


def _action(action: Action) -> dict[str, Any]:
    values = {key: getattr(action, key) for key in ACTION}
    if action.keys is not None:
        values["keys"] = list(action.keys)
    return values


def _box(plan: Plan, box: Box | None) -> list[int] | None:
    if box is None:
        return None
    return plan.coords.boxes_to_observation([box])[0].tolist()
