"""Detect folders and files that shadow our packages.

A user's folder may also be named `pipelines` or `online_env`; if it comes first on `sys.path`,
Python imports it instead of our package, and nothing of ours runs in that import. So the command
line checks before it imports them, `hijack doctor` has a row for each, and `import hijack_data`
warns.
"""

import importlib.util
import os
import sys
import warnings

HOME = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
OTHERS = ("pipelines", "online_env")


def find_shadow(*names: str) -> str:
    """Return which file or folder hides one of the packages `names`, and the remedy, or ""."""
    for name in names:
        path = _find_package(name)
        if path is not None and path != os.path.realpath(os.path.join(HOME, name)):
            folder = os.path.dirname(path)
            return (
                f"{path} is imported instead of AgentHijack's own package {name!r}, because "
                f"{folder} comes before {HOME} on sys.path; rename it, or leave its folder "
                "out of PYTHONPATH and start Python elsewhere"
            )
    return ""


def warn_of_shadows() -> None:
    """Warn when a folder or file of the user's hides one of the other two packages.

    The command line is left out: it reports a shadow where it matters.
    """
    if sys.argv and os.path.basename(sys.argv[0]) in ("hijack", "-m"):
        return
    problem = find_shadow(*OTHERS)
    if problem:
        from .errors import HijackWarning  # here: a process that needs no errors starts faster

        warnings.warn(f"{problem} (hijack_data itself works)", HijackWarning, stacklevel=3)


def _find_package(name: str) -> str | None:
    """Return the real path of the folder or file that `import name` would import, or `None`."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    path = folders[0] if folders else spec.origin
    return os.path.realpath(path) if path else None
