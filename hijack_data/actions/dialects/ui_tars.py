r"""The action text of UI-TARS, such as `Action: click(start_box='...')` after a `Thought:`.

A reply has one action or several.

Version 1.0 gives boxes in 0..1000 of the picture, whatever its size; version 1.5 gives pixels of
the smart-resized picture (`CoordMap.model`), with or without box tokens. A box of four numbers aims
at its centre. The signatures are those of the paper's appendix, "Action Space".
"""

import re
from collections.abc import Collection, Iterator
from typing import NamedTuple

from ...errors import ActionError, ParameterTypeError, shown
from ...types import Action
from ..program.source import TextEdit, spliced
from ..scaling import Scaling
from .fields import at, key_names, number
from .ui_tars_text import Call, sections
from .unmapped import check_fields

THOUSAND = (1000, 1000)

_CLICKS = {"click": "click", "left_double": "double_click", "right_single": "right_click"}
WAIT_SECONDS = 5.0  # the prompt says that wait() sleeps for 5 s
# The action has no amount; UI-TARS's own code scrolls by 5.
_NOTCHES = {"up": 5, "down": -5, "left": None, "right": None}

_SIDEWAYS: dict[str, float] = {"left": -5, "right": 5}

_BOXES = ("start_box", "end_box")
_SCROLL = (*_BOXES, "direction")
_ARGUMENT = re.compile(r"""\s*(\w+)\s*=\s*(?:'(?P<a>[^']*)'|"(?P<b>[^"]*)")\s*(?:,|\Z)""")
_CONTENT = re.compile(r"""\s*(?:content\s*=\s*)?(['"])(.*)\1\s*""", re.DOTALL)
_PLACED = re.compile(r"\b(?:start_|end_)?(?:box|point|coordinate)s?\s*=")
_AFTER_TEXT = re.compile(r"""(?<!\\)['"]\s*,\s*(?:start_|end_)(?:box|point)\s*=\s*['"]""")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_TOKENS = ("<|box_start|>", "<|box_end|>")
_SHAPES = ("N,N", "(N,N)", "[N,N]", "N,N,N,N", "(N,N,N,N)", "[N,N,N,N]")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "'": "'", '"': '"', "\\": "\\"}


class _Argument(NamedTuple):
    value: str
    start: int  # start and end in the whole text


def map_ui_tars(text: object, scaling: Scaling) -> str:
    """Return 1.5 text with the numbers of its boxes scaled, and everything else as it is.

    The boxes of every `Action:` are scaled, although only the last one is read. Raises
    `ActionError` for an unknown action, a box that is missing, malformed or given twice, and text
    that may hide a box.
    """
    checked = _text(text)
    edits: list[TextEdit] = []
    for section in sections(checked):
        for call in section:
            edits += _edits(call, scaling)
    return spliced(checked, edits)


def check_ui_tars(text: object) -> str:
    """Return 1.0 text as it is: its 0..1000 do not depend on the size of the picture.

    It raises the same errors as `map_ui_tars`.
    """
    thousandths = Scaling.fractions(THOUSAND, 1000)
    map_ui_tars(text, thousandths)
    parse_ui_tars(text, thousandths)
    return _text(text)


def parse_ui_tars(text: object, scaling: Scaling) -> list[Action]:
    """Read the actions of a reply, in order.

    `call_user` is `"fail"`, `finished` is `"done"` with its content as text.

    If there are several `Action:`, the last one counts. Raises `ActionError` for text without an
    action, an unknown action, or a box that is missing, malformed or given twice.
    """
    last = sections(_text(text))[-1]
    return [_action(call, scaling) for call in last]


def sideways_of_ui_tars(text: object) -> list[float | None]:
    """Return for each action the notches that it scrolls to the right, or `None`."""
    found: list[float | None] = []
    for call in sections(_text(text))[-1]:
        direction = _direction(call) if call.name == "scroll" else ""
        found.append(_SIDEWAYS.get(direction))
    return found


def _text(text: object) -> str:
    if not isinstance(text, str):
        raise ParameterTypeError(f"a UI-TARS action must be a string, got {shown(text)}")
    return text


def _arguments(call: Call, known: Collection[str]) -> dict[str, _Argument]:
    found: dict[str, _Argument] = {}
    position = 0
    while call.inside[position:].strip():
        match = _ARGUMENT.match(call.inside, position)
        if match is None:
            rest = shown(call.inside[position:])
            raise ActionError(f"{call.name}: cannot read {rest}; write name='value'")
        name = match[1]
        if name in found:
            raise ActionError(f"{call.name}: {name} is given twice; give one action for each point")
        group = "a" if match["a"] is not None else "b"
        found[name] = _Argument(match[group], call.start + match.start(group))
        position = match.end()
    given = {name: argument.value for name, argument in found.items()}
    check_fields(given, known, f"UI-TARS {call.name}")
    return found


