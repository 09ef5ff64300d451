"""The labels of a sample: which entries are labels, how each is written, what becomes of them."""

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
Declared: TypeAlias = Mapping[str, str | None]

# Entries that have a meaning of their own in every sample, and how they are written unless
# something else is declared.
OWN = ("target", "target_box", "elements", "action", "action_code")
# of a tree, some lie where one would have to scroll
_ELEMENTS = box_format("xyxy", 0, anywhere=True)
# Entries that say which sample it is, and are never labels.
KEYS = ("id", "step", "epoch", "plan")


class Labels:
    """Which entries of a sample are labels, and how they are written.

    Args:
        declared: for each entry the name of its format (`hijack_data.labels.formats` lists them),
            or `None` to leave it as it is. An entry inside another is named by a path:
            `"objects.bbox"`; where a list is on the way, it counts for each of its parts.
        target: the declared entry at which the sample aims: what has to show under
            `label_policy="avoid"`. By default the first that is there of `target`, `target_box`,
            the point of the action and the one declared point or box.

    A format that does not exist is an `UnknownNameError`, anything that is not a declaration a
    `ParameterError` or `ParameterTypeError`.
    """

    def __init__(self, declared: Declared | None = None, target: str | None = None) -> None:
        if declared is not None and not isinstance(cast(object, declared), Mapping):
            raise ParameterTypeError(
                f"labels must be a dictionary such as {{'bbox': 'xyxy'}}, got {declared!r}"
            )
        given = declared or {}
        for key in given:
            if not isinstance(cast(object, key), str):
                raise ParameterTypeError(f"labels: {key!r} is no name of an entry; give strings")
        self.declared = {key: format_of(name) for key, name in given.items()}
        if target is not None and target not in {*self.declared, *OWN}:
            raise ParameterError(
                f"target={target!r} is not among the labels; declare it: labels={{{target!r}:"
                " 'xyxy'}"
            )
        self.target = target

    def __reduce__(self) -> "tuple[type[Labels], tuple[Declared, str | None]]":
        # Formats are functions; their names go to workers, and into the fingerprints of `datasets`.
        return Labels, ({key: form.name for key, form in self.declared.items()}, self.target)

    def __repr__(self) -> str:
        return repr({key: form.name for key, form in self.declared.items()})

    @property
    def left(self) -> frozenset[str]:
        """The entries that pass as they are."""
        return frozenset(path for path, form in self.declared.items() if form.name == LEAVE)

    # --- what follows the pixels

    def follow(self, plan: Plan, sample: SampleDict) -> dict[str, Any]:
        """Return the entries that differ after a plan, in pixels of the corrupted picture.

        Raises `LabelError` for an entry that could be a label but is not declared, and for labels
        that cannot follow.
        """
        row = is_row(sample)
        if plan.coords.is_identity:
            return {}
        move = Move(plan.size, plan.out_size)
        moved: dict[str, Any] = {}
        for path, form in self.declared.items():
            self._follow_path(
                path,
                form,
                {
                    **sample,
                    **moved,
                },
                move,
                moved,
            )
        for key, value in sample.items():
            inside = [path for path in self.declared if path == key or path.startswith(f"{key}.")]
            if key in inside or value is None:
                continue
            if self._follow_own(key, sample, move, moved, row):
                continue
            self._check(key, value, inside, move)
        return moved

    def _follow_path(
        self,
        path: str,
        form: Format,
        sample: SampleDict,
        move: Move,
        moved: dict[str, Any],
    ) -> None:
        key, steps = _split(path, sample)
        if key in sample:
            change = partial(moved_as, path, form, move=move)
            moved[key] = _changed_at(sample[key], steps, change)

    def _follow_own(
        self,
        key: str,
        sample: SampleDict,
        move: Move,
        moved: dict[str, Any],
        row: bool,
    ) -> bool:
        """Move an entry that has a meaning of its own; `False` for one that has none."""
        value = sample[key]
        if key in KEYS or (row and key in (*PROVENANCE, *RECORDED)):
            return True
        if key in ("width", "height"):
            height, width = move.before
            side = width if key == "width" else height
            if not np.all(np.asarray(to_host(value)) == side):
                return False  # of a box, or of another picture
            moved[key] = moved_as(key, FORMATS[key], value, move)
            return True
        if key == "action_code":
            moved[key] = self._code(value, sample, move, row)
            return True
        if key == "action" and not is_own_action(value):
            return False  # perhaps another dialect: to be declared
        if _is_own(key, value):
            moved[key] = moved_as(key, _own_format(key, value), value, move)
            return True
        if row and key == "boxes":  # TorchDataset's
            moved[key] = moved_as(key, FORMATS["xyxy"], value, move)
            return True
        return False

    def _code(
        self,
        value: Any,
        sample: SampleDict,
        move: Move,
        row: bool,
    ) -> Any:
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

    def _check(
        self,
        key: str,
        value: Any,
        inside: list[str],
        move: Move,
    ) -> None:
        """Check that no undeclared part of an entry could be a label.

        Raises:
            LabelError: one could.
        """
        rest = value
        for path in inside:
            rest = _changed_at(rest, path.split(".")[1:], _nothing)
        found = find_undeclared(key, rest, move.before)
        if found is not None:
            raise LabelError(explained(*found, move.before, move.after))

    # --- where the sample aims

    def place(self, sample: SampleDict, size: Size) -> Location | None:
        """Return where a sample aims, in pixels of its picture of `size` (height, width).

        `None` if it aims nowhere.

        Raises `LabelError` for labels that cannot be right on such a picture.
        """
        found = next(iter(self._places(sample, size)), None)
        if found is None or found.end is not None:
            return found
        return Location(found.target, self._end(sample, size))

    def boxes(
        self,
        sample: SampleDict,
        key: str,
        size: Size,
    ) -> list[tuple[float, ...]]:
        """Return the boxes of an entry in pixels, `xyxy`. Raises `LabelError`."""
        value = sample.get(key)
        form = self.declared.get(key) or _own_format(key, value)
        if value is None:
            return []
        return [place.target for place in places_of(key, form, value, size)]

    def check_target(self, sample: SampleDict, size: Size) -> None:
        """Check that the target of a sample is known, if an entry could be one.

        Raises:
            LabelError: an entry could be the target, but none is declared, or several are.
        """
        known = [path for path in self._pointing() if _split(path, sample)[0] in sample]
        known += [key for key in ("target", "target_box", "action") if _is_told(key, sample)]
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

    def _places_at(
        self,
        path: str,
        sample: SampleDict,
        size: Size,
    ) -> list[Location]:
        key, steps = _split(path, sample)
        value = sample.get(key)
        if value is None:
            return []
        if path in self.declared:
            form = self.declared[path]
        elif not _is_told(path, sample):
            return []
        else:
            form = _own_format(path, value)
        found: list[Location] = []

        def collect(part: Any) -> None:
            found.extend(places_of(path, form, part, size))

        _changed_at(value, steps, collect)
        return found

    def _end(self, sample: SampleDict, size: Size) -> tuple[float, ...] | None:
        """Return where a drag from the target ends: from the action, or else from `action_code`."""
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


