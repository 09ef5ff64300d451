"""The tools of an episode, as a server of the official MCP SDK."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from mcp.server import MCPServer
from mcp.server.mcpserver import Image
from mcp.server.mcpserver.exceptions import ToolError
from mcp.server.mcpserver.tools import Tool
from pydantic import ConfigDict, Field

from hijack_data import __version__
from hijack_data.errors import HijackError, suggest
from hijack_data.png import encode

from ..agents.base import DONE, FAIL, WAIT
from ..embedded.guest.shim.ah_input.keys import NAMED
from .tool_client import OVER, ClientView, ToolClient, action_code

MAX_CLICKS = 100  # of the wheel
GUIDE = (
    "You use a computer by its mouse and keyboard. Your task: {instruction}\n"
    "Every action answers with a picture of the screen; coordinates are its pixels, from the top"
    " left corner. Call done when the task is finished, or fail if it cannot be done."
)
ToolAnswer = list[Any]
PixelCoordinate = Annotated[int, Field(ge=0, description="In pixels of the last picture")]
WheelClicks = Annotated[
    int, Field(ge=-MAX_CLICKS, le=MAX_CLICKS, description="Clicks of the wheel; 0 for none")
]
TypedText = Annotated[str, Field(max_length=10_000)]
KeyNames = Annotated[
    list[Annotated[str, Field(min_length=1, max_length=20)]],
    Field(min_length=1, max_length=8, description="Pressed together, such as ctrl and c"),
]


def make_tool_server(
    client: ToolClient,
    *,
    with_tree: bool,
    read_score: Callable[[], float | None] | None,
    note_call: Callable[[], object],
) -> MCPServer[Any]:
    """Return the server; the episode must have begun.

    Args:
        client: The agent of the episode, which the tools act for.
        with_tree: Whether there is the tool `tree`.
        read_score: Returns the score after the end; `None` if the client is not told it.
        note_call: Called before and after each call of a tool.
    """
    turn = client.look()
    guide = GUIDE.format(instruction=turn.instruction)
    tools = _Tools(client, read_score, note_call)
    functions: list[Callable[..., Any]] = [
        tools.screenshot,
        tools.click,
        tools.double_click,
        tools.type,
        tools.keys,
        tools.scroll,
        tools.drag,
        *([tools.tree] if with_tree else []),
        tools.wait,
        tools.done,
        tools.fail,
    ]
    return MCPServer(
        "computer",
        instructions=guide,
        version=__version__,
        log_level="ERROR",
        tools=list(map(_strict_tool, functions)),
    )


def _strict_tool(function: Callable[..., Any]) -> Tool:
    """Return a tool that refuses arguments it does not have, which the SDK's would not notice."""
    tool = Tool.from_function(function, structured_output=False)
    model = tool.fn_metadata.arg_model
    config = {"model_config": ConfigDict(extra="forbid"), "__module__": __name__}
    tool.fn_metadata.arg_model = type(model.__name__, (model,), config)
    tool.parameters = tool.fn_metadata.arg_model.model_json_schema(by_alias=True)
    return tool


