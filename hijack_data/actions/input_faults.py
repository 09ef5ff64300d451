"""Faults of pointer and keyboard: what an agent does arrives changed, twice, or not at all.

An `InputFault` is data of a plan. It waits for the next action of the agent that it can hit, and
changes that action's code before the machine gets it. An action is pyautogui code, read by
`pyautogui_grammar`; what arrives is code of the same grammar, so anyone can compute it again from
the agent's code, the plan and the elements of the screen.

A fault hits an action as a whole, and only one that holds nothing over its end: a key or a button
that one action presses and another one releases is never left half pressed.
"""

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, cast, get_args

from ..errors import ParameterError, short_repr, shorten_list
from ..types import BoxArray, Point, Size
from .agent_actions import MAX_CODE_CHARS
from .call_coordinates import read_coordinates
from .pyautogui_functions import KEY_NAMES, KEYBOARD, LIVE_FUNCTIONS, POINTER
from .pyautogui_grammar import PyautoguiCall, Value, read_calls
from .python_source import ParsedSource, TextEdit
from .scaling import Scaling

FaultKind: TypeAlias = Literal["drop", "repeat", "offset"]
InputKind: TypeAlias = Literal["click", "drag", "key", "scroll"]
OffsetUnit: TypeAlias = Literal["pixels", "percent"]

FAULTS: tuple[FaultKind, ...] = get_args(FaultKind)
INPUTS: tuple[InputKind, ...] = get_args(InputKind)
UNITS: tuple[OffsetUnit, ...] = get_args(OffsetUnit)
PRESSES: tuple[InputKind, ...] = ("click", "drag", "key")
MAX_TIMES = 10
MAX_ACTIONS = 1000
MAX_OFFSET = 10_000  # pixels, or percent
UNKNOWN_SIDE = 32  # pixels; the side of a target whose element is not known
# The fields of each kind of fault beside `fault`, `of` and `actions`.
_FIELDS: dict[str, tuple[str, ...]] = {
    "drop": (),
    "repeat": ("times",),
    "offset": ("dx", "dy", "unit"),
}
_MOVES = ("moveTo", "moveRel", "move")
_DRAGS = ("dragTo", "dragRel", "drag")
_WHEELS = ("scroll", "hscroll", "vscroll")
_HOLDS = {"keyDown": "keyUp", "mouseDown": "mouseUp"}
_NOTHING = "pyautogui.sleep(0)"  # replaces a call that does not arrive


@dataclass(frozen=True)
class InputFault:
    """One fault of the input, which hits the next `actions` actions that it can hit.

    Args:
        fault: `"drop"`: nothing is pressed, only the pointer moves. `"repeat"`: the action arrives
            `times` times, at once. `"offset"`: every point that it names is shifted.
        of: the kinds of inputs, of which an action must have one to be hit.
        actions: how many actions it hits, 1 to `MAX_ACTIONS`.
        times: of `"repeat"`, 2 to `MAX_TIMES`.
        dx: of `"offset"`, to the right; at most `MAX_OFFSET` either way.
        dy: of `"offset"`, downwards.
        unit: of `dx` and `dy`: `"pixels"` of the screen, or `"percent"` of half the target's width
            and height, so that 100 leads from its centre to its edge. The target is the smallest
            element under the action's first point, or `UNKNOWN_SIDE` pixels if none is known.

    Raises:
        ParameterError: a field has a value that it does not accept.
    """

    fault: FaultKind
    of: tuple[InputKind, ...] = PRESSES
    actions: int = 1
    times: int = 2
    dx: int = 0
    dy: int = 0
    unit: OffsetUnit = "pixels"

    def __post_init__(self) -> None:
        _expect(self.fault in FAULTS, "fault", self.fault, f"one of {', '.join(FAULTS)}")
        is_list = isinstance(cast(object, self.of), tuple) and len(set(self.of)) == len(self.of)
        are_kinds = is_list and self.of and all(kind in INPUTS for kind in self.of)
        _expect(are_kinds, "of", self.of, f"a tuple of different kinds of {', '.join(INPUTS)}")
        _expect(self.unit in UNITS, "unit", self.unit, f"one of {', '.join(UNITS)}")
        for name, low, high in (
            ("actions", 1, MAX_ACTIONS),
            ("times", 2, MAX_TIMES),
            ("dx", -MAX_OFFSET, MAX_OFFSET),
            ("dy", -MAX_OFFSET, MAX_OFFSET),
        ):
            value = getattr(self, name)
            is_whole = type(value) is int and low <= value <= high
            _expect(is_whole, name, value, f"an integer in {low}..{high}")
        moves = self.fault != "offset" or self.dx or self.dy
        _expect(moves, "dx", self.dx, "an offset together with dy; both are 0")
        for field in dataclasses.fields(self)[3:]:
            is_used = field.name in _FIELDS[self.fault]
            value = getattr(self, field.name)
            _expect(
                is_used or value == field.default,
                field.name,
                value,
                f"left out: a fault of kind {self.fault!r} does not have it",
            )

    @property
    def needs_elements(self) -> bool:
        """Whether what it does depends on where the elements are."""
        return self.unit == "percent"

    def to_data(self) -> dict[str, Any]:
        """Return JSON data of the fault, with the fields of its kind."""
        fields = {name: getattr(self, name) for name in _FIELDS[self.fault]}
        return {"input": self.fault, "of": list(self.of), "actions": self.actions, **fields}

    @classmethod
    def from_data(cls, data: object) -> "InputFault":
        """Read a fault from JSON data: exactly the fields of its kind.

        Raises:
            ParameterError: a field is missing, unknown, or has a value that it does not accept.
        """
        fields = dict(cast("dict[str, Any]", data)) if isinstance(data, dict) else {}
        kind = fields.pop("input", None)
        _expect(kind in FAULTS, "input", kind, f"one of {', '.join(FAULTS)}")
        names = {"of", "actions", *_FIELDS[kind]}
        if set(fields) != names:
            raise ParameterError(
                f"a fault of kind {kind!r} has the fields {shorten_list(sorted(names))}, got"
                f" {shorten_list(sorted(map(str, fields)))}"
            )
        kinds = fields.pop("of")
        _expect(isinstance(kinds, list), "of", kinds, "a list")
        return cls(fault=kind, of=tuple(kinds), **fields)


