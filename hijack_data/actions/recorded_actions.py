"""Map the action texts of recordings and dataset rows to a resized picture."""

import json
from collections.abc import Mapping
from typing import Any, cast

from .dialects import DICT_DIALECTS, FRACTIONS, RESIZED_DIALECTS, map_typed
from .scaling import Scaling

# Nothing in the text depends on the size of the picture: no coordinates at all, or fractions of it.
SIZELESS = "sizeless"
SCREENAGENT = "screenagent"


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


def _mapped(data: object, dialect: str, scaling: Scaling) -> object:
    if dialect in DICT_DIALECTS:
        return map_typed(data, dialect, scaling)
    fields: dict[str, Any] = dict(cast("Mapping[str, Any]", data))
    position: Any = fields.get("mouse_position")
    if isinstance(position, dict):
        x, y = scaling.point(cast(Any, position)["width"], cast(Any, position)["height"])
        fields["mouse_position"] = {"width": x, "height": y}
    return fields
