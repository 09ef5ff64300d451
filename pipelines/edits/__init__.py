"""Trajectory edits: show in a recording the corruptions that act on a machine.

There is one file per corruption, with its name: the corruption itself is
`hijack_data/corruptions/NAME.py`, its effect on a live machine `online_env/effects/NAME.py`. An
`Edit` takes a step and an effect of the plan; it returns the screen after the effect and the action
to take, or raises `NotApplicable`.

To add an edit, decorate a subclass of `Edit` with `@register`.
"""

from collections.abc import Iterator
from typing import Any, TypeVar

from hijack_data.registry import Registry

from .base import Edit, EditedStep, Frame, NotApplicable

__all__ = ["EDITS", "Edit", "EditedStep", "Frame", "NotApplicable", "register"]


def _problems(edit: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with the class of an edit."""
    if not isinstance(edit, type) or not issubclass(edit, Edit):
        yield "it is not a subclass of pipelines.edits.Edit"
        return
    for name in ("kind", "event"):
        if not getattr(edit, name, ""):
            yield f"{name} is not set"
    if getattr(edit, "__abstractmethods__", ()):
        yield "it does not define apply"


def _instantiate(edit: type[Edit]) -> Edit:
    return edit()


# Keys are the kinds of effects in plans.
EDITS = Registry[Edit](
    "edit",
    "edits",
    builtin={
        "launch_app": "pipelines.edits.multi_apps:LaunchAppEdit",
        "touch": "pipelines.edits.accidental_touch:TouchEdit",
        "minimise": "pipelines.edits.app_minimization:MinimiseEdit",
        "firewall": "pipelines.edits.network_error:FirewallEdit",
        "lock": "pipelines.edits.verification:LockEdit",
    },
    own_name="kind",
    problems=_problems,
    prepare=_instantiate,
    related=("corruptions",),
)

E = TypeVar("E", bound=type[Edit])


def register(edit: E) -> E:
    """Class decorator: register an edit for the effects of its `kind`.

    Raises:
        ParameterError: the edit is incomplete, or its kind has another edit.
    """
    EDITS.add(edit)
    return edit
