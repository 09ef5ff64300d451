"""A plan: what to do to one picture, as data.

A plan is made once, on the host. Every backend applies it in the same way; it can be stored in a
dataset row and replayed years later. It holds integers and recipes, but no pixels. `to_json` and
`from_json` are exact inverses; `digest` names a plan.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias, cast

from .actions.input_faults import InputFault
from .choices import CLEAN as CLEAN
from .coords import CoordMap
from .drawing.raster import render
from .drawing.sprite import Sprite
from .errors import HijackError, ParameterTypeError, PlanError, short_repr, suggest
from .frozen import freeze, thaw
from .limits import check_area
from .types import MAX_SIDE, Point, Size, as_size

FORMAT = "agenthijack-plan"
VERSION = 1
_FINGERPRINT = re.compile(r"[0-9a-f]{16}")


@dataclass(frozen=True)
class Paste:
    """Stamp one sprite at one or more places.

    `at` holds the top-left corners (x, y) in pixels of the picture at the time of the operation;
    parts outside the picture are cut off. `fingerprint` is that of the sprite when the plan was
    made. A plan that is applied in the process that made it never needs the fingerprint, so it is
    computed when the plan is first compared, pickled or written as JSON.
    """

    sprite: Mapping[str, Any]
    at: tuple[Point, ...]
    fingerprint: str = cast(str, cached_property(lambda op: render(op.sprite).fingerprint))

    def __post_init__(self) -> None:
        _check(self.sprite, Mapping, "Paste.sprite", "a mapping")
        _check(self.at, tuple, "Paste.at", "a tuple of points (x, y)")
        if not (isinstance(fingerprint := vars(self)["fingerprint"], str) and fingerprint):
            del vars(self)["fingerprint"]

    def __getstate__(self) -> dict[str, Any]:
        return {"sprite": self.sprite, "at": self.at, "fingerprint": self.fingerprint}

    def draws_as_planned(self, sprite: Sprite) -> bool:
        """Return whether `sprite`, drawn here from the recipe, is the one that was planned."""
        return "fingerprint" not in vars(self) or sprite.fingerprint == self.fingerprint

    def to_data(self) -> dict[str, Any]:
        """Return JSON data of the operation."""
        at = [list(point) for point in self.at]
        return {
            "op": "paste",
            "sprite": dict(self.sprite),
            "at": at,
            "fingerprint": self.fingerprint,
        }


@dataclass(frozen=True)
class Resample:
    """Resize the picture to `size` (height, width) with Pillow's bicubic filter.

    Raises:
        ParameterTypeError: the size is not two integers.
        ParameterError: the size exceeds `limits`.
    """

    size: Size

    def __post_init__(self) -> None:
        size = check_area(as_size(self.size, "Resample.size"), "Resample.size")
        object.__setattr__(self, "size", size)

    def to_data(self) -> dict[str, Any]:
        """JSON data of the operation."""
        return {"op": "resample", "size": list(self.size), "filter": "bicubic"}


Op: TypeAlias = Paste | Resample


@dataclass(frozen=True)
class Effect:
    """Something to do to the machine, carried out by `online_env`.

    `kind` is the name of the effect; `params` is JSON data, which is copied and made immutable. Two
    parameters mean the same for all kinds: `begins` (`{"seconds": s}` after the observation of its
    step) and `lasts` (`{"seconds": s}` or `{"steps": n}`).

    Raises:
        PlanError: a field has another type.
    """

    kind: str
    params: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        _check(self.kind, str, "effect.kind", "a string")
        object.__setattr__(self, "params", _frozen(self.params, "effect.params"))

    def to_data(self) -> dict[str, Any]:
        """JSON data of the effect."""
        return {"effect": self.kind, "params": thaw(self.params)}

    @property
    def is_delayed(self) -> bool:
        """Whether the effect begins some seconds after the observation of its step."""
        return "begins" in self.params


@dataclass(frozen=True)
class Plan:
    """One corruption of one picture.

    Args:
        corruption: id with version, such as `"pop_ups-v2"`; parts of a sequence are joined by `+`.
        size: `(height, width)` in pixels of the picture that the plan is for.
        params: the resolved parameters, JSON data, copied and made immutable.
        ops: pixel operations, in order.
        effects: what to do to a live machine.
        notes: remarks for the reader of the plan, such as "placed 47 of 50 marks".
        inputs: what happens to actions of the agent on their way to the machine.

    Raises:
        PlanError: a field has the wrong type, or JSON cannot hold the parameters.
        ParameterTypeError, ParameterError: `size` is not a valid size, or exceeds `limits`.
    """

    corruption: str
    size: Size
    params: Mapping[str, Any] = field(default_factory=dict[str, Any])
    ops: tuple[Op, ...] = ()
    effects: tuple[Effect, ...] = ()
    notes: tuple[str, ...] = ()
    inputs: tuple[InputFault, ...] = ()

    def __post_init__(self) -> None:
        if not _check(self.corruption, str, "corruption", "a string"):
            raise PlanError("plan: corruption is empty; give an id such as 'marks-v1'")
        _check_all(self.ops, Paste | Resample, "ops", "a Paste or a Resample")
        _check_all(self.effects, Effect, "effects", "an Effect")
        _check_all(self.notes, str, "notes", "a string")
        _check_all(self.inputs, InputFault, "inputs", "an InputFault")
        size = check_area(as_size(self.size, "plan: size"), "plan: size")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "params", _frozen(self.params, "params"))

    def __hash__(self) -> int:
        return hash(self.digest())

    @property
    def out_size(self) -> Size:
        """`(height, width)` of the corrupted picture."""
        sizes = [op.size for op in self.ops if isinstance(op, Resample)]
        return sizes[-1] if sizes else self.size

    @property
    def coords(self) -> CoordMap:
        """The map of coordinates between the corrupted picture and the screen."""
        return CoordMap(observation=self.out_size, screen=self.size)

    @property
    def parts(self) -> tuple[tuple[str, Mapping[str, Any]], ...]:
        """The ids of the corruptions that the plan joins, in order, each with its parameters.

        Raises:
            PlanError: the parameters of one are missing.
        """
        ids = self.corruption.split("+")
        if len(ids) == 1:
            return ((self.corruption, self.params),)
        keys = _part_keys(ids)
        for key in keys:
            _check(self.params.get(key), Mapping, f"params.{key}", "an object")
        return tuple((part, self.params[key]) for part, key in zip(ids, keys, strict=True))

    def then(self, other: "Plan") -> "Plan":
        """Return the plan that applies this plan and then `other`.

        Raises:
            ParameterTypeError: `other` is not a plan.
            PlanError: `other` was not made for the `out_size` of this plan.
        """
        if not isinstance(cast(object, other), Plan):
            raise ParameterTypeError(f"Plan.then takes a Plan, got {type(other).__name__}")
        if other.size != self.out_size:
            first = f"{self.corruption} (gives {self.out_size})"
            second = f"{other.corruption} (made for {other.size})"
            raise PlanError(f"cannot join {first} and {second}")
        notes = self.notes + other.notes
        if self.corruption == CLEAN:
            return replace(other, size=self.size, notes=notes)
        if other.corruption == CLEAN:
            return replace(self, notes=notes)
        return Plan(
            corruption=f"{self.corruption}+{other.corruption}",
            size=self.size,
            params=joined_params([*self.parts, *other.parts]),
            ops=self.ops + other.ops,
            effects=self.effects + other.effects,
            notes=notes,
            inputs=self.inputs + other.inputs,
        )

    def to_data(self) -> dict[str, Any]:
        """JSON data of the plan, with its digest."""
        data = {**self._content(), "params": thaw(self.params)}
        return {**data, "digest": _digest(data)}

    def to_json(self) -> str:
        """One line of JSON; `from_json` gives back an equal plan."""
        data = self._content()
        return _dump({**data, "digest": _digest(data)})

    def digest(self) -> str:
        """64 hexadecimal digits that identify the plan: the SHA-256 of its content."""
        return _digest(self._content())

    @classmethod
    def clean(cls, size: Size) -> "Plan":
        """The plan that changes nothing."""
        return cls(CLEAN, as_size(size))

    @classmethod
    def from_json(cls, text: str | bytes) -> "Plan":
        """Read a plan.

        Raises:
            PlanError: the plan is damaged, was edited, has a newer version or exceeds `limits`.
            ParameterTypeError: `text` is neither `str` nor `bytes`.
        """
        if not isinstance(cast(object, text), str | bytes | bytearray):
            raise ParameterTypeError(
                f"Plan.from_json reads JSON text, str or bytes, got {type(text).__name__}; "
                "use Plan.from_data for data that was parsed"
            )
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise PlanError(f"plan: not JSON ({error})") from None
        return cls.from_data(data)

    @classmethod
    def from_data(cls, data: object) -> "Plan":
        """Read a plan from JSON data.

        Raises:
            PlanError: see `from_json`.
        """
        if not isinstance(data, dict) or cast("dict[str, Any]", data).get("format") != FORMAT:
            raise PlanError(f"plan: not an AgentHijack plan (field 'format' must be {FORMAT!r})")
        body = dict(cast("dict[str, Any]", data))
        _check_version(body.get("version"))
        claimed = body.pop("digest", None)
        digest = _digest(body)
        if claimed != digest:
            raise PlanError(
                f"plan: the content does not match its digest ({claimed} != {digest}); "
                "it was edited or cut off, plan again"
            )
        try:
            return _parse(body)
        except PlanError:
            raise
        except HijackError as error:
            raise PlanError(str(error)) from None

    def _content(self) -> dict[str, Any]:
        content = {
            "format": FORMAT,
            "version": VERSION,
            "corruption": self.corruption,
            "size": list(self.size),
            "params": self.params,
            "ops": [op.to_data() for op in self.ops],
            "effects": [effect.to_data() for effect in self.effects],
            "notes": list(self.notes),
        }
        if self.inputs:  # plans of before this field, and their digests, stay as they are
            content["inputs"] = [fault.to_data() for fault in self.inputs]
        return content


def joined_params(parts: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """Return the parameters of the plan that joins these parts.

    Args:
        parts: the ids of corruptions, in order, each with its parameters.

    Returns:
        The parameters by id. An id that occurs again has its number: `marks-v1`, `marks-v1#2`.
    """
    keys = _part_keys([part for part, _ in parts])
    return {key: params for key, (_, params) in zip(keys, parts, strict=True)}


def _part_keys(ids: Sequence[str]) -> list[str]:
    numbers = [ids[: place + 1].count(part) for place, part in enumerate(ids)]
    return [
        f"{part}#{number}" if number > 1 else part
        for part, number in zip(ids, numbers, strict=True)
    ]


def _check(value: object, kind: Any, path: str, expected: str) -> Any:
    """Return `value` if it has the type `kind`; a `bool` does not count as an `int`.

    Raises:
        PlanError: it has another type.
    """
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        actual = f"{short_repr(value)} ({type(value).__name__})"
        raise PlanError(f"plan: {path} has the wrong type: {actual}; it must be {expected}")
    return value


def _check_all(values: object, kind: Any, path: str, expected: str) -> None:
    for index, value in enumerate(_check(values, tuple, path, "a tuple")):
        _check(value, kind, f"{path}[{index}]", expected)


def _frozen(params: object, path: str) -> Mapping[str, Any]:
    return freeze(_check(params, Mapping, path, "a mapping"), f"plan: {path}")


_write = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
).encode


def _dump(data: object) -> str:
    """Return one line of JSON, the form from which digests are computed.

    Raises:
        PlanError: JSON cannot hold the data.
    """
    try:
        return _write(data)
    except (TypeError, ValueError) as error:
        freeze(data, "plan")  # raises with the place of the bad value
        raise PlanError(f"plan: cannot be written as JSON ({error})") from None
    except RecursionError:
        raise PlanError("plan: nested too deeply") from None


def _digest(data: object) -> str:
    return hashlib.sha256(_dump(data).encode("utf-8", "surrogatepass")).hexdigest()


def _check_version(version: object) -> None:
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise PlanError(f"plan: version {version!r} must be an integer, 1 to {VERSION}")
    if version > VERSION:
        newer = f"is newer than this library reads ({VERSION})"
        raise PlanError(f"plan: version {version} {newer}; upgrade agenthijack")


def _fields(data: object, kinds: Mapping[str, type], path: str) -> dict[str, Any]:
    """Check that a JSON object has exactly the fields of `kinds`, of these types, and return it.

    Raises:
        PlanError: a field is missing, unknown or of another type.
    """
    fields: dict[str, Any] = _check(data, dict, path or "it", "an object")
    dot = f"{path}." if path else ""
    for key, kind in kinds.items():
        if key not in fields:
            raise PlanError(f"plan: {dot}{key} is missing; the plan was cut off, plan again")
        _check(fields[key], kind, f"{dot}{key}", _WORDS[kind])
    unknown = next((key for key in fields if key not in kinds), None)
    if unknown is not None:
        raise PlanError(f"plan: {dot}{unknown} is not a field{suggest(unknown, kinds)}")
    return fields


_WORDS = {str: "a string", int: "an integer", list: "a list", dict: "an object"}
_PLAN = {
    "format": str,
    "version": int,
    "corruption": str,
    "size": list,
    "params": dict,
    "ops": list,
    "effects": list,
    "notes": list,
}
_PASTE = {"op": str, "sprite": dict, "at": list, "fingerprint": str}
_RESAMPLE = {"op": str, "size": list, "filter": str}
_EFFECT = {"effect": str, "params": dict}


def _parse(data: object) -> Plan:
    has_inputs = isinstance(data, dict) and "inputs" in cast("dict[str, Any]", data)
    body = _fields(cast(object, data), {**_PLAN, "inputs": list} if has_inputs else _PLAN, "")
    if has_inputs and not body["inputs"]:
        raise PlanError("plan: inputs is empty; leave it out")
    effects = [_fields(e, _EFFECT, f"effects[{i}]") for i, e in enumerate(body["effects"])]
    return Plan(
        body["corruption"],
        _size(body["size"], "size"),
        body["params"],
        tuple(_parse_op(op, f"ops[{i}]") for i, op in enumerate(body["ops"])),
        tuple(Effect(effect["effect"], effect["params"]) for effect in effects),
        tuple(body["notes"]),
        tuple(InputFault.from_data(fault) for fault in body.get("inputs", ())),
    )


def _parse_op(data: object, path: str) -> Op:
    kind = _check(data, dict, path, "an object").get("op")
    if kind == "paste":
        op = _fields(data, _PASTE, path)
        if not _FINGERPRINT.fullmatch(op["fingerprint"]):
            raise PlanError(
                f"plan: {path}.fingerprint is malformed: {short_repr(op['fingerprint'])}"
            )
        return Paste(op["sprite"], _points(op["at"], f"{path}.at"), op["fingerprint"])
    if kind == "resample":
        op = _fields(data, _RESAMPLE, path)
        if op["filter"] != "bicubic":
            actual = short_repr(op["filter"])
            raise PlanError(f"plan: {path}.filter = {actual}; only 'bicubic' is known")
        return Resample(_size(op["size"], f"{path}.size"))
    raise PlanError(f"plan: {path}.op = {short_repr(kind)} is not known; known: paste, resample")


def _size(value: list[object], path: str) -> Size:
    """Check that a size in a plan is a list of integers, and return it."""
    for index, side in enumerate(value):
        _check(side, int, f"{path}[{index}]", "an integer")
    return as_size(value, f"plan: {path}")


def _points(values: list[Any], path: str) -> tuple[Point, ...]:
    bad = next((i for i, value in enumerate(values) if not _is_point(value)), None)
    if bad is None:
        return tuple((x, y) for x, y in values)
    expected = f"[x, y], two integers, pixel coordinates of at most {MAX_SIDE}"
    problem = f"{path}[{bad}] is out of range or has the wrong type: {short_repr(values[bad])}"
    raise PlanError(f"plan: {problem}; it must be {expected}")


def _is_point(value: Any) -> bool:
    if type(value) is not list or len(cast("list[Any]", value)) != 2:
        return False
    x, y = cast("list[Any]", value)
    if type(x) is not int or type(y) is not int:
        return False
    return -MAX_SIDE <= x <= MAX_SIDE and -MAX_SIDE <= y <= MAX_SIDE
