"""The functions of pyautogui and of AgentNet's `computer` that actions may call."""

from collections.abc import Mapping
from typing import TypeAlias

FunctionNames: TypeAlias = Mapping[str, frozenset[str]]

# Parameters in order, up to the last one that this library reads: `x, y` are absolute, `xOffset,
# yOffset` relative.
_POINT = ("x", "y")
_CLICK = ("x", "y", "interval", "button")
_HOLD = ("x", "y", "button")
_OFFSET = ("xOffset", "yOffset")
_DRAG = ("duration", "tween", "button")
_WHEEL = ("clicks", "x", "y")

# OpenCUA's computer.triple_click(x, y), which pyautogui does not have.
AGENTNET_TRIPLE = "triple_click"

POINTER: dict[str, tuple[str, ...]] = {
    "moveTo": _POINT,
    "click": ("x", "y", "clicks", "interval", "button"),
    "leftClick": _POINT,
    "rightClick": _POINT,
    "middleClick": _POINT,
    "doubleClick": _CLICK,
    "tripleClick": _CLICK,
    AGENTNET_TRIPLE: _CLICK,
    "mouseDown": _HOLD,
    "mouseUp": _HOLD,
    "dragTo": (*_POINT, *_DRAG),
    "scroll": _WHEEL,
    "hscroll": _WHEEL,
    "vscroll": _WHEEL,
    "moveRel": _OFFSET,
    "move": _OFFSET,
    "dragRel": (*_OFFSET, *_DRAG),
    "drag": (*_OFFSET, *_DRAG),
}
KEYBOARD: dict[str, tuple[str, ...]] = {
    "write": ("message",),
    "typewrite": ("message",),
    "press": ("keys", "presses"),
    "hotkey": ("keys",),
    "keyDown": ("key",),
    "keyUp": ("key",),
}
_KEY_WORDS = """
    accept add alt altleft altright apps backspace browserback browserfavorites browserforward
    browserhome browserrefresh browsersearch browserstop capslock clear command convert ctrl
    ctrlleft ctrlright decimal del delete divide down end enter esc escape execute final fn hanguel
    hangul hanja help home insert junja kana kanji launchapp1 launchapp2 launchmail
    launchmediaselect left modechange multiply nexttrack nonconvert num0 num1 num2 num3 num4 num5
    num6 num7 num8 num9 numlock option optionleft optionright pagedown pageup pause pgdn pgup
    playpause prevtrack print printscreen prntscrn prtsc prtscr return right scrolllock select
    separator shift shiftleft shiftright sleep space stop subtract tab up volumedown volumemute
    volumeup win winleft winright yen
"""
# The keys of pyautogui with names; every single character is one, too.
KEY_NAMES = frozenset(_KEY_WORDS.split()) | {f"f{number}" for number in range(1, 25)}
SETTINGS = frozenset({"PAUSE", "FAILSAFE", "MINIMUM_DURATION", "MINIMUM_SLEEP"})
BUTTONS = {name.upper(): name for name in ("left", "middle", "right", "primary", "secondary")}

# What code may call on a live desktop: the functions of each module.
LIVE_FUNCTIONS: FunctionNames = {
    "pyautogui": frozenset({*POINTER, *KEYBOARD, "sleep"} - {AGENTNET_TRIPLE}),
    "time": frozenset({"sleep"}),
}
# What recorded code may call: also AgentNet's `computer`, and texts pasted from the clipboard.
RECORDED_FUNCTIONS: FunctionNames = {
    **LIVE_FUNCTIONS,
    "computer": frozenset({*POINTER, *KEYBOARD, "sleep", "wait", "terminate"}),
    "pyperclip": frozenset({"copy"}),
}

SPECIAL_WORDS = {"WAIT": "wait", "DONE": "done", "FAIL": "fail"}
