"""Functions that OSWorld-Verified's tasks name and desktop-env 1.0.2 lacks.

Without them a reset ends in an error. Their meaning is read from the tasks: `vlc 5ac2891a`,
`multi_apps e8172110`, `chrome 93eabf48`.
"""

import importlib
import json
from collections.abc import Callable, Iterable
from typing import Any

PREFERENCES = "/home/user/.config/google-chrome/Default/Preferences"
_MODES = {0: "system", 1: "light", 2: "dark"}


def check_play_and_exit(config_path: str, rule: dict[str, Any]) -> float:
    """Return 1.0 if vlcrc sets `play-and-exit` to `rule["expected_play_and_exit"]`.

    VLC's default is 0.
    """
    value = "0"
    with open(config_path, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            key, _, setting = line.strip().partition("=")
            if key == "play-and-exit":
                value = setting.strip()
    expected = str(int(rule["expected_play_and_exit"]))
    return float(value == expected)


def check_structure_sim_with_threshold(
    src_path: str | None, tgt_path: str | None, ssim_threshold: float = 0.85, **_: Any
) -> float:
    """Return 1.0 if both pictures have one size and their similarity reaches `ssim_threshold`.

    The structural similarity is 0 to 1.
    """
    gimp: Any = importlib.import_module("desktop_env.evaluators.metrics.gimp")

    if not src_path or not tgt_path:
        return 0.0
    with gimp.Image.open(src_path) as source, gimp.Image.open(tgt_path) as target:
        if source.size != target.size:
            return 0.0
        alike = gimp.structure_check_by_ssim(source, target, ssim_threshold)
        return float(bool(alike))


def get_chrome_appearance_mode_ui(env: Any, config: dict[str, Any]) -> str:
    """Return the colour scheme in the browser's preferences: `light`, `dark` or `system`."""
    path = config.get("path", PREFERENCES)
    stored = json.loads(env.controller.get_file(path) or b"{}")
    theme = stored.get("browser", {}).get("theme", {})
    older = theme.get("color_scheme", 0)
    scheme = theme.get("color_scheme2", older)
    return _MODES.get(scheme, "system")


METRICS = (check_play_and_exit, check_structure_sim_with_threshold)
GETTERS = (get_chrome_appearance_mode_ui,)


def add_missing(metrics: Any, getters: Any) -> list[str]:
    """Add the functions that `desktop_env` lacks; return their names."""
    return [*_add(metrics, METRICS), *_add(getters, GETTERS)]


def complete_manager(provider: str) -> None:
    """Let the manager of Azure's machines be made.

    It lacks a method that its base class declares since it was written. A run calls none of its
    methods, because the machine is named by the user.
    """
    if provider == "azure":
        module: Any = importlib.import_module("desktop_env.providers.azure.manager")
        module.AzureVMManager.__abstractmethods__ = frozenset()


def _add(module: Any, functions: Iterable[Callable[..., Any]]) -> list[str]:
    names: list[str] = []
    for function in functions:
        name = function.__name__
        if not hasattr(module, name):
            setattr(module, name, function)
            names.append(name)
    return names
