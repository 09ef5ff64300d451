"""What an effect on the machine looks like on one screenshot, put together from recorded pictures.

How that is done belongs to `pipelines`, which plans it for datasets; it is called by name, and
imported on first use.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from .plan import Paste, Plan
from .planner import Planner
from .types import Fidelity, Scene, UInt8Array

# Where it lives: a function with the arguments of `composite`.
MAKER = "pipelines.edits.single:composite"


@dataclass(frozen=True)
class Composite:
    """An effect as a picture.

    Args:
        plan: the plan of the effect with the operations that show it.
        fidelity: how true the picture is, see docs/composites.md.
        event: what happened, one plain sentence.
    """

    plan: Plan
    fidelity: Fidelity
    event: str


def composite(
    plan: Plan,
    image: UInt8Array,
    scene: Scene,
    *,
    seed: int = 0,
    sample: int | str = 0,
) -> Composite:
    """Show the effects of a plan on a screenshot, whatever desktop it is of.

    Nothing is known of a single screenshot but what `scene` says: where it names no applications,
    the effect is shown as one of an application for which it can be.

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
    """Return whether a plan acts on a machine, and shows nothing of it on a picture yet."""
    return bool(plan.effects) and not any(
        isinstance(op, Paste) and op.sprite.get("draw") == "asset" for op in plan.ops
    )


def uses_elements(planner: Planner) -> bool:
    """Return whether what a planner shows on a picture may depend on the elements.

    Composites included: they show effects where elements leave room for them.
    """
    return planner.needs_elements or bool(planner.effects)
