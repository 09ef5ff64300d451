"""Register our environments with gymnasium, without importing it.

Gymnasium takes 0.3 s to import and most users of this package do not need it. So the environments
are registered at once if it is loaded already, and otherwise right after it is loaded.
"""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

EMBEDDED_ID = "AgentHijack/Embedded-v0"
BROWSER_ID = "AgentHijack/Browser-v0"
_REGISTRY = "gymnasium.envs.registration"
_MAKERS = {
    EMBEDDED_ID: "online_env.environment.registration:make_embedded",
    BROWSER_ID: "online_env.browser.registration:make_browser",
}


def register(registration: Any) -> None:
    """Register the environments; those that are registered stay.

    Args:
        registration: the module `gymnasium.envs.registration`.
    """
    for name, maker in _MAKERS.items():
        if name not in registration.registry:
            # A real desktop has clocks and blinking cursors: two runs show the same task, but not
            # the same pixels, so it is registered as non-deterministic.
            registration.register(name, entry_point=maker, nondeterministic=True)


def register_with_gymnasium() -> None:
    """Register the environments now, or as soon as gymnasium is imported."""
    gymnasium_registry = sys.modules.get(_REGISTRY)
    if gymnasium_registry is not None:
        register(gymnasium_registry)
    elif not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder:
    """Finds gymnasium's registry as the other finders do, and registers once it is loaded.

    Its base would be `importlib.abc.MetaPathFinder`, which takes half of the time of this package.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of the registry's module; `None` for any other."""
        if fullname != _REGISTRY:
            return None
        sys.meta_path.remove(self)
        for finder in sys.meta_path:
            spec = finder.find_spec(fullname, path, target)
            if spec is not None:
                _register_after(spec.loader)
                return spec
        return None


def _register_after(loader: Any) -> None:
    """Let a loader register the environments after it has run its module."""
    run = loader.exec_module

    def exec_module(module: ModuleType) -> None:
        run(module)
        register(module)

    loader.exec_module = exec_module
