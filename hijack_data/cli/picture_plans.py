"""The plan that `hijack apply` carries out on a picture."""

from pathlib import Path
from typing import Any

import click

from .. import params as p
from ..composites import composite, is_bare, uses_elements
from ..config.corruption_settings import check
from ..config.nodes import Problems
from ..config.yaml_reader import read_yaml
from ..corruption import Corruption, check_names, find_corruption
from ..elements import scene_from
from ..errors import HijackError, MissingDependencyError, ParameterError, PlanError
from ..plan import Plan
from ..planner import Planner
from ..types import Scene, UInt8Array


def parse_settings(cls: type[Corruption], settings: tuple[str, ...]) -> dict[str, Any]:
    """Turn `key=value` words into parameters.

    The value of a text parameter is taken as it is, any other is read as in a configuration.

    Raises:
        ParameterError: a word is not `key=value`.
        ConfigError: a value is refused.
    """
    values: dict[str, Any] = {}
    problems = Problems()
    for setting in settings:
        key, sign, text = setting.partition("=")
        if not sign:
            raise ParameterError(f"--set {setting!r} must be key=value")
        check_names(cls, {key: None})
        if key in values:
            raise ParameterError(f"--set {key} is given twice; remove one")
        parameter, _ = p.parameters(cls)[key]
        if parameter.kind in ("str", "choice", "color", "ip"):
            values[key] = text.replace("\\n", "\n")
            continue
        tree = read_yaml(text.encode(), f"--set {setting}", problems)
        if tree is None:
            values[key] = None
        else:
            values[key] = check(problems, parameter, f"{cls.name}.{key}", tree)
    problems.check()
    return values


def make_scene(
    planner: Planner, image: UInt8Array, tree: str | None
) -> tuple[Scene, tuple[str, ...]]:
    """Make the scene of a picture, with its elements if the corruption needs them."""
    if tree is not None:
        return scene_from(image, tree=_read(tree)), ()
    if not uses_elements(planner):
        return scene_from(image, detect="none"), ()
    try:
        return scene_from(image), ()
    except MissingDependencyError as error:
        return scene_from(image, detect="none"), (f"no elements are known: {error}",)


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise HijackError(f"{path}: cannot be read ({error.strerror or error})") from None


def make_plan(
    image: UInt8Array,
    name: str | None,
    plan_file: str | None,
    settings: tuple[str, ...],
    **key: Any,
) -> tuple[Plan, tuple[str, ...]]:
    """Return the plan, read from a file or made for this picture, and notes on it.

    Raises:
        UsageError: the options contradict each other.
        HijackError: the corruption cannot be shown on this picture.
    """
    severity = key.pop("severity")
    tree = key.pop("tree")
    if plan_file is not None:
        return _read_plan(plan_file, name), ()
    if name is None:
        raise click.UsageError("give the NAME of a corruption, or --plan FILE")
    cls = find_corruption(name)
    values = parse_settings(cls, settings)
    spec = cls(**values) if severity is None else cls.at(severity, **values)
    scene, notes = make_scene(spec, image, tree)
    plan = spec.plan(scene, **key)
    _check_shows(plan)
    if not is_bare(plan):
        return plan, notes
    try:
        composited = composite(plan, image, scene, seed=key["seed"], sample=key["sample"])
    except HijackError as error:
        if not notes:
            raise
        raise HijackError(f"{error}; {notes[-1]}") from None
    advice = "a live desktop shows its own, see `hijack desktop corrupt`"
    return composited.plan, (*notes, f"fidelity: {composited.fidelity}; {advice}")


def _check_shows(plan: Plan) -> None:
    """Refuse a plan that changes an agent's input only.

    Raises:
        PlanError: the plan has faults of the input, and a picture has no agent.
    """
    if plan.inputs and not plan.ops and not plan.effects:
        raise PlanError(
            f"{plan.corruption} changes what an agent does, and shows nothing on a picture; use it"
            " in hijack bench, or in hijack build for a recording"
        )


def _read_plan(file: str, name: str | None) -> Plan:
    plan = Plan.from_json(_read(file))
    if name is not None and plan.corruption not in (find_corruption(name)().id, name):
        raise PlanError(f"{file}: a plan of {plan.corruption}, not of {name}")
    _check_shows(plan)
    if is_bare(plan):
        raise PlanError(
            f"{file}: a plan of {plan.corruption} for a machine, which shows nothing on a"
            " picture; leave out --plan and give the corruption's name"
        )
    return plan
