"""Dialects that are a table of actions and a syntax, each by the public definition of its model.

| dialect | public definition | a reply | coordinates |
|---|---|---|---|
| `glm` | zai-org/GLM-V, gui-agent | `left_click(start_box='[x,y]')`, JSON | 0..1000 |
| `cogagent` | THUDM/CogAgent, Action_space | `CLICK(box=[[x1,y1,x2,y2]])` | 0..1000 |
| `autoglm` | zai-org/Open-AutoGLM | `do(action="Tap", element=[x,y])` | 0..1000 |
| `showui` | showlab/ShowUI | `{'action': 'CLICK', 'position': [x,y]}` | 0..1 |
| `internvl` | OpenGVLab, grounding | `<box>[[x1,y1,x2,y2]]</box>` | 0..1000 |
| `holo1.5` | hcompai/hai-cookbook | `Click(x, y)`, or JSON | smart-resized pixels |
| `holo2` | hcompai/hai-cookbook | the same | 0..1000 |
| `gemini` | google-gemini/computer-use-preview | function calls | 0..1000 |

The makers of `glm`, `cogagent` and `gemini` say 0..999, and divide by 1000.
"""

import json
import re
from collections.abc import Mapping
from typing import Any, cast

from ...errors import ActionError, short_repr
from ...types import Action
from .action_rules import (
    PIXELS_PER_NOTCH,
    ActionCall,
    Arguments,
    CallReader,
    Meaning,
    Rule,
    coordinates,
    drag_rule,
    end_rule,
    key_rule,
    point_rule,
    press_rule,
    screenshot_rule,
    scroll_meaning,
    scroll_rule,
    status_rule,
    type_rule,
    unsupported_rule,
    wait_rule,
)
from .answer_text import answer_text
from .call_syntax import Rebuild, flat_call_decoder, holds_json, json_calls, python_calls
from .field_checks import action_at, as_fields

_PHONE = "a desktop has no such key or gesture of a phone"
_BROWSER = "it needs a browser that is driven by addresses, not a pointer"
_ELEMENT = ("element_info", "element_type")  # what the model thinks is at the point
_TOOL = "it asks for a tool, not for the pointer or the keyboard"

# --- GLM-4.5V and 4.6V

_GLM: dict[str, Rule] = {
    "left_click": point_rule("click", "start_box"),
    "right_click": point_rule("right_click", "start_box"),
    "middle_click": point_rule("middle_click", "start_box"),
    "hover": point_rule("move", "start_box"),
    "left_double_click": point_rule("double_click", "start_box"),
    "left_drag": drag_rule(["start_box"], ["end_box"]),
    "key": press_rule("keys"),
    "type": type_rule("content"),
    "scroll": scroll_rule("start_box", steps="step"),
    "WAIT": wait_rule(5.0),
    "DONE": end_rule("done"),
    "FAIL": end_rule("fail"),
}
_GLM_PHONE: dict[str, Rule] = {
    "status": status_rule("goal_status", ("complete",), ("infeasible",)),
    "answer": end_rule("done", "text"),
    "click": point_rule("click", "box_2d"),
    "long_press": unsupported_rule(_PHONE, "box_2d"),
    # "this action contains clicking the text field, typing in the text and pressing the enter"
    "input_text": type_rule("text", "box_2d", clear="override", enter=True),
    "keyboard_enter": key_rule("enter"),
    "navigate_home": unsupported_rule(_PHONE),
    "navigate_back": unsupported_rule(_PHONE),
    "swipe": unsupported_rule(_PHONE, "box_2d"),
    "open_app": unsupported_rule(_PHONE),
    "wait": wait_rule(),
}
_GLM_LABEL = re.compile(r"^[ \t]*Action:", re.MULTILINE)
_GLM_MEMORY = re.compile(r"^[ \t]*Memory:", re.MULTILINE)
_GLM_EXAMPLE = "left_click(start_box='[500,500]', element_info='OK')"


def _glm_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "glm")
    start = 0
    for label in _GLM_LABEL.finditer(answer):
        start = label.end()
    memory = _GLM_MEMORY.search(answer, start)
    part = _only(answer, start, memory.start() if memory else len(answer))
    if holds_json(part):
        return json_calls(
            part, "glm", flat_call_decoder("action_type", "glm"), '{"action_type": "click", ...}'
        )
    return python_calls(part, "glm", tuple(_GLM), _GLM_EXAMPLE)


GLM = CallReader("glm", {**_GLM, **_GLM_PHONE}, _glm_calls, remarks=_ELEMENT)

# --- CogAgent


