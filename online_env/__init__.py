"""The live benchmark: real desktops, their local internet, and what disturbs them.

The public names; each is loaded when it is first used, and the desktops need no gymnasium:

* `Desktop`: the protocol of a machine that is looked at, acted on and corrupted.
* `EmbeddedDesktop`: a desktop of this machine's own, in namespaces.
* `HttpDesktop`: a desktop whose guest server answers over HTTP, such as a virtual machine.
* `CorruptedEnv`: the gymnasium environment; `EvalSettings` holds its options, `SmallTasks` and
  `OsworldStage` are the tasks it can run.
* `register_envs`: registers the environments with `gymnasium.make`, as this import has done.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .gymnasium_registration import register_with_gymnasium

if TYPE_CHECKING:
    from .desktops.http import HttpDesktop as HttpDesktop
    from .desktops.protocol import Desktop as Desktop
    from .embedded.desktop import EmbeddedDesktop as EmbeddedDesktop
    from .environment import CorruptedEnv as CorruptedEnv
    from .environment import EvalSettings as EvalSettings
    from .environment import SmallTasks as SmallTasks
    from .environment import register_envs as register_envs
    from .osworld.stage import OsworldStage as OsworldStage

register_with_gymnasium()

# Loaded when asked for: desktops are used without gymnasium, too, and start faster so.
_HOMES = {
    "CorruptedEnv": ".environment",
    "Desktop": ".desktops.protocol",
    "EmbeddedDesktop": ".embedded.desktop",
    "EvalSettings": ".environment",
    "HttpDesktop": ".desktops.http",
    "OsworldStage": ".osworld.stage",
    "SmallTasks": ".environment",
    "register_envs": ".environment",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    public_names = list(globals())
    modules = [name for name in public_names if f"{__name__}.{name}" in sys.modules]
    dunders = [name for name in public_names if name.startswith("__")]
    return sorted({*_HOMES, *modules, *dunders})
