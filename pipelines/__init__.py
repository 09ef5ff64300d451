"""Pipelines: recorded trajectories in, datasets out.

>>> from pipelines import build, inspect_source, open_dataset, verify
"""

import importlib
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same names, for type checkers; tests/test_api.py compares the two
    from .building.build import build as build
    from .building.build_report import BuildReport as BuildReport
    from .dataset.lazy_rows import render as render
    from .dataset.opening import Dataset as Dataset
    from .dataset.opening import open_dataset as open_dataset
    from .inspection import Inspection as Inspection
    from .inspection import inspect_source as inspect_source
    from .proof.verify import VerifyReport as VerifyReport
    from .proof.verify import verify as verify

# Where each name is defined. They are imported on first use (PEP 562), as those of `hijack_data`:
# a process that opens a dataset does not wait for the readers of recordings.
_HOMES = {
    "pipelines.building.build": ("build",),
    "pipelines.building.build_report": ("BuildReport",),
    "pipelines.dataset.lazy_rows": ("render",),
    "pipelines.dataset.opening": ("Dataset", "open_dataset"),
    "pipelines.inspection": ("Inspection", "inspect_source"),
    "pipelines.proof.verify": ("VerifyReport", "verify"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Import a name from the module that defines it.

    Raises:
        AttributeError: there is no such name.
    """
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, the loaded submodules and the special attributes."""
    present = globals()
    modules = [name for name in present if f"{__name__}.{name}" in sys.modules]
    special = [name for name in present if name.startswith("__")]
    return sorted({*__all__, *modules, *special})
