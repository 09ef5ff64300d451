"""The formats of labels, and how labels of each follow the pixels when a picture is resized.

| format | also called | what it is |
|---|---|---|
| `xyxy`, `xywh` | `pascal_voc`, `box`; `coco` | boxes in pixels: two corners; a corner and the
sides |
| `cxcywh`, `yxyx` | | boxes in pixels: the centre and the sides; two corners, y first |
| `xyxy01` and so on | `albumentations`; `yolo` for `cxcywh01` | boxes in fractions 0..1 of the
picture |
| `xyxy1000` and so on | | boxes in 0..1000 of the picture |
| `xy`, `yx` | `point`, `points`, `keypoints`, `polygon` | points in pixels |
| `xy01`, `xy1000`, `yx01`, `yx1000` | `point01`, `point1000` | points in fractions, in 0..1000 |
| `xyv` | | points in pixels with a visibility, 0 for none (COCO's key points) |
| `x`, `y` | | one coordinate of points in pixels |
| `dx`, `dy` | | a width or distance, a height or distance, in pixels |
| `width`, `height`, `hw`, `wh` | | the size of the picture |
| `mask` | | one value a pixel, `[..., H, W]` |
| `action` | | an `Action`, or a dictionary as the rows of a dataset have it |
| a dialect such as `qwen3_vl` | | actions, see `hijack_data.actions.DIALECTS` |
| `grounding`, `grounding_resized` | `bbox_2d`, `<box>`; `bbox_2d_resized` | text with marks in
pixels of the picture, of the smart-resized one, see `grounding` |
| `grounding01`, `grounding1000` | `bbox_2d01`, `<box>1000` | the same in fractions |
| `loc` | `<loc>` | text with `<loc...>` tokens |
| `chat(...)` | | a conversation, see `chat` |
| a function | | maps `(value, move)` to the value after the move |
| `picture` | | pictures that follow the plan as the main one does, `hijack_data.sample_pictures` |
| `leave` | `None` | passes as it is |

An entry may hold one box or point, or many in any nesting of lists, tuples, arrays and tensors, or
a flat list of numbers.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from ..actions import DIALECTS
from ..errors import HijackError, LabelError, ParameterTypeError, UnknownNameError, suggest
from ..types import Size
from .action_formats import dialect_format, map_own_action, own_locations
from .base import LEAVE, Format, Location, Move
from .box_formats import ORDERS, box_format
from .chat import ROLES, ChatLabels, TextMapper, chat_format, function_format
from .grounding_text import RESIZED, grounding_aliases, grounding_format, loc_format
from .point_formats import point_format
from .size_and_mask_formats import coordinate_format, map_mask, size_format

PICTURE = "picture"  # its pixels are changed before labels are


def _formats() -> dict[str, Format]:
    formats = [box_format(order, unit) for order in ORDERS for unit in (0, 1, 1000)]
    formats += [point_format(order, unit) for order in ("xy", "yx") for unit in (0, 1, 1000)]
    formats += [point_format("xy", 0, visibility=True)]
    formats += [coordinate_format(name) for name in ("x", "y", "dx", "dy")]
    formats += [size_format(name) for name in ("width", "height", "hw", "wh")]
    formats += [Format("mask", map_mask), Format("action", map_own_action, own_locations)]
    formats += [dialect_format(dialect) for dialect in DIALECTS]
    formats += [*(grounding_format(unit) for unit in (0, 1, 1000, RESIZED)), loc_format()]
    formats += [Format(name, lambda value, _: value) for name in (PICTURE, LEAVE)]
    return {form.name: form for form in formats}


FORMATS: Mapping[str, Format] = _formats()
ALIASES: Mapping[str, str] = {
    "pascal_voc": "xyxy",
    "box": "xyxy",
    "boxes": "xyxy",
    "coco": "xywh",
    "yolo": "cxcywh01",
    "albumentations": "xyxy01",
    "point": "xy",
    "points": "xy",
    "keypoints": "xy",
    "polygon": "xy",
    "point01": "xy01",
    "points01": "xy01",
    "point1000": "xy1000",
    "points1000": "xy1000",
    "box01": "xyxy01",
    "box1000": "xyxy1000",
    **grounding_aliases(),
}


def find_format(name: object) -> Format:
    """Return the format of that name, of a function or of `chat(...)`; `None` is `leave`.

    Raises:
        ParameterError: a function cannot be pickled.
        ParameterTypeError: it is none of these.
        UnknownNameError: there is no such format.
    """
    if name is None:
        return FORMATS[LEAVE]
    if isinstance(name, ChatLabels):
        other_format = None if name.others is None else find_format(name.others)
        return chat_format(name, find_format(name.form), other_format)
    if callable(name):
        return function_format(name)
    if not isinstance(name, str):
        raise ParameterTypeError(
            f"the format of a label must be a name such as 'xyxy', got {name!r}"
        )
    full_name = ALIASES.get(name.lower(), name.lower())
    if full_name not in FORMATS:
        raise UnknownNameError(
            f"unknown format of labels {name!r}{suggest(name, [*FORMATS, *ALIASES])}; known:"
            f" {', '.join(FORMATS)}"
        )
    return FORMATS[full_name]


def chat(
    form: str | TextMapper,
    roles: Sequence[str] = ("assistant",),
    indices: Sequence[int] | None = None,
    others: str | TextMapper | None = None,
) -> ChatLabels:
    """Declare an entry that holds a conversation, of which some messages hold coordinates.

    Args:
        form: how the text of the addressed messages is written: a dialect of actions, another
            format of labels, or a function `(text, move) -> text` at the top level of a module.
            Tool calls (`tool_calls`) and blocks such as `tool_use` are given to it as dictionaries.
        roles: the roles of the addressed messages. `human` and `gpt` are `user` and `assistant`.
        indices: the positions of the addressed messages among all messages, from 0, or from the end
            if negative; all if `None`.
        others: the format of all other messages. By default they stay as they are, and one with two
            numbers, of which one is above 1, is an error: a prompt may name a point, or the size of
            the screen. `"leave"` lets them pass.

    Returns:
        A value for `labels=`.

    Raises:
        ParameterError: a role is given twice or none is given, or a function cannot be pickled.
        ParameterTypeError: an argument has another type.
        UnknownNameError: there is no such format.
    """
    names = (roles,) if isinstance(roles, str) else tuple(roles)
    if not names or not all(isinstance(cast("object", name), str) for name in names):
        raise ParameterTypeError(f"chat roles must be texts such as 'assistant', got {roles!r}")
    positions = None if indices is None else tuple(indices)
    if positions is not None and not all(type(cast("object", index)) is int for index in positions):
        raise ParameterTypeError(f"chat indices must be whole numbers, got {indices!r}")
    for entry in (form, others):
        if entry is not None:
            find_format(entry)
    return ChatLabels(form, tuple(ROLES.get(name, name) for name in names), positions, others)


def map_label(key: str, form: Format, value: Any, move: Move) -> Any:
    """Return a label after a move.

    Raises:
        LabelError: the label cannot follow the pixels; the message names its key.
    """
    try:
        return form.map_value(value, move)
    except HijackError as error:
        raise LabelError(_about(key, form, error)) from None


def label_locations(key: str, form: Format, value: Any, size: Size) -> list[Location]:
    """Return where a label points.

    Raises:
        LabelError: the label cannot be right; the message names its key.
    """
    try:
        return form.locate(value, size)
    except HijackError as error:
        raise LabelError(_about(key, form, error)) from None


def _about(key: str, form: Format, error: Exception) -> str:
    return (
        f"the sample's entry {key!r}, as {form.name}: {error}; labels={{{key!r}: ...}} says how it"
        " is written"
    )