def _gesture(arguments: Arguments) -> list[Meaning]:
    steps = re.findall(r"(KEY_DOWN|KEY_PRESS|KEY_UP)\(key='([^']*)'\)", arguments.text("actions"))
    if not steps:
        raise ActionError("cogagent GESTURE needs actions such as [KEY_PRESS(key='a')]")
    kinds = {"KEY_DOWN": "key_down", "KEY_PRESS": "hotkey", "KEY_UP": "key_up"}
    return [Meaning(Action(kinds[name], keys=(_cog_key(pressed),))) for name, pressed in steps]


def _key_press(arguments: Arguments) -> list[Meaning]:
    return [Meaning(Action("hotkey", keys=(_cog_key(arguments.text("key")),)))]


def _cog_key(name: str) -> str:
    pyautogui_names = {
        "lcontrol": "ctrl",
        "rcontrol": "ctrl",
        "right control": "ctrl",
        "control": "ctrl",
        "lmenu": "alt",
        "rmenu": "alt",
        "lshift": "shift",
        "rshift": "shift",
        "right shift": "shift",
        "right command": "command",
        "return": "enter",
        **{f"{way} arrow": way for way in ("up", "down", "left", "right")},
    }
    return pyautogui_names.get(name.lower(), name.lower())


_COGAGENT: dict[str, Rule] = {
    "CLICK": point_rule("click", "box"),
    "DOUBLE_CLICK": point_rule("double_click", "box"),
    "RIGHT_CLICK": point_rule("right_click", "box"),
    "HOVER": point_rule("move", "box"),
    "TYPE": type_rule("text", "box"),
    **{
        f"SCROLL_{way.upper()}": scroll_rule("box", direction=way, steps="step_count")
        for way in ("up", "down", "left", "right")
    },
    "KEY_PRESS": _key_press,
    "GESTURE": _gesture,
    "LAUNCH": unsupported_rule("a desktop starts programs by its pointer"),
    "QUOTE_TEXT": unsupported_rule(_TOOL, "box"),
    "LLM": unsupported_rule(_TOOL),
    "QUOTE_CLIPBOARD": unsupported_rule(_TOOL),
}
_COG_LABEL = re.compile(r"^[ \t]*Grounded[ _]Operation:", re.MULTILINE | re.IGNORECASE)
_COG_END = re.compile(r"\s*END(?:\(\))?\s*(?:<<[^<>]*>>)?\s*")
_COG_EXAMPLE = "CLICK(box=[[387,248,727,317]], element_info='OK')"


def _cogagent_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "cogagent")
    start = 0
    for label in _COG_LABEL.finditer(answer):
        start = label.end()
    if _COG_END.fullmatch(answer, start):
        return [ActionCall("END", {})]
    return python_calls(_only(answer, start, len(answer)), "cogagent", (*_COGAGENT,), _COG_EXAMPLE)


COGAGENT = CallReader(
    "cogagent", {**_COGAGENT, "END": end_rule("done")}, _cogagent_calls, remarks=_ELEMENT
)

# --- AutoGLM

_AUTOGLM: dict[str, Rule] = {
    "Tap": point_rule("click", "element"),
    "Double Tap": point_rule("double_click", "element"),
    "Long Press": unsupported_rule(_PHONE, "element"),
    "Swipe": drag_rule(["start"], ["end"]),
    "Type": type_rule("text"),
    "Type_Name": type_rule("text"),
    "Wait": wait_rule(1.0, "duration"),
    "finish": end_rule("done", "message"),
    "Take_over": end_rule("fail", "message"),
    "Interact": end_rule("fail"),
    **dict.fromkeys(("Launch", "Back", "Home"), unsupported_rule(_PHONE)),
    **dict.fromkeys(("Note", "Call_API"), unsupported_rule(_TOOL)),
}
_ANSWER = re.compile(r"<answer>")
_AUTOGLM_EXAMPLE = 'do(action="Tap", element=[500,500])'


def _autoglm_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "autoglm")
    start = 0
    for tag in _ANSWER.finditer(answer):
        start = tag.end()
    calls = python_calls(
        _only(answer, start, len(answer)), "autoglm", ("do", "finish"), _AUTOGLM_EXAMPLE
    )
    return [_autoglm_call(call) for call in calls]


def _autoglm_call(call: ActionCall) -> ActionCall:
    if call.name == "finish":
        return call
    arguments = dict(call.arguments)
    return ActionCall(arguments.pop("action", None), arguments, call.start, call.end)


AUTOGLM = CallReader("autoglm", _AUTOGLM, _autoglm_calls, notes=("message",))

# --- ShowUI


def _showui_scroll(arguments: Arguments) -> list[Meaning]:
    return [
        scroll_meaning(
            arguments.direction("value").lower(), 5, arguments.optional_point("position")
        )
    ]


def _showui_type(arguments: Arguments) -> list[Meaning]:
    return type_rule("value", "position")(arguments)


