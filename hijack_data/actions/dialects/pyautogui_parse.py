"""Parse pyautogui code into the one `Action` of the library."""

import ast
from collections.abc import Iterable, Sequence

from ...errors import ParameterError
from ...types import Action, Size, as_size
from ..program.arguments import arguments, positional
from ..program.flow import Flow
from ..program.folding import Folder
from ..program.guard import hidden_moves
from ..program.names import Callee, Names
from ..program.pointing import Pointing
from ..program.values import Bindings, MaybeValue
from ..pyautogui_functions import AGENTNET_TRIPLE, KEYBOARD, POINTER, SPECIAL_WORDS
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

    Raises `ActionError` for code that is not Python and for a coordinate that is not a constant.

    Calls that belong together are one action: `moveTo` and `dragTo` a drag, `moveTo` and `scroll` a
    scroll at a point, `write` and `press('enter')` a text that ends in a newline, keys held around
    a click a click with keys. Code with more than one action, or with a loop or a branch, becomes
    `"other"`, at the first point in the code. A drag whose start is not in the code has no `x, y`.

    Args:
        code: pyautogui code, AgentNet's `computer.terminate(...)` and the like, or WAIT, FAIL or
            DONE.
        size: (height, width) of the screenshot: points are clamped to it, or not clamped if it is
            `None`.
        normalized: coordinates are fractions 0..1 of `size` (AgentNet).

    Raises:
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
    scaling = Scaling.pixels(checked)
    screen = checked
    if normalized and checked:
        scaling = Scaling.fractions(checked)
        screen = None
    with refuse_deep_nesting():
        calls = _Reader(ParsedSource(code), scaling, screen).run()
        return combine(calls, checked)


class _Reader:
    def __init__(self, source: ParsedSource, scaling: Scaling, screen: Size | None) -> None:
        self._tree = source.tree
        self._names = Names(source.tree)
        self._folder = Folder(self._names, screen)
        self._pointing = Pointing(source, self._folder, scaling)
        self._plain = {id(s.value) for s in source.tree.body if isinstance(s, ast.Expr)}
        self._calls: list[Action] = []

    def run(self) -> list[Action]:
        for _ in hidden_moves(self._tree, self._names):
            return []
        lost = Flow(self._folder, self._call).run(self._tree)
        for call in lost:
            if self._names.callee(call.func) is not None:
                self._calls.append(Action("other"))
        return self._calls

    def _call(self, call: ast.Call, env: Bindings) -> None:
        callee = self._names.callee(call.func)
        if callee is None:
            return
        action = self._action(callee, call, env)
        if action is not None:
            self._calls.append(action)

    def _action(self, callee: Callee, call: ast.Call, env: Bindings) -> Action | None:
        module, name = callee
        if module == "pyautogui" and (name in POINTER or name in KEYBOARD):
            if id(call) not in self._plain:
                return Action("other")
            if name in POINTER:
                return self._pointer(name, call, env)
            return self._keyboard(name, call, env)
        if name in ("sleep", "wait"):
            return Action("wait", amount=_number(self._first(call, env)))
        if name == "terminate":
            status = str(self._first(call, env, "status"))
            return Action(_STATUS.get(status, "other"))
        if name == "copy" and module == "pyperclip":
            return _with_text(CLIPBOARD, self._first(call, env))
        return None

    def _first(self, call: ast.Call, env: Bindings, name: str = "value") -> MaybeValue:
        for argument in arguments(call, (name,), self._folder, env).values():
            return argument.value
        return None

    def _values(
        self, call: ast.Call, parameters: Sequence[str], env: Bindings
    ) -> dict[str, MaybeValue]:
        given = arguments(call, parameters, self._folder, env)
        return {name: argument.value for name, argument in given.items()}

    def _pointer(self, name: str, call: ast.Call, env: Bindings) -> Action:
        x, y, _ = self._pointing.place(call, name, env)
        given = self._values(call, POINTER[name], env)
        button = given.get("button", "left")
        if name in _CLICKS:
            clicks = given.get("clicks", 1) if name == "click" else _CLICKS[name]
            return Action(click_type(button, clicks), x, y)
        if name in _PLAIN:
            return Action(_PLAIN[name], x, y)
        if name in ("scroll", "vscroll"):
            amount = _number(given.get("clicks"))
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

    def _keyboard(self, name: str, call: ast.Call, env: Bindings) -> Action:
        given = self._values(call, KEYBOARD[name], env)
        if name in ("write", "typewrite"):
            return _with_text("type", given.get("message"))
        if name == "hotkey":
            pressed = [argument.value for argument in positional(call.args, self._folder, env)]
            return _keys("hotkey", pressed or [given.get("keys")])
        if name == "press":
            keys = given.get("keys")
            is_one = isinstance(keys, str) or (isinstance(keys, tuple) and len(keys) == 1)
            if not is_one or given.get("presses", 1) != 1:
                return Action("other")
            return _keys("hotkey", [keys])
        held = "key_down" if name == "keyDown" else "key_up"
        return _keys(held, [given.get("key")])


def _number(value: MaybeValue) -> float | None:
    return value if isinstance(value, int | float) else None


def _with_text(type: str, text: MaybeValue) -> Action:
    if not isinstance(text, str):
        return Action("other")
    return Action(type, text=text)


def _keys(type: str, values: Iterable[MaybeValue]) -> Action:
    names: list[str] = []
    for value in values:
        for key in value if isinstance(value, tuple) else (value,):
            if not isinstance(key, str):
                return Action("other")
            names.append(key)
    if not names:
        return Action("other")
    return Action(type, keys=tuple(names))
