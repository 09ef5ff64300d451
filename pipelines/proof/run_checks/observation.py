"""Compute the plan, the pictures and the action of one line of an episode again."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data import apply
from hijack_data.actions import count_points
from hijack_data.actions.agent_actions import read_action
from hijack_data.compose import Sequence
from hijack_data.corruption import make_corruption
from hijack_data.errors import ActionError, short_repr
from hijack_data.picture_io import pixel_sha256
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner
from hijack_data.runs.page_layer import LAYER, MAX_DIFFERENCE, compare_painted
from hijack_data.types import Scene, Size, UInt8Array, as_boxes, as_size

from ...dataset.image_codec import decode
from ...readers import fields
from ...readers.safe_files import inside

NOT_A_STRING = (
    "an action must be a string"  # the log has the `repr` of an answer that was not a string
)


@dataclass(frozen=True, kw_only=True)
class ReplayInputs:
    """Everything that decides the plans of an episode.

    Args:
        seed: the seed of all draws.
        sample: the task's id.
        apps: normalised names of the task's applications.
        planner: the corruption; `None` for a clean episode.
        is_stated: whether the log states `planner`; otherwise it is derived from the logged plans.
        size: `(height, width)` of the screen; `None` if the log does not contain it.
        allow_code: whether any code was allowed.
        has_page_layer: whether the run had the browser draw what plans paste.
    """

    seed: int
    sample: str
    apps: tuple[str, ...]
    planner: Planner | None
    is_stated: bool
    size: Size | None
    allow_code: bool
    has_page_layer: bool = False

    @property
    def needs_elements(self) -> bool:
        """Whether the plans depend on where elements are, as far as the log states the planner."""
        return self.planner is not None and self.planner.needs_elements

    def plan(self, scene: Scene, step: int, logged: Plan) -> Plan:
        """Return the plan of a step on a screen."""
        planner = self.planner if self.is_stated else _planner_in(logged)
        if planner is None:
            return Plan.clean(scene.size)
        return planner.plan(scene, seed=self.seed, sample=self.sample, step=step)


@dataclass
class ReplayedObservation:
    """The result for a line: its plan, computed again, and its problems."""

    plan: Plan
    problems: list[str] = field(default_factory=list[str])


def check_observation(
    folder: Path, line: Mapping[str, Any], key: ReplayInputs
) -> ReplayedObservation:
    """Compute an observation again, and the code that ran for the agent's answer.

    Args:
        folder: the episode.
        line: one line of its steps.
        key: what decides its plans.

    Raises:
        HijackError: the line, or its picture, cannot be read.
    """
    logged = Plan.from_data(line.get("plan"))
    boxes = as_boxes(fields.items(line, "boxes"))
    apps = fields.strings(line.get("apps"))
    name = fields.text(line, "image")
    clean = _read_picture(folder, name)
    height, width = clean.shape[:2]
    scene = Scene((height, width), boxes, apps)
    plan = key.plan(scene, fields.step_number(line, "step"), logged)
    observation = ReplayedObservation(plan)
    if apps != key.apps:
        observation.problems.append(
            f"apps are {list(apps)}, those of the record are {list(key.apps)}"
        )
    if key.size is not None and scene.size != key.size:
        screen_size = f"{key.size[1]}x{key.size[0]}"
        observation.problems.append(f"{name}: is {width}x{height}, the screen was {screen_size}")
    if len(boxes) and key.is_stated and not key.needs_elements:
        observation.problems.append("there are boxes, and no plan needs them")
    observation.problems += _plan_problems(line, logged, plan)
    observation.problems += _picture_problems(folder, line, clean, plan, key.has_page_layer)
    observation.problems += _action_problems(line, plan, key.allow_code)
    text = line.get("said")
    if text is not None and not isinstance(text, str):
        observation.problems.append(f"said must be a string, got {short_repr(text)}")
    return observation


def _plan_problems(line: Mapping[str, Any], logged: Plan, plan: Plan) -> list[str]:
    problems: list[str] = []
    stored = line.get("plan_digest")
    logged_digest = logged.digest()
    new_digest = plan.digest()
    if logged_digest != stored:
        problems.append(f"plan_digest is not that of the plan ({stored})")
    if new_digest != logged_digest:
        problems.append(
            f"planned again the plan is another: {new_digest[:16]}, it was {logged_digest[:16]}"
        )
    return problems


def _picture_problems(
    folder: Path, line: Mapping[str, Any], clean: UInt8Array, plan: Plan, has_page_layer: bool
) -> list[str]:
    name = line["image"]
    stored = line.get("seen")
    agent_digest = line.get("seen_sha256")
    problems: list[str] = []
    is_rendered = line.get(LAYER) is not None and stored is not None
    if is_rendered and not has_page_layer:
        problems.append(f"{LAYER}: the browser drew nothing in this run, so pixels must be equal")
    elif is_rendered:
        problems += _rendered_problems(folder, line, plan)
    elif pixel_sha256(apply(plan, clean) if plan.ops else clean) != agent_digest:
        problems.append(f"{name}: disturbed again it is not what the agent saw (seen_sha256)")
    if not problems and pixel_sha256(clean) != line.get("image_sha256"):
        problems.append(f"{name}: is not what was on the screen (image_sha256)")
    if (stored is not None) != bool(plan.ops):
        problems.append(
            f"seen is {short_repr(stored)}, and the plan has {len(plan.ops)} operations"
        )
    if stored is not None and pixel_sha256(_read_picture(folder, str(stored))) != agent_digest:
        problems.append(f"{stored}: is not what the agent saw (seen_sha256)")
    return problems


def _rendered_problems(folder: Path, line: Mapping[str, Any], plan: Plan) -> list[str]:
    """Compare a picture whose plan the browser drew with what the plan paints."""
    name = str(line["seen"])
    layer = fields.mapping(line.get(LAYER), LAYER)
    picture = _read_picture(folder, name)
    area = layer.get("area")
    if picture.shape[:2] != plan.size:
        return [f"{name}: is not of the size of the screen"]
    if not isinstance(area, list) or any(type(side) is not int or side < 0 for side in area):
        return [f"{LAYER}.area must be [height, width], got {short_repr(area)}"]
    pixels, difference = compare_painted(plan, picture, as_size(area))
    if (pixels, difference) != (layer.get("pixels"), layer.get("difference")):
        return [f"{name}: {LAYER} is not what the picture shows: {pixels} pixels, {difference}"]
    if difference > MAX_DIFFERENCE:
        return [f"{name}: differs from its plan by {difference}, at most {MAX_DIFFERENCE}"]
    return []


def _action_problems(line: Mapping[str, Any], plan: Plan, allow_code: bool) -> list[str]:
    """Compare the code that ran with the agent's answer, mapped to the real screen."""
    raw = line.get("raw")
    logged = line.get("code")
    if raw is None and logged is None:
        return []
    if raw is None:
        return ["code ran without an answer of the agent (raw is null)"]
    if not isinstance(raw, str):
        return [f"raw must be a string, got {short_repr(raw)}"]
    if logged is None and str(line.get("error")).startswith(NOT_A_STRING):
        return []
    code = _map_to_screen(raw, plan, allow_code)
    if code == logged:
        return []
    outcome = "is refused" if code is None else f"gives {short_repr(code)}"
    return [f"read again the agent's answer (raw) {outcome}, code is {short_repr(logged)}"]


def _map_to_screen(raw: str, plan: Plan, allow_code: bool) -> str | None:
    """Return the code for an answer, in pixels of the screen; `None` if it is refused."""
    try:
        request = read_action(raw, allow_code)
        if request.kind != "code":
            return request.code
        return plan.coords.code_to_screen(request.code)
    except ActionError:
        return None


def answer_points(raw: object, allow_code: bool) -> tuple[int, int]:
    """Return how many points an answer names, and how many of them are fractions."""
    try:
        request = read_action(raw, allow_code)
    except ActionError:
        return 0, 0
    return count_points(request.code) if request.kind == "code" else (0, 0)


def _planner_in(logged: Plan) -> Planner | None:
    """Return the planner named in a plan, for logs that do not state the planner."""
    if logged.corruption == CLEAN:
        return None
    parts = [make_corruption(name, **params) for name, params in logged.parts]
    return parts[0] if len(parts) == 1 else Sequence(parts)


def _read_picture(folder: Path, name: str) -> UInt8Array:
    return decode(inside(folder, name).read_bytes(), name)
