"""Compare each row of a step with the row that the code of the build makes for it."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hijack_data import apply
from hijack_data.corruption import Corruption
from hijack_data.errors import HijackError, short_repr
from hijack_data.frozen import thaw
from hijack_data.labels.dataset_rows import params_json
from hijack_data.picture_io import pixel_sha256
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner, leaves
from hijack_data.safety import changed_pixels
from hijack_data.types import UInt8Array

from ..building.step_rows import DrawnRow, draw_rows, keeps, lazy_plan, picture_digest, row_labels
from ..dataset.columns import BASE
from ..dataset.image_codec import decode
from ..dataset.lazy_rows import picture_bytes
from ..edits.variants import AVOIDING, Variant, VariantPlanner
from ..errors import DatasetError
from .event_rows import event_variant
from .recorded_steps import RecordedFacts, damaged_row, read_plan

# The note of a plan on elements off the screen; a dataset does not contain those elements.
_ELEMENTS = re.compile(r"\d+ of \d+ boxes are empty or off the screen and were ignored")
OTHER_PICTURE = "the plan makes another picture of the clean row than the one stored"


@dataclass(frozen=True)
class StoredRow:
    """A row that is consistent in itself: its picture, uint8 RGB `[H, W, 3]`, and its plan."""

    row: Mapping[str, Any]
    picture: UInt8Array
    plan: Plan


@dataclass(kw_only=True)
class StepChecker:
    """Compares the rows of one step.

    Args:
        rows: the rows as stored, in order.
        recorded: the recorded step, `None` if unknown.
        planners: the planners of the build by label, `None` if the manifest does not contain them.
        ranks: the order of the labels.
        seed: that of the build.
        label_policy: that of the build.
        rejected: the places at which the build rejected rows whose code it could not map.
        regenerated: number of corrupted rows whose picture was made again.
    """

    rows: list[dict[str, Any]]
    recorded: RecordedFacts | None
    planners: Mapping[str, Planner] | None
    ranks: Mapping[str, int]
    seed: int
    label_policy: str
    rejected: frozenset[str] = frozenset()
    regenerated: int = 0
    _undrawn: str | None = None
    _last: tuple[bytes, UInt8Array] | None = None
    _is_step_picture: bool = False

    def problems(self) -> Iterator[str]:
        """Yield the problems; each names a row."""
        generated = self._generate_rows()
        following = next(generated, None)
        for row in sorted(self.rows, key=self._rank):
            while following is not None and self.ranks[following.label] < self._rank(row):
                yield from self._missing(following)
                following = next(generated, None)
            expected = None
            if following is not None and following.label == row["corruption"]:
                expected = following
                following = next(generated, None)
            problem = self._problem(row, expected)
            if problem:
                yield f"row {row['id']}: {problem}"
        while following is not None:
            yield from self._missing(following)
            following = next(generated, None)

    def _missing(self, generated: DrawnRow) -> Iterator[str]:
        sample = generated.variant.sample
        location = f"{sample.trajectory.id}, step {sample.step.index}, {generated.label}"
        if location not in self.rejected:
            yield (
                f"row {generated.labels['id']}: is missing; its step and the parameters of the"
                " build give it"
            )

    def _generate_rows(self) -> Iterator[DrawnRow]:
        recorded = self.recorded
        if recorded is not None and recorded.picture:
            yield from draw_rows(
                recorded.sample, recorded.source_name, recorded.settings, recorded.tally
            )

    def _rank(self, row: Mapping[str, Any]) -> int:
        return self.ranks.get(row["corruption"], len(self.ranks))

    def _problem(self, row: dict[str, Any], expected: DrawnRow | None) -> str:
        try:
            stored = self._read_stored(row, expected)
            self._check_undrawn(stored)
            if self.recorded is not None:
                self._compare(stored, expected, self.recorded)
            elif BASE in row:
                self.regenerated += bool(stored.plan.ops)
        except HijackError as error:
            return str(error).removeprefix(f"row {row['id']}: ")
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            return str(damaged_row(error))
        return ""

    # --- A row on its own

    def _read_stored(self, row: dict[str, Any], expected: DrawnRow | None) -> StoredRow:
        if BASE in row:
            stored = self._draw_lazy_row(row, expected)
        else:
            picture = decode(picture_bytes(row["screenshot"]), "screenshot")
            stored = StoredRow(row, picture, read_plan(row, None))
            if pixel_sha256(picture) != row["image_sha256"]:
                raise DatasetError("screenshot does not decode to image_sha256")
        _check_plan(row, stored.picture, stored.plan)
        return stored

    def _draw_lazy_row(self, row: dict[str, Any], expected: DrawnRow | None) -> StoredRow:
        # returns a lazy row with its picture drawn
        before = self._base(row)
        plan = read_plan(row, before)
        if row["corruption"] == CLEAN and plan.ops:
            raise DatasetError("a clean row whose plan changes the picture")
        picture = before
        if (
            plan.ops
            and self._is_step_picture
            and expected is not None
            and expected.variant.plan == plan
        ):
            picture = expected.picture
        elif plan.ops:
            picture = apply(plan, before)
        if self._digest(picture, plan) != row["image_sha256"]:
            raise DatasetError(f"{BASE} and the plan do not make the picture of image_sha256")
        if self.recorded is not None and not self._is_step_picture:
            raise DatasetError(f"{BASE} is not the picture of its step")
        return StoredRow(row, picture, plan)

    def _base(self, row: Mapping[str, Any]) -> UInt8Array:
        """Return the picture of a lazy row before its corruption, uint8 RGB `[H, W, 3]`.

        Rows of a step that share it decode it once.
        """
        data = picture_bytes(row[BASE])
        if self._last is not None and self._last[0] == data:
            return self._last[1]
        picture = decode(data, BASE)
        self._last = data, picture
        recorded = self.recorded
        self._is_step_picture = recorded is not None and np.array_equal(
            picture, recorded.sample.image
        )
        return picture

    def _digest(self, picture: UInt8Array, plan: Plan) -> str:
        """Return the SHA-256 of a lazy row's picture, reusing the hash of its step's picture."""
        if self._is_step_picture and self.recorded is not None:
            return picture_digest(self.recorded.sample.base, picture, plan)
        return pixel_sha256(picture)

    def _check_undrawn(self, stored: StoredRow) -> None:
        """Check that rows on which nothing is drawn have the same picture: that of their step.

        Raises:
            DatasetError: a row has another picture than an earlier one.
        """
        if stored.plan.ops:
            return
        digest = stored.row["image_sha256"]
        self._undrawn = self._undrawn or digest
        if digest != self._undrawn:
            raise DatasetError(
                "its plan draws nothing, and another such row of its step has another picture"
            )

    # --- A row and its step

    def _compare(
        self, stored: StoredRow, expected: DrawnRow | None, recorded: RecordedFacts
    ) -> None:
        row = stored.row
        if (
            expected is None
            and recorded.picture
            and row["corruption"] in self._provable_labels(recorded)
        ):
            raise DatasetError(
                "its step, the seed and the parameters of the build give no such row"
            )
        if expected is not None:
            self._check_seed(stored, [expected.variant], recorded)
        if recorded.picture:
            self._check_picture(stored, expected, recorded)
        variant = (
            expected.variant if expected is not None else self._variant_from_plan(stored, recorded)
        )
        if variant is None:
            return
        labels = self._labels(stored, expected, variant, recorded)
        for name, value in labels.items():
            if row[name] != value:
                raise DatasetError(
                    f"{name} is {short_repr(row[name])}, it should be {short_repr(value)}"
                )

    def _labels(
        self,
        stored: StoredRow,
        expected: DrawnRow | None,
        variant: Variant,
        recorded: RecordedFacts,
    ) -> dict[str, Any]:
        """Return the values that the columns of a row must have."""
        row = stored.row
        plan = stored.plan
        variant = replace(variant, plan=plan)
        labels = row_labels(variant, row["corruption"], self.seed)
        if recorded.picture:
            changed_count = 0
            if plan.ops:
                changed_count = changed_pixels(recorded.sample.image, stored.picture, plan)
            labels["changed_pixels"] = changed_count
            self._check_label_policy(row, plan, labels)
        if BASE in row:
            del labels["plan"]
        if BASE in row and expected is not None:
            generated = replace(expected, variant=variant)
            labels["plan"] = lazy_plan(generated, {**row, **labels}, recorded.settings)
        if not recorded.code and not plan.coords.is_identity:
            del labels["action_code"]
        return labels

    def _provable_labels(self, recorded: RecordedFacts) -> list[str]:
        labels = [label for label, _ in recorded.settings.planners]
        if recorded.settings.clean:
            labels.append(CLEAN)
        return labels

    def _check_picture(
        self, stored: StoredRow, expected: DrawnRow | None, recorded: RecordedFacts
    ) -> None:
        plan = stored.plan
        if BASE not in stored.row:
            if expected is not None and expected.variant.plan == plan:
                picture = expected.picture
            else:
                picture = _draw_plan(plan, recorded.sample.image)
            if not np.array_equal(picture, stored.picture):
                raise DatasetError(OTHER_PICTURE)
        self.regenerated += bool(plan.ops)

    def _check_seed(
        self, stored: StoredRow, variants: list[Variant], recorded: RecordedFacts
    ) -> None:
        # checks that a plan is one of those that were made again
        plan = stored.plan
        for variant in variants:
            if variant.plan == plan or _is_same_plan(variant.plan, plan):
                return
        if recorded.picture and BASE not in stored.row:
            picture = _draw_plan(plan, recorded.sample.image)
            if not np.array_equal(picture, stored.picture):
                raise DatasetError(OTHER_PICTURE)
        again = variants[0].plan.digest()[:12] if variants else "none"
        raise DatasetError(
            f"plan is {plan.digest()[:12]}, seed {self.seed} and the parameters of the build give"
            f" {again}"
        )

    def _variant_from_plan(self, stored: StoredRow, recorded: RecordedFacts) -> Variant | None:
        # returns the variant of a row whose plan cannot be made again, with its picture
        row = stored.row
        plan = stored.plan
        label = row["corruption"]
        planner = None if self.planners is None else self.planners.get(label)
        if planner is not None and label in self._provable_labels(recorded):
            chooser = VariantPlanner(self.seed, recorded.settings.label_policy, None)
            variants = chooser.variants(recorded.sample, planner)
            self._check_seed(stored, [variant for variant in variants if variant], recorded)
        elif planner is not None:
            _check_params(plan, planner)
        if row["event"] is not None:
            return event_variant(row, plan, recorded.sample)
        if plan.effects:
            kind = plan.effects[0].kind
            raise DatasetError(f"event is None, its plan does {kind} to the machine")
        return Variant(recorded.sample, plan, plan)

    def _check_label_policy(
        self, row: Mapping[str, Any], plan: Plan, labels: Mapping[str, Any]
    ) -> None:
        # checks that the label policy of the build keeps such a row
        policy = self.label_policy
        visible_share = labels["target_visible"]
        if plan.ops and not labels["changed_pixels"]:
            raise DatasetError(
                "no pixel differs from the clean picture, and the build leaves such rows out"
            )
        if not keeps(policy, plan, visible_share):
            raise DatasetError(
                f"{visible_share:.0%} of its target shows, and the label policy {policy!r} drops"
                " such rows"
            )
        is_drawn_over = bool(plan.ops) and row["event"] is None
        if is_drawn_over and policy in AVOIDING and visible_share is not None and visible_share < 1:
            raise DatasetError(
                f"{visible_share:.0%} of its target shows, and the label policy {policy!r} keeps"
                " it free"
            )


def _draw_plan(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Return the picture that a plan makes, uint8 RGB `[H, W, 3]`."""
    return apply(plan, image) if plan.ops else image