@dataclass(frozen=True)
class AlteredAction:
    """What arrives of an action, and the faults that changed it."""

    code: str
    faults: tuple[InputFault, ...]


class WaitingFaults:
    """The faults of one episode that wait for an action: feed it plans and actions in their order.

    Args:
        size: `(height, width)` of the screen in pixels.
    """

    def __init__(self, size: Size) -> None:
        self._size = size
        self._waiting: list[InputFault] = []

    @property
    def needs_elements(self) -> bool:
        """Whether a fault waits that depends on where the elements are."""
        return any(fault.needs_elements for fault in self._waiting)

    def add(self, faults: Iterable[InputFault]) -> None:
        """Let the faults of a plan wait; each replaces one of the same kind that still waits."""
        for fault in faults:
            self._waiting = [earlier for earlier in self._waiting if earlier.fault != fault.fault]
            self._waiting.append(fault)

    def alter(self, code: str, boxes: BoxArray) -> AlteredAction | None:
        """Return what arrives of an action, or `None` if no fault hits it.

        A `drop` comes first: an action that gets lost leaves nothing for other faults to hit.

        Args:
            code: the action, in pixels of the screen; code that `read_action` accepts.
            boxes: of the elements on the screen, int32 `[N, 4]`, `xyxy`.

        Raises:
            ActionError: the code is beyond the grammar.
        """
        hits: list[InputFault] = []
        waiting: list[InputFault] = []
        for fault in sorted(self._waiting, key=lambda fault: fault.fault != "drop"):
            altered = alter_code(code, fault, self._size, boxes)
            if altered is None:
                waiting.append(fault)
                continue
            code = altered
            hits.append(fault)
            if fault.actions > 1:
                waiting.append(dataclasses.replace(fault, actions=fault.actions - 1))
        self._waiting = waiting
        return AlteredAction(code, tuple(hits)) if hits else None


def alter_code(code: str, fault: InputFault, size: Size, boxes: BoxArray) -> str | None:
    """Return the code that arrives under one fault, or `None` if the fault cannot hit it.

    An offset hits no action that arrives where it aimed all the same.

    Args:
        code: an action, in pixels of the screen.
        fault: what happens to it.
        size: `(height, width)` of the screen.
        boxes: of the elements on the screen, int32 `[N, 4]`, `xyxy`.

    Raises:
        ActionError: the code is beyond the grammar.
    """
    source = ParsedSource(code)
    calls = read_calls(source, LIVE_FUNCTIONS)
    if not can_hit(fault, calls):
        return None
    if fault.fault == "drop":
        return _drop(source, calls, size)
    if fault.fault == "repeat":
        repeated = "\n".join([code] * fault.times)
        return repeated if len(repeated) <= MAX_CODE_CHARS else None
    point = _first_point(source, calls, size)
    if point is None:
        return None
    shift = (fault.dx, fault.dy)
    if fault.unit == "percent":
        shift = _scaled_shift(shift, point, boxes)
    from .dialects.pyautogui_code import map_code  # loads every dialect

    altered = map_code(code, _Shifted(size, size, shift=_inside(shift, point, size)))
    # At an edge of the screen, nothing may land elsewhere.
    return None if _input_points(altered, size) == _input_points(code, size) else altered