def _numbers(call: Call, argument: _Argument, name: str) -> list[re.Match[str]]:
    bare = argument.value
    for token in _TOKENS:
        bare = bare.replace(token, " ")
    shape = "".join(_NUMBER.sub("N", bare).split())
    if shape not in _SHAPES:
        raise ActionError(
            f"{call.name} {name} must be (x,y) or [x1,y1,x2,y2], got {shown(argument.value)}"
        )
    return list(_NUMBER.finditer(argument.value))


def _edits(call: Call, scaling: Scaling) -> Iterator[TextEdit]:
    for name, argument in _boxes(call).items():
        found = _numbers(call, argument, name)
        given = [float(match[0]) for match in found]
        scaling.check_point(*given)
        for index, match in enumerate(found):
            scale = scaling.y if index % 2 else scaling.x
            value = number(given[index], f"{call.name} {name}")
            start = argument.start + match.start()
            end = argument.start + match.end()
            yield TextEdit(start, end, str(scale(value)))


def _boxes(call: Call) -> dict[str, _Argument]:
    # An error when one that the action needs is missing.
    if call.name not in (*_CLICKS, "drag", "scroll"):
        _check_boxless(call)
        return {}
    known = _SCROLL if call.name == "scroll" else _BOXES
    given = _arguments(call, known)
    wanted = _BOXES if call.name == "drag" else _BOXES[:1]
    for name in wanted:
        if name not in given and call.name != "scroll":
            example = f"{call.name}({name}='(100,200)')"
            raise ActionError(f"{call.name} needs {name}; write {example}")
    boxes: dict[str, _Argument] = {}
    for name in _BOXES:
        box = given.get(name)
        if box is not None and (name in wanted or box.value.strip()):
            boxes[name] = box
    return boxes


def _check_boxless(call: Call) -> None:
    # Refuses an action that has no box, but is given one.
    hidden = _PLACED
    if call.name in ("type", "finished") and _CONTENT.fullmatch(call.inside):
        hidden = _AFTER_TEXT
    if hidden.search(call.inside):
        raise ActionError(f"{call.name} takes no point, got {shown(call.inside)}; leave it out")


def _centre(call: Call, scaling: Scaling) -> dict[str, tuple[int, int]]:
    centres: dict[str, tuple[int, int]] = {}
    for name, argument in _boxes(call).items():
        what = f"{call.name} {name}"
        values = [number(float(match[0]), what) for match in _numbers(call, argument, name)]
        across = values[::2]
        down = values[1::2]
        centres[name] = scaling.point(sum(across) / len(across), sum(down) / len(down))
    return centres


def _action(call: Call, scaling: Scaling) -> Action:
    centres = _centre(call, scaling)
    place = centres.get("start_box")
    match call.name:
        case "drag":
            x2, y2 = centres["end_box"]
            return at("drag", place, x2=x2, y2=y2)
        case "scroll":
            return _scroll(call, place)
        case "hotkey":
            key = _arguments(call, ("key",)).get("key", _Argument("", 0)).value
            return Action("hotkey", keys=key_names(key, "hotkey key", "+"))
        case "type":
            return Action("type", text=_content(call))
        case "wait":
            return Action("wait", amount=WAIT_SECONDS)
        case "finished":
            return Action("done", text=_content(call) if call.inside.strip() else None)
        case "call_user":
            return Action("fail")
        case _:
            return at(_CLICKS[call.name], place)


def _scroll(call: Call, place: tuple[int, int] | None) -> Action:
    notches = _NOTCHES[_direction(call)]
    if notches is None:
        return at("other", place)
    return at("scroll", place, amount=notches)


def _direction(call: Call) -> str:
    given = _arguments(call, _SCROLL)
    direction = given.get("direction", _Argument("", 0)).value.strip().lower()
    if direction not in _NOTCHES:
        raise ActionError(
            f"scroll direction must be up, down, left or right, got {direction!r:.60}"
        )
    return direction


def _content(call: Call) -> str:
    match = _CONTENT.fullmatch(call.inside)
    if match is None:
        raise ActionError(
            f"{call.name} needs a quoted text, got {shown(call.inside)}; write content='...'"
        )
    return re.sub(r"\\(.)", lambda m: _ESCAPES.get(m[1], m[0]), match[2], flags=re.DOTALL)
