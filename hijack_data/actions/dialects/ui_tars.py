r"""The actions of UI-TARS and Seed: `Action: click(start_box='...')` after a `Thought:`, or XML.

A reply has one action or several. Points are written in many ways, `start_box='(1,2)'`,
`point='<point>1 2</point>'`, `<bbox>1 2 3 4</bbox>`, and mean the same; a box of four numbers aims
at its centre. Seed writes the same actions as `<function=click><parameter=point>1 2</parameter>`.

Version 1.0, Doubao and Seed give 0..1000 of the picture, whatever its size; version 1.5 gives
pixels of the smart-resized picture (`CoordMap.model`).
"""

import re
from collections.abc import Iterator
from typing import Any

from ...errors import ActionError, short_repr
from ...types import Action
from ..scaling import Scaling
from .action_rules import (
    DEFAULT_NOTCHES,
    ActionCall,
    Arguments,
    CallReader,
    Meaning,
    Rule,
    end_rule,
    press_rule,
    scroll_meaning,
    unsupported_rule,
    wait_rule,
)
from .answer_text import answer_text
from .call_syntax import (
    TOOL_CALL,
    WrittenArgument,
    rewriter,
    tool_call_blocks,
    unescape,
    xml_functions,
)
from .field_checks import action_at
from .ui_tars_text import Call as TextCall
from .ui_tars_text import sections

DIALECT = "UI-TARS"
WAIT_S = 5.0  # the prompt says that wait() sleeps for 5 s
_PHONE = "a desktop has no such key or gesture of a phone"
_ALIASES = {"point": "start_box", "start_point": "start_box", "end_point": "end_box"}
_WITHOUT_POINT = (
    *("hotkey", "type", "wait", "finished", "call_user"),
    *("open_app", "press_home", "press_back"),
)
_ARGUMENT = re.compile(r"""\s*(\w+)\s*=\s*(?:'(?P<a>[^']*)'|"(?P<b>[^"]*)")\s*(?:,|\Z)""")
_CONTENT = re.compile(r"""\s*(?:content\s*=\s*)?(['"])(.*)\1\s*""", re.DOTALL)
_PLACED = re.compile(r"\b(?:start_|end_)?(?:box|point|coordinate)s?\s*=")
_AFTER_TEXT = re.compile(r"""(?<!\\)['"]\s*,\s*(?:start_|end_)(?:box|point)\s*=\s*['"]""")
_XML = "<function"


def _aiming(kind: str) -> Rule:
    # A click may have an end_box, too, which means nothing and is mapped.
    def rule(arguments: Arguments) -> list[Meaning]:
        point = arguments.point("start_box")
        _optional(arguments, "end_box")
        return [Meaning(action_at(kind, point))]

    return rule


def _drag(arguments: Arguments) -> list[Meaning]:
    x2, y2 = arguments.point("end_box")
    return [Meaning(action_at("drag", arguments.point("start_box"), x2=x2, y2=y2))]


def _scroll(arguments: Arguments) -> list[Meaning]:
    point = _optional(arguments, "start_box")
    _optional(arguments, "end_box")
    return [scroll_meaning(arguments.direction(), DEFAULT_NOTCHES, point)]


def _long_press(arguments: Arguments) -> list[Meaning]:
    return [Meaning(action_at("other", arguments.point("start_box")), refusal=_PHONE)]


def _optional(arguments: Arguments, name: str) -> tuple[int, int] | None:
    if not str(arguments.value(name, "")).strip():
        return None
    return arguments.optional_point(name)


def _type(arguments: Arguments) -> list[Meaning]:
    return [Meaning(Action("type", text=arguments.text("content")))]


RULES: dict[str, Rule] = {
    "click": _aiming("click"),
    "left_double": _aiming("double_click"),
    "right_single": _aiming("right_click"),
    "hover": _aiming("move"),
    "move_to": _aiming("move"),
    "mouse_down": _aiming("mouse_down"),
    "mouse_up": _aiming("mouse_up"),
    "drag": _drag,
    "hotkey": press_rule("key"),
    "type": _type,
    "scroll": _scroll,
    "wait": wait_rule(WAIT_S),
    "finished": end_rule("done", "content"),
    "call_user": end_rule("fail"),
    "long_press": _long_press,
    "open_app": unsupported_rule(_PHONE),
    "press_home": unsupported_rule(_PHONE),
    "press_back": unsupported_rule(_PHONE),
}


def _all_calls(reply: object) -> list[ActionCall]:
    """Return the calls of every `Action:`, which are mapped although only the last ones count."""
    answer = answer_text(reply, DIALECT)
    if _is_xml(answer):
        return list(_xml_calls(answer))
    return [_call(call) for section in sections(answer) for call in section]


def _last_calls(reply: object) -> list[ActionCall]:
    """Return the calls of the last `Action:`."""
    answer = answer_text(reply, DIALECT)
    if _is_xml(answer):
        return list(_xml_calls(answer))
    return [_call(call) for call in sections(answer)[-1]]