def can_hit(fault: InputFault, calls: Sequence[PyautoguiCall]) -> bool:
    """Return whether a fault can hit the action of some calls: it has such an input, as a whole."""
    return bool(input_kinds(calls) & set(fault.of)) and _is_complete(calls)


def moves_from_pointer(calls: Sequence[PyautoguiCall]) -> bool:
    """Return whether an action acts where the pointer happens to be, and moves it.

    Such an action leads elsewhere if it is done twice: a move by a distance, a drag whose start is
    not in the code, a click at the pointer before a move.
    """
    is_placed = acts_at_pointer = moves = False
    for call in calls:
        parameters = POINTER.get(call.function)
        if parameters is None:
            continue
        if "xOffset" in parameters:
            return True
        arguments = _bind(call)
        x, y = arguments.get("x"), arguments.get("y")
        is_place = isinstance(x, tuple) or (x is not None and y is not None)
        # A drag begins where the pointer is.
        begins_placed = is_placed or (is_place and call.function not in _DRAGS)
        acts_at_pointer |= call.function not in _MOVES and not begins_placed
        moves |= x is not None or y is not None
        is_placed |= is_place
    return acts_at_pointer and moves


def input_kinds(calls: Sequence[PyautoguiCall]) -> set[InputKind]:
    """Return the kinds of inputs among the calls of an action; moving the pointer is none."""
    kinds: set[InputKind] = set()
    is_down = has_moved = False
    for call in calls:
        name = call.function
        if name in (*KEYBOARD, *POINTER) and not _presses(call):
            continue
        if name in KEYBOARD:
            kinds.add("key")
        elif name in _WHEELS:
            kinds.add("scroll")
        elif name in _DRAGS:
            kinds.add("drag")
        elif name == "mouseDown":
            is_down, has_moved = True, False
        elif name == "mouseUp":
            kinds.add("drag" if is_down and (has_moved or "x" in _bind(call)) else "click")
            is_down = False
        elif name in _MOVES:
            has_moved = True
        elif name in POINTER:
            kinds.add("click")
    if is_down:
        kinds.add("click")
    return kinds


def _presses(call: PyautoguiCall) -> bool:
    """Return whether a call does anything at all.

    It may type an empty text, click 0 times, or press a key that there is not: pyautogui goes on.
    """
    amounts = {"message", "keys", "presses", "clicks"}
    arguments = _bind(call)
    if any(value in (0, "", ()) for key, value in arguments.items() if key in amounts):
        return False
    if call.function == "hotkey":
        keys = [argument.value for argument in call.positional]
    else:
        keys = [arguments[name] for name in ("key", "keys") if name in arguments]
        if isinstance(arguments.get("message"), tuple):  # no text, but a list of keys
            keys.append(arguments["message"])
        if not keys:
            return True
    return any(_is_key(name) for key in keys for name in (key if isinstance(key, tuple) else [key]))


def _is_key(name: object) -> bool:
    """Return whether pyautogui has a key of a name; what is no text fails in the guest."""
    return not isinstance(name, str) or len(name) == 1 or name.lower() in KEY_NAMES


def _bind(call: PyautoguiCall) -> dict[str, Value]:
    arguments = call.bind({**POINTER, **KEYBOARD}[call.function])
    return {name: argument.value for name, argument in arguments.items()}


def first_press(code: str, size: Size) -> Point | None:
    """Return where code first presses a button of the mouse, or `None` if it does not say.

    Args:
        code: an action, in pixels of the screen.
        size: `(height, width)` of the screen.

    Raises:
        ActionError: the code is beyond the grammar.
    """
    for call, start, _ in _pointer_path(code, size):
        if call.function in POINTER and call.function not in (*_MOVES, *_WHEELS, "mouseUp"):
            return start
    return None


def _input_points(code: str, size: Size) -> list[Point | None]:
    """Return where the pointer is at each press, release, turn of the wheel and key of some code.

    `None` stands for where it happens to be.
    """
    points: list[Point | None] = []
    for call, start, end in _pointer_path(code, size):
        if call.function not in _MOVES:
            points += [start, end]
    return points


