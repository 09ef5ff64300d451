"""Select the corruptions of a build, check them, and write them as a configuration."""

from collections.abc import Mapping
from typing import Any

import hijack_data as hj
from hijack_data.config import dump
from hijack_data.corruption import find_corruption
from hijack_data.errors import ParameterTypeError
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner, advice_for, leaves

from ..edits import EDITS
from ..errors import BuildError
from . import inline_corruptions

ALL = "all"
VISUAL = "all-visual"
SCOPE = "observation"


def select(corruptions: Mapping[str, Planner] | str) -> dict[str, Planner]:
    """Return planners by label.

    Args:
        corruptions: a mapping from labels to planners, a line of text (see `inline_corruptions`),
            `ALL` registered corruptions, or the `VISUAL` ones, which change the picture alone.

    Raises:
        BuildError: a corruption cannot be built.
        UnknownNameError: no corruption has such a name.
    """
    if not isinstance(corruptions, str | Mapping):
        raise BuildError(
            "corruptions must be names or a mapping from labels to corruptions, got"
            f" {corruptions!r:.80}"
        )
    planners = _named(corruptions) if isinstance(corruptions, str) else dict(corruptions)
    for label, planner in planners.items():
        _check_label(label)
        _check_planner(label, planner)
        _check_effects(planner)
        _check_inputs(planner)
    return planners


def needs_boxes(planner: Planner) -> bool:
    """Return whether plans, or the edits that show their effects, depend on element boxes.

    For a `Schedule`, epoch 0 decides, because builds use that epoch.
    """
    if any(leaf.needs_elements for leaf in leaves(planner)):
        return True
    edits = [EDITS[kind] for kind in planner.effects if kind in EDITS]
    return any(edit.uses_elements for edit in edits)


def config_text(planners: Mapping[str, Planner], options: Mapping[str, Any]) -> str | None:
    """Return the configuration (YAML) of the same build; `None` if no file can hold it."""
    try:
        return dump(planners, options) if planners else None
    except ParameterTypeError:
        return None


def _named(text: str) -> dict[str, Planner]:
    match text.strip():
        case _ if text.strip() == ALL:
            return {name: hj.make_corruption(name) for name in hj.corruption_names()}
        case "all-visual":
            return {
                name: hj.make_corruption(name)
                for name in hj.corruption_names()
                if find_corruption(name).scope == SCOPE
            }
        case _:
            return inline_corruptions.parse(text).planners


def _check_label(label: object) -> None:
    is_text = isinstance(label, str) and label and label.isprintable()
    if not is_text or label == CLEAN or "/" in str(label):
        raise BuildError(
            f"corruptions: {label!r} cannot be a label; give a name without '/', other than"
            f" {CLEAN!r}"
        )


def _check_planner(label: str, planner: object) -> None:
    if not isinstance(planner, Planner):
        raise BuildError(
            f"corruptions: {label!r} must be a corruption such as Marks(), got"
            f" {planner!r:.80}{advice_for(planner)}"
        )


def _check_effects(planner: Planner) -> None:
    """Refuse a planner with effects on the machine that no edit shows.

    Raises:
        BuildError: an effect has no edit; the message names it.
    """
    for leaf in leaves(planner):
        unknown = _unshown(leaf.effects)
        if unknown:
            possible = [
                name
                for name in hj.corruption_names()
                if not _unshown(find_corruption(name).effects)
            ]
            raise BuildError(
                f"corruptions: {leaf.label} does {', '.join(unknown)} to the machine, and what that"
                f" looks like in a recording is not known; leave it out: {','.join(possible)}"
            )


def _check_inputs(planner: Planner) -> None:
    """Refuse a planner that joins faults of the agent's input with other corruptions.

    Raises:
        BuildError: it does; the message names them.
    """
    parts = {leaf.label: bool(leaf.inputs) for leaf in leaves(planner)}
    if len(set(parts.values())) > 1:
        faults = ", ".join(label for label, is_fault in parts.items() if is_fault)
        raise BuildError(
            f"corruptions: {planner.label} joins {faults} with other corruptions; in a dataset,"
            " faults of the input stand alone: give them labels of their own"
        )


def _unshown(kinds: tuple[str, ...]) -> list[str]:
    return sorted(set(kinds) - set(EDITS))
