"""Write the Python call and the command that reproduce a plan, where these exist."""

import json
import shlex
from typing import Any

from ..compose import Sequence
from ..composites import uses_elements
from ..corruption import Corruption, from_plan, make_corruption
from ..errors import HijackError
from ..params import Every, parameters, to_json
from ..plan import Plan
from ..planner import Planner
from ..types import Scene


def maker(plan: Plan) -> Corruption | None:
    """Return the corruption that a plan names, or `None` for a sequence or any other planner."""
    try:
        return from_plan(plan)
    except HijackError:
        return None


def python_call(
    plan: Plan, scene: Scene, seed: int, sample: str, *, composited: bool = False
) -> str | None:
    """Return the line of Python that makes `plan`, or `None` if a corruption is not registered.

    With `composited`, the line gives the plan with the operations that show its effect.
    """
    try:
        planner, source = _planner(plan)
        equal = planner.plan(scene, seed=seed, sample=sample) == plan
    except HijackError:
        return None
    key = f"seed={seed}, sample={_literal(sample)}"
    if not equal:
        return None
    line = f"{source}.plan(scene, {key})"
    return f"composite({line}, picture, scene, {key}).plan" if composited else line


def cli_call(plan: Plan, seed: int, sample: str, *, detected: bool = True) -> str | None:
    """Return the command that corrupts the picture `sample` in the same way, or `None`.

    `detected` tells whether the scene has the elements that the command would find by itself.
    """
    corruption = maker(plan)
    if corruption is None or (uses_elements(corruption) and not detected):
        return None
    settings = {key: _setting(value) for key, value in _non_default_params(corruption).items()}
    if None in settings.values():
        return None
    path = f"./{sample}" if sample.startswith("-") else sample
    words = ["hijack", "apply", path, corruption.name, "-o", "out.png"]
    words += ["--seed", str(seed), f"--sample={sample}"]
    for key, text in settings.items():
        words += ["--set", f"{key}={text}"]
    return shlex.join(words)


def schedule(corruption: Corruption) -> str:
    """Return the steps at which a corruption acts, as text."""
    match corruption.steps:
        case None:
            return "at every step"
        case Every(every=every):
            return f"every {every} steps"
        case int() as step:
            return "before the episode" if step < 0 else f"at step {step}"
        case several:
            return f"at steps {', '.join(map(str, several))}"


def _planner(plan: Plan) -> tuple[Planner, str]:
    """Return the planner that a plan names, and its source code."""
    if "+" not in plan.corruption:
        only = from_plan(plan)
        return only, _source(only)
    parts = [make_corruption(name, **params) for name, params in plan.parts]
    return Sequence(parts), f"hj.Sequence([{', '.join(map(_source, parts))}])"


def _source(corruption: Corruption) -> str:
    values = "".join(
        f", {key}={_literal(value)}" for key, value in _non_default_params(corruption).items()
    )
    return f"hj.make_corruption({_literal(corruption.name)}{values})"


def _non_default_params(corruption: Corruption) -> dict[str, Any]:
    """Return the parameters that differ from their defaults, as JSON data."""
    defaults = {key: to_json(default) for key, (_, default) in parameters(corruption).items()}
    return {key: value for key, value in corruption.params().items() if value != defaults[key]}


def _literal(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _setting(value: Any) -> str | None:
    # The syntax of `--set`: text is unquoted with escaped line breaks; anything else is YAML.
    if not isinstance(value, str):
        return json.dumps(value)
    return None if "\\n" in value else value.replace("\n", "\\n")
