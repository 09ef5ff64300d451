"""The names and parameters of the functions of pyautogui and of AgentNet's `computer`."""

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


def words(text: str) -> frozenset[str]:
    """Return the words of a text as a set."""
    return frozenset(text.split())


# Functions that read the screen at a place, or that move the pointer by commands in a text.
REFUSED = words("pixel pixelMatchesColor onScreen getWindowsAt run platformModule")
# Functions that read the screen, each with the number of arguments before the first that can name a
# region.
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
# Functions that take no place on the screen, so their arguments need no mapping.
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

SPECIAL_WORDS = {"WAIT": "wait", "DONE": "done", "FAIL": "fail"}


def is_public(name: str) -> bool:
    """Return whether pyautogui is known to have a function or constant of this name."""
    return name in POINTER or name in READERS or name in REFUSED or is_harmless(name)


def is_harmless(name: str) -> bool:
    """Return whether pyautogui's `name` may be passed on, because it cannot move the pointer."""
    if name in KEYBOARD or name in FREE or name in SETTINGS or name in _CONSTANTS:
        return True
    return name.endswith("Exception") or name.startswith("ease")