def _check_plan(row: Mapping[str, Any], picture: UInt8Array, plan: Plan) -> None:
    # checks that the columns about a plan agree with it, and with each other
    height, width = picture.shape[:2]
    if (height, width) != (row["height"], row["width"]):
        raise DatasetError(f"screenshot is {width}x{height}, the row says otherwise")
    if plan.digest() != row["plan_digest"]:
        raise DatasetError("plan does not match plan_digest")
    if params_json(plan) != row["params"]:
        raise DatasetError("params are not those of the plan")
    is_exact = row["fidelity"] == "exact"
    has_event = row["event"] is not None
    if (row["inserted"] and not row["event"]) or has_event == is_exact:
        raise DatasetError("event, inserted and fidelity contradict each other")
    if plan.out_size != (height, width):
        raise DatasetError("plan gives a picture of another size")


def _is_same_plan(generated: Plan, stored: Plan) -> bool:
    """Return whether plans are equal except for their notes on elements off the screen."""
    return _without_elements(generated).digest() == _without_elements(stored).digest()


def _without_elements(plan: Plan) -> Plan:
    notes = [note for note in plan.notes if not _ELEMENTS.fullmatch(note)]
    return replace(plan, notes=tuple(notes))


def _check_params(plan: Plan, planner: Planner) -> None:
    # checks that a plan is of the corruptions of its label, with their parameters
    params_by_id: dict[str, list[dict[str, Any]]] = {}
    parts = list(leaves(planner))
    if not all(isinstance(part, Corruption) for part in parts):
        return  # the planner of a plug-in may put any parameters into its plans
    for leaf in parts:
        params_by_id.setdefault(leaf.id, []).append(leaf.params())
    if not params_by_id:
        return
    for name, frozen_params in plan.parts:
        if name not in params_by_id:
            raise DatasetError(f"plan is one of {name}, its label has {', '.join(params_by_id)}")
        params = thaw(frozen_params)
        if params not in params_by_id[name]:
            expected = short_repr(params_by_id[name][0])
            raise DatasetError(
                f"params of {name} are {short_repr(params)}, the build has {expected}"
            )
