"""Convert the answers of foreign agents to our actions."""

from collections.abc import Mapping
from typing import Any, cast

from hijack_data.actions import code_of, unreadable_action
from hijack_data.errors import ActionError, ParameterTypeError, short_repr
from hijack_data.types import Size

PYAUTOGUI = "pyautogui"
COMPUTER_13 = "computer_13"


def read_action_codes(action: object, dialect: str, size: Size) -> tuple[list[str], str]:
    """Return an action as pyautogui code, WAIT, DONE or FAIL, and why it could not be read.

    An action that cannot be read becomes a text that the environment refuses: the step is used up
    and counted as malformed, as for our own agents.

    Args:
        action: Code, a word, or a dict, in the form of the dialect.
        dialect: One of `hijack_data.actions.DIALECTS`.
        size: (height, width) of the picture that the agent saw.

    Raises:
        UnknownNameError: There is no such dialect.
    """
    try:
        codes = _read(action, dialect, size)
    except (ActionError, ParameterTypeError) as error:
        return [unreadable_action(error)], str(error)
    return codes, ""


def _read(action: object, dialect: str, size: Size) -> list[str]:
    if dialect != PYAUTOGUI:
        codes = code_of(action, dialect, size)
        if not codes:
            raise ActionError(f"{dialect}: {short_repr(action)} holds no action")
        return codes
    if not isinstance(action, str):
        raise ActionError(f"an action must be a string, got {short_repr(action)}")
    return [action]


def read_osworld_codes(action: object, size: Size) -> list[str]:
    """Convert an answer of one of OSWorld's agents, as `read_action_codes` does.

    Its agents answer with code or a word, with a dict of `computer_13`, or with a dict that holds
    the code under `command`, or under `action` beside `action_space: pyautogui`.
    """
    if isinstance(action, str):
        return [action]
    if isinstance(action, Mapping):
        fields = cast("Mapping[str, Any]", action)
        code = _code_in(fields)
        if code is not None:
            return [code]
    codes, _ = read_action_codes(action, COMPUTER_13, size)
    return codes


def _code_in(fields: Mapping[str, Any]) -> str | None:
    if isinstance(fields.get("command"), str):
        return fields["command"]
    if fields.get("action_space") == PYAUTOGUI and isinstance(fields.get("action"), str):
        return fields["action"]
    return None
