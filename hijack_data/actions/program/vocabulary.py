"""The words by which code is recognised that may move the pointer without pyautogui.

No list of such functions can be complete, but their names usually tell (`move`, `click`, `drag`,
`cursor`, ...), so names are judged by the words in them.
"""

import re

from .signatures import words

# Libraries that move the pointer, or read the screen at a place, under names of their own.
POINTER_MODULES = words("""
    pynput mouse pydirectinput autopy Xlib evdev uinput libevdev ctypes cffi win32api win32com
    Quartz pymouse pykeymouse PyMouse PyUserInput autoit uiautomation pywinauto dogtail ldtp
    pyatspi gi jnius lackey sikuli ahk interception directkeys rpa clicknium airtest uiautomator2
    appium adbutils pyscreeze mss humancursor pyclick
""")
# Modules that find modules, names and functions, or run code, without naming them in the program.
REFLECTIVE_MODULES = words("""
    importlib imp pkgutil runpy builtins __builtin__ __main__ code codeop inspect gc pickle dill
    cloudpickle marshal timeit profile cProfile trace pdb bdb doctest zipimport multiprocessing
    unittest mock
""")
# Modules whose functions never move the pointer, whatever their names (shutil.move).
HARMLESS_MODULES = words("""
    os shutil pathlib time datetime random math string re json csv glob tempfile itertools
    functools collections logging platform subprocess webbrowser pyperclip keyboard numpy np
    pandas pd
""")

# Builtins that run code or reach names that do not appear in the program.
REFLECTIVE = words("""
    exec eval compile __import__ globals locals vars setattr delattr breakpoint builtins
    __builtins__
""")
# Attributes that lead to modules and namespaces.
REACHING = words("""
    modules sys _sys builtins importlib import_module inspect ctypes ctypeslib windll cdll
    f_globals f_locals f_builtins f_back tb_frame gi_frame cr_frame ag_frame func_globals
""")
OPEN_DUNDERS = words("__name__ __file__ __doc__ __debug__ __version__")
SYS = words("""
    exit argv path platform version version_info executable maxsize byteorder stdin stdout stderr
    getsizeof getrecursionlimit setrecursionlimit getdefaultencoding exc_info
""")

_VERB = re.compile(
    "click|mouse|cursor|pointer|drag|swipe|hover|wheel|touch|(?<!re)move|resizeto|resizerel"
    "|sendinput|pixel|^crop$|^grab$"
)
_WEAK_VERB = re.compile("scroll|press|^tap|tap$|goto|pos$|position|fakeinput|screenshot|region")
_NOUNS = words("mouse pointer cursor touch wheel")  # page.mouse is an object, not a call
DEVICES = words("mouse pointer touchscreen")
PLACES = words("coords coord coordinate coordinates xy")
_POSED = words("""
    position left top right bottom topleft topright bottomleft bottomright midtop midbottom midleft
    midright center centerx centery
""")

# Words in commands, or in code inside texts, that move the pointer.
_COMMAND = re.compile(
    r"\bimport\s+pyautogui|\bfrom\s+pyautogui|\bpyautogui\s*\.|^\s*pyautogui\s*$"
    r"|\b(?:xdotool|ydotool|dotool|cliclick|xte|nircmd|autohotkey|evemu-event|wlrctl|pynput)\b"
    r"|SetCursorPos|mouse_event|\bmouse\.(?:move|click)\b|Cursor\]::Position|\bmovecursor\b"
    r"|\bcursor\s+set\b|\bclick\s+at\s*\{|\binput\s+(?:tap|swipe)\b|\b__main__\s*\.",
    re.IGNORECASE,
)


def is_verb(name: str) -> bool:
    """Return whether a function of this name is likely to move a pointer or to read pixels."""
    return _VERB.search(_plain(name)) is not None


def is_weak_verb(name: str) -> bool:
    """Return whether a function of this name, called with two numbers, may move a pointer."""
    return _WEAK_VERB.search(_plain(name)) is not None


def is_pointer_attribute(name: str) -> bool:
    """Return whether an attribute that is read but not called may be a pointer function."""
    return is_verb(name) and name not in _NOUNS


def is_place_attribute(name: str) -> bool:
    """Return whether setting this attribute may move something: `mouse.position = (10, 20)`."""
    return name in _POSED or is_verb(name)


def names_pointer(text: str) -> bool:
    """Return whether a text, if run as a command or as code, could move the pointer."""
    return _COMMAND.search(text) is not None


def _plain(name: str) -> str:
    return name.replace("_", "").lower()
