"""Are our packages ours?

`pipelines` and `online_env` are names that a folder of yours may have, too, and one that comes
first on `sys.path` is imported in the place of ours. The command line asks here before it imports
them.
"""

import importlib.util
from pathlib import Path

HOME = Path(__file__).resolve().parent.parent


def complaint(*names: str) -> str:
    """Return which file or folder hides one of our packages `names`, and the remedy, or `""`."""
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
    """Return the folder or the file that `import name` takes; `None` where there is none."""
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
