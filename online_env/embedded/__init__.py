"""The embedded desktop: Xfce in namespaces of this machine, made from its own packages.

`runtime` holds what isolates it, `guest` the server inside, `sites` its local internet.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .desktop import EmbeddedDesktop as EmbeddedDesktop

__all__ = ["EmbeddedDesktop"]


def __getattr__(name: str) -> object:
    """Load the class when it is asked for: the guest server and the sites need none of it.

    Raises:
        AttributeError: There is no such name.
    """
    if name in __all__:
        return getattr(importlib.import_module(".desktop", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