def _pointer_path(
    code: str, size: Size
) -> Iterator[tuple[PyautoguiCall, Point | None, Point | None]]:
    """Yield the calls of pointer and keyboard, and where the pointer is as each acts and after it.

    A drag acts where the pointer is, and moves it; any other call acts where it moves the pointer.
    """
    source = ParsedSource(code)
    pointer: Point | None = None
    for call in read_calls(source, LIVE_FUNCTIONS):
        start = pointer
        if call.function in POINTER:
            x, y, _ = read_coordinates(source, call, Scaling(size, size))
            pointer = _pointer_after(pointer, x, y, "x" in POINTER[call.function], size)
        elif call.function not in KEYBOARD:
            continue
        yield call, start if call.function in _DRAGS else pointer, pointer


def _pointer_after(
    pointer: Point | None, x: int | None, y: int | None, is_absolute: bool, size: Size
) -> Point | None:
    """Return where the pointer is after a move, as far as that is known."""
    if is_absolute and x is not None and y is not None:
        return x, y
    if pointer is None:
        return None
    height, width = size
    if is_absolute:
        return pointer[0] if x is None else x, pointer[1] if y is None else y
    across, down = pointer[0] + (x or 0), pointer[1] + (y or 0)
    return max(0, min(across, width - 1)), max(0, min(down, height - 1))


def _is_complete(calls: Sequence[PyautoguiCall]) -> bool:
    """Return whether an action releases all that it presses, and nothing else."""
    down: list[tuple[str, Value]] = []
    for call in calls:
        name = call.function
        if name not in (*_HOLDS, *_HOLDS.values()):
            continue
        pressed = _bind(call).get("key" if name.startswith("key") else "button")
        if name in _HOLDS:
            down.append((_HOLDS[name], pressed))
        elif (name, pressed) in down:
            down.remove((name, pressed))
        else:
            return False
    return not down


def _drop(source: ParsedSource, calls: Sequence[PyautoguiCall], size: Size) -> str:
    """Return code that moves the pointer as the calls do, and presses nothing."""
    edits = [
        TextEdit(*source.span(call.node), _movement(source, call, size))
        for call in calls
        if call.function not in _MOVES and call.function in {**POINTER, **KEYBOARD}
    ]
    return source.edited(edits)


def _movement(source: ParsedSource, call: PyautoguiCall, size: Size) -> str:
    if call.function in KEYBOARD:
        return _NOTHING
    x, y, _ = read_coordinates(source, call, Scaling(size, size))
    if x is None and y is None:
        return _NOTHING
    function = "moveTo" if "x" in POINTER[call.function] else "moveRel"
    return f"pyautogui.{function}({x}, {y})"


def _first_point(source: ParsedSource, calls: Sequence[PyautoguiCall], size: Size) -> Point | None:
    """Return the first point of the screen that the calls name, which is their target."""
    for call in calls:
        if "x" in POINTER.get(call.function, ()):
            x, y, _ = read_coordinates(source, call, Scaling(size, size))
            if x is not None and y is not None:
                return x, y
    return None


def _scaled_shift(percent: Point, point: Point, boxes: BoxArray) -> Point:
    """Return a shift in pixels for one in percent of half the target under a point."""
    x, y = point
    under = [
        (x2 - x1, y2 - y1) for x1, y1, x2, y2 in boxes.tolist() if x1 <= x < x2 and y1 <= y < y2
    ]
    sides = min(under, key=math.prod, default=(UNKNOWN_SIDE, UNKNOWN_SIDE))
    across, down = (
        _away_from_zero(share * side, 200) for share, side in zip(percent, sides, strict=True)
    )
    return across, down


def _away_from_zero(value: int, divisor: int) -> int:
    """Return the quotient, rounded up in its size, so that no shift vanishes."""
    quotient = -(-abs(value) // divisor)
    return -quotient if value < 0 else quotient


def _inside(shift: Point, point: Point, size: Size) -> Point:
    """Return the shift, mirrored where it would lead off the screen and its mirror would not."""
    height, width = size
    across, down = (
        -step if not 0 <= start + step < side and 0 <= start - step < side else step
        for step, start, side in zip(shift, point, (width, height), strict=True)
    )
    return across, down


@dataclass(frozen=True)
class _Shifted(Scaling):
    """The identity of the screen, but absolute points are shifted; those off the screen clamp."""

    shift: Point = (0, 0)

    def x(self, value: float) -> int:
        return self._shifted(super().x(value), 0)

    def y(self, value: float) -> int:
        return self._shifted(super().y(value), 1)

    def _shifted(self, pixel: int, axis: int) -> int:
        side = self.target[1 - axis]
        return max(0, min(pixel + self.shift[axis], side - 1))


def _expect(is_right: object, name: str, value: object, expected: str) -> None:
    """Check a field of a fault.

    Raises:
        ParameterError: the value is not what is expected.
    """
    if not is_right:
        raise ParameterError(f"InputFault: {name} must be {expected}; got {short_repr(value)}")