class _Tools:
    """The tools; the docstring of each is what clients are told about it."""

    def __init__(
        self,
        client: ToolClient,
        read_score: Callable[[], float | None] | None,
        note_call: Callable[[], object],
    ) -> None:
        self._client = client
        self._read_score = read_score
        self._note_call = note_call

    def screenshot(self) -> ToolAnswer:
        """Look at the screen as it was after the last action, and read the task again."""
        turn = self._look()
        height, width = turn.size
        size = f"The picture has {width}x{height} pixels."
        return [f"Task: {turn.instruction}\n{size}", *_seen(turn)]

    def click(
        self,
        x: PixelCoordinate,
        y: PixelCoordinate,
        button: Literal["left", "right", "middle"] = "left",
    ) -> ToolAnswer:
        """Click at a point."""
        self._check_points((x, y))
        return self._act(action_code("click", x, y, button=button))

    def double_click(self, x: PixelCoordinate, y: PixelCoordinate) -> ToolAnswer:
        """Double-click at a point."""
        self._check_points((x, y))
        return self._act(action_code("doubleClick", x, y))

    def type(self, text: TypedText) -> ToolAnswer:
        """Type a text where the focus is; a line break presses Enter."""
        return self._act(action_code("write", text))

    def keys(self, keys: KeyNames) -> ToolAnswer:
        """Press keys together, such as ["enter"] or ["ctrl", "a"].

        Raises:
            ToolError: A key is unknown, or there twice.
        """
        names = [_check_key(key) for key in keys]
        if len(names) > 1:  # a capital letter alone is Shift and its key; in Ctrl+S it is the key
            names = [name.lower() for name in names]
        if len(set(names)) < len(names):
            raise ToolError("a key is there twice, and keys are pressed together: call once each")
        return self._act(action_code("hotkey", *names))

    def scroll(
        self, x: PixelCoordinate, y: PixelCoordinate, down: WheelClicks = 0, right: WheelClicks = 0
    ) -> ToolAnswer:
        """Turn the wheel at a point; negative numbers scroll up and left."""
        self._check_points((x, y))
        calls = [action_code("moveTo", x, y)]
        if down:
            calls.append(action_code("scroll", -down))
        if right:
            calls.append(action_code("hscroll", right))
        return self._act("\n".join(calls))

    def drag(
        self, x: PixelCoordinate, y: PixelCoordinate, to_x: PixelCoordinate, to_y: PixelCoordinate
    ) -> ToolAnswer:
        """Drag with the left button from one point to another."""
        self._check_points((x, y), (to_x, to_y))
        return self._act(
            f"{action_code('moveTo', x, y)}\n{action_code('dragTo', to_x, to_y, button='left')}"
        )

    def tree(self) -> str:
        """List the elements on the screen: role, name, centre and size in pixels."""
        with self._errors_for_client():
            return self._client.tree()

    def wait(self) -> ToolAnswer:
        """Wait for a second."""
        return self._act(WAIT)

    def done(self) -> ToolAnswer:
        """Say that the task is finished; this ends the episode."""
        return self._act(DONE)

    def fail(self) -> ToolAnswer:
        """Say that the task cannot be done; this ends the episode."""
        return self._act(FAIL)

    def _look(self) -> ClientView:
        with self._errors_for_client():
            return self._client.look()

    def _act(self, action: str) -> ToolAnswer:
        with self._errors_for_client():
            turn = self._client.act(action)
        if turn is not None:
            return _seen(turn)
        score = None if self._read_score is None else self._read_score()
        return [OVER if score is None else f"{OVER} Score: {score:g}"]

    @contextmanager
    def _errors_for_client(self) -> Iterator[None]:
        """Raise what is wrong in the block as the SDK's error, whose text the client is told.

        Raises:
            ToolError: The episode is over, or the desktop does not answer.
        """
        self._note_call()
        try:
            yield
        except HijackError as error:
            raise ToolError(str(error)) from None
        finally:
            self._note_call()

    def _check_points(self, *points: tuple[int, int]) -> None:
        """Check that points are in the picture; otherwise nothing is done, and no step is used.

        Raises:
            ToolError: One of them is outside.
        """
        height, width = self._look().size
        for x, y in points:
            if x >= width or y >= height:
                raise ToolError(
                    f"({x}, {y}) is outside of the picture: x is 0 to {width - 1}, y is 0 to"
                    f" {height - 1}"
                )


def _check_key(key: str) -> str:
    """Return the name of a key in pyautogui's spelling.

    Raises:
        ToolError: There is no such key.
    """
    name = key.lower()
    if len(name) > 1 and name not in NAMED:
        raise ToolError(f"there is no key {key!r}{suggest(name, NAMED)}")
    return name if len(name) > 1 else key


def _seen(turn: ClientView) -> ToolAnswer:
    """Return what a guard says, if it says anything, and the picture."""
    return [*([turn.notice] if turn.notice else []), _image(turn)]


def _image(turn: ClientView) -> Image:
    return Image(data=encode(turn.picture), format="png")
