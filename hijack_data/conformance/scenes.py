"""Check that a corruption copes with unusual screens, and that `needs_elements` is right."""

from functools import lru_cache

from .._apply import apply
from ..corruption import Corruption
from ..errors import HijackError, ParameterError
from ..plan import Plan
from ..types import Scene, as_boxes
from . import cases
from .base import expect, fail

SEEDS = range(4)


def check_scenes(cls: type[Corruption]) -> list[str]:
    """Any screen gives an applicable plan, or a `ParameterError` with the reason."""
    refused: dict[str, str] = {}
    for spec in cases.levels(cls):
        for description, screen in cases.unusual_scenes():
            plan = _plan_or_reason(spec, description, screen)
            if isinstance(plan, Plan):
                _check_applies(plan, description, screen)
            elif screen.size == cases.SIZES[0]:
                refused[description] = plan
    return [
        f"a screen {description} is refused: {reason}" for description, reason in refused.items()
    ]


def _plan_or_reason(spec: Corruption, description: str, screen: Scene) -> Plan | str:
    """Return the plan, or the reason why the screen is refused."""
    try:
        return spec.plan(screen, seed=2, sample="scenes")
    except ParameterError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001  (a plug-in may raise anything)
        fail(f"on a screen {description}: {type(error).__name__}: {error}")


def _check_applies(plan: Plan, description: str, screen: Scene) -> None:
    expect(
        Plan.from_json(plan.to_json()) == plan,
        f"the plan for a screen {description} is not JSON data",
    )
    if not plan.ops:
        return
    try:
        out = apply(plan, _picture(screen.size))
    except HijackError as error:
        fail(f"the plan for a screen {description} cannot be applied: {error}")
    size = out.shape[:2]
    expect(size == plan.out_size, f"the plan for a screen {description} gives a picture of {size}")


_picture = lru_cache(cases.picture)


def check_elements(cls: type[Corruption]) -> list[str]:
    """Without `needs_elements` a plan is the same whether or not the elements are known."""
    full = cases.scene(cases.SIZES[0])
    without_boxes = Scene(full.size, as_boxes(None), full.apps, full.target)
    notes: list[str] = []
    for spec in cases.variants(cls):
        differs = any(
            _outcome(spec, full, seed) != _outcome(spec, without_boxes, seed) for seed in SEEDS
        )
        expect(
            spec.needs_elements or not differs,
            f"plans depend on scene.boxes, yet needs_elements is false ({spec.params()}): boxes "
            "are looked for only where it is true, so override needs_elements",
        )
        if spec.needs_elements and not differs and cls.scope != "action":
            notes.append(
                f"needs_elements is true, yet plans are the same without boxes: {spec.params()}"
            )
    return notes[:1]


def _outcome(spec: Corruption, screen: Scene, seed: int) -> str:
    try:
        return spec.plan(screen, seed=seed, sample="elements").digest()
    except Exception as error:  # noqa: BLE001  (an IndexError shows that boxes are read)
        return type(error).__name__
