"""The labels of a sample: which entries are labels, their formats, and how they are changed."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeAlias, cast

import numpy as np

from ..errors import HijackError, LabelError, ParameterError, ParameterTypeError
from ..plan import Plan
from ..types import Size
from .actions import is_own_action
from .base import Format, Location, Move
from .boxes import box_format
from .formats import FORMATS, LEAVE, format_of, moved_as, places_of
from .numbers import to_host
from .rows import PROVENANCE, RECORDED, is_row, moved_code
from .undeclared import explained, find_undeclared, how_to_declare

SampleDict: TypeAlias = Mapping[str, Any]
Declared: TypeAlias = Mapping[str, Any]

# Entries with a fixed meaning in every sample, and their formats unless others are declared.
OWN = ("target", "target_box", "elements", "action", "action_code")
# elements of an accessibility tree may lie outside the visible area
_ELEMENTS = box_format("xyxy", 0, anywhere=True)
# Entries that identify the sample, and are never labels.
KEYS = ("id", "step", "epoch", "plan")


class Labels:
    """Which entries of a sample are labels, and in which formats.

    Args:
        declared: for each entry the name of its format (`hijack_data.labels.formats` lists them), a
            function, `chat(...)`, or `None` to leave it as it is. An entry inside another is named
            by a path, such as `"objects.bbox"`; a path through a list applies to each item of the
            list.
        target: the declared entry at which the sample aims, which must stay visible under
            `label_policy="avoid"`. By default the first existing one of `target`, `target_box`, the
            point of the action, and the only declared point or box.

    Raises `UnknownNameError` for an unknown format, and `ParameterError` or `ParameterTypeError`
    for an invalid declaration.
    """

    def __init__(self, declared: Declared | None = None, target: str | None = None) -> None:
        if declared is not None and not isinstance(cast(object, declared), Mapping):
            raise ParameterTypeError(
                f"labels must be a dictionary such as {{'bbox': 'xyxy'}}, got {declared!r}"
            )
        given = declared or {}
        for key in given:
            if not isinstance(cast(object, key), str):
                raise ParameterTypeError(f"labels: {key!r} is not a string; give strings")
        self.declared = {key: format_of(name) for key, name in given.items()}
        if target is not None and target not in {*self.declared, *OWN}:
            raise ParameterError(
                f"target={target!r} is not among the labels; declare it: labels={{{target!r}:"
                " 'xyxy'}"
            )
        self.target = target

    def __reduce__(self) -> "tuple[type[Labels], tuple[Declared, str | None]]":
        # Formats hold functions, so workers and the fingerprints of `datasets` get their names
        # instead.
        return Labels, ({key: form.declared for key, form in self.declared.items()}, self.target)

    def __repr__(self) -> str:
        return repr({key: form.name for key, form in self.declared.items()})

    @property
    def left(self) -> frozenset[str]:
        """The entries that stay unchanged."""
        return frozenset(path for path, form in self.declared.items() if form.name == LEAVE)

    # --- Labels after a plan

    def follow(self, plan: Plan, sample: SampleDict) -> dict[str, Any]:
        """Return the entries that a plan changes, in pixels of the corrupted picture.

        Raises `LabelError` for an entry that could be a label but is not declared, and for labels
        that cannot follow.
        """
        row = is_row(sample)
        if plan.coords.is_identity:
            return {}
        move = Move(plan.size, plan.out_size)
        moved: dict[str, Any] = {}
        for path, form in self.declared.items():
            self._follow_path(path, form, {**sample, **moved}, move, moved)
        for key, value in sample.items():
            inside = [path for path in self.declared if path == key or path.startswith(f"{key}.")]
            if key in inside or value is None:
                continue
            if self._follow_fixed(key, sample, move, moved, row):
                continue
            self._check(key, value, inside, move)
        return moved

    def _follow_path(
        self, path: str, form: Format, sample: SampleDict, move: Move, moved: dict[str, Any]
    ) -> None:
        key, steps = _split(path, sample)
        if key in sample:
            change = partial(moved_as, path, form, move=move)
            moved[key] = _changed_at(sample[key], steps, change)

    def _follow_fixed(
        self, key: str, sample: SampleDict, move: Move, moved: dict[str, Any], row: bool
    ) -> bool:
        """Move an entry with a fixed meaning, and return whether the entry has one."""
        value = sample[key]
        if key in KEYS or (row and key in (*PROVENANCE, *RECORDED)):
            return True
        if key in ("width", "height"):
            height, width = move.before
            side = width if key == "width" else height
            if not np.all(np.asarray(to_host(value)) == side):
                return False  # the side of a box, or of another picture
            moved[key] = moved_as(key, FORMATS[key], value, move)
            return True
        if key == "action_code":
            moved[key] = self._code(value, sample, move, row)
            return True
        if key == "action" and not is_own_action(value):
            return False  # perhaps in another dialect, which must then be declared
        if _has_fixed_meaning(key, value):
            moved[key] = moved_as(key, _fixed_format(key, value), value, move)
            return True
        if row and key == "boxes":  # TorchDataset's
            moved[key] = moved_as(key, FORMATS["xyxy"], value, move)
            return True
        return False

    def _code(self, value: Any, sample: SampleDict, move: Move, row: bool) -> Any:
        if not isinstance(value, str | bytes):
            raise LabelError(f"the sample's entry 'action_code' must be text, got {value!r:.80}")
        code = value.decode("utf-8") if isinstance(value, bytes) else value
        action: Any = sample.get("action")
        known = action if row or is_own_action(action) else None
        try:
            text = moved_code(code, known, move)
        except LabelError:
            raise
        except HijackError as error:
            raise type(error)(f"the sample's entry 'action_code': {error}") from None
        return text.encode("utf-8") if isinstance(value, bytes) else text

    def _check(self, key: str, value: Any, inside: list[str], move: Move) -> None:
        """Check that no undeclared part of an entry could be a label.

        Raises:
            LabelError: an undeclared part could be a label.
        """
        rest = value
        for path in inside:
            rest = _changed_at(rest, path.split(".")[1:], _blanked)
        found = find_undeclared(key, rest, move.before)
        if found is not None:
            raise LabelError(explained(*found, move.before, move.after))

    # --- The target of a sample

    def place(self, sample: SampleDict, size: Size) -> Location | None:
        """Return the target of a sample, in pixels of its picture of `size` (height, width).

        Returns `None` if it has none.

        Raises `LabelError` for labels that cannot be right on such a picture.
        """
        found = next(iter(self._places(sample, size)), None)
        if found is None or found.end is not None:
            return found
        return Location(found.target, self._end(sample, size))

    def boxes(self, sample: SampleDict, key: str, size: Size) -> list[tuple[float, ...]]:
        """Return the boxes of an entry in pixels, `xyxy`. Raises `LabelError`."""
        value = sample.get(key)
        form = self.declared.get(key) or _fixed_format(key, value)
        if value is None:
            return []
        return [place.target for place in places_of(key, form, value, size)]

    def check_target(self, sample: SampleDict, size: Size) -> None:
        """Check that the target of a sample is known, if an entry could be one.

        Raises:
            LabelError: an entry could be the target, but none is declared, or several are.
        """
        known = [path for path in self._pointing() if _split(path, sample)[0] in sample]
        fixed = ("target", "target_box", "action")
        known += [key for key in fixed if _has_fixed_format(key, sample)]
        several = [path for path in known if path in self.declared and path not in OWN]
        if len(several) > 1 and len(several) == len(known) and self.target is None:
            raise LabelError(
                "label_policy='avoid' keeps the target of a sample in sight, and "
                f"{' and '.join(several)} could be it; say which: target={several[0]!r}"
            )
        if known or is_row(sample):
            return
        for key, value in sample.items():
            if key in KEYS or key == "elements" or key in self.declared:
                continue
            found = find_undeclared(key, value, size, aims=True)
            if found is not None:
                raise LabelError(
                    "label_policy='avoid' keeps the target of a sample in sight; this one names"
                    f" none, but its entry {found[0]!r} could be it: declare it, such as"
                    f" {how_to_declare(*found)}, or {{{found[0]!r}: 'leave'}}"
                )

    def _pointing(self) -> list[str]:
        """Return the declared entries that can be the target."""
        nowhere = FORMATS[LEAVE].places
        return [
            path
            for path, form in self.declared.items()
            if path != "elements" and form.places is not nowhere
        ]

    def _places(self, sample: SampleDict, size: Size) -> list[Location]:
        if self.target is not None:
            return _only(self.target, self._places_at(self.target, sample, size))
        for key in ("target", "target_box", "action"):
            found = self._places_at(key, sample, size)
            if found:
                return _only(key, found)
        found: list[Location] = []
        for path in self._pointing():
            if path not in OWN:
                found += self._places_at(path, sample, size)
        if not found and "action_code" in self.declared:
            return self._places_at("action_code", sample, size)[:1]
        return found if len(found) == 1 else []

    def _places_at(self, path: str, sample: SampleDict, size: Size) -> list[Location]:
        key, steps = _split(path, sample)
        value = sample.get(key)
        if value is None:
            return []
        if path in self.declared:
            form = self.declared[path]
        elif not _has_fixed_format(path, sample):
            return []
        else:
            form = _fixed_format(path, value)
        found: list[Location] = []

        def collect(part: Any) -> None:
            found.extend(places_of(path, form, part, size))

        _changed_at(value, steps, collect)
        return found

    def _end(self, sample: SampleDict, size: Size) -> tuple[float, ...] | None:
        """Return where a drag from the target ends, from the action or from `action_code`."""
        action = sample.get("action")
        if action is not None and (is_own_action(action) or "action" in self.declared):
            return _first_end(self._places_at("action", sample, size))
        code = sample.get("action_code")
        if not isinstance(code, str) or not any(word in code for word in DRAGGING):
            return None
        form = self.declared.get("action_code", FORMATS["pyautogui"])
        try:
            return _first_end(places_of("action_code", form, code, size))
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


def _first_end(places: list[Location]) -> tuple[float, ...] | None:
    return places[0].end if places else None


def _has_fixed_meaning(key: str, value: Any) -> bool:
    """Return whether an entry has a fixed meaning.

    A dictionary under `target` has none: it holds the boxes, masks and classes of torchvision's
    detection models.
    """
    return key in OWN and not (key == "target" and isinstance(value, Mapping))


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


def _split(path: str, sample: SampleDict) -> tuple[str, list[str]]:
    """Split a path into an entry of a sample and the path inside that entry."""
    if path in sample:
        return path, []
    key, *steps = path.split(".")
    return key, steps


def _blanked(_: Any) -> None:
    """Replace a declared label by `None` while the rest of its entry is checked."""


def _changed_at(value: Any, steps: list[str], change: Callable[[Any], Any]) -> Any:
    """Return a copy of a value with the end of a path changed, also inside lists on the path."""
    if value is None:
        return None
    if not steps:
        return change(value)
    if isinstance(value, list | tuple):
        parts = [_changed_at(part, steps, change) for part in cast("list[Any]", value)]
        return tuple(parts) if isinstance(value, tuple) else parts
    if not isinstance(value, Mapping):
        return value
    entries = dict(cast("Mapping[str, Any]", value))
    if steps[0] in entries:
        entries[steps[0]] = _changed_at(entries[steps[0]], steps[1:], change)
    return entries
