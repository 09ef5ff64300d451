"""The dialects in which agents write actions, and the table that names them.

`pyautogui_code` maps code, `pyautogui_parse` reads it and `pyautogui_write` writes it;
`combine_calls` merges the calls of one action. Most other dialects are a table from the names of
their actions to rules (`action_rules`) and a syntax (`call_syntax`): `table_dialects`, `qwen`,
`ui_tars`. `answer_text` leaves out thoughts; `field_checks` and `unmapped_fields` check the fields
of all typed dialects.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...errors import ActionError, ParameterError, UnknownNameError, suggest
from ...smart_resize import smart_resize
from ...types import Action, Size, as_size
from ..agent_actions import fenced_spans
from ..scaling import Scaling
from .action_rules import CallReader
from .computer_13 import map_computer_13, parse_computer_13
from .computer_tool_code import anthropic_code, computer_13_code, openai_code
from .computer_tools import map_anthropic, map_openai, parse_anthropic, parse_openai
from .opencua import fenced_code, map_fenced, parse_fenced
from .pyautogui_code import map_code
from .pyautogui_parse import parse_pyautogui
from .qwen import QWEN
from .table_dialects import AUTOGLM, COGAGENT, GEMINI, GLM, HOLO, INTERNVL, SHOWUI
from .ui_tars import check_ui_tars, map_ui_tars, parse_ui_tars, ui_tars_code

PIXELS = 0
RESIZED = -1


@dataclass(frozen=True)
class Dialect:
    """One way to write actions.

    Args:
        parse: returns the actions of a reply, in pixels.
        map: returns a reply with its coordinates scaled. For fractions, which are the same at every
            size, it only checks the reply.
        write: returns each action of a reply as code; `None` if it is code already.
        unit: the space of its coordinates: `PIXELS` of the picture, `RESIZED` for pixels of the
            smart-resized picture, otherwise fractions 0..`unit`.
        is_text: whether a reply is text, rather than a dict or its JSON.
    """

    parse: Callable[[object, Scaling], list[Action]]
    map: Callable[[object, Scaling], Any]
    write: Callable[[object, Scaling], list[str]] | None
    unit: int = PIXELS
    is_text: bool = True


def _table_dialect(reader: CallReader, unit: int, is_text: bool = True) -> Dialect:
    def check(reply: object, _: Scaling) -> Any:
        return reader.check(reply, unit)

    mapped = reader.map if unit <= 0 else check
    return Dialect(reader.parse, mapped, reader.write, unit, is_text)


def _ui_tars_dialect(unit: int) -> Dialect:
    def check(reply: object, _: Scaling) -> Any:
        return check_ui_tars(reply, unit)

    return Dialect(parse_ui_tars, map_ui_tars if unit <= 0 else check, ui_tars_code, unit)


def _map_pyautogui(code: Any, scaling: Scaling) -> str:
    if isinstance(code, str) and "```" in code and fenced_spans(code):
        return map_fenced(code, scaling)
    return map_code(code, scaling)


def _parse_pyautogui(code: Any, scaling: Scaling) -> list[Action]:
    if isinstance(code, str) and "```" in code and fenced_spans(code):
        return parse_fenced(code, scaling)
    return [parse_pyautogui(code, scaling.target if scaling.clamp else None)]


_TABLE: Mapping[str, Dialect] = {
    "pyautogui": Dialect(_parse_pyautogui, _map_pyautogui, None),
    "computer_13": Dialect(
        lambda action, scaling: [parse_computer_13(action, scaling)],
        map_computer_13,
        computer_13_code,
        is_text=False,
    ),
    "ui_tars": _ui_tars_dialect(1000),
    "ui_tars_1.5": _ui_tars_dialect(RESIZED),
    "qwen2.5_vl": _table_dialect(QWEN, RESIZED),
    "qwen3_vl": _table_dialect(QWEN, 1000),
    "openai": Dialect(parse_openai, map_openai, openai_code, is_text=False),
    "anthropic": Dialect(parse_anthropic, map_anthropic, anthropic_code, is_text=False),
    "seed": _ui_tars_dialect(1000),
    "opencua": Dialect(parse_fenced, map_fenced, fenced_code, RESIZED),
    "gui_owl": _table_dialect(QWEN, 1000),
    "mai_ui": _table_dialect(QWEN, 999),
    "glm": _table_dialect(GLM, 1000),
    "cogagent": _table_dialect(COGAGENT, 1000),
    "autoglm": _table_dialect(AUTOGLM, 1000),
    "showui": _table_dialect(SHOWUI, 1),
    "internvl": _table_dialect(INTERNVL, 1000),
    "holo1.5": _table_dialect(HOLO, RESIZED),
    "holo2": _table_dialect(HOLO, 1000),
    "gemini": _table_dialect(GEMINI, 1000, is_text=False),
}
DIALECTS = tuple(_TABLE)
# Dialects in fractions of the picture, each with the largest fraction; dialects in pixels of the
# smart-resized picture; dialects whose replies are text other than code.
FRACTIONS: Mapping[str, int] = {
    name: entry.unit for name, entry in _TABLE.items() if entry.unit > 0
}
RESIZED_DIALECTS = tuple(name for name, entry in _TABLE.items() if entry.unit == RESIZED)
TEXT_PARSERS: Mapping[str, Callable[[object, Scaling], list[Action]]] = {
    name: entry.parse for name, entry in _TABLE.items() if entry.is_text and name != "pyautogui"
}
# Dialects whose actions are dicts, or JSON of them.
DICT_DIALECTS = tuple(name for name, entry in _TABLE.items() if not entry.is_text)


def map_typed(action: Any, dialect: str, scaling: Scaling) -> Any:
    """Return `action` with its coordinates scaled, in the same form.

    A reply in fractions of the picture (`FRACTIONS`) comes back as it is: it means the same point
    at every size.

    Raises:
        ActionError: the action cannot be mapped.
        UnknownNameError: the dialect is unknown.
    """
    return _dialect(dialect).map(action, scaling)


def parse_actions(action: Any, dialect: str, size: Size | None = None) -> list[Action]:
    """Parse the text, code or dict of an agent into `Action`s, in pixels of the picture.

    The result is a list because a reply may have several actions.

    Args:
        action: code, text or a dict, in the form of the dialect.
        dialect: one of `DIALECTS`.
        size: (height, width) of the picture to which the coordinates refer (for `RESIZED_DIALECTS`
            the smart-resized one); points are clamped to it. With `None` they are not clamped. The
            dialects in `FRACTIONS` need it.

    Raises:
        ParameterError: the dialect needs `size`, and it is missing.
        ActionError: the action cannot be read.
        UnknownNameError: the dialect is unknown.
    """
    entry = _dialect(dialect)
    if dialect == "pyautogui" and not (isinstance(action, str) and "```" in action):
        return [parse_pyautogui(action, size)]
    checked = None if size is None else as_size(size)
    return entry.parse(action, fraction_scaling(dialect, checked) or Scaling.pixels(checked))


def parse_with(action: Any, dialect: str, scaling: Scaling) -> list[Action]:
    """Parse actions whose coordinates a scaling turns into pixels.

    The space of the dialect itself plays no part.

    Raises:
        ActionError: the action cannot be read.
        UnknownNameError: the dialect is unknown.
    """
    return _dialect(dialect).parse(action, scaling)


def fraction_scaling(dialect: str, size: Size | None) -> Scaling | None:
    """Return the scaling from the fractions of a dialect to pixels; `None` if it has none.

    Raises:
        ParameterError: the dialect needs a size, and it is missing.
    """
    unit = FRACTIONS.get(dialect)
    if unit is None:
        return None
    if size is None:
        raise ParameterError(
            f"{dialect} gives 0..{unit} of the picture; give its size=(height, width)"
        )
    return Scaling.fractions(size, unit)


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
    write = _dialect(dialect).write
    if write is None:
        raise ActionError("pyautogui is code already; use map_code to scale it")
    return write(action, _live_scaling(dialect, as_size(size), resized))


def _live_scaling(dialect: str, size: Size, resized: Size | None) -> Scaling:
    fractions = fraction_scaling(dialect, size)
    if fractions is not None:
        return fractions
    if dialect not in RESIZED_DIALECTS:
        return Scaling.pixels(size)
    source = as_size(resized, "resized") if resized is not None else smart_resize(*size)
    return Scaling(source, size, recorded=True)


def _dialect(name: object) -> Dialect:
    dialect = _TABLE.get(name) if isinstance(name, str) else None
    if dialect is None:
        raise UnknownNameError(f"unknown dialect {name!r}{suggest(name, DIALECTS)}")
    return dialect
