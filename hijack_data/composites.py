"""Show an effect on the machine in a single screenshot, composed from recorded pictures.

The composing is done by `pipelines`, which also does it for datasets; its function is named as text
and imported on first use.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from .plan import Paste, Plan
from .planner import Planner
from .types import Fidelity, Scene, UInt8Array

# The function of `pipelines` that does it, with the same arguments as `composite`.
MAKER = "pipelines.edits.single_picture:composite"


@dataclass(frozen=True)
class Composite:
    """An effect shown as a picture.

    Args:
        plan: the plan of the effect with the operations that show it.
        fidelity: how realistic the picture is, see docs/composites.md.
        event: what happened, one plain sentence.
    """

    plan: Plan
    fidelity: Fidelity
    event: str


def composite(
    plan: Plan, image: UInt8Array, scene: Scene, *, seed: int = 0, sample: int | str = 0
) -> Composite:
    """Show the effects of a plan on a screenshot of any desktop.

    Only `scene` describes a single screenshot: if it names no applications, the effect is shown for
    any application for which recorded pictures exist.

    Passes on `HijackError` (the effect cannot be shown on this screenshot; the message says why).

    Args:
        plan: with one effect or more.
        image: the screenshot, uint8 RGB `[H, W, 3]`; not modified.
        scene: its elements, and its applications as far as they are known.
        seed: 0 to 2**64 - 1.
        sample: the id that the plan was made for.
    """
    module, _, name = MAKER.partition(":")
    make = cast("Callable[..., Composite]", getattr(importlib.import_module(module), name))
    return make(plan, image, scene, seed=seed, sample=sample)


def is_bare(plan: Plan) -> bool:
    """Return whether a plan has effects on a machine, and no operations that show them."""
    return bool(plan.effects) and not any(
        isinstance(op, Paste) and op.sprite.get("draw") == "asset" for op in plan.ops
    )


def uses_elements(planner: Planner) -> bool:
    """Return whether the pictures that a planner makes may depend on the elements.

    This includes composites, which place effects where the elements leave room.
    """
    return planner.needs_elements or bool(planner.effects)
