"""What every agent must have: a class, or a function that makes agents, without arguments."""

import inspect
from collections.abc import Iterator
from typing import Any

from hijack_data.errors import ParameterError


def agent_problems(maker: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with the class of an agent, or with a function that makes agents."""
    if not callable(maker):
        yield "an agent is a class, or a function that returns an agent"
        return
    if isinstance(maker, type) and not callable(getattr(maker, "predict", None)):
        yield "it has no predict(instruction, obs)"
    required = [name for name, value in _parameters(maker).items() if _is_needed(value)]
    if required:
        yield f"it is made without arguments; give {', '.join(required)} a default"


def _parameters(maker: Any) -> dict[str, inspect.Parameter]:
    try:
        return dict(inspect.signature(maker).parameters)
    except (TypeError, ValueError):  # of a class in C
        return {}


def _is_needed(parameter: inspect.Parameter) -> bool:
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return parameter.default is inspect.Parameter.empty and parameter.kind not in several


def check_agent(maker: Any) -> None:
    """Check the class of an agent, or a function that makes agents.

    Raises:
        ParameterError: it is none; the message has all problems.
    """
    problems = "; ".join(agent_problems(maker, ""))
    if problems:
        title = getattr(maker, "__qualname__", type(maker).__qualname__)
        raise ParameterError(f"cannot register {title}: {problems}")
