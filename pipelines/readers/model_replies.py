"""Read the actions in text replies of models.

| family | form | coordinates |
|---|---|---|
| Qwen-VL | `<tool_call>{"name": "computer_use", ...}</tool_call>`, `mobile_use` | prompt, choice |
| UI-TARS | `Action: click(start_box='(x,y)')`, `point='<point>x y</point>'` | chosen |
| Seed | `<function=click><parameter=point>x y</parameter></function>` | 0..1000, or chosen |
| GLM-4.5V | `left_click(start_box='[x,y]')` | 0..1000, or chosen |
| CogAgent | `Grounded Operation: CLICK(box=[[x1,y1,x2,y2]])` | 0..1000, or chosen |
| AutoGLM | `do(action="Tap", element=[x,y])`, `finish(message="...")` | 0..1000, or chosen |
| ShowUI | `{'action': 'CLICK', 'value': None, 'position': [x, y]}` | 0..1, or chosen |
| ScaleCUA | `<action>click(x=..., y=...)</action>` | pixels, or chosen |
| code | a reply that is, or ends in, a block of pyautogui code | pixels, or chosen |
| OS-Atlas | `CLICK <point>[[x,y]]</point>`, `<box>[[x1,y1,x2,y2]]</box>` | 0..1000, or chosen |
"""

import ast
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from hijack_data.actions.dialects.pyautogui_code import calls_pyautogui
from hijack_data.actions.dialects.qwen import holds_tool_call
from hijack_data.actions.pyautogui_functions import KEYBOARD, POINTER
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import HijackError, short_repr
from hijack_data.types import Action, Box, Size

from ..choices import FRACTIONS, PIXELS, THOUSAND, XYXY
from . import fields
from .box_forms import box_center, box_in
from .fields import FieldError
from .reader_options import Space, space_scaling
from .recorded_actions import PYAUTOGUI, QWEN_3, UI_TARS, ParsedAction, read_recorded

SCROLL_NOTCHES = 5  # the distance of a scroll without one, as in UI-TARS's own code
_CODE = re.compile(r"```(?:python|py)?\s*\n?(.*?)```\s*\Z", re.DOTALL)
_UI_TARS = re.compile(
    r"\b(?:click|left_double|right_single|drag|scroll|hover|move_to|mouse_down|mouse_up)"
    r"\((?:start_box|point|start_point)\s*=|\bhotkey\(key\s*="
    r"|\btype\(content\s*=|^Action:\s*(?:wait|finished|call_user)\(",
    re.MULTILINE,
)
_SEED = re.compile(r"<(?:seed:)?tool_call>\s*<function=(?!computer_use|mobile_use)")
# Forms that only one model writes, with the space that its maker defines.
_DEFINED: tuple[tuple[str, Space, re.Pattern[str]], ...] = (
    (
        "glm",
        THOUSAND,
        re.compile(
            r"\b(?:left_click|right_click|middle_click|left_double_click|left_drag)"
            r"\(start_box='\[|\bscroll\(start_box='\[[^']*', direction='\w*', step="
        ),
    ),
    ("cogagent", THOUSAND, re.compile(r"^[ \t]*Grounded Operation:", re.MULTILINE)),
    ("autoglm", THOUSAND, re.compile(r"\bdo\(action=[\"']|\bfinish\(message=[\"']")),
    (
        "showui",
        FRACTIONS,
        re.compile(r"\A\s*\{'action': '[A-Z_]+', 'value': .*'position': ", re.DOTALL),
    ),
)
_LAST_CALLS = re.compile(r"^(?:pyautogui|computer)\.\w+\(.*\Z", re.DOTALL | re.MULTILINE)
_ACTION = re.compile(r"<action>\s*(.*?)\s*</action>", re.DOTALL)
_ATLAS = re.compile(r"(?:\A|\n)actions?:\s*\n?(.*)\Z", re.DOTALL | re.IGNORECASE)
_POINT = r"\[\[\s*([\d.]+)\s*,\s*([\d.]+)\s*\]\]"
_ATLAS_POINT = re.compile(rf"(CLICK|LONG_PRESS|DOUBLE_CLICK|RIGHT_CLICK)\s*<point>{_POINT}</point>")
_ATLAS_TEXT = re.compile(r"(TYPE|SCROLL|OPEN_APP)\s*\[(.*)\]", re.DOTALL)
_ATLAS_BOX = re.compile(r"<box>\[\[\s*([\d.]+(?:\s*,\s*[\d.]+){3})\s*\]\]</box>")
_ATLAS_WORDS = {
    "COMPLETE": Action("done"),
    "IMPOSSIBLE": Action("fail"),
    "WAIT": Action("wait"),
    "ENTER": Action("hotkey", keys=("enter",)),
    "PRESS_BACK": Action("other"),
    "PRESS_HOME": Action("other"),
    "PRESS_RECENT": Action("other"),
}
_WORDS = ("wait", "sleep", "terminate")
_PYAUTOGUI = (*POINTER, *KEYBOARD, *_WORDS)
_OWN_CALLS = {
    "open_app": Action("other"),
    "back": Action("other"),
    "home": Action("other"),
    "callUser": Action("fail"),
    "call_user": Action("fail"),
}
_ATLAS_CLICKS = {
    "CLICK": "click",
    "LONG_PRESS": "other",
    "DOUBLE_CLICK": "double_click",
    "RIGHT_CLICK": "right_click",
}


