"""Read recorded actions in their agents' dialects, and map them to corrupted pictures.

`Step.action_code` keeps the recorded text verbatim (dicts as JSON). A `RecordedStep` names its
dialect.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

from hijack_data.actions import FRACTIONS as DIALECT_FRACTIONS
from hijack_data.actions import RESIZED_DIALECTS, Scaling, map_code, parse_pyautogui, parse_with
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.actions.input_faults import InputFault
from hijack_data.actions.recorded_actions import map_recorded
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, HijackError, ParameterError
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Action, Size, Step

from ..choices import COORDINATES, FRACTIONS, PIXELS, RESIZED, THOUSAND
from . import fields
from .fields import FieldError
from .reader_options import Space, space_scaling

PYAUTOGUI = "pyautogui"
COMPUTER_13 = "computer_13"
UI_TARS = "ui_tars"
UI_TARS_15 = "ui_tars_1.5"
OPENAI = "openai"
ANTHROPIC = "anthropic"
QWEN_25 = "qwen2.5_vl"
QWEN_3 = "qwen3_vl"
# The spaces of dialects that are not in pixels.
OWN_SPACES: Mapping[str, Space] = {
    **dict.fromkeys([name for name, unit in DIALECT_FRACTIONS.items() if unit == 1000], THOUSAND),
    **dict.fromkeys([name for name, unit in DIALECT_FRACTIONS.items() if unit == 1], FRACTIONS),
    **dict.fromkeys(RESIZED_DIALECTS, RESIZED),
}
_VERSIONS: Mapping[str, Mapping[Space, str]] = {
    UI_TARS: {THOUSAND: UI_TARS, RESIZED: UI_TARS_15},
    QWEN_3: {THOUSAND: QWEN_3, RESIZED: QWEN_25},
    **{
        dialect: {OWN_SPACES[dialect]: dialect}
        for dialect in ("glm", "cogagent", "autoglm", "showui")
    },
}


@dataclass(frozen=True)
class RecordedStep(Step):
    """A step whose `action_code` may be in another dialect than pyautogui.

    Args:
        dialect: one of `hijack_data.actions.DIALECTS`, `SCREENAGENT` or `SIZELESS`.
        acts: false if the step does nothing on the screen, as a plan or a thought.
    """

    dialect: str = PYAUTOGUI
    acts: bool = True


@dataclass(frozen=True)
class AlteredStep(RecordedStep):
    """A step of which the machine received something else than the agent did.

    `action` and `action_code` are what the agent did; `extra` says what the machine received.

    Args:
        faults: the faults of the input that hit the action.
    """

    faults: tuple[InputFault, ...] = ()


@dataclass(frozen=True)
class ParsedAction:
    """A recorded action: the text that a step keeps, and its dialect."""

    action: Action
    code: str
    dialect: str


def first_action(
    raw: object, dialect: str, size: Size, field: str, space: Space | None = None
) -> Action:
    """Return the action, or the first of several, in pixels of a picture.

    Args:
        raw: text or a dict in the dialect.
        dialect: name of the dialect.
        size: (height, width) of the picture.
        field: name of the field in errors.
        space: the space of the coordinates, if that is not the dialect's own.

    Raises:
        FieldError: the value is not an action of the dialect, or points outside the picture.
    """
    default_space = OWN_SPACES.get(dialect, PIXELS)
    try:
        action = _parsed(raw, dialect, space_scaling(space or default_space, size))
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    return fields.check_on_screen(action, size, field)


def read_recorded(
    raw: object, dialect: str, size: Size, field: str, choice: str | None, default: Space | None
) -> ParsedAction:
    """Return an action whose coordinates are in the chosen space, or in the default one.

    If a family of models has a version with that space, its dialect is used. If there is none, or
    if pyautogui code or a dictionary is not in pixels, the code is rewritten in pixels, because
    rows do not name their space. Without choice and default, an action at a point is refused.

    Args:
        raw: text or a dict in the dialect.
        dialect: name of the dialect.
        size: (height, width) of the picture.
        field: name of the field in errors.
        choice: the space that the user chose.
        default: the space without a choice.

    Raises:
        FieldError: the action cannot be read; the message names the spaces that the numbers fit.
    """
    space = choice or default
    if space is None:
        return _pointless(raw, dialect, size, field)
    try:
        action = first_action(raw, dialect, size, field, space)
    except FieldError as error:
        fit = "" if choice else _hint(raw, dialect, size, space)
        raise FieldError(field, f"{error.reason}{fit}") from None
    version = _VERSIONS.get(dialect, {PIXELS: dialect}).get(space)
    if version is not None:
        return ParsedAction(action, raw_action_text(raw, field), version)
    code = _in_pixels(raw, dialect, action, space_scaling(space, size))
    return ParsedAction(action, code, PYAUTOGUI)


def _pointless(raw: object, dialect: str, size: Size, field: str) -> ParsedAction:
    try:
        action = _parsed(raw, dialect, Scaling((1, 1), (1, 1), clamp=False))
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    if action.point or action.end:
        fit = _hint(raw, dialect, size, None)
        raise FieldError(field, f"nothing says what its coordinates count{fit}")
    return ParsedAction(
        fields.check_on_screen(action, size, field), raw_action_text(raw, field), dialect
    )


def _in_pixels(raw: object, dialect: str, action: Action, scaling: Scaling) -> str:
    """Return the code of an action in pixels; `""` if pyautogui cannot express it."""
    if dialect == PYAUTOGUI:
        return map_code(cast("str", raw), scaling)
    try:
        return write_pyautogui(action)
    except ActionError:
        return ""


def _hint(raw: object, dialect: str, size: Size, tried_space: Space | None) -> str:
    """Return a remedy that lists the spaces, other than the known one, that an action fits."""
    fit: list[str] = []
    for space in COORDINATES:
        if space == tried_space:
            continue
        try:
            action = first_action(raw, dialect, size, "", space)
        except FieldError:
            continue
        if action.point or action.end:
            fit.append(space)
    if not fit:
        return ""
    return f"; it fits {' or '.join(fit)}: say which with --coordinates"


def raw_action_text(raw: object, field: str) -> str:
    """Return the text that `action_code` keeps of a recorded action.

    Raises:
        FieldError: a dataset cannot store the action.
    """
    if isinstance(raw, str):
        return fields.storable(raw, field)
    try:
        text = json.dumps(raw, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise FieldError(field, f"cannot be kept as JSON ({error})") from None
    return fields.storable(text, field)


def observed_code(coords: CoordMap, step: Step) -> str:
    """Return the `action_code` of a step in pixels of the observation of `coords`.

    The code stays in its dialect.

    Raises:
        ActionError: the code cannot be mapped.
    """
    dialect = step.dialect if isinstance(step, RecordedStep) else PYAUTOGUI
    if coords.is_identity:
        return step.action_code
    scaling = Scaling(coords.screen, coords.observation)
    model = _between_models(coords) if dialect in RESIZED_DIALECTS else scaling
    return map_recorded(step.action_code, dialect, scaling, model)


def _parsed(raw: object, dialect: str, scaling: Scaling) -> Action:
    # Pixels are not clamped, so that a point outside can be distinguished from one at the edge.
    if dialect == PYAUTOGUI:
        code = cast("str", raw)
        in_pixels = scaling == Scaling.pixels(None)
        return parse_pyautogui(code if in_pixels else map_code(code, scaling), None)
    return parse_with(raw, dialect, scaling)[0]


def _between_models(coords: CoordMap) -> Scaling:
    try:
        return Scaling(smart_resize(*coords.screen), smart_resize(*coords.observation))
    except ParameterError as error:
        raise ActionError(str(error)) from None
