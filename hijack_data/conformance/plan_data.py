"""Check that a plan is independent data, and that planning changes nothing else."""

import os
import pickle
from contextlib import suppress
from typing import Any

from ..corruption import Corruption
from ..errors import HijackError
from ..plan import Plan
from ..types import Scene
from . import cases
from .base import expect, fail


def check_plan_is_data(cls: type[Corruption]) -> None:
    """Plans survive JSON and pickling unchanged, and an edited plan is refused."""
    for plan, _ in cases.plans(cls):
        text = _written(plan)
        again = Plan.from_json(text)
        advice = "keep tuples and NumPy numbers out of recipes, and lists out of plans"
        expect(again == plan, f"Plan.from_json(plan.to_json()) differs: {advice}")
        expect(again.digest() == plan.digest(), "the digest changes in a JSON round trip")
        copied = pickle.loads(pickle.dumps(plan))  # noqa: S301
        expect(copied == plan, "the plan does not survive pickling")
        name = f'"corruption":"{plan.corruption}"'
        edited = text.replace(name, '"corruption":"edited-v1"')
        expect(_refused(edited), "an edited plan is accepted")


def _written(plan: Plan) -> str:
    try:
        return plan.to_json()
    except HijackError:
        raise
    except (TypeError, ValueError) as error:
        fail(f"the plan is not JSON data ({error}); use int(...), float(...), lists and texts")


def _refused(text: str) -> bool:
    try:
        Plan.from_json(text)
    except HijackError:
        return True
    return False


def check_kept(cls: type[Corruption]) -> None:
    """Later plans do not change an earlier one."""
    screen = cases.scene(cases.SIZES[0])
    specs = cases.levels(cls)
    made = [spec.plan(screen, seed=seed, sample="kept") for spec in specs for seed in range(3)]
    told = [plan.to_json() for plan in made]
    for spec in reversed(specs):
        for seed in range(3, 6):
            spec.plan(screen, seed=seed, sample="later", epoch=1).to_json()
    expect(
        [plan.to_json() for plan in made] == told,
        "planning again changes plans that were made before: give each plan a recipe, parameters "
        "of effects and lists of its own",
    )


def check_untouched(cls: type[Corruption]) -> None:
    """Planning changes none of its inputs: scene, corruption, severities, environment."""
    given = [cases.scene(cases.SIZES[0]), *(other for _, other in cases.unusual_scenes())]
    for spec in cases.levels(cls):
        for screen in given:
            before = _state(spec, screen)
            with suppress(Exception):  # the checks in `scenes` report what planning raises
                spec.plan(screen, seed=1, sample="untouched")
            changed = [key for key, value in _state(spec, screen).items() if before[key] != value]
            advice = "only read what is given, or work on a copy"
            expect(not changed, f"planning changes {', '.join(changed)}; {advice}")


def _state(spec: Corruption, screen: Scene) -> dict[str, Any]:
    """Return everything that planning sees and must not change, as values to compare."""
    return {
        "scene.boxes": (screen.boxes.tolist(), str(screen.boxes.dtype)),
        "scene.size": screen.size,
        "scene.apps": tuple(screen.apps),
        "scene.target": screen.target,
        "the attributes of scene": sorted(vars(screen)),
        "the parameters of the corruption": repr(spec.params()),
        "severities": repr(type(spec).severities),
        "os.environ": dict(os.environ),
        "the working directory": os.getcwd(),
    }
