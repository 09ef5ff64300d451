"""Parameters of a corruption, each declared once.

The declaration gives the default, the check, the error text and the documentation.
"""

import dataclasses
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, cast

from PIL import ImageColor

from .errors import ParameterError, ParameterTypeError, short_repr, shorten_list, suggest

ParamKind: TypeAlias = Literal["bool", "int", "float", "str", "color", "choice", "steps", "ip"]
_KEY = "agenthijack"
# Kinds whose name alone would not be clear in messages.
_WORDS: Mapping[str, str] = {
    "ip": "IPv4 or IPv6 address",
    "steps": "step, list of steps, or {every: k}",
}


@dataclass(frozen=True)
class Every:
    """A schedule that fires at steps `every`, `2 * every`, ..."""

    every: int


Steps: TypeAlias = int | tuple[int, ...] | Every


@dataclass(frozen=True)
class Parameter:
    """What one field of a corruption accepts.

    `paper` is the parameter's key in the paper's YAML, if it differs from ours.
    """

    kind: ParamKind
    doc: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    optional: bool = False
    paper: str | None = None

    def check(self, key: str, value: object) -> Any:
        """Return `value` in its normal form.

        Args:
            key: the name of the parameter in messages, such as `"marks.number"`.
            value: the value to check.

        Raises:
            ParameterTypeError: the value has the wrong type.
            ParameterError: the value is out of its range.
        """
        if value is None and self.optional:
            return None
        return _CHECKS[self.kind](self, key, value)

    @property
    def accepts(self) -> str:
        """The accepted values, in words."""
        if self.choices:
            return " | ".join(self.choices)
        text = _WORDS.get(self.kind, self.kind)
        if self.low is not None and self.high is not None:
            text += f" in [{self.low:g}, {self.high:g}]"
        elif self.low is not None:
            text += f" >= {self.low:g}"
        elif self.high is not None:
            text += f" <= {self.high:g}"
        return f"{text} or none" if self.optional else text


def param(
    default: Any,
    doc: str,
    *,
    kind: ParamKind | None = None,
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
    optional: bool = False,
    paper: str | None = None,
) -> Any:
    """Declare a field of a corruption; by default, its kind is the type of the default value."""
    kinds: dict[type, ParamKind] = {bool: "bool", int: "int", float: "float", str: "str"}
    kind_name: ParamKind = kind or ("choice" if choices else kinds[type(default)])
    meta = Parameter(kind_name, doc, low, high, tuple(choices), optional, paper)
    return dataclasses.field(default=default, metadata={_KEY: meta})


def parameters(spec: Any) -> dict[str, tuple[Parameter, Any]]:
    """Return `{name: (parameter, default)}` of a corruption, in the order of declaration.

    Args:
        spec: the class, or an instance of it.
    """
    parameter_fields = [field for field in dataclasses.fields(spec) if _KEY in field.metadata]
    return {field.name: (field.metadata[_KEY], field.default) for field in parameter_fields}


def to_json(value: Any) -> Any:
    """Return a checked value as JSON data."""
    if isinstance(value, Every):
        return {"every": value.every}
    if isinstance(value, tuple):
        return list(cast("tuple[int, ...]", value))
    return value


def is_due(steps: Steps, step: int) -> bool:
    """Return whether a schedule fires at `step`."""
    if isinstance(steps, Every):
        return step > 0 and step % steps.every == 0
    if isinstance(steps, tuple):
        return step in steps
    return step == steps


def _wrong_type(key: str, value: object, expected: str) -> ParameterTypeError:
    actual = f"{short_repr(value)} ({type(value).__name__})"
    return ParameterTypeError(f"{key} must be {expected}, got {actual}")


def _in_range(p: Parameter, key: str, value: float) -> None:
    is_low = p.low is not None and value < p.low
    is_high = p.high is not None and value > p.high
    if is_low or is_high:
        raise ParameterError(f"{key} must be {p.accepts}, got {short_repr(value)}")