@dataclass(frozen=True)
class ModelReply:
    """The action of a reply, and the box of its target if it names one."""

    recorded: ParsedAction
    box: Box | None = None


@dataclass(frozen=True)
class ReplyContext:
    """The facts that decide the space of a reply's coordinates.

    Args:
        size: (height, width) of the picture.
        choice: the space that the user chose, if any.
        stated_space: the space stated in the prompt, if any.
    """

    size: Size
    choice: str | None = None
    stated_space: Space | None = None

    def read(
        self, raw: str, dialect: str, field: str, default: Space | None = None
    ) -> ParsedAction:
        """Return an action in a dialect.

        Raises:
            FieldError: the action cannot be read.
        """
        return read_recorded(
            raw, dialect, self.size, field, self.choice, self.stated_space or default
        )

    def reply(self, raw: str, dialect: str, field: str, default: Space | None = None) -> ModelReply:
        """Return a reply that is an action in a dialect, see `read`."""
        return ModelReply(self.read(raw, dialect, field, default))


def is_action(text: str) -> bool:
    """Return whether a reply is an action, readable or not."""
    return _family(text) is not None


def parse_reply(text: str, field: str, context: ReplyContext) -> ModelReply:
    """Return the action of a reply.

    Raises:
        FieldError: the text is not an action, cannot be read, or has an unknown space.
    """
    family = _family(text)
    if family is None:
        raise FieldError(field, f"{short_repr(text)} is not an action")
    return family(text, field, context)


def _family(text: str) -> Callable[[str, str, ReplyContext], ModelReply] | None:
    """Return the function that reads replies such as this one, if it is an action."""
    if holds_tool_call(text):
        return lambda text, field, context: context.reply(text, QWEN_3, field)
    if _SEED.search(text):
        return lambda text, field, context: context.reply(text, UI_TARS, field, THOUSAND)
    for dialect, space, form in _DEFINED:
        if form.search(text):
            return partial(_defined, dialect, space)
    if _UI_TARS.search(text):
        return lambda text, field, context: context.reply(text, UI_TARS, field)
    if _ACTION.search(text):
        return _scale_cua
    code = reply_code(text)
    if code:
        return lambda _, field, context: context.reply(code, PYAUTOGUI, field, PIXELS)
    if _ATLAS_BOX.search(text):
        return _atlas_box
    return _atlas if _is_atlas(_atlas_body(text)) else None


def _defined(
    dialect: str, space: Space, text: str, field: str, context: ReplyContext
) -> ModelReply:
    # What the prompt says of the size of the screen does not change the space of these models.
    return ModelReply(read_recorded(text, dialect, context.size, field, context.choice, space))


def _is_atlas(body: str) -> bool:
    if body in _ATLAS_WORDS or _ATLAS_POINT.fullmatch(body):
        return True
    return _ATLAS_TEXT.fullmatch(body) is not None


def reply_code(text: str) -> str:
    """Return the pyautogui code of a reply that is code or ends in code; `""` for any other."""
    block = _CODE.search(text)
    code = block[1].strip() if block else text.strip()
    if code in ("WAIT", "FAIL", "DONE"):
        return code
    if "pyautogui." in code and (block or calls_pyautogui(code)):
        return code
    return _last_lines(code)


def _last_lines(text: str) -> str:
    """Return the lines of code at the end of a reply that begins with prose."""
    match = _LAST_CALLS.search(text)
    code = match[0].strip() if match else ""
    return code if code and calls_pyautogui(code, or_computer=True) else ""


def _scale_cua(text: str, field: str, context: ReplyContext) -> ModelReply:
    """Read calls such as `click(x=0.5, y=0.5)`: most have pyautogui's names and arguments.

    Raises:
        FieldError: the reply is not a list of calls.
    """
    body = _ACTION.findall(text)[-1]
    calls = _calls(body)
    if not calls:
        raise FieldError(field, f"{short_repr(body)} is not a list of calls")
    if len(calls) == 1 and calls[0][0] not in _PYAUTOGUI:
        return ModelReply(_own_call(*calls[0], field, context))
    lines = [f"{_module(name)}.{ast.unparse(call)}" for name, call in calls]
    return context.reply("\n".join(lines), PYAUTOGUI, field, PIXELS)


