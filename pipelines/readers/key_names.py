"""The names of keys in the plain format: those of pyautogui, in any case, and single characters."""

from collections.abc import Iterable

from hijack_data.actions.pyautogui_functions import KEY_NAMES
from hijack_data.errors import suggest

# Names that other tools give to these keys.
OTHER_NAMES = {
    "control": "ctrl",
    "control_l": "ctrlleft",
    "control_r": "ctrlright",
    "alt_l": "altleft",
    "alt_r": "altright",
    "shift_l": "shiftleft",
    "shift_r": "shiftright",
    "super": "win",
    "super_l": "winleft",
    "super_r": "winright",
    "meta": "win",
    "windows": "win",
    "cmd": "command",
    "back_space": "backspace",
    "caps_lock": "capslock",
    "page_up": "pageup",
    "page_down": "pagedown",
    "next": "pagedown",
    "prior": "pageup",
    "arrowup": "up",
    "arrowdown": "down",
    "arrowleft": "left",
    "arrowright": "right",
}


def key_problem(keys: Iterable[str]) -> str:
    """Return what is wrong with the names of keys, and the fix; `""` if nothing is."""
    names = list(keys)
    if not names:
        return "names no key; write such as ['ctrl', 's']"
    for name in names:
        lowered = name.lower()
        if len(name) != 1 and lowered not in KEY_NAMES:
            suggestion = OTHER_NAMES.get(lowered)
            hint = f"; write {suggestion!r}" if suggestion else suggest(lowered, KEY_NAMES)
            return f"{name!r:.40} is not the name of a key in pyautogui{hint}"
    return ""
