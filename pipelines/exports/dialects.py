"""Write actions as text in the dialect that a model learns.

| dialect | form | coordinates |
|---|---|---|
| `pyautogui` | recorded pyautogui code, or code made of the action; WAIT, FAIL, DONE | pixels |
| `ui_tars` | UI-TARS 1.0, `click(start_box='(500,250)')` | 0..1000 of the screenshot |
| `ui_tars_1.5` | the same of UI-TARS 1.5 | pixels of the smart-resized screenshot |

`hijack_data.actions.parse_actions` reads the text back as the same action, except for details that
the dialect cannot express.
"""

from collections.abc import Callable, Mapping
from typing import Any

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.pyautogui_code import calls_pyautogui
from hijack_data.actions.dialects.pyautogui_write import unsupported_action_error, write_pyautogui
from hijack_data.errors import UnknownNameError, suggest
from hijack_data.labels.action_formats import own_action
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Action, Size

from ..choices import DIALECTS

_UI_TARS_CLICKS = {"click": "click", "double_click": "left_double", "right_click": "right_single"}
_UI_TARS_WORDS = {"wait": "wait()", "fail": "call_user()"}
_GRID = (1000, 1000)
_NO_KEY = frozenset(" +'\"\\\n")
_ESCAPES = str.maketrans({"\\": "\\\\", "'": "\\'", "\n": "\\n", "\t": "\\t", "\r": "\\r"})


def action_text(row: Mapping[str, Any], dialect: str) -> str:
    """Return the action of a row as text.

    Raises:
        ActionError: the dialect cannot express the action.
    """
    return _RENDER[dialect](row)


def check_dialect(dialect: str) -> None:
    """Check the name of a dialect.

    Raises:
        UnknownNameError: there is no such dialect.
    """
    if dialect not in _RENDER:
        raise UnknownNameError(f"unknown dialect {dialect!r}{suggest(dialect, _RENDER)}")


def _pyautogui(row: Mapping[str, Any]) -> str:
    if calls_pyautogui(row["action_code"]):
        return row["action_code"]
    return write_pyautogui(own_action(row["action"]))


def _ui_tars(row: Mapping[str, Any], make_scaling: Callable[[Size], Scaling], dialect: str) -> str:
    action = own_action(row["action"])
    kind = action.type
    if kind in _UI_TARS_WORDS:
        return _UI_TARS_WORDS[kind]
    if kind == "done":
        return f"finished(content={_quote(action.text)})" if action.text else "finished()"
    if kind == "type":
        return f"type(content={_quote(_text(action, dialect))})"
    if kind == "hotkey" and not action.amount:  # which would be seconds of holding them
        keys = " ".join(_keys(action, dialect))
        return f"hotkey(key='{keys}')"
    if action.keys or kind == "hotkey":
        raise unsupported_action_error(action, dialect)
    screen = (int(row["height"]), int(row["width"]))
    return _ui_tars_pointing(action, make_scaling(screen), dialect)


def _ui_tars_pointing(action: Action, scaling: Scaling, dialect: str) -> str:
    """Return the text of an action at a point.

    Raises:
        ActionError: the dialect cannot express the action.
    """
    kind = action.type
    start = _box(action.x, action.y, scaling)
    end = _box(action.x2, action.y2, scaling)
    if kind in _UI_TARS_CLICKS and start:
        return f"{_UI_TARS_CLICKS[kind]}(start_box='{start}')"
    if kind == "drag" and start and end:
        return f"drag(start_box='{start}', end_box='{end}')"
    if kind == "scroll" and start and action.amount:
        direction = "up" if action.amount > 0 else "down"
        return f"scroll(start_box='{start}', direction='{direction}')"
    error = unsupported_action_error(action, dialect)
    raise error


def _ui_tars_10(row: Mapping[str, Any]) -> str:
    return _ui_tars(row, lambda size: Scaling(size, _GRID, grid=False), "ui_tars")


def _ui_tars_15(row: Mapping[str, Any]) -> str:
    return _ui_tars(row, lambda size: Scaling(size, smart_resize(*size)), "ui_tars_1.5")


_RENDER: Mapping[str, Callable[[Mapping[str, Any]], str]] = dict(
    zip(DIALECTS, (_pyautogui, _ui_tars_10, _ui_tars_15), strict=True)
)


def _box(x: int | None, y: int | None, scaling: Scaling) -> str:
    if x is None or y is None:
        return ""
    px, py = scaling.point(x, y)
    return f"({px},{py})"


def _text(action: Action, dialect: str) -> str:
    if action.text is None:
        raise unsupported_action_error(action, dialect)
    return action.text


def _keys(action: Action, dialect: str) -> tuple[str, ...]:
    keys = action.keys or ()
    if not keys or not all(map(_is_plain_key, keys)):
        raise unsupported_action_error(action, dialect)
    return keys


def _is_plain_key(key: str) -> bool:
    return bool(key) and not set(key) & _NO_KEY


def _quote(text: str) -> str:
    return f"'{text.translate(_ESCAPES)}'"