def _both_ends(arguments: Arguments) -> list[Meaning]:
    pair: Any = arguments.value("position")
    corners = cast("list[Any]", pair) if isinstance(pair, list | tuple) else []
    flat = [number for corner in corners for number in coordinates(corner, arguments.label)]
    if len(corners) != 2 or len(flat) != 4:
        value_text = short_repr(cast("object", pair))
        raise ActionError(
            f"{arguments.label} needs a position [[x1, y1], [x2, y2]], got {value_text}"
        )
    inner = Arguments(arguments.label, {"start": flat[:2], "end": flat[2:]}, arguments.scaling)
    return drag_rule(["start"], ["end"])(inner)


_SHOWUI: dict[str, Rule] = {
    "CLICK": point_rule("click", "position"),
    "TAP": point_rule("click", "position"),
    "HOVER": point_rule("move", "position"),
    "INPUT": _showui_type,
    "TYPE": _showui_type,
    "SELECT": unsupported_rule("what a list offers is chosen by clicks", "position"),
    "SELECT_TEXT": _both_ends,
    "SWIPE": _both_ends,
    "SCROLL": _showui_scroll,
    "ENTER": key_rule("enter"),
    "COPY": key_rule("ctrl", "c"),
    "ANSWER": end_rule("done", "value"),
}
_SHOWUI_EXAMPLE = "{'action': 'CLICK', 'value': None, 'position': [0.5, 0.5]}"


def _showui_read(value: Any) -> tuple[object, Mapping[str, Any], Rebuild]:
    if not isinstance(value, list | tuple):
        return flat_call_decoder("action", "showui")(value)
    # "where you want to click": [0.73, 0.21]
    return "CLICK", {"position": list(cast("list[Any]", value))}, _unchanged


def _showui_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "showui")
    return json_calls(answer, "showui", _showui_read, _SHOWUI_EXAMPLE, python=True)


SHOWUI = CallReader("showui", _SHOWUI, _showui_calls, notes=("value", "position"))

# --- InternVL

_BOX = re.compile(r"<box>([^<]*)</box>")


def _internvl_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "internvl")
    boxes = list(_BOX.finditer(answer))
    if len(boxes) != 1 or answer.count("<box>") != 1:
        raise ActionError(
            f"internvl: a click is one box, and {short_repr(answer.strip())} has {len(boxes)};"
            " write <ref>OK</ref><box>[[100,200,300,400]]</box>"
        )
    return [ActionCall("click", {"box": boxes[0][1]}, *boxes[0].span(1))]


INTERNVL = CallReader("internvl", {"click": point_rule("click", "box")}, _internvl_calls)

# --- Holo

_HOLO: dict[str, Rule] = {
    **dict.fromkeys(("click_element", "click_absolute", "click"), point_rule("click", "x", "y")),
    "write_element": type_rule("content", "x", "y"),
    # "then press Enter"
    "write_element_abs": type_rule("content", "x", "y", enter=True),
    "scroll": scroll_rule(),
    "go_back": key_rule("alt", "left"),
    "refresh": key_rule("f5"),
    "wait": wait_rule(2.0, "seconds"),
    "answer": end_rule("done", "content"),
    "goto": unsupported_rule(_BROWSER),
    "restart": unsupported_rule(_BROWSER),
}
_HOLO_CLICK = re.compile(r"\s*Click\(\s*(-?\d+)\s*,\s*(-?\d+)\s*\)\s*\Z")
_HOLO_EXAMPLE = '{"action": "click_element", "element": "OK", "x": 100, "y": 200}'


def _holo_read(value: Any) -> tuple[object, Mapping[str, Any], Rebuild]:
    fields = as_fields(value, "holo")
    inner = fields.get("action")
    if isinstance(inner, Mapping):  # beside the note and the thought of a step
        name, arguments, rebuild_inner = flat_call_decoder("action", "holo")(inner)

        def rebuild(inner_arguments: dict[str, Any]) -> dict[str, Any]:
            return {**fields, "action": rebuild_inner(inner_arguments)}

        return name, arguments, rebuild
    if set(fields) == {"x", "y"}:
        return "click", fields, _unchanged
    return flat_call_decoder("action", "holo")(value)


def _holo_calls(reply: object) -> list[ActionCall]:
    answer = answer_text(reply, "holo")
    click = _HOLO_CLICK.match(answer)
    if click is None:
        return json_calls(answer, "holo", _holo_read, _HOLO_EXAMPLE)
    arguments = {"x": int(click[1]), "y": int(click[2])}
    start, end = click.span(1)[0], click.span(2)[1]
    between = answer[click.end(1) : click.start(2)]
    return [ActionCall("click", arguments, start, end, lambda a: f"{a['x']}{between}{a['y']}")]


HOLO = CallReader("holo", _HOLO, _holo_calls, notes=("element",))

