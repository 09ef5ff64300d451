"""A world for programs to run in: pyautogui, other ways to the pointer, a shell; all take notes."""

import builtins
import contextlib
import functools
import heapq
import importlib
import inspect
import operator
import random
import sys
import types
from unittest import mock

from hijack_data.errors import ActionError

RELATIVE = ("moveRel", "dragRel", "move", "drag")
WHEELS = ("scroll", "hscroll", "vscroll")
READERS = ("screenshot", "locateOnScreen", "locateCenterOnScreen", "locateAllOnScreen")
TOOLS = ("xdotool", "ydotool", "cliclick", "pyautogui")
LIBRARIES = ("page", "mouse", "win32api", "autoit", "Quartz", "uiautomation")
STANDARD = (contextlib, functools, heapq, importlib, inspect, operator, random, sys)


class Recorder(types.ModuleType):
    """Stands for pyautogui; remembers (function, coordinates, everything else) of each call."""

    def __init__(self, size):
        super().__init__("pyautogui")
        self.calls = []
        self._size = size

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        if name == "size":
            return lambda: types.SimpleNamespace(width=self._size[1], height=self._size[0])
        offset = 1 if name in WHEELS else 0
        names = ("xOffset", "yOffset") if name in RELATIVE else ("x", "y")

        def call(*args, **kwargs):
            args, pair = list(args), [None, None]
            for index, key in enumerate(names):
                if key in kwargs:
                    pair[index] = kwargs.pop(key)
                elif name != "write" and len(args) > offset + index:
                    pair[index] = args[offset + index]
            arguments = args[:offset] + args[offset + 2 :] if name != "write" else args
            if isinstance(pair[0], tuple | list):
                pair = list(pair[0])
            self.calls.append((name, pair, arguments, kwargs))

        return call


class Elsewhere:
    """Any object, module or function of another library; notes what it is called with."""

    def __init__(self, notes):
        object.__setattr__(self, "_notes", notes)

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Elsewhere(self._notes)

    def __call__(self, *args, **kwargs):
        self._notes.append(("elsewhere", args, kwargs))
        return Elsewhere(self._notes)

    def __setattr__(self, name, value):
        self._notes.append(("elsewhere", (name, value), {}))


class World:
    """A place to run one program in, which finds pyautogui and its `click` imported already."""

    def __init__(self, size):
        self._gui = Recorder(size)
        self._notes = []
        self._main = types.ModuleType("__main__")
        self._builtins = types.ModuleType("builtins")  # programs may change them
        vars(self._builtins).update(vars(builtins))
        shell = types.SimpleNamespace(run=self._shell, system=self._shell, Popen=self._shell)
        entries = {name: Elsewhere(self._notes) for name in LIBRARIES}
        self._modules = {
            "pyautogui": self._gui,
            "pyautogui._pyautogui_x11": entries["mouse"],
            "subprocess": shell,
            "__main__": self._main,
            "builtins": self._builtins,
            **entries,
        }
        vars(self._main).update({module.__name__: module for module in STANDARD})
        vars(self._main).update(
            {"pyautogui": self._gui, "click": self._gui.click, "subprocess": shell, **entries},
            __builtins__=vars(self._builtins),
            __main__=self._main,
        )

    def run(self, code, **names):
        """Run `code`, which meets `names` too; return the type of the error that ends it."""
        vars(self._main).update(names)
        outcome = _Outcome()
        with mock.patch.dict(sys.modules, self._modules), contextlib.redirect_stdout(None), outcome:
            exec(code, vars(self._main))
        return outcome.error

    def _shell(self, command, *args, **kwargs):
        text = command if isinstance(command, str) else " ".join(command)
        if any(tool in text for tool in TOOLS):
            self._notes.append(("shell", (text, 1), kwargs))

    @property
    def moves(self):
        """(function, x, y) of all calls of pyautogui that were given coordinates, in order."""
        calls = [(name, *pair) for name, pair, *_ in self._gui.calls if name not in READERS]
        return [call for call in calls if call[1:] != (None, None)]

    @property
    def hidden(self):
        """What reached the pointer, or a part of the screen, in ways that no mapping can change."""
        reads = [
            (name, pair, kwargs)
            for name, pair, _, kwargs in self._gui.calls
            if name in READERS and ("region" in kwargs or pair[1] is not None)
        ]
        return [note for note in self._notes if _has_number(note[1:])] + reads


class _Outcome:
    """Holds back the error that ends a program, and remembers its type."""

    error = None

    def __enter__(self):
        return self

    def __exit__(self, error, *_):
        self.error = error
        return error is not None and issubclass(error, Exception)


def _has_number(value):
    if isinstance(value, dict):
        return any(map(_has_number, value.values()))
    if isinstance(value, tuple | list):
        return any(map(_has_number, value))
    return isinstance(value, int | float) and not isinstance(value, bool)


def programs(text):
    """The programs of a text, which empty lines part."""
    return text.strip("\n").split("\n\n")


def scaled(coords, name, point):
    """What the coordinates of a call of `name` must become; what is no point stays."""
    if len(point) != 2:
        return tuple(point)
    to = coords.vector_to_screen if name in RELATIVE else lambda *pair: coords.to_screen(pair)
    full = to(*(value or 0 for value in point))
    return tuple(None if old is None else new for old, new in zip(point, full, strict=True))


def judge(code, coords, around=dict):
    """Run a program before and after the mapping, and compare what it does.

    Returns "refused" (with line and column), "right", or what went wrong; and whether the program
    reached the pointer at all. `around` makes the names that it meets.
    """
    before = World(coords.observation)
    outcome = before.run(code, **around())
    reached = bool(before.moves or before.hidden)
    try:
        mapped = coords.code_to_screen(code)
    except ActionError as error:
        placed = str(error).startswith("line ")
        return ("refused" if placed else f"refused without a place: {error}"), reached
    if before.hidden:
        return f"passed on, though it does {before.hidden}", reached
    after = World(coords.screen)
    again = after.run(mapped, **around())
    want = [(name, *scaled(coords, name, point)) for name, *point in before.moves]
    if (outcome, want) == (again, after.moves) and not after.hidden:
        return "right", reached
    return f"became\n{mapped}\nwhich does {again} {after.moves}, not {outcome} {want}", reached
