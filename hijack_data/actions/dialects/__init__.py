"""The dialects in which agents write actions: one module each, and the tables that name them.

`pyautogui_code` maps code, `pyautogui_parse` reads it and `pyautogui_write` writes it; `combine`
merges the calls of one action. `fields` and `unmapped` check the fields of all typed dialects.
"""

from collections.abc import Callable
from typing import Any

from ...errors import ActionError, ParameterError, UnknownNameError, suggest
from ...smart_resize import smart_resize
from ...types import Action, Size, as_size
from ..scaling import Scaling
from .computer_13 import map_computer_13, parse_computer_13
from .pyautogui_code import map_code
from .pyautogui_parse import parse_pyautogui
from .qwen import check_qwen, map_qwen, parse_qwen
from .tool_calls import map_anthropic, map_openai, parse_anthropic, parse_openai
from .tool_code import WRITERS
from .ui_tars import check_ui_tars, map_ui_tars, parse_ui_tars

_MAPPERS: dict[str, Callable[[object, Scaling], Any]] = {
    "computer_13": map_computer_13,
    "ui_tars": lambda action, _: check_ui_tars(action),
    "ui_tars_1.5": map_ui_tars,
    "qwen2.5_vl": map_qwen,
    "qwen3_vl": lambda action, _: check_qwen(action),
    "openai": map_openai,
    "anthropic": map_anthropic,
}
TEXT_PARSERS: dict[str, Callable[[object, Scaling], list[Action]]] = {
    "ui_tars": parse_ui_tars,
    "ui_tars_1.5": parse_ui_tars,
    "qwen2.5_vl": parse_qwen,
    "qwen3_vl": parse_qwen,
}
# Dialects with coordinates in 0..1000 of the picture; dialects in pixels of the smart-resized
# picture.
THOUSANDTHS = ("ui_tars", "qwen3_vl")
RESIZED_DIALECTS = ("ui_tars_1.5", "qwen2.5_vl")
_PARSERS: dict[str, Callable[[object, Scaling], Action]] = {
    "computer_13": parse_computer_13,
    "openai": parse_openai,
    "anthropic": parse_anthropic,
}
DIALECTS = ("pyautogui", *_MAPPERS)


def map_typed(action: Any, dialect: str, scaling: Scaling) -> Any:
    """Return `action` with its coordinates scaled, in the same form.

    Text of `ui_tars` and `qwen3_vl` comes back as it is: 0..1000 of the picture is the same point
    at every size. Raises `UnknownNameError` for an unknown dialect and `ActionError` for an action
    that cannot be mapped.
    """
    _check(dialect)
    if dialect == "pyautogui":
        return map_code(action, scaling, scaling.source)
    return _MAPPERS[dialect](action, scaling)


def parse_actions(action: Any, dialect: str, size: Size | None = None) -> list[Action]:
    """Parse the text, code or dict of an agent into `Action`s, in pixels of the picture.

    The result is a list because a reply may have several actions. Raises `UnknownNameError` for an
    unknown dialect and `ActionError` for an action that cannot be read.

    Args:
        action: code, text or a dict, in the form of the dialect.
        dialect: one of `DIALECTS`.
        size: (height, width) of the picture to which the coordinates refer (for `ui_tars_1.5` and
            `qwen2.5_vl` the smart-resized one); points are clamped to it. With `None` they are not
            clamped. `ui_tars` and `qwen3_vl` need it.

    Raises:
        ParameterError: the dialect needs `size`, and it is missing.
    """
    _check(dialect)
    if dialect == "pyautogui":
        return [parse_pyautogui(action, size)]
    checked = None if size is None else as_size(size)
    if dialect in THOUSANDTHS:
        if checked is None:
            raise ParameterError(
                f"{dialect} gives 0..1000 of the picture; give its size=(height, width)"
            )
        return TEXT_PARSERS[dialect](action, Scaling.fractions(checked, 1000))
    scaling = Scaling.pixels(checked)
    if dialect in TEXT_PARSERS:
        return TEXT_PARSERS[dialect](action, scaling)
    return [_PARSERS[dialect](action, scaling)]


def code_of(action: Any, dialect: str, size: Size, resized: Size | None = None) -> list[str]:
    """Return a typed action of an agent as pyautogui code in pixels of its picture.

    Each item of the result is code, or `WAIT`, `DONE` or `FAIL`; a reply with several actions has
    several items. Unlike `parse_actions` followed by `write_pyautogui`, this keeps sideways
    scrolling, repeated and held keys, and the inner points of a drag.

    Args:
        action: text or a dict, in the form of the dialect.
        dialect: one of `DIALECTS` except `pyautogui`, which is code already.
        size: (height, width) of the picture that the agent saw.
        resized: (height, width) of the picture that the model saw, for `RESIZED_DIALECTS`;
            `smart_resize` of `size` if it is not given.

    Raises:
        ActionError: the dialect is `pyautogui`, or the action cannot be read or cannot be expressed
            with pointer and keyboard.
    """
    _check(dialect)
    if dialect not in WRITERS:
        raise ActionError("pyautogui is code already; use map_code to scale it")
    return WRITERS[dialect](action, _scaling_of(dialect, as_size(size), resized))


def _scaling_of(dialect: str, size: Size, resized: Size | None) -> Scaling:
    if dialect in THOUSANDTHS:
        return Scaling.fractions(size, 1000)
    if dialect not in RESIZED_DIALECTS:
        return Scaling.pixels(size)
    source = as_size(resized, "resized") if resized is not None else smart_resize(*size)
    return Scaling(source, size, recorded=True)


def _check(dialect: object) -> None:
    if dialect not in DIALECTS:
        raise UnknownNameError(f"unknown dialect {dialect!r}{suggest(dialect, DIALECTS)}")
