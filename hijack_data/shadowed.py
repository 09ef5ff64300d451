"""Detect folders and files that shadow our packages.

A user's folder may also be named `pipelines` or `online_env`; if it comes first on `sys.path`,
Python imports it instead of our package. The command line checks this before it imports them.
"""

import importlib.util
from pathlib import Path

HOME = Path(__file__).resolve().parent.parent


def complaint(*names: str) -> str:
    """Return which file or folder hides one of the packages `names`, and the remedy, or ""."""
    for name in names:
        place = _found(name)
        if place is not None and place != (HOME / name).resolve():
            return (
                f"{place} is imported in the place of AgentHijack's own package {name!r}, because "
                f"{place.parent} comes before {HOME} on sys.path; rename it, or leave its folder "
                "out of PYTHONPATH and start Python elsewhere"
            )
    return ""


def _found(name: str) -> Path | None:
    """Return the folder or file that `import name` would import, or `None`."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    if folders:
        return Path(folders[0]).resolve()
    return Path(spec.origin).resolve() if spec.origin else None
