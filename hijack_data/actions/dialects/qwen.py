r"""The tool calls of Qwen's vision models and their kin: JSON or XML in text.

They look like `<tool_call>{"name": "computer_use", "arguments": {...}}</tool_call>`, like
`<tool_call><function=computer_use><parameter=action>left_click</parameter>...</tool_call>`
(Qwen3.5), or are the JSON alone, with its name or only the arguments.

The arguments of `computer_use` and `mobile_use` hold an `action` and its fields; a reply may hold
several calls, and text around them. Qwen2.5-VL points at pixels of the smart-resized picture
(`CoordMap.model`), Qwen3-VL, GUI-Owl 1.5 (Mobile-Agent) at 0..1000 of the picture, MAI-UI at
0..999. A coordinate of -1, -1 says that there is no such element, and does nothing.
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any, cast

from ...errors import ActionError
from ...types import Action
from .action_rules import (
    PIXELS_PER_NOTCH,
    ActionCall,
    Arguments,
    CallReader,
    Meaning,
    Rule,
    end_rule,
    point_rule,
    scroll_meaning,
    status_rule,
    unsupported_rule,
)
from .answer_text import answer_text
from .call_syntax import (
    TOOL_CALL,
    Rebuild,
    flat_call_decoder,
    holds_json,
    json_calls,
    rewriter,
    tool_call_blocks,
    xml_functions,
)
from .field_checks import action_at, as_fields, refuse_unknown_action, short_repr

TOOLS = ("computer_use", "mobile_use")
EXAMPLE = (
    '<tool_call>{"name": "computer_use", "arguments": {"action": "left_click", "coordinate":'
    " [100, 200]}}</tool_call>"
)
_PHONE = "a desktop has no such key or gesture of a phone"


def _drag(arguments: Arguments) -> list[Meaning]:
    # MAI-UI's drag names its end, and GUI-Owl's its start as coordinate1.
    starts = [arguments.optional_point(name) for name in ("start_coordinate", "coordinate1")]
    ends = [
        arguments.optional_point(name) for name in ("coordinate", "end_coordinate", "coordinate2")
    ]
    known_ends = [end for end in ends if end is not None]
    if len(known_ends) != 1 or None not in starts:
        raise ActionError(f"{arguments.label} needs a coordinate to drag to; give one [x, y]")
    start = next((start for start in starts if start is not None), None)
    return [Meaning(action_at("drag", start, x2=known_ends[0][0], y2=known_ends[0][1]))]


def _swipe(arguments: Arguments) -> list[Meaning]:
    if arguments.value("direction") is not None and arguments.value("coordinate2") is None:
        # How far MAI-UI's swipe goes is up to the phone.
        point = arguments.optional_point("coordinate")
        arguments.direction()
        return [Meaning(action_at("other", point), refusal=_PHONE)]
    x2, y2 = arguments.point("coordinate2")
    return [Meaning(action_at("drag", arguments.point("coordinate"), x2=x2, y2=y2))]


def _scroll(arguments: Arguments) -> list[Meaning]:
    point = arguments.optional_point("coordinate")
    return [
        Meaning(action_at("scroll", point, amount=arguments.number("pixels") / PIXELS_PER_NOTCH))
    ]


def _hscroll(arguments: Arguments) -> list[Meaning]:
    # The tool does not define which direction is positive; here it is right, as in pyautogui.
    notches = arguments.number("pixels") / PIXELS_PER_NOTCH
    return [scroll_meaning("right", notches, arguments.optional_point("coordinate"))]


def _key(arguments: Arguments) -> list[Meaning]:
    name = "text" if arguments.value("keys") is None else "keys"
    return [Meaning(Action("hotkey", keys=arguments.keys(name)))]


def _wait(arguments: Arguments) -> list[Meaning]:
    return [Meaning(Action("wait", amount=arguments.number("time", 0)))]


def _type(arguments: Arguments) -> list[Meaning]:
    return [Meaning(Action("type", text=arguments.text("text")))]


def _answer(arguments: Arguments) -> list[Meaning]:
    return [Meaning(Action("done", text=arguments.text("text")))]


_COMPUTER: dict[str, Rule] = {
    "key": _key,
    "hotkey": _key,
    "type": _type,
    "mouse_move": point_rule("move", "coordinate"),
    "click": point_rule("click", "coordinate"),
    "left_click": point_rule("click", "coordinate", optional=True),
    "left_click_drag": _drag,
    "drag": _drag,
    "right_click": point_rule("right_click", "coordinate", optional=True),
    "middle_click": point_rule("middle_click", "coordinate", optional=True),
    "double_click": point_rule("double_click", "coordinate", optional=True),
    "triple_click": point_rule("triple_click", "coordinate", optional=True),
    "scroll": _scroll,
    "hscroll": _hscroll,
    "wait": _wait,
    "terminate": status_rule("status", ("success",), ("failure", "fail")),
    "answer": _answer,
    "interact": end_rule("fail"),
    "call_user": end_rule("fail"),
    "ask_user": end_rule("fail"),
    "long_press": unsupported_rule(_PHONE, "coordinate"),
    "swipe": _swipe,
    "system_button": unsupported_rule(_PHONE),
    "open": unsupported_rule(_PHONE),
}
_NOTES = ("action", "keys", "text", "pixels", "time", "status", "button", "description")


def tool_call_text(name: str, arguments: object) -> str:
    """Return a call as the models write it."""
    data = json.dumps({"name": name, "arguments": arguments}, ensure_ascii=False)
    return f"<tool_call>\n{data}\n</tool_call>"


def holds_tool_call(reply: str) -> bool:
    """Return whether text holds a call of one of `TOOLS`, readable or not."""
    return "<tool_call>" in reply and any(tool in reply for tool in TOOLS)


def _calls(reply: object) -> list[ActionCall]:
    if isinstance(reply, Mapping):
        name, arguments, rebuild = _read(cast("Mapping[str, Any]", reply))
        return [ActionCall(name, arguments, write=rebuild)]
    answer = answer_text(reply, "tool call")
    if TOOL_CALL.search(answer) is None:
        if holds_json(answer):
            return json_calls(answer, "tool call", _read, EXAMPLE)
        raise ActionError(f"no whole tool call in {short_repr(answer.strip())}; write {EXAMPLE}")
    return [
        call
        for text, start, _ in tool_call_blocks(answer, EXAMPLE)
        for call in _block_calls(text, start)
    ]


def _block_calls(text: str, start: int) -> Iterator[ActionCall]:
    if text.lstrip().startswith("<function"):
        for tool, arguments, begin, end in xml_functions(text, start):
            if tool not in TOOLS:
                refuse_unknown_action("tool_call", tool, TOOLS)
            values = {name: argument.value for name, argument in arguments.items()}
            rewrite = {name: part for name, part in arguments.items() if name != "action"}
            action = values.pop("action", None)
            write = rewriter(text[begin - start : end - start], rewrite, begin)
            yield ActionCall(action, values, begin, end, write)
        return
    if not text.strip().startswith("{") or not text.rstrip().endswith("}"):
        raise ActionError(f"no whole tool call in {short_repr(text.strip())}; write {EXAMPLE}")
    try:
        for call in json_calls(text, "tool call", _read, EXAMPLE):
            yield ActionCall(
                call.name, call.arguments, start + call.start, start + call.end, call.write
            )
    except ActionError as error:
        if "is no action (" not in str(error):
            raise
        raise ActionError(f"the tool call is not JSON: {error}") from None


def _read(value: Any) -> tuple[object, Mapping[str, Any], Rebuild]:
    """Return the action of a call, its fields, and a function that writes it with other fields.

    Raises:
        ActionError: the call is of another tool, or its arguments are not JSON.
    """
    call = as_fields(value, "tool call")
    if "arguments" not in call and "action" in call:
        return flat_call_decoder("action", "tool call")(call)
    if call.get("name") not in TOOLS:
        refuse_unknown_action("tool_call", call.get("name"), TOOLS)
    raw_arguments: object = call.get("arguments")
    as_text = isinstance(raw_arguments, str)
    if as_text:  # as the API of chat completions writes it
        try:
            raw_arguments = json.loads(raw_arguments)
        except (ValueError, RecursionError) as error:
            raise ActionError(f"the arguments of the tool call are not JSON ({error})") from None
    arguments = as_fields(raw_arguments, "tool call")
    action = arguments.pop("action", None)

    def rebuild(fields: dict[str, Any]) -> dict[str, Any]:
        rebuilt: Any = {"action": action, **fields}
        if as_text:
            rebuilt = json.dumps(rebuilt, ensure_ascii=False)
        return {**call, "arguments": rebuilt}

    return action, arguments, rebuild


QWEN = CallReader("tool call", _COMPUTER, _calls, notes=_NOTES, remarks=("action", "description"))