def _check_bool(p: Parameter, key: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise _wrong_type(key, value, "true or false")
    return value


def _check_int(p: Parameter, key: str, value: object) -> int:
    if isinstance(value, bool):
        raise _wrong_type(key, value, "an integer")
    try:
        number = operator.index(cast(Any, value))
    except TypeError:
        raise _wrong_type(key, value, "an integer") from None
    _in_range(p, key, number)
    return number


def _check_float(p: Parameter, key: str, value: object) -> float:
    if isinstance(value, bool) or not hasattr(value, "__float__"):
        raise _wrong_type(key, value, "a number")
    try:
        number = float(cast(Any, value))
    except OverflowError:
        number = math.inf
    except (TypeError, ValueError):
        raise _wrong_type(key, value, "a number") from None
    if not math.isfinite(number):
        raise ParameterError(f"{key} must be finite, got {short_repr(value)}")
    _in_range(p, key, number)
    return number


def _check_str(p: Parameter, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise _wrong_type(key, value, "a string")
    bad = next((c for c in value if ord(c) < 32 and c not in "\n\t"), None)
    if bad is not None:
        raise ParameterError(f"{key} holds the control character {bad!r}; remove it")
    return value


def _check_choice(p: Parameter, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise _wrong_type(key, value, f"one of {shorten_list(p.choices)}")
    if value not in p.choices:
        options = shorten_list(p.choices)
        hint = suggest(value, p.choices)
        raise ParameterError(f"{key} must be one of {options}, got {short_repr(value)}{hint}")
    return value


def _check_color(p: Parameter, key: str, value: object) -> str:
    if isinstance(value, list | tuple):
        parts = cast("Sequence[object]", value)
        if len(parts) == 3 and all(_is_channel(v) for v in parts):
            return "#{:02x}{:02x}{:02x}".format(*cast("Sequence[int]", parts))
        raise ParameterError(f"{key} must be three integers in 0..255, got {short_repr(parts)}")
    if not isinstance(value, str):
        raise _wrong_type(key, value, "a colour name, '#rrggbb' or [r, g, b]")
    try:
        _opaque(value, key)
    except ParameterError:
        raise
    except ValueError:
        hint = suggest(value.lower(), ImageColor.colormap) if value.isalpha() else ""
        if "did you mean" not in hint:
            hint = "; use a CSS colour name or '#rrggbb'"
        raise ParameterError(f"{key} is not a colour: {short_repr(value)}{hint}") from None
    return value


def _is_channel(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int):
        return False
    return 0 <= value <= 255


def _opaque(color: str, key: str) -> tuple[int, int, int]:
    """Return the channels of a colour.

    Raises:
        ValueError: the text is not a colour.
        ParameterError: the colour has transparency.
    """
    channels = ImageColor.getrgb(color)
    if len(channels) != 3:
        solid = "#{:02x}{:02x}{:02x}".format(*channels)
        message = f"{key} = {color!r} has transparency, which is not drawn"
        raise ParameterError(f"{message}; use {solid!r}, the colour without it")
    return channels


def _check_steps(p: Parameter, key: str, value: object) -> Steps:
    if isinstance(value, Every):
        return _parse_every(key, value.every)
    if isinstance(value, Mapping):
        data = cast("Mapping[object, object]", value)
        if set(data) != {"every"}:
            raise ParameterError(f"{key} as a mapping must be {{every: k}}, got {short_repr(data)}")
        return _parse_every(key, data["every"])
    if isinstance(value, list | tuple):
        items = cast("Sequence[object]", value)
        if not items:
            raise ParameterError(f"{key} is an empty list of steps; give at least one step")
        steps = {_check_int(p, f"{key}[{i}]", item) for i, item in enumerate(items)}
        return tuple(sorted(steps))
    try:
        return _check_int(p, key, value)
    except ParameterTypeError:
        raise _wrong_type(key, value, "a step, a list of steps or {every: k}") from None


def _parse_every(key: str, value: object) -> Every:
    positive = Parameter("int", "", low=1)
    return Every(_check_int(positive, f"{key}.every", value))


def _check_ip(p: Parameter, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise _wrong_type(key, value, "an IP address as a string")
    try:
        return address(value)
    except ValueError as error:
        zone = "; leave out the zone, from % on" if "%" in value else "; example: 192.168.1.10"
        raise ParameterError(f"{key} is not an IP address: {error}{zone}") from None


def address(text: str) -> str:
    """Return an IPv4 or IPv6 address in its normal form.

    Raises:
        ValueError: the text is not an address, or has a zone (`fe80::1%eth0`), which firewalls
            refuse and which may hold any characters.
    """
    import ipaddress

    if "%" in text:
        raise ValueError(f"{text!r} has a zone")
    return str(ipaddress.ip_address(text))


_CHECKS: dict[ParamKind, Callable[[Parameter, str, object], Any]] = {
    "bool": _check_bool,
    "int": _check_int,
    "float": _check_float,
    "str": _check_str,
    "choice": _check_choice,
    "color": _check_color,
    "steps": _check_steps,
    "ip": _check_ip,
}


def rgb(color: str) -> tuple[int, int, int]:
    """Return a colour as (r, g, b), each 0..255.

    Raises:
        ValueError: the text is not a colour.
        ParameterError: the colour has transparency.
    """
    return _opaque(color, "colour")