def _calls(body: str) -> list[tuple[str, ast.Call]]:
    """Return the calls of plain names in a text; empty if it is anything else."""
    try:
        tree = ast.parse(body)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    calls: list[tuple[str, ast.Call]] = []
    for statement in tree.body:
        call = statement.value if isinstance(statement, ast.Expr) else None
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
            return []
        calls.append((call.func.id, call))
    return calls


def _module(name: str) -> str:
    return "computer" if name in _WORDS else "pyautogui"


def _own_call(name: str, call: ast.Call, field: str, context: ReplyContext) -> ParsedAction:
    """Read a call that pyautogui does not have.

    Raises:
        FieldError: the call is unknown.
    """
    arguments = {
        keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords if keyword.arg
    }
    text = ast.unparse(call)
    if name in _OWN_CALLS:
        return ParsedAction(_OWN_CALLS[name], text, SIZELESS)
    if name == "response":
        end_action = Action("done", text=_answer(call))
        return ParsedAction(fields.check_on_screen(end_action, context.size, field), text, SIZELESS)
    if name == "swipe" and {"from_coord", "to_coord"} <= arguments.keys():
        start = f"pyautogui.moveTo({arguments['from_coord']})"
        end = f"pyautogui.dragTo({arguments['to_coord']})"
        return context.read(f"{start}\n{end}", PYAUTOGUI, field, PIXELS)
    if name == "long_press" and {"x", "y"} <= arguments.keys():
        move = f"pyautogui.moveTo({arguments['x']}, {arguments['y']})"
        held_action = context.read(move, PYAUTOGUI, field, PIXELS)
        return ParsedAction(replace(held_action.action, type="other"), "", PYAUTOGUI)
    raise FieldError(field, f"{short_repr(text)} is not an action that is known")


def _answer(call: ast.Call) -> str | None:
    """Return the first argument of a call if it is text."""
    arguments = [*call.args, *(keyword.value for keyword in call.keywords)]
    first = arguments[0] if arguments else None
    if isinstance(first, ast.Constant) and isinstance(first.value, str):
        return first.value
    return None


def _atlas_body(text: str) -> str:
    match = _ATLAS.search(text)
    return (match[1] if match else text).strip()


def _atlas(text: str, field: str, context: ReplyContext) -> ModelReply:
    body = _atlas_body(text)
    if body in _ATLAS_WORDS:
        return ModelReply(ParsedAction(_ATLAS_WORDS[body], text, SIZELESS))
    click_match = _ATLAS_POINT.fullmatch(body)
    if click_match:
        x, y = _atlas_point(click_match, field, context)
        action = Action(_ATLAS_CLICKS[click_match[1]], x, y)
        return ModelReply(_parsed_action(action, text, field, context))
    text_match = _ATLAS_TEXT.fullmatch(body)
    action = _atlas_text(text_match[1], text_match[2]) if text_match else Action("other")
    return ModelReply(
        ParsedAction(fields.check_on_screen(action, context.size, field), text, SIZELESS)
    )


def _atlas_point(match: re.Match[str], field: str, context: ReplyContext) -> tuple[int, int]:
    try:
        scaling = space_scaling(context.choice or THOUSAND, context.size)
        return scaling.point(float(match[2]), float(match[3]))
    except HijackError as error:
        raise FieldError(field, str(error)) from None


def _atlas_text(name: str, argument: str) -> Action:
    if name == "TYPE":
        return Action("type", text=argument)
    direction = argument.strip().lower()
    if name == "SCROLL" and direction == "up":
        return Action("scroll", amount=SCROLL_NOTCHES)
    if name == "SCROLL" and direction == "down":
        return Action("scroll", amount=-SCROLL_NOTCHES)
    return Action("other")


def _atlas_box(text: str, field: str, context: ReplyContext) -> ModelReply:
    boxes = _ATLAS_BOX.findall(text)
    if len(boxes) > 1:
        raise FieldError(field, f"names {len(boxes)} boxes; one is a click, several are none")
    numbers = [float(number) for number in boxes[0].split(",")]
    box = box_in((context.choice or THOUSAND, XYXY), numbers, context.size, field)
    x, y = box_center(box)
    action = Action("click", x, y)
    return ModelReply(_parsed_action(action, text, field, context), box)


def _parsed_action(action: Action, text: str, field: str, context: ReplyContext) -> ParsedAction:
    """Return the text that a step keeps: a reply in thousandths, else the action in pixels."""
    fields.check_on_screen(action, context.size, field)
    if context.choice in (None, THOUSAND):
        return ParsedAction(action, text, SIZELESS)
    code = ""
    if action.type == "click":
        code = f"pyautogui.click({action.x}, {action.y})"
    return ParsedAction(action, code, PYAUTOGUI)
