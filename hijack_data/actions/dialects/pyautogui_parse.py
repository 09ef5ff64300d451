"""Parse pyautogui code into the one `Action` of the library."""

from collections.abc import Iterable, Mapping

from ...errors import ParameterError
from ...types import Action, Size, as_size
from ..call_coordinates import read_coordinates
from ..pyautogui_functions import (
    AGENTNET_TRIPLE,
    KEYBOARD,
    POINTER,
    RECORDED_FUNCTIONS,
    SPECIAL_WORDS,
)
from ..pyautogui_grammar import Argument, PyautoguiCall, Value, read_calls
from ..python_source import ParsedSource, refuse_deep_nesting
from ..scaling import Scaling
from .combine_calls import CLIPBOARD, DRAG_BY, MOVE_BY, combine
from .field_checks import click_type
from .pyautogui_code import check_text

_PLAIN = {
    "moveTo": "move",
    "leftClick": "click",
    "rightClick": "right_click",
    "middleClick": "middle_click",
    "moveRel": MOVE_BY,
    "move": MOVE_BY,
    "hscroll": "other",
}
_CLICKS = {"click": 1, "doubleClick": 2, "tripleClick": 3, AGENTNET_TRIPLE: 3}
_HOLDS = {"mouseDown": "mouse_down", "mouseUp": "mouse_up"}
_STATUS = {"success": "done", "failure": "fail"}


def parse_pyautogui(code: str, size: Size | None, normalized: bool = False) -> Action:
    """Parse pyautogui code into one `Action`.

    Calls that belong together are one action: `moveTo` and `dragTo` a drag, `moveTo` and `scroll` a
    scroll at a point, `write` and `press('enter')` a text that ends in a newline, keys held around
    a click a click with keys. Code with more than one action becomes `"other"`, at the first point
    in the code. A drag whose start is not in the code has no `x, y`.

    Args:
        code: pyautogui code, AgentNet's `computer.terminate(...)` and the like, or WAIT, FAIL or
            DONE.
        size: (height, width) of the screenshot: points are clamped to it, or not clamped if it is
            `None`.
        normalized: coordinates are fractions 0..1 of `size` (AgentNet).

    Raises:
        ActionError: the code is beyond the grammar (`pyautogui_grammar`), or a coordinate is not a
            number.
        ParameterError: the coordinates are `normalized`, and `size` is missing.
    """
    check_text(code)
    if normalized and size is None:
        raise ParameterError(
            "normalized coordinates need the size of the screenshot; give size=(height, width)"
        )
    checked = None if size is None else as_size(size)
    word = code.strip()
    if word in SPECIAL_WORDS:
        return Action(SPECIAL_WORDS[word])
    scaling = Scaling.fractions(checked) if normalized and checked else Scaling.pixels(checked)
    source = ParsedSource(code)
    calls = [_call_action(source, call, scaling) for call in read_calls(source, RECORDED_FUNCTIONS)]
    with refuse_deep_nesting():
        return combine(calls, checked)


def _call_action(source: ParsedSource, call: PyautoguiCall, scaling: Scaling) -> Action:
    if call.function in POINTER:
        x, y, _ = read_coordinates(source, call, scaling)
        return _pointer(call, x, y)
    if call.function in KEYBOARD:
        return _keyboard(call)
    if call.function == "terminate":
        return Action(_STATUS.get(str(_first(call)), "other"))
    if call.function == "copy":
        return _with_text(CLIPBOARD, _first(call))
    seconds = _first(call)  # of sleep or wait
    return Action("wait", amount=_number(seconds))


def _first(call: PyautoguiCall) -> Value:
    for argument in (*call.positional, *call.keywords.values()):
        return argument.value
    return None


def _pointer(call: PyautoguiCall, x: int | None, y: int | None) -> Action:
    name = call.function
    arguments = call.bind(POINTER[name])
    button = _get(arguments, "button", "left")
    if name in _CLICKS:
        clicks = _get(arguments, "clicks", 1) if name == "click" else _CLICKS[name]
        return Action(click_type(button, clicks), x, y)
    if name in _PLAIN:
        return Action(_PLAIN[name], x, y)
    if name in ("scroll", "vscroll"):
        amount = _number(_get(arguments, "clicks", None))
        if amount is None:
            return Action("other", x, y)
        return Action("scroll", x, y, amount=amount)
    if click_type(button, 1) != "click":
        return Action("other", x, y)
    if name in _HOLDS:
        return Action(_HOLDS[name], x, y)
    if name == "dragTo":
        return Action("drag", x2=x, y2=y)
    return Action(DRAG_BY, x, y)


def _keyboard(call: PyautoguiCall) -> Action:
    name = call.function
    arguments = call.bind(KEYBOARD[name])
    if name in ("write", "typewrite"):
        return _with_text("type", _get(arguments, "message", None))
    if name == "hotkey":
        keys = [argument.value for argument in call.positional]
        return _keys("hotkey", keys or [_get(arguments, "keys", None)])
    if name == "press":
        pressed = _get(arguments, "keys", None)
        is_one = isinstance(pressed, str) or (isinstance(pressed, tuple) and len(pressed) == 1)
        if not is_one or _get(arguments, "presses", 1) != 1:
            return Action("other")
        return _keys("hotkey", [pressed])
    return _keys("key_down" if name == "keyDown" else "key_up", [_get(arguments, "key", None)])


def _get(arguments: Mapping[str, Argument], name: str, default: Value) -> Value:
    argument = arguments.get(name)
    return default if argument is None else argument.value


def _number(value: Value) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return value


def _with_text(type: str, text: Value) -> Action:
    if not isinstance(text, str):
        return Action("other")
    return Action(type, text=text)


def _keys(type: str, values: Iterable[Value]) -> Action:
    names: list[str] = []
    for value in values:
        for key in value if isinstance(value, tuple) else (value,):
            if not isinstance(key, str):
                return Action("other")
            names.append(key)
    if not names:
        return Action("other")
    return Action(type, keys=tuple(names))
