"""Map the action texts of recordings and dataset rows to a resized picture."""

import json
from collections.abc import Mapping
from typing import Any, cast

from ..errors import HijackError
from ..types import Action
from .dialects import DIALECTS, DICT_DIALECTS, FRACTIONS, RESIZED_DIALECTS, map_typed, parse_actions
from .dialects.pyautogui_code import calls_pyautogui
from .scaling import Scaling

# Nothing in the text depends on the size of the picture: no coordinates at all, or fractions of it.
SIZELESS = "sizeless"
SCREENAGENT = "screenagent"
_ANY_SIZE = (1000, 1000)
# Entries of lists that change nothing on the screen: of ScreenAgent, OpenAI and Anthropic.
_IDLE = ("PlanAction", "EvaluateSubTaskAction", "WaitAction", "wait", "screenshot")


def map_recorded(code: str, dialect: str, scaling: Scaling, model: Scaling) -> str:
    """Return recorded text with its coordinates scaled.

    Args:
        code: text of a dialect; dictionaries are JSON, alone or in a list.
        dialect: one of `hijack_data.actions.DIALECTS`, `SCREENAGENT` or `SIZELESS`.
        scaling: maps from the picture for which the code was written to the resized picture.
        model: maps between the two smart-resized pictures, to which the coordinates of
            `RESIZED_DIALECTS` refer.

    Raises:
        ActionError: the text cannot be mapped.
    """
    if not code or dialect == SIZELESS or dialect in FRACTIONS:
        return code
    if dialect == "pyautogui":
        return map_typed(code, dialect, scaling)
    if dialect in RESIZED_DIALECTS:
        return map_typed(code, dialect, model)
    data: object = json.loads(code)
    if isinstance(data, list):
        mapped = [_mapped(item, dialect, scaling) for item in cast("list[Any]", data)]
        return json.dumps(mapped, ensure_ascii=False)
    return json.dumps(_mapped(data, dialect, scaling), ensure_ascii=False)


def holds_several(code: str, first: Action) -> bool:
    """Return whether a reply of a model holds more actions than its first one; waits do not count.

    A recorded step has the first action of a reply as its own. Code of pyautogui is one action
    however many calls it has.

    Args:
        code: the recorded text, of any dialect; dictionaries are JSON, alone or in a list.
        first: the first action.
    """
    if not code or calls_pyautogui(code):
        return False
    try:
        data: object = json.loads(code)
    except (ValueError, RecursionError):
        data = None
    if isinstance(data, list):
        return sum(map(_acts, cast("list[Any]", data))) > 1
    for dialect in DIALECTS:
        raw = data if dialect in DICT_DIALECTS else code
        if dialect == "pyautogui" or raw is None:
            continue
        try:
            actions = parse_actions(raw, dialect, _ANY_SIZE)
        except HijackError:
            continue
        acting = [action for action in actions if action.type != "wait"]
        if len(acting) > 1 and acting[0].type == first.type:
            return True
    return False


def _acts(entry: Any) -> bool:
    """Return whether an entry of a recorded list does something on the screen."""
    fields = cast("dict[str, Any]", entry) if isinstance(entry, dict) else {}
    kinds = (fields.get("action_type"), fields.get("type"), fields.get("action"))
    return not any(kind in _IDLE for kind in kinds if isinstance(kind, str))


def _mapped(data: object, dialect: str, scaling: Scaling) -> object:
    if dialect in DICT_DIALECTS:
        return map_typed(data, dialect, scaling)
    fields: dict[str, Any] = dict(cast("Mapping[str, Any]", data))
    position: Any = fields.get("mouse_position")
    if isinstance(position, dict):
        x, y = scaling.point(cast(Any, position)["width"], cast(Any, position)["height"])
        fields["mouse_position"] = {"width": x, "height": y}
    return fields
