"""The properties that every corruption must have, checked by trying them.

This suite runs in `hijack check` and in the project's own tests.

A check is a function `(cls) -> notes` that raises `CheckFailed` with the probable cause. Pictures
are compared with a plain reference that follows the definition pixel by pixel, so a mistake in any
kernel shows. docs/write_a_corruption.md lists what no check can see.
"""

from ..corruption import Corruption
from .base import Check, Result, expect, fail, run_check
from .cases import SIZES, picture, scene
from .declarations import check_parameters, check_registered
from .determinism import check_deterministic, check_processes, check_seed
from .pixels import (
    check_backends,
    check_batches,
    check_levels,
    check_scope,
    check_visible,
    jax_operations,
)
from .plan_data import check_kept, check_plan_is_data, check_untouched
from .reference import reference
from .scenes import check_elements, check_scenes

__all__ = [
    "CHECKS",
    "SIZES",
    "Check",
    "Result",
    "check_backends",
    "check_batches",
    "check_deterministic",
    "check_elements",
    "check_kept",
    "check_levels",
    "check_parameters",
    "check_plan_is_data",
    "check_processes",
    "check_registered",
    "check_scenes",
    "check_scope",
    "check_seed",
    "check_untouched",
    "check_visible",
    "expect",
    "fail",
    "jax_operations",
    "picture",
    "reference",
    "run",
    "run_check",
    "scene",
]

CHECKS: tuple[Check, ...] = (
    check_registered,
    check_parameters,
    check_plan_is_data,
    check_deterministic,
    check_processes,
    check_seed,
    check_kept,
    check_untouched,
    check_scenes,
    check_elements,
    check_scope,
    check_backends,
    check_batches,
    check_visible,
    check_levels,
)


def run(cls: type[Corruption]) -> list[Result]:
    """Run all checks on one corruption."""
    return [run_check(check, cls) for check in CHECKS]