# --- Gemini

_XY = ("x", "y")


def _gemini_scroll(arguments: Arguments) -> list[Meaning]:
    way = arguments.direction()
    # 0..1000 of the side of the screen
    notches = arguments.distance("magnitude", way, 800) / PIXELS_PER_NOTCH
    return [scroll_meaning(way, notches, arguments.point(*_XY))]


def _gemini_drag(arguments: Arguments) -> list[Meaning]:
    starts = [arguments.optional_point(*names) for names in (_XY, ("start_x", "start_y"))]
    ends = [
        arguments.optional_point(*names)
        for names in (("destination_x", "destination_y"), ("end_x", "end_y"))
    ]
    if starts.count(None) != 1 or ends.count(None) != 1:
        raise ActionError(
            f"{arguments.label} needs x, y, destination_x and destination_y (or start_x, start_y,"
            " end_x and end_y)"
        )
    start = starts[0] or starts[1]
    x2, y2 = cast("tuple[int, int]", ends[0] or ends[1])
    return [Meaning(action_at("drag", start, x2=x2, y2=y2))]


def _scroll_document(arguments: Arguments) -> list[Meaning]:
    way = arguments.direction()
    if way in ("up", "down"):
        return [Meaning(Action("hotkey", keys=(f"page{way}",)))]
    return [Meaning(Action("other"), refusal="how far the document goes sideways is not defined")]


_GEMINI: dict[str, Rule] = {
    **dict.fromkeys(("click_at", "click"), point_rule("click", *_XY)),
    "double_click": point_rule("double_click", *_XY),
    "triple_click": point_rule("triple_click", *_XY),
    "middle_click": point_rule("middle_click", *_XY),
    "right_click": point_rule("right_click", *_XY),
    **dict.fromkeys(("hover_at", "move"), point_rule("move", *_XY)),
    "mouse_down": point_rule("mouse_down", *_XY),
    "mouse_up": point_rule("mouse_up", *_XY),
    "type_text_at": type_rule(
        "text",
        *_XY,
        clear="clear_before_typing",
        enter="press_enter",
        defaults={"clear_before_typing": True, "press_enter": False},
    ),
    "type": type_rule("text", enter="press_enter"),
    **dict.fromkeys(("scroll_at", "scroll"), _gemini_scroll),
    "scroll_document": _scroll_document,
    "drag_and_drop": _gemini_drag,
    **dict.fromkeys(("key_combination", "hotkey"), press_rule("keys")),
    "press_key": press_rule("key"),
    "key_down": press_rule("key", "key_down"),
    "key_up": press_rule("key", "key_up"),
    "wait_5_seconds": wait_rule(5.0),
    "wait": wait_rule(1.0, "seconds"),
    "take_screenshot": screenshot_rule(),
    "go_back": key_rule("alt", "left"),
    "go_forward": key_rule("alt", "right"),
    "long_press": unsupported_rule(_PHONE, *_XY),
    **dict.fromkeys(("navigate", "search", "open_web_browser"), unsupported_rule(_BROWSER)),
}
_GEMINI_EXAMPLE = '{"name": "click_at", "args": {"x": 500, "y": 500}}'
_CALL_FIELDS = ("function_call", "functionCall")


def _gemini_read(value: Any) -> tuple[object, Mapping[str, Any], Rebuild]:
    fields = as_fields(value, "gemini")
    for wrapper in (*_CALL_FIELDS, "function"):
        if isinstance(fields.get(wrapper), Mapping):
            fields = as_fields(fields[wrapper], "gemini")
            break
    arguments: object = fields.get("args", fields.get("arguments")) or {}
    if isinstance(arguments, str):
        try:
            arguments = json.loads(arguments)
        except (ValueError, RecursionError) as error:
            raise ActionError(f"gemini: the arguments are not JSON ({error})") from None
    return fields.get("name"), as_fields(arguments, "gemini"), _unchanged


def _gemini_calls(reply: object) -> list[ActionCall]:
    if isinstance(reply, Mapping):
        name, arguments, _ = _gemini_read(reply)
        return [ActionCall(name, arguments)]
    if isinstance(reply, list) and reply:
        return [call for part in cast("list[Any]", reply) for call in _gemini_calls(part)]
    return json_calls(
        answer_text(cast("object", reply), "gemini"), "gemini", _gemini_read, _GEMINI_EXAMPLE
    )


GEMINI = CallReader("gemini", _GEMINI, _gemini_calls, notes=("intent", "safety_decision"))


def _unchanged(arguments: dict[str, Any]) -> dict[str, Any]:
    return arguments


def _only(text: str, start: int, end: int) -> str:
    """Return text of the same length with everything blank outside a part."""
    return " " * start + text[start:end] + " " * (len(text) - end)
