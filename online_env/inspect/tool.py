"""The computer as a tool of Inspect.

Inspect's providers know its own tool by the name `computer` and exactly these eleven parameters,
and give the model its native computer use instead (Anthropic's, OpenAI's, Google's). This tool has
both, so models play as they were trained to; all others get it as a function.
"""

from collections.abc import Callable
from typing import Any, Literal

from inspect_ai.model import ContentImage, ContentText
from inspect_ai.tool import Tool, ToolResult, tool

from hijack_data.errors import HijackError
from hijack_data.types import Size

from ..agents.adapters.action_codes import read_action_codes
from .sessions import Session, in_thread

OVER = "The episode is over: no more actions count. Submit your answer."
_REMOVED = "(an older screenshot)"
# The keys by which programs do what these buttons of a mouse do.
_SIDE_BUTTONS = {
    "back_click": "pyautogui.hotkey('alt', 'left')",
    "forward_click": "pyautogui.hotkey('alt', 'right')",
}
# What Inspect tells a model about the screen in its native computer use, whatever its size is.
FWXGA: Size = (768, 1366)
_GOOGLE = ("gemini-2.5-computer-use-preview", "gemini-3-flash-preview")


def native_display_size(api: Any, name: str) -> Size | None:
    """Return the (height, width) that Inspect tells a model, or `None` if it tells it nothing.

    Such a model is to be shown pictures of that size. Anthropic's toolset and OpenAI's tool take
    pictures of any size.

    Args:
        api: The model's provider, `Model.api`.
        name: The model's name.
    """
    toolset = getattr(api, "computer_use_toolset", None)
    if callable(toolset):
        return None if toolset() else FWXGA
    if any(model in name for model in _GOOGLE):
        return FWXGA
    return None


def computer_tool(session: Callable[[], Session], keep: int) -> Tool:
    """Return the tool.

    Args:
        session: Called without arguments; returns the `Session` of the present sample.
        keep: How many of the latest results keep their pictures when they are sent again.
    """

    async def execute(
        action: str | None = None,
        coordinate: list[int] | None = None,
        duration: int | None = None,
        region: list[int] | None = None,
        scroll_amount: int | None = None,
        scroll_direction: Literal["up", "down", "left", "right"] | None = None,
        start_coordinate: list[int] | None = None,
        text: str | None = None,
        repeat: int | None = None,
        press_enter: bool | None = None,
        actions: list[dict[str, object]] | None = None,
    ) -> ToolResult:
        """Use the mouse and the keyboard of a computer, and look at its screen.

        The result is a screenshot.

        Args:
            action: One of left_click, right_click, middle_click, double_click, triple_click,
                back_click, forward_click, left_click_drag, left_mouse_down, left_mouse_up,
                mouse_move, scroll, type, key, hold_key, wait, screenshot, zoom.
            coordinate: Where, [x, y] in pixels of the screenshot.
            duration: Seconds, for wait and hold_key.
            region: What zoom shows, [x1, y1, x2, y2] in pixels of the screenshot.
            scroll_amount: Clicks of the wheel.
            scroll_direction: Where to scroll.
            start_coordinate: Where left_click_drag begins, [x, y].
            text: What to type, or the keys to press, such as ctrl+s.
            repeat: How often key presses the keys.
            press_enter: Whether type presses Return at the end.
            actions: Several actions in order, each an object with these fields.
        """
        single = {
            "action": action,
            "coordinate": coordinate,
            "duration": duration,
            "region": region,
            "scroll_amount": scroll_amount,
            "scroll_direction": scroll_direction,
            "start_coordinate": start_coordinate,
            "text": text,
            "repeat": repeat,
            "press_enter": press_enter,
        }
        return await in_thread(_take_actions, session(), actions or [single])

    # Inspect's agents forget the `model_input` of a `ToolDef`; it has to come by the decorator.
    @tool(name="computer", model_input=_drop_older_pictures(keep), parallel=False)
    def computer() -> Tool:
        return execute

    return computer()


def _take_actions(session: Session, calls: list[dict[str, Any]]) -> ToolResult:
    """Take actions; return what could not be read, and the picture."""
    notes: list[str] = []
    picture = ""
    for call in calls:
        if session.record is not None:
            break
        arguments = {name: value for name, value in call.items() if value is not None}
        picture = ""
        if arguments.get("action") == "zoom":
            picture = _zoom(session, arguments, notes)
            continue
        for code in _codes(session, arguments, notes):
            session.act(code)
    if session.record is not None:
        notes.append(OVER)
    image = ContentImage(image=picture or session.picture())
    return [*(ContentText(text=note) for note in notes), image]


def _codes(session: Session, call: dict[str, Any], notes: list[str]) -> list[str]:
    name = call.get("action")
    if name in _SIDE_BUTTONS:
        return [_SIDE_BUTTONS[name]]
    codes, problem = read_action_codes(call, "anthropic", session.size)
    if problem:
        notes.append(f"This action was not understood: {problem}")
    return codes


def _zoom(session: Session, call: dict[str, Any], notes: list[str]) -> str:
    """Return a part of the present picture, larger; that is no step."""
    region = call.get("region")
    if region is None:
        notes.append("This action was not understood: zoom needs a region, [x1, y1, x2, y2]")
        return ""
    try:
        return session.picture(tuple(region))
    except (HijackError, TypeError, ValueError) as error:
        notes.append(f"This action was not understood: {error}")
        return ""


def _drop_older_pictures(keep: int) -> Any:
    """Return a function that replaces the pictures of older results by words."""

    def select_recent(message_index: int, message_total: int, content: Any, hints: Any) -> Any:
        keeps_all = hints.get("disable_computer_screenshot_truncation", False)
        if keeps_all or isinstance(content, str) or message_total - message_index <= keep:
            return content
        return [_without_picture(part) for part in content]

    return select_recent


def _without_picture(part: Any) -> Any:
    if isinstance(part, ContentImage):
        return ContentText(text=_REMOVED)
    return part
