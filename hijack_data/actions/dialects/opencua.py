"""Code in replies: OpenCUA's, and pyautogui code in a ``` fence.

OpenCUA thinks in prose and ends with a fence of pyautogui code, in which `computer.wait()`,
`.terminate(status='success')` and `.triple_click(x, y)` stand beside pyautogui's own functions. Its
points are pixels of the smart-resized picture.
"""

import ast
import re
import textwrap
from typing import cast

from ...errors import ActionError, short_repr
from ...types import Action
from ..agent_actions import fenced_spans
from ..pyautogui_functions import AGENTNET_TRIPLE
from ..python_source import ParsedSource, TextEdit, apply_edits, refuse_deep_nesting
from ..scaling import Scaling
from .answer_text import answer_text
from .pyautogui_code import calls_pyautogui, map_code
from .pyautogui_parse import parse_pyautogui
from .pyautogui_write import write_pyautogui


def map_fenced(reply: object, scaling: Scaling) -> str:
    """Return a reply with the code in its fences scaled, or all of it if it has no fence.

    Raises:
        ActionError: the code cannot be mapped.
    """
    answer = answer_text(reply, "opencua")
    text = cast("str", reply)
    spans = fenced_spans(answer)
    if not spans:
        return map_code(text, scaling)
    edits = [TextEdit(start, end, _map_block(text[start:end], scaling)) for start, end in spans]
    return apply_edits(text, edits)


def parse_fenced(reply: object, scaling: Scaling) -> list[Action]:
    """Return the action of each fence.

    Raises:
        ActionError: the code cannot be mapped.
    """
    answer = answer_text(reply, "opencua")
    spans = fenced_spans(answer) or [(0, len(answer))]
    blocks = [textwrap.dedent(answer[start:end]).strip() for start, end in spans]
    if scaling == Scaling.pixels(None):
        return [parse_pyautogui(block, None) for block in blocks]
    size = scaling.target if scaling.clamp else None
    return [parse_pyautogui(map_code(block, scaling), size) for block in blocks]


def fenced_code(reply: object, scaling: Scaling) -> list[str]:
    """Return the action of each fence as code in pixels.

    Raises:
        ActionError: the code cannot be mapped, or a block is no action.
    """
    answer = answer_text(reply, "opencua")
    spans = fenced_spans(answer) or [(0, len(answer))]
    blocks = [textwrap.dedent(answer[start:end]).strip() for start, end in spans]
    codes = [plain_code(map_code(block, scaling), scaling) for block in blocks]
    for code in codes:
        if not calls_pyautogui(code) and parse_pyautogui(code, None).type == "other":
            raise ActionError(
                f"opencua: {short_repr(code)} is no action; write pyautogui code in a fence"
            )
    return codes


def plain_code(code: str, scaling: Scaling) -> str:
    """Return code without AgentNet's `computer`, which a desktop does not have.

    Args:
        code: the code, in pixels of `scaling.target`.
        scaling: names the size of the picture.

    Raises:
        ActionError: `computer` waits or terminates beside other calls.
    """
    if "computer" not in code:
        return code
    with refuse_deep_nesting():
        source = ParsedSource(code)
        edits = [
            TextEdit(*source.span(node), "pyautogui.tripleClick")
            for node in ast.walk(source.tree)
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == "computer"
            and node.attr in ("tripleClick", AGENTNET_TRIPLE)
        ]
        rewritten = source.edited(edits)
    if not re.search(r"\bcomputer\s*\.\s*\w+\s*\(", rewritten):
        return rewritten
    return write_pyautogui(parse_pyautogui(rewritten, scaling.target if scaling.clamp else None))


def _map_block(block: str, scaling: Scaling) -> str:
    """Return a block of code scaled; a block that is indented as a whole keeps its indentation."""
    dedented = textwrap.dedent(block)
    if dedented == block:
        return map_code(block, scaling)
    indent = block[: len(block) - len(block.lstrip(" \t"))]
    return textwrap.indent(map_code(dedented, scaling), indent)
