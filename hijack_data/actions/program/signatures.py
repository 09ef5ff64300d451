"""The names and parameters of the functions of pyautogui and of AgentNet's `computer`."""

# Parameters in order, as far as anybody here reads them: `x, y` are absolute, `xOffset, yOffset`
# relative.
_POINT = ("x", "y")
_CLICK = ("x", "y", "interval", "button")
_HOLD = ("x", "y", "button")
_OFFSET = ("xOffset", "yOffset")
_DRAG = ("duration", "tween", "button")
_WHEEL = ("clicks", "x", "y")

POINTER: dict[str, tuple[str, ...]] = {
    "moveTo": _POINT,
    "click": ("x", "y", "clicks", "interval", "button"),
    "leftClick": _POINT,
    "rightClick": _POINT,
    "middleClick": _POINT,
    "doubleClick": _CLICK,
    "tripleClick": _CLICK,
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


def words(text: str) -> frozenset[str]:
    """The words of a text, as a set."""
    return frozenset(text.split())


# They work on the screen at a place, or move the pointer in a language of their own.
REFUSED = words("pixel pixelMatchesColor onScreen getWindowsAt run platformModule")
# They look at the screen: how many arguments come before those that can name a part of it.
READERS = {
    "screenshot": 1,
    "locateOnScreen": 1,
    "locateCenterOnScreen": 1,
    "locateAllOnScreen": 1,
    "locateOnWindow": 2,
    "locate": 2,
    "locateAll": 2,
}
READER_OPTIONS = words("""
    imageFilename image needleImage haystackImage title minSearchTime grayscale confidence limit
    step allScreens
""")
# They take no place on the screen, so their arguments need no mapping.
FREE = words("""
    sleep wait countdown hold shortcut size resolution position center Point Size getPointOnLine
    alert confirm prompt password terminate isValidKey isShiftCharacter failSafeCheck linear
    useImageNotFoundException mouseInfo printInfo getInfo getActiveWindow getActiveWindowTitle
    getAllWindows getAllTitles getWindowsWithTitle
""")
SETTINGS = words("""
    PAUSE FAILSAFE MINIMUM_DURATION MINIMUM_SLEEP DARWIN_CATCH_UP_TIME LOG_SCREENSHOTS
    LOG_SCREENSHOTS_LIMIT
""")
_CONSTANTS = words("LEFT MIDDLE RIGHT PRIMARY SECONDARY KEYBOARD_KEYS KEY_NAMES QWERTY QWERTZ")
BARE = frozenset({*POINTER, *KEYBOARD, *REFUSED, *READERS, "sleep", "size", "position"})

# AgentNet writes computer.terminate(...), computer.tripleClick(...)
PYAUTOGUI = frozenset({"pyautogui", "computer"})
MODULES = frozenset({*PYAUTOGUI, "time", "pyperclip"})

SPECIAL = {
    "WAIT": "wait",
    "DONE": "done",
    "FAIL": "fail",
}


def is_public(name: str) -> bool:
    """Whether pyautogui has a function or constant of this name, as far as is known here."""
    return name in POINTER or name in READERS or name in REFUSED or is_harmless(name)


def is_harmless(name: str) -> bool:
    """Whether pyautogui's `name` may be passed on: who has it can move the pointer to no place."""
    if name in KEYBOARD or name in FREE or name in SETTINGS or name in _CONSTANTS:
        return True
    return name.endswith("Exception") or name.startswith("ease")
