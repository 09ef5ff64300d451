"""What the actions of a dialect mean, as a table from their names to rules.

A rule reads the arguments of one call and returns what they mean. The factories below make the
rules of nearly all dialects; `Arguments` checks every argument, scales the points, and keeps the
arguments as they are written, so that reading an action and mapping it can never disagree.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

from ...errors import ActionError, short_repr, suggest
from ...types import Action
from ..python_source import TextEdit, apply_edits
from ..scaling import Scaling
from .field_checks import action_at, key_combination, number
from .pyautogui_write import hscroll_code, write_pyautogui
from .unmapped_fields import check_carried_out, check_fields

OptionalPoint: TypeAlias = tuple[int, int] | None
# Of scrolling without an amount: UI-TARS's own code scrolls by 5.
DEFAULT_NOTCHES = 5
# Tools that scroll in pixels: a notch of the wheel scrolls most programs by about this many.
PIXELS_PER_NOTCH = 100
WAIT = "WAIT"
_ENDS = ("done", "fail")
_DIRECTIONS = ("up", "down", "left", "right")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_TAGS = re.compile(r"</?(?:point|bbox|box)>|<\|(?:box|point)_(?:start|end)\|>")
_SHAPES = frozenset(
    f"{left}{numbers}{right}"
    for left, right in (("", ""), ("(", ")"), ("[", "]"), ("[[", "]]"), ("((", "))"))
    for numbers in ("N,N", "N,N,N,N", "N N", "N N N N", "(N,N),(N,N)")
)
_ABSENT_COORDINATE = -1.0


class NoSuchPlace(Exception):
    """The model answers that what it looks for is not there: a point of -1, -1."""


@dataclass(frozen=True)
class Meaning:
    """One action that a call stands for.

    Args:
        action: the action, in pixels.
        code: its code, if an `Action` lacks a field for what it does (sideways scrolling).
        refusal: why a desktop cannot do it, if it cannot.
    """

    action: Action
    code: str = ""
    refusal: str = ""


Rule: TypeAlias = Callable[["Arguments"], list[Meaning]]


class Arguments:
    """The arguments of one call.

    Args:
        label: the dialect and the action, for messages.
        values: the arguments by name; `None` counts as not there.
        scaling: from the space of the dialect to pixels.

    Attributes:
        mapped: the arguments with their points scaled, written as before.
    """

    def __init__(self, label: str, values: Mapping[str, Any], scaling: Scaling) -> None:
        self.label = label
        self.scaling = scaling
        self.mapped: dict[str, Any] = dict(values)
        self._values = values
        self._read: set[str] = set()

    def check_all_read(self, note_names: Sequence[str] = ()) -> None:
        """Check that no argument was left that may hold coordinates.

        Raises:
            ActionError: there is one, which would stay unmapped.
        """
        check_fields(self._values, (*self._read, *note_names), self.label)

    def check_carried_out(self, remarks: Sequence[str] = ()) -> None:
        """Check that no argument asks for something that the rule does not do.

        Raises:
            ActionError: there is one, which would be ignored.
        """
        check_carried_out(self._values, (*self._read, *remarks), self.label)

    def value(self, name: str, default: Any = None) -> Any:
        """Return an argument, or the default if it is not there."""
        self._read.add(name)
        value = self._values.get(name)
        return default if value is None else value

    def text(self, name: str) -> str:
        """Return an argument that is text.

        Raises:
            ActionError: it is not there, or is not text.
        """
        value = self.value(name)
        if not isinstance(value, str):
            raise ActionError(f"{self.label} needs a text {name}, got {short_repr(value)}")
        return value

    def number(self, name: str, default: float | None = None) -> float:
        """Return a number, also one that is written as text, such as "3 seconds".

        Raises:
            ActionError: it is not there and has no default, or is no number.
        """
        value = self.value(name, default)
        if isinstance(value, str):
            match = re.fullmatch(r"\s*(-?\d+(?:\.\d+)?)\s*(?:s|seconds?)?\s*", value, re.ASCII)
            value = value if match is None else float(match[1])
        return number(value, f"{self.label} {name}")

    def direction(self, name: str = "direction") -> str:
        """Return a direction.

        Raises:
            ActionError: it is none of up, down, left and right.
        """
        value = self.value(name)
        if not isinstance(value, str) or value.strip().lower() not in _DIRECTIONS:
            raise ActionError(
                f"{self.label} {name} must be up, down, left or right, got {short_repr(value)}"
            )
        return value.strip().lower()

    def keys(self, name: str, separators: str = "+") -> tuple[str, ...]:
        """Return keys under pyautogui's names.

        Raises:
            ActionError: the argument names no keys.
        """
        value = self.value(name)
        if isinstance(value, str) and re.fullmatch(r"\s*\[.*\]\s*", value, re.DOTALL):
            value = re.findall(r"[^\s,\[\]'\"]+", value)
        return key_combination(value, f"{self.label} {name}", separators)

    def point(self, *names: str) -> tuple[int, int]:
        """Return a point in pixels: `point("coordinate")`, or `point("x", "y")`.

        Raises:
            ActionError: it is not there, or is no point of the dialect's space.
            NoSuchPlace: it is -1, -1.
        """
        point = self.optional_point(*names)
        if point is None:
            raise ActionError(f"{self.label} needs {' and '.join(names)}; give a point")
        return point

    def optional_point(self, *names: str) -> OptionalPoint:
        """Return a point in pixels, or `None` if its arguments are not there.

        Raises:
            ActionError: the value is no point of the dialect's space.
            NoSuchPlace: the point is -1, -1.
        """
        values = [self.value(name) for name in names]
        if all(value is None or value == [] for value in values):
            return None
        label = f"{self.label} {' and '.join(names)}"
        original = values[0] if len(names) == 1 else values
        numbers = coordinates(original, label)
        if all(n == _ABSENT_COORDINATE for n in numbers):
            raise NoSuchPlace
        scaled = scaled_coordinates(numbers, self.scaling)
        mapped = with_coordinates(original, scaled)
        for name, value in zip(names, [mapped] if len(names) == 1 else mapped, strict=True):
            self.mapped[name] = value
        across = numbers[::2]
        down = numbers[1::2]
        return self.scaling.point(sum(across) / len(across), sum(down) / len(down))

    def distance(self, name: str, direction: str, default: float) -> float:
        """Return a distance in pixels along a direction.

        Raises:
            ActionError: the argument is no number.
        """
        length = self.number(name, default)
        upright = direction in ("up", "down")
        return abs(self.scaling.dy(length) if upright else self.scaling.dx(length))


# --- Points as models write them


def coordinates(value: object, label: str) -> list[float]:
    """Return the two or four numbers of a point or box: lists, text, or a dict of x and y.

    Raises:
        ActionError: the value is no point and no box.
    """
    numbers: list[float] = []
    if isinstance(value, str):
        pattern = _NUMBER.sub("N", _TAGS.sub(" ", value))
        shape = re.sub(r"\s*([\[\](),])\s*", r"\1", " ".join(pattern.split()))
        if shape in _SHAPES:
            matches = _NUMBER.finditer(_TAGS.sub(_blank, value))
            numbers = [number(float(match[0]), label) for match in matches]
    elif isinstance(value, dict):
        fields = cast("dict[str, Any]", value)
        if set(fields) == {"x", "y"}:
            numbers = [_coordinate(fields[name], label) for name in ("x", "y")]
    elif isinstance(value, list | tuple):
        parts = cast("list[Any]", value)
        if len(parts) == 1 and isinstance(parts[0], list | tuple):
            return coordinates(cast("object", parts[0]), label)
        if len(parts) in (2, 4):
            numbers = [_coordinate(part, label) for part in parts]
    if not numbers:
        value_text = short_repr(cast("object", value))
        raise ActionError(f"{label} must be [x, y] or [x1, y1, x2, y2], got {value_text}")
    return numbers


def scaled_coordinates(numbers: Sequence[float], scaling: Scaling) -> list[int]:
    """Return the numbers of a point or box in pixels.

    Raises:
        ActionError: a number lies outside the space of the dialect.
    """
    scaling.check_point(*numbers)
    return [scaling.y(n) if i % 2 else scaling.x(n) for i, n in enumerate(numbers)]


def with_coordinates(value: Any, numbers: Sequence[int]) -> Any:
    """Return a point or box with other numbers, written as before."""
    if isinstance(value, str):
        places = list(_NUMBER.finditer(_TAGS.sub(_blank, value)))
        edits = [TextEdit(*match.span(), str(n)) for match, n in zip(places, numbers, strict=True)]
        return apply_edits(value, edits)
    if isinstance(value, dict):
        return {**cast("dict[str, Any]", value), "x": numbers[0], "y": numbers[1]}
    parts = cast("list[Any]", value)
    if len(parts) == 1:
        items = [with_coordinates(parts[0], numbers)]
    else:
        items = [
            str(n) if isinstance(old, str) else n for old, n in zip(parts, numbers, strict=True)
        ]
    return tuple(items) if isinstance(value, tuple) else items


def _coordinate(value: Any, label: str) -> float:
    if isinstance(value, str) and _NUMBER.fullmatch(value.strip()):
        return float(value)
    return number(value, label)


def _blank(match: re.Match[str]) -> str:
    return " " * len(match[0])


# --- Rules


def point_rule(kind: str, *names: str, optional: bool = False) -> Rule:
    """Return the rule of a click, or another action of a kind, at a point."""

    def rule(arguments: Arguments) -> list[Meaning]:
        point = arguments.optional_point(*names) if optional else arguments.point(*names)
        return [Meaning(action_at(kind, point))]

    return rule


def drag_rule(start: Sequence[str], end: Sequence[str]) -> Rule:
    """Return the rule of a drag."""

    def rule(arguments: Arguments) -> list[Meaning]:
        begin = arguments.point(*start)
        x2, y2 = arguments.point(*end)
        return [Meaning(action_at("drag", begin, x2=x2, y2=y2))]

    return rule


def type_rule(
    text: str,
    *point_names: str,
    clear: str | bool = False,
    enter: str | bool = False,
    defaults: Mapping[str, bool] | None = None,
) -> Rule:
    """Return the rule of typing, after a click if there is a point.

    `clear` and `enter` say whether the field is emptied first and Enter is pressed last; if they
    are texts, the argument of that name says it, by default as in `defaults`.
    """

    def says(arguments: Arguments, option: str | bool) -> bool:
        if isinstance(option, bool):
            return option
        flag = arguments.value(option, (defaults or {}).get(option, False))
        if isinstance(flag, str) and flag.lower() in ("true", "false"):
            flag = flag.lower() == "true"
        if not isinstance(flag, bool):
            raise ActionError(
                f"{arguments.label} {option} must be true or false, got {short_repr(flag)}"
            )
        return flag

    def rule(arguments: Arguments) -> list[Meaning]:
        spot = arguments.optional_point(*point_names) if point_names else None
        meanings = [] if spot is None else [Meaning(action_at("click", spot))]
        if says(arguments, clear):
            meanings += [Meaning(Action("hotkey", keys=k)) for k in (("ctrl", "a"), ("delete",))]
        typed = arguments.text(text)
        if says(arguments, enter):
            typed += "\n"
        return [*meanings, Meaning(Action("type", text=typed))]

    return rule


def press_rule(name: str, kind: str = "hotkey") -> Rule:
    """Return the rule of keys that an argument names."""
    return lambda arguments: [Meaning(Action(kind, keys=arguments.keys(name)))]


def key_rule(*keys: str) -> Rule:
    """Return the rule of an action that presses always the same keys."""
    return lambda _: [Meaning(Action("hotkey", keys=keys))]


def scroll_rule(*point_names: str, direction: str = "direction", steps: str = "") -> Rule:
    """Return the rule of scrolling; `direction` is an argument, or the direction itself."""

    def rule(arguments: Arguments) -> list[Meaning]:
        spot = arguments.optional_point(*point_names) if point_names else None
        way = direction if direction in _DIRECTIONS else arguments.direction(direction)
        notches = arguments.number(steps, DEFAULT_NOTCHES) if steps else DEFAULT_NOTCHES
        return [scroll_meaning(way, notches, spot)]

    return rule


def scroll_meaning(direction: str, notches: float, point: OptionalPoint) -> Meaning:
    """Return what scrolling by so many notches means."""
    if direction in ("up", "down"):
        amount = notches if direction == "up" else -notches
        return Meaning(action_at("scroll", point, amount=amount))
    sideways = notches if direction == "right" else -notches
    return Meaning(action_at("other", point), code=hscroll_code(sideways, point))


def wait_rule(seconds: float | None = None, name: str = "") -> Rule:
    """Return the rule of waiting; an argument may name the seconds."""

    def rule(arguments: Arguments) -> list[Meaning]:
        if not name or arguments.value(name) is None:
            return [Meaning(Action("wait", amount=seconds))]
        return [Meaning(Action("wait", amount=arguments.number(name)))]

    return rule


def end_rule(kind: str, name: str = "") -> Rule:
    """Return the rule of an action that ends the episode, with an answer if it has one."""

    def rule(arguments: Arguments) -> list[Meaning]:
        words = arguments.value(name) if name else None
        return [Meaning(Action(kind, text=None if words is None else str(words)))]

    return rule


def status_rule(name: str, successes: Sequence[str], failures: Sequence[str]) -> Rule:
    """Return the rule of an action that ends the episode with success, its default, or failure."""

    def rule(arguments: Arguments) -> list[Meaning]:
        status = arguments.value(name, successes[0])
        word = status.strip().lower() if isinstance(status, str) else status
        if word not in (*successes, *failures):
            raise ActionError(
                f"{arguments.label} {name} must be one of {', '.join((*successes, *failures))},"
                f" got {short_repr(status)}"
            )
        return [Meaning(Action("fail" if word in failures else "done"))]

    return rule


def screenshot_rule() -> Rule:
    """Return the rule of an action that only looks: the next picture comes anyway."""
    return lambda _: [Meaning(Action("other"), code=WAIT)]


def unsupported_rule(reason: str, *point_names: str) -> Rule:
    """Return the rule of an action that a desktop does not have; its points are mapped."""

    def rule(arguments: Arguments) -> list[Meaning]:
        spot = arguments.optional_point(*point_names) if point_names else None
        return [Meaning(action_at("other", spot), refusal=reason)]

    return rule


# --- Calls


@dataclass(frozen=True)
class ActionCall:
    """One call as it stands in a reply.

    Args:
        name: the name of the action.
        arguments: its arguments.
        start: where the part of the reply begins that `write` replaces.
        end: where it ends.
        write: returns that part with other arguments.
    """

    name: object
    arguments: Mapping[str, Any]
    start: int = 0
    end: int = 0
    write: Callable[[dict[str, Any]], Any] | None = None


@dataclass(frozen=True)
class CallReader:
    """Reads the calls of a dialect by a table.

    Args:
        dialect: its name, for messages.
        rules: the meaning of each action.
        find: returns the calls of a reply; it raises `ActionError` if there is none.
        notes: arguments of any action that say nothing about the screen.
        remarks: those of the notes that say nothing about the action either; by default all.
    """

    dialect: str
    rules: Mapping[str, Rule]
    find: Callable[[object], list[ActionCall]]
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] | None = None

    def read(
        self, reply: object, scaling: Scaling
    ) -> list[tuple[ActionCall, Arguments, list[Meaning]]]:
        """Return the calls of a reply with their arguments and what they mean.

        Raises:
            ActionError: there is no call, or one that the dialect does not have or that is broken.
        """
        reads: list[tuple[ActionCall, Arguments, list[Meaning]]] = []
        for call in self.find(reply):
            rule = self.rules.get(call.name) if isinstance(call.name, str) else None
            if rule is None:
                problem = unknown_action(self.dialect, call.name, self.rules)
                raise problem
            arguments = Arguments(f"{self.dialect} {call.name}", call.arguments, scaling)
            try:
                meanings = rule(arguments)
            except NoSuchPlace:
                meanings = [Meaning(Action("other"), code=WAIT)]
                arguments.mapped = dict(call.arguments)
            arguments.check_all_read(self.notes)
            reads.append((call, arguments, meanings))
        return reads

    def parse(self, reply: object, scaling: Scaling) -> list[Action]:
        """Return the actions of a reply, in order.

        Raises:
            ActionError: the reply cannot be read, see `read`.
        """
        calls = self.read(reply, scaling)
        return [meaning.action for _, _, meanings in calls for meaning in meanings]

    def map(self, reply: object, scaling: Scaling) -> Any:
        """Return the reply with the points of its calls scaled.

        Raises:
            ActionError: the reply cannot be read, see `read`.
        """
        edits: list[TextEdit] = []
        for call, arguments, _ in self.read(reply, scaling):
            if call.write is None or arguments.mapped == call.arguments:
                continue
            rewritten = call.write(arguments.mapped)
            if not isinstance(reply, str):
                return rewritten
            edits.append(TextEdit(call.start, call.end, rewritten))
        return apply_edits(cast("str", reply), edits) if edits else reply

    def check(self, reply: object, unit: int) -> Any:
        """Return a reply in fractions 0..`unit` of the picture as it is, if it can be read.

        Fractions are the same point at every size.

        Raises:
            ActionError: the reply cannot be read, see `read`.
        """
        self.read(reply, Scaling.fractions((1000, 1000), unit))
        return reply

    def write(self, reply: object, scaling: Scaling) -> list[str]:
        """Return each call as code.

        Raises:
            ActionError: the reply cannot be read, see `read`, a desktop cannot do the action, or
                an argument asks for something that the action does not do.
        """
        remarks = self.notes if self.remarks is None else self.remarks
        codes: list[str] = []
        for call, arguments, meanings in self.read(reply, scaling):
            codes.append(self._code(call, meanings))
            if not all(meaning.action.type in _ENDS for meaning in meanings):
                arguments.check_carried_out(remarks)
        return codes

    def _code(self, call: ActionCall, meanings: Sequence[Meaning]) -> str:
        lines: list[str] = []
        for meaning in meanings:
            if meaning.refusal:
                raise ActionError(
                    f"{self.dialect} {call.name}: {meaning.refusal}; use an action of pointer or"
                    " keyboard"
                )
            lines.append(meaning.code or write_pyautogui(meaning.action))
        return "\n".join(lines)


def unknown_action(dialect: str, name: object, actions: Mapping[str, object]) -> ActionError:
    """Return the error for an action that a dialect does not have; it lists those it has."""
    hint = suggest(name, actions) if isinstance(name, str) and len(name) < 80 else ""
    return ActionError(
        f"{dialect} has no action {short_repr(name)}{hint}; it has {', '.join(actions)}"
    )
