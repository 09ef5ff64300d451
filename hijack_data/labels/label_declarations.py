"""The labels of a sample: which entries are labels, their formats, and how they are changed."""

import sys
from collections.abc import Collection, Mapping
from typing import Any, TypeAlias, cast

import numpy as np

from ..actions import calls_pyautogui
from ..errors import HijackError, LabelError, ParameterError, ParameterTypeError, suggest
from ..plan import Plan
from ..sample_pictures import has_pixels, is_plain, is_sequence, names_picture, rebuilt
from ..types import Size
from .action_formats import is_own_action
from .base import Format, Location, Move
from .box_formats import box_format
from .dataset_rows import COLUMNS, is_row, map_action_code
from .formats import FORMATS, LEAVE, PICTURE, find_format, label_locations, map_label
from .label_paths import (
    SampleDict,
    find_lost_step,
    is_following,
    locate_at_path,
    map_at_path,
    names_at,
    split_path,
)
from .nested_numbers import to_host
from .undeclared_entries import Undeclared, declarations, undeclared_error

Declared: TypeAlias = Mapping[str, Any]

# Entries with a fixed meaning in every sample, and their formats unless others are declared.
FIXED_ENTRIES = ("target", "target_box", "elements", "action", "action_code")
# elements of an accessibility tree may lie outside the visible area
_ELEMENTS = box_format("xyxy", 0, anywhere=True)
# Entries that identify the sample or come from a transform, and are never labels.
IDENTITY_ENTRIES = ("id", "step", "epoch", "plan", "target_visible")


