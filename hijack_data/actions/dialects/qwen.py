r"""The tool calls of Qwen's vision models, which are JSON in text.

They look like `<tool_call>{"name": "computer_use", ...}</tool_call>`.

The arguments of `computer_use` and `mobile_use` hold an `action` and its fields; a reply may hold
several calls, and text around them. Qwen2.5-VL points at pixels of the smart-resized picture
(`CoordMap.model`), Qwen3-VL at 0..1000 of the picture.
"""

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, cast

from ...errors import ActionError, ParameterTypeError
from ...types import Action
from ..program.source import TextEdit, spliced
from ..scaling import Scaling
from .fields import as_fields, at, combination, number, point, shown, text, unknown
from .tool_calls import PIXELS_PER_NOTCH
from .unmapped import check_fields

TOOLS = ("computer_use", "mobile_use")
NAMES = (
    "key",
    "type",
    "mouse_move",
    "click",
    "left_click",
    "left_click_drag",
    "right_click",
    "middle_click",
    "double_click",
    "triple_click",
    "scroll",
    "hscroll",
    "wait",
    "terminate",
    "answer",
    "long_press",
    "swipe",
    "system_button",
    "open",
)
_POINTS = ("coordinate", "coordinate2", "start_coordinate")
_FIELDS = ("action", "keys", "text", "pixels", "time", "status", "button", "description", *_POINTS)
_CLICKS = {
    "click": "click",
    "left_click": "click",
    "right_click": "right_click",
    "middle_click": "middle_click",
    "double_click": "double_click",
    "triple_click": "triple_click",
    "mouse_move": "move",
    "long_press": "other",
}
_OTHERS = ("hscroll", "system_button", "open")
_NEED_POINT = ("mouse_move", "left_click_drag", "long_press", "swipe", "click")
_BLOCK = re.compile(r"<tool_call>\s*(\{.*?\})\s*(?:</tool_call>|\Z)", re.DOTALL)


class _Call(NamedTuple):
    """One call: the parsed JSON and where it stands in the text."""

    data: dict[str, Any]
    start: int
    end: int


def tool_call_text(name: str, arguments: object) -> str:
    """Return a call as the models write it."""
    data = json.dumps({"name": name, "arguments": arguments}, ensure_ascii=False)
    return f"<tool_call>\n{data}\n</tool_call>"


def holds_tool_call(reply: str) -> bool:
    """Return whether text holds a call of one of `TOOLS`, readable or not."""
    return "<tool_call>" in reply and any(tool in reply for tool in TOOLS)


def map_qwen(reply: object, scaling: Scaling) -> str:
    """Return the text with the coordinates of its calls scaled; the text around the calls stays.

    Raises `ActionError` for text without a call, an unknown tool or action, a missing or malformed
    point, and unknown fields that may hold coordinates.
    """
    checked = _text(reply)
    edits: list[TextEdit] = []
    for call in _calls(checked):
        given, _ = _arguments(call)
        for key in _POINTS:
            if given.get(key) is not None:
                given[key] = list(scaling.point(*point(given[key], key)))
        mapped = json.dumps({**call.data, "arguments": given}, ensure_ascii=False)
        edits.append(TextEdit(call.start, call.end, mapped))
    return spliced(checked, edits)


def check_qwen(reply: object) -> str:
    """Return text with coordinates in 0..1000 unchanged, checked as by `map_qwen`."""
    parse_qwen(reply, Scaling.fractions((1000, 1000), 1000))
    return _text(reply)


def parse_qwen(reply: object, scaling: Scaling) -> list[Action]:
    """Read the calls of a reply, in order. Raises `ActionError` as `map_qwen`.

    `answer` and `terminate` become `"done"` or `"fail"`; a drag without `start_coordinate` starts
    at the pointer. `PIXELS_PER_NOTCH` of the `pixels` that `scroll` counts make one notch.
    """
    return [_action(*_arguments(call), scaling) for call in _calls(_text(reply))]


def sideways_of_qwen(reply: object) -> list[float | None]:
    """Return for each call the notches that it scrolls to the right, or `None`.

    The tool does not define which direction of `hscroll` is positive; here it is right, as in
    pyautogui. Raises `ActionError` as `map_qwen`.
    """
    found: list[float | None] = []
    for call in _calls(_text(reply)):
        given, name = _arguments(call)
        if name == "hscroll":
            found.append(number(given.get("pixels"), "pixels") / PIXELS_PER_NOTCH)
        else:
            found.append(None)
    return found


def _text(reply: object) -> str:
    if not isinstance(reply, str):
        raise ParameterTypeError(f"a reply with tool calls must be a string, got {shown(reply)}")
    return reply


def _calls(reply: str) -> Iterator[_Call]:
    blocks = list(_BLOCK.finditer(reply))
    if not blocks or len(blocks) != reply.count("<tool_call>"):
        raise ActionError(
            f"no whole tool call in {shown(reply)}; write "
            '<tool_call>{"name": "computer_use", "arguments": {...}}</tool_call>'
        )
    for block in blocks:
        try:
            data: object = json.loads(block[1])
        except (ValueError, RecursionError) as error:
            raise ActionError(f"the tool call is not JSON ({error})") from None
        yield _Call(as_fields(data, "tool call"), *block.span(1))


def _arguments(call: _Call) -> tuple[dict[str, Any], str]:
    """Return a copy of the arguments, and the name of the action."""
    if call.data.get("name") not in TOOLS:
        unknown("tool_call", call.data.get("name"), TOOLS)
    given = as_fields(call.data.get("arguments"), "tool call")
    name = given.get("action")
    if name not in NAMES:
        unknown(str(call.data["name"]), name, NAMES)
    check_fields(given, _FIELDS, f"tool call {name}")
    if name in _NEED_POINT and given.get("coordinate") is None:
        raise ActionError(f"{name} needs a coordinate; give [x, y]")
    return given, cast("str", name)


def _action(given: dict[str, Any], name: str, scaling: Scaling) -> Action:
    places = {
        key: scaling.point(*point(given[key], f"{name} {key}"))
        for key in _POINTS
        if given.get(key) is not None
    }
    place = places.get("coordinate")
    if name in _CLICKS:
        return at(_CLICKS[name], place)
    if name in _OTHERS:
        return at("other", place)
    match name:
        case "left_click_drag":
            return _drag(places.get("start_coordinate"), place)
        case "swipe":
            return _drag(place, places.get("coordinate2"))
        case "scroll":
            return at(
                "scroll", place, amount=number(given.get("pixels"), "pixels") / PIXELS_PER_NOTCH
            )
        case "type":
            return Action("type", text=text(given.get("text"), "type text"))
        case "key":
            keys = given.get("text") if given.get("keys") is None else given["keys"]
            return Action("hotkey", keys=combination(keys, "keys", "+"))
        case "wait":
            return Action("wait", amount=number(given.get("time", 0), "wait time"))
        case "answer":
            return Action("done", text=text(given.get("text"), "answer text"))
        case _:
            return Action("fail" if given.get("status") == "failure" else "done")


def _drag(start: tuple[int, int] | None, end: tuple[int, int] | None) -> Action:
    if end is None:
        raise ActionError("swipe needs a coordinate2; give [x, y]")
    return at("drag", start, x2=end[0], y2=end[1])