def _is_xml(answer: str) -> bool:
    return TOOL_CALL.search(answer) is not None or answer.lstrip().startswith(_XML)


def _xml_calls(answer: str) -> Iterator[ActionCall]:
    blocks = [(answer, 0, len(answer))]
    if TOOL_CALL.search(answer):
        blocks = tool_call_blocks(answer, "<function=click><parameter=point>1 2</parameter>")
    count = 0
    for text, offset, _ in blocks:
        for name, arguments, start, end in xml_functions(text, offset):
            count += 1
            renamed = _renamed(arguments, name)
            values = {key: argument.value for key, argument in renamed.items()}
            yield ActionCall(name, values, start, end, rewriter(answer[start:end], renamed, start))
    if not count:
        raise ActionError(
            f"UI-TARS: no action in {short_repr(answer.strip())}; write for example"
            " <function=click><parameter=point>100 200</parameter></function>"
        )


def _call(call: TextCall) -> ActionCall:
    end = call.start + len(call.inside)
    if call.name in ("type", "finished"):
        _check_boxless(call)
        has_content = call.name == "type" or call.inside.strip()
        content = {"content": _content(call)} if has_content else {}
        return ActionCall(call.name, content)
    if call.name in _WITHOUT_POINT:
        _check_boxless(call)
        if not call.inside.strip():
            return ActionCall(call.name, {})
    arguments = _renamed(_arguments(call), call.name)
    values: dict[str, Any] = {key: argument.value for key, argument in arguments.items()}
    write = rewriter(call.inside, arguments, 0)
    return ActionCall(call.name, values, call.start, end, write)


def _arguments(call: TextCall) -> dict[str, WrittenArgument]:
    """Return the arguments of a call; they stand in `call.inside`.

    Raises:
        ActionError: they are not written `name='value'`.
    """
    arguments: dict[str, WrittenArgument] = {}
    position = 0
    end = len(call.inside.rstrip())
    while position < end:
        match = _ARGUMENT.match(call.inside, position)
        if match is None:
            remainder = short_repr(call.inside[position:])
            raise ActionError(f"{call.name}: cannot read {remainder}; write name='value'")
        name = match[1]
        if name in arguments:
            raise ActionError(f"{call.name}: {name} is given twice; give one action for each point")
        group = "a" if match["a"] is not None else "b"
        arguments[name] = WrittenArgument(match[group], match.start(group), match.end(group))
        position = match.end()
    return arguments


def _renamed(arguments: dict[str, WrittenArgument], action: str) -> dict[str, WrittenArgument]:
    """Return arguments under the names of UI-TARS 1.0: `point` is `start_box`, and so on.

    Raises:
        ActionError: two have the same name.
    """
    renamed: dict[str, WrittenArgument] = {}
    for name, argument in arguments.items():
        key = _ALIASES.get(name, name)
        if key in renamed:
            raise ActionError(f"{action}: {key} is given twice, as {name} too; give it once")
        renamed[key] = argument
    return renamed


def _check_boxless(call: TextCall) -> None:
    # Refuses an action that has no box, but is given one.
    hidden = _PLACED
    if call.name in ("type", "finished") and _CONTENT.fullmatch(call.inside):
        hidden = _AFTER_TEXT
    if hidden.search(call.inside):
        raise ActionError(
            f"{call.name} takes no point, got {short_repr(call.inside)}; leave it out"
        )


def _content(call: TextCall) -> str:
    match = _CONTENT.fullmatch(call.inside)
    if match is None:
        raise ActionError(
            f"{call.name} needs a quoted text, got {short_repr(call.inside)}; write content='...'"
        )
    return unescape(match[2])


_EVERY = CallReader(DIALECT, RULES, _all_calls)
_LAST = CallReader(DIALECT, RULES, _last_calls)


def map_ui_tars(text: object, scaling: Scaling) -> Any:
    """Return text with the numbers of its points scaled, and everything else as it is.

    The points of every `Action:` are scaled, although only the last one is read. Raises
    `ActionError` for an unknown action, a point that is missing, malformed or given twice, and text
    that may hide a point.
    """
    return _EVERY.map(text, scaling)


def check_ui_tars(text: object, unit: int) -> Any:
    """Return text in fractions 0..`unit` of the picture as it is, if `map_ui_tars` can read it."""
    return _EVERY.check(text, unit)


def parse_ui_tars(text: object, scaling: Scaling) -> list[Action]:
    """Read the actions of a reply, in order. If there are several `Action:`, the last one counts.

    `call_user` is `"fail"`, `finished` is `"done"` with its content as text.

    Raises:
        ActionError: the reply cannot be read, see `map_ui_tars`.
    """
    return _LAST.parse(text, scaling)


def ui_tars_code(text: object, scaling: Scaling) -> list[str]:
    """Return the actions of a reply as code, in order.

    Raises:
        ActionError: the reply cannot be read, see `map_ui_tars`, or a desktop cannot do the action.
    """
    return _LAST.write(text, scaling)