class Labels:
    """Which entries of a sample are labels, and in which formats.

    Args:
        declared: for each entry the name of its format (`hijack_data.labels.formats` lists them), a
            function, `chat(...)`, or `None` to leave it as it is. An entry inside another is named
            by a path, such as `"objects.bbox"`; a path through a list applies to each item of the
            list. Every path must match something in every sample, unless it ends in `?`
            (`"bbox?"`) or its entry is left.
        target: the declared entry at which the sample aims, which must stay visible under
            `label_policy="avoid"`. By default the first existing one of `target`, `target_box`, the
            point of the action, and the only declared point or box.

    Raises:
        ParameterError: a declaration is invalid.
        ParameterTypeError: a declaration has another type.
        UnknownNameError: a format is unknown.
    """

    def __init__(self, declarations: Declared | None = None, target: str | None = None) -> None:
        if declarations is not None and not isinstance(cast(object, declarations), Mapping):
            raise ParameterTypeError(
                f"labels must be a dictionary such as {{'bbox': 'xyxy'}}, got {declarations!r}"
            )
        formats = declarations or {}
        for key in formats:
            if not isinstance(cast(object, key), str):
                raise ParameterTypeError(f"labels: {key!r} is not a string; give strings")
        self.formats = {key.removesuffix("?"): find_format(name) for key, name in formats.items()}
        if len(self.formats) < len(formats):
            twice = next(key for key in formats if f"{key}?" in formats)
            raise ParameterError(f"labels: {twice!r} is declared twice, with and without '?'")
        self.optional = frozenset(key.removesuffix("?") for key in formats if key.endswith("?"))
        if target is not None and target not in {*self.formats, *FIXED_ENTRIES}:
            raise ParameterError(
                f"target={target!r} is not among the labels; declare it: labels={{{target!r}:"
                " 'xyxy'}"
            )
        self.target = target

    def __reduce__(self) -> "tuple[type[Labels], tuple[Declared, str | None]]":
        # Formats hold functions, so workers and the fingerprints of `datasets` get their names
        # instead.
        declarations = {
            self._path(key): form.name_or_declaration for key, form in self.formats.items()
        }
        return Labels, (declarations, self.target)

    def __repr__(self) -> str:
        return repr({self._path(key): form.name for key, form in self.formats.items()})

    def _path(self, key: str) -> str:
        """Return a path as it was declared."""
        return f"{key}?" if key in self.optional else key

    @property
    def unchanged_paths(self) -> frozenset[str]:
        """The entries that stay unchanged."""
        return frozenset(path for path, form in self.formats.items() if form.name == LEAVE)

    def is_picture(self, path: str) -> bool | None:
        """Return whether a dotted path is that of pictures; `None` if nothing says so.

        An entry inside one that is left is left, too.
        """
        form = self.formats.get(path)
        if form is not None:
            return form.name == PICTURE
        if any(path.startswith(f"{parent}.") for parent in self.unchanged_paths):
            return False
        return names_picture(path) or None

    # --- Labels after a plan

    def follow(
        self,
        plan: Plan,
        sample: SampleDict,
        skip: Collection[str] = (),
        unclear: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """Return the entries that a plan changes, in pixels of the corrupted picture.

        Args:
            plan: what happens to the picture of the sample.
            sample: its entries; pictures in it stay as they are.
            skip: entries that are no labels, such as the one that holds the id.
            unclear: parts of it that could be pictures, by their dotted paths; an error.

        Raises:
            LabelError: a declaration matches nothing in the sample, entries are neither harmless
                nor declared (the message names them all), or a label cannot follow the pixels.
        """
        self.check_paths(sample)
        changes: dict[str, Any] = {}
        if plan.coords.is_identity:
            if unclear:
                problem = undeclared_error(unclear, plan.size, plan.size, bool(self.formats))
                raise problem
            self._follow_tensors(sample, changes, plan, skip)
            return changes
        row = is_row(sample)
        move = Move(plan.size, plan.out_size)
        for path, form in self.formats.items():
            self._follow_path(path, form, {**sample, **changes}, move, changes)
        self._follow_tensors(sample, changes, plan, skip)
        undeclared = Undeclared(self._is_settled)
        for key, value in sample.items():
            if key in self.formats or key in skip or value is None or is_following(value):
                continue
            if not self._follow_fixed(key, sample, move, changes, row):
                undeclared.check(key, value)
        parts = {**undeclared.parts, **(unclear or {})}
        if parts:
            problem = undeclared_error(parts, move.before, move.after, bool(self.formats))
            raise problem
        return changes

    def check_paths(self, sample: SampleDict) -> None:
        """Check that every declaration matches something in a sample.

        Declarations that end in `?`, and those that leave an entry, may match nothing.

        Raises:
            LabelError: a path leads nowhere, or to two places.
        """
        for path, form in self.formats.items():
            key, steps = split_path(path, sample)
            if not steps and "." in path and path.partition(".")[0] in sample:
                first, *inner_steps = path.split(".")
                if names_at(sample[first], inner_steps) is None:
                    raise LabelError(
                        f"labels={{{path!r}: ...}} means two entries of the sample: {path!r}, and"
                        f" {'.'.join(inner_steps)!r} inside {first!r}; rename one of them"
                    )
            if path in self.optional or form.name == LEAVE:
                continue
            names = sample if key not in sample else names_at(sample[key], steps)
            if names is not None:
                advice = suggest(find_lost_step(path, sample), map(str, names))
                raise LabelError(
                    f"labels={{{path!r}: {form.name!r}}} matches nothing in the sample"
                    f"{advice}; where the entry may be missing, write {path + '?'!r}"
                )

    def _is_settled(self, path: str, value: Any) -> bool:
        if path in self.formats:
            return True
        return bool(names_picture(path)) and has_pixels(value)

    def _follow_path(
        self, path: str, form: Format, sample: SampleDict, move: Move, changes: dict[str, Any]
    ) -> None:
        key, steps = split_path(path, sample)
        if key in sample and form.name not in (LEAVE, PICTURE):
            changes[key] = map_at_path(path, form, sample[key], steps, move)

    def _follow_tensors(
        self, sample: SampleDict, changes: dict[str, Any], plan: Plan, skip: Collection[str]
    ) -> None:
        """Map the boxes, key points and masks of torchvision, wherever they are."""
        if "torchvision.tv_tensors" not in sys.modules:
            return
        for key, value in sample.items():
            if key in skip:
                continue
            value = changes.get(key, value)
            if is_plain(value):
                continue
            after = self._map_tensors(key, value, plan)
            if after is not value:
                changes[key] = after

    def _map_tensors(self, path: str, value: Any, plan: Plan) -> Any:
        if is_following(value):
            if path in self.unchanged_paths:
                return value
            from .torchvision_labels import check_order, follow_tensor

            if path in self.formats:
                check_order(path, value, self.formats[path].name)
            return follow_tensor(value, [plan])
        if path in self.unchanged_paths:
            return value
        if isinstance(value, Mapping):
            entries = cast("Mapping[Any, Any]", value)
            if not any(map(_may_hold_tensors, entries.values())):
                return entries
            parts = {
                key: self._map_tensors(f"{path}.{key}", part, plan) for key, part in entries.items()
            }
            is_unchanged = all(parts[key] is part for key, part in entries.items())
            return entries if is_unchanged else parts
        if not is_sequence(value) or not any(_may_hold_tensors(part) for part in value):
            return value
        after = [self._map_tensors(path, part, plan) for part in value]
        is_unchanged = all(new is old for new, old in zip(after, value, strict=True))
        return value if is_unchanged else rebuilt(value, after)

    def _follow_fixed(
        self, key: str, sample: SampleDict, move: Move, changes: dict[str, Any], row: bool
    ) -> bool:
        """Move an entry with a fixed meaning, and return whether the entry has one."""
        value = sample[key]
        if key in IDENTITY_ENTRIES or (row and key in COLUMNS):
            return True
        if any(path.startswith(f"{key}.") for path in self.formats):
            return False  # its parts are declared, or checked
        if key in ("width", "height"):
            height, width = move.before
            side = width if key == "width" else height
            if not _is_side(value, side):
                return False  # the side of a box, or of another picture
            changes[key] = map_label(key, FORMATS[key], value, move)
            return True
        if key == "action_code":
            if not row and not is_own_action(sample.get("action")) and not _is_code(value):
                return False  # in another dialect, which must then be declared
            changes[key] = self._map_code(value, sample, move, row)
            return True
        if key == "action" and not is_own_action(value):
            return False  # perhaps in another dialect, which must then be declared
        if _has_fixed_meaning(key, value):
            changes[key] = map_label(key, _fixed_format(key, value), value, move)
            return True
        if row and key == "boxes":  # TorchDataset's
            changes[key] = map_label(key, FORMATS["xyxy"], value, move)
            return True
        return False

    def _map_code(self, value: Any, sample: SampleDict, move: Move, row: bool) -> Any:
        if not isinstance(value, str | bytes):
            raise LabelError(f"the sample's entry 'action_code' must be text, got {value!r:.80}")
        code = value.decode("utf-8") if isinstance(value, bytes) else value
        action: Any = sample.get("action")
        known_action = action if row or is_own_action(action) else None
        try:
            text = map_action_code(code, known_action, move)
        except LabelError:
            raise
        except HijackError as error:
            raise type(error)(f"the sample's entry 'action_code': {error}") from None
        return text.encode("utf-8") if isinstance(value, bytes) else text

    # --- The target of a sample

    def find_target(self, sample: SampleDict, size: Size) -> Location | None:
        """Return the target of a sample, in pixels of its picture of `size` (height, width).

        Returns `None` if it has none.

        Raises:
            LabelError: a label cannot be right on such a picture.
        """
        location = next(iter(self._locations(sample, size)), None)
        if location is None or location.end is not None:
            return location
        return Location(location.target, self._end(sample, size))

    def boxes(self, sample: SampleDict, key: str, size: Size) -> list[tuple[float, ...]]:
        """Return the boxes of an entry in pixels, `xyxy`.

        Raises:
            LabelError: the entry holds no boxes of such a picture.
        """
        value = sample.get(key)
        form = self.formats.get(key) or _fixed_format(key, value)
        if value is None:
            return []
        return [location.target for location in label_locations(key, form, value, size)]

    def check_target(self, sample: SampleDict, size: Size, skip: Collection[str] = ()) -> None:
        """Check that the target of a sample is known, if an entry could be one.

        `skip` names entries that are no labels.

        Raises:
            LabelError: an entry could be the target, but none is declared, or several are.
        """
        candidates = [path for path in self._pointing() if split_path(path, sample)[0] in sample]
        fixed = ("target", "target_box", "action")
        candidates += [key for key in fixed if _has_fixed_format(key, sample)]
        several = [
            path for path in candidates if path in self.formats and path not in FIXED_ENTRIES
        ]
        if len(several) > 1 and len(several) == len(candidates) and self.target is None:
            raise LabelError(
                "label_policy='avoid' keeps the target of a sample in sight, and "
                f"{' and '.join(several)} could be it; say which: target={several[0]!r}"
            )
        if candidates or is_row(sample):
            for path in several if self.target is None else ():
                if any(
                    not _has_area(location.target)
                    for location in self._locations_at(path, sample, size)
                ):
                    raise LabelError(
                        f"label_policy='avoid' keeps the target of a sample in sight, and {path} is"
                        " a box without area, which cannot be seen"
                    )
            return
        undeclared = Undeclared(self._is_settled, aims=True)
        for key, value in sample.items():
            if key not in IDENTITY_ENTRIES and key != "elements" and key not in skip:
                undeclared.check(key, value)
        if undeclared.parts:
            raise LabelError(
                "label_policy='avoid' keeps the target of a sample in sight; this one names none,"
                f" but {' or '.join(map(repr, undeclared.parts))} could be it; declare what is"
                f" the target, and leave the rest:\n{declarations(undeclared.parts, size)}"
            )

    def _pointing(self) -> list[str]:
        """Return the declared entries that can be the target."""
        nowhere = FORMATS[LEAVE].locate
        return [
            path
            for path, form in self.formats.items()
            if path != "elements" and form.locate is not nowhere
        ]

    def _locations(self, sample: SampleDict, size: Size) -> list[Location]:
        if self.target is not None:
            return _only(self.target, self._locations_at(self.target, sample, size))
        for key in ("target", "target_box", "action"):
            locations = self._locations_at(key, sample, size)
            if locations:
                return _only(key, locations)
        locations: list[Location] = []
        for path in self._pointing():
            if path not in FIXED_ENTRIES:
                locations += self._locations_at(path, sample, size)
        if not locations and "action_code" in self.formats:
            return self._locations_at("action_code", sample, size)[:1]
        # A box without area is a label like others, but nothing that could be in sight.
        return locations if len(locations) == 1 and _has_area(locations[0].target) else []

    def _locations_at(self, path: str, sample: SampleDict, size: Size) -> list[Location]:
        key, steps = split_path(path, sample)
        value = sample.get(key)
        if value is None:
            return []
        if path in self.formats:
            form = self.formats[path]
        elif not _has_fixed_format(path, sample):
            return []
        else:
            form = _fixed_format(path, value)
        return locate_at_path(path, form, value, steps, size)

    def _end(self, sample: SampleDict, size: Size) -> tuple[float, ...] | None:
        """Return where a drag from the target ends, from the action or from `action_code`."""
        action = sample.get("action")
        if action is not None and (is_own_action(action) or "action" in self.formats):
            return _first_end(self._locations_at("action", sample, size))
        code = sample.get("action_code")
        if not isinstance(code, str) or not any(word in code for word in DRAGGING):
            return None
        form = self.formats.get("action_code", FORMATS["pyautogui"])
        try:
            return _first_end(label_locations("action_code", form, code, size))
        except HijackError:
            return None


DRAGGING = ("drag", "mouseUp")  # pyautogui code without any of these functions is not a drag


def _only(key: str, places: list[Location]) -> list[Location]:
    """Return the place of a target.

    Raises:
        LabelError: it has several; whether one of them has to show, or all, nobody said.
    """
    if key in ("target", "target_box") and len(places) > 1:
        raise LabelError(
            f"the sample's entry {key!r} holds {len(places)} places, but a sample aims at one:"
            f" leave that one in {key!r}, and declare the others under a name of their own, such"
            " as labels={'others': 'xyxy'}"
        )
    return places


def _has_area(point_or_box: tuple[float, ...]) -> bool:
    return len(point_or_box) == 2 or (
        point_or_box[2] > point_or_box[0] and point_or_box[3] > point_or_box[1]
    )


def _first_end(places: list[Location]) -> tuple[float, ...] | None:
    return places[0].end if places else None


def _has_fixed_meaning(key: str, value: Any) -> bool:
    """Return whether an entry has a fixed meaning.

    A dictionary under `target` has none: it holds the boxes, masks and classes of torchvision's
    detection models.
    """
    return key in FIXED_ENTRIES and not (key == "target" and isinstance(value, Mapping))


def _has_fixed_format(key: str, sample: SampleDict) -> bool:
    """Return whether a sample has an entry with a fixed meaning in a known format."""
    if key not in sample or not _has_fixed_meaning(key, sample[key]):
        return False
    return key != "action" or sample[key] is None or is_own_action(sample[key])


def _fixed_format(key: str, value: Any) -> Format:
    # The format of an entry with a fixed meaning.
    match key:
        case "target":
            width = _width(value)
            if width not in (2, 4):
                raise LabelError(
                    "the sample's entry 'target' must be a point (x, y) or a box (x1, y1, x2, y2),"
                    f" got {width} numbers"
                )
            return FORMATS["xyxy" if width == 4 else "xy"]
        case "elements":
            return _ELEMENTS
        case "action":
            return FORMATS["action"]
        case "action_code":
            return FORMATS["pyautogui"]
        case _:
            return FORMATS["xyxy"]


def _width(value: Any) -> int:
    """Return how many numbers a target has, which should be 2 or 4."""
    shape = getattr(value, "shape", None)
    if shape is not None:
        return int(shape[-1]) if len(shape) else 0
    parts: Any = value
    while isinstance(parts, list | tuple) and parts and isinstance(parts[0], list | tuple):
        parts = cast("list[Any]", parts)[0]
    return len(cast(Any, parts)) if hasattr(cast(Any, parts), "__len__") else 0


def _is_code(value: Any) -> bool:
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return isinstance(text, str) and calls_pyautogui(text)


def _may_hold_tensors(value: Any) -> bool:
    if value is None or isinstance(value, str | int | float):
        return False
    if isinstance(value, list | tuple):
        parts = cast("list[Any]", value)
        return bool(parts) and not isinstance(parts[0], int | float | str)
    return isinstance(value, Mapping) or is_following(value)


def _is_side(value: Any, side: int) -> bool:
    """Return whether all numbers of an entry are one side of the picture."""
    try:
        return bool(np.all(np.asarray(to_host(value)) == side))
    except (TypeError, ValueError, RuntimeError):  # no numbers, or lists of different lengths
        return False