DRAGGING = ("drag", "mouseUp")  # pyautogui code without any of these drags nothing


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


def _is_own(key: str, value: Any) -> bool:
    """Return whether an entry has a meaning of its own.

    A dictionary under `target` is what torchvision's detection models take: boxes, masks, classes.
    """
    return key in OWN and not (key == "target" and isinstance(value, Mapping))


def _is_told(key: str, sample: SampleDict) -> bool:
    """Return whether a sample has an entry of its own of which it is known how it is written."""
    if key not in sample or not _is_own(key, sample[key]):
        return False
    return key != "action" or sample[key] is None or is_own_action(sample[key])


def _own_format(key: str, value: Any) -> Format:
    # The format of an entry that has a meaning of its own.
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
    """Return the number of numbers in a target, which should be 2 or 4."""
    shape = getattr(value, "shape", None)
    if shape is not None:
        return int(shape[-1]) if len(shape) else 0
    parts: Any = value
    while isinstance(parts, list | tuple) and parts and isinstance(parts[0], list | tuple):
        parts = cast("list[Any]", parts)[0]
    return len(cast(Any, parts)) if hasattr(cast(Any, parts), "__len__") else 0


def _split(path: str, sample: SampleDict) -> tuple[str, list[str]]:
    """Return the entry of a sample in which a path begins, and the rest of the path."""
    if path in sample:
        return path, []
    key, *steps = path.split(".")
    return key, steps


def _nothing(_: Any) -> None:
    """Replace a declared label while the rest of its entry is checked."""


def _changed_at(
    value: Any,
    steps: list[str],
    change: Callable[[Any], Any],
) -> Any:
    """Return a copy of a value with the end of a path changed, also in lists on the way."""
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
