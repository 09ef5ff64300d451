"""The names of keys in the plain format: those of pyautogui, in any case, and single characters."""

from collections.abc import Iterable

from hijack_data.errors import suggest

_WORDS = """
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
NAMES = frozenset(_WORDS.split()) | {f"f{number}" for number in range(1, 25)}
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
        plain = name.lower()
        if len(name) != 1 and plain not in NAMES:
            other = OTHER_NAMES.get(plain)
            hint = f"; write {other!r}" if other else suggest(plain, NAMES)
            return f"{name!r:.40} is not the name of a key in pyautogui{hint}"
    return ""
