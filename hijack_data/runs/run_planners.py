"""Write the planner of an episode into the log of a run, and read it back."""

from typing import Any, cast

import yaml

from ..config import dump, load_config
from ..errors import ConfigError, HijackError
from ..plan import CLEAN
from ..planner import Planner


def get_label(planner: Planner | None) -> str:
    """Return the default label of a planner; `"clean"` for `None`."""
    return CLEAN if planner is None else planner.label


def planner_params(planner: Planner | None) -> dict[str, Any]:
    """Return the parameters as JSON data; of a sequence those of each part by its id."""
    return {} if planner is None else planner.params()


def dump_planner(planner: Planner | None) -> str | None:
    """Return the planner as a configuration, from which its plans can be made again.

    `"clean"` for `None`; `None` if a file cannot hold the planner.
    """
    if planner is None:
        return CLEAN
    try:
        return dump([planner])
    except HijackError:
        return None


def load_planner(text: str) -> Planner | None:
    """Return the planner that `dump_planner` wrote; `None` for clean.

    Raises:
        ConfigError: the text is not a configuration of one corruption.
    """
    if text == CLEAN:
        return None
    try:
        planners = load_config(yaml.safe_load(text)).corruptions
    except (yaml.YAMLError, HijackError, ValueError) as error:
        raise ConfigError([f"no configuration of one corruption ({error})"]) from None
    if len(planners) != 1:
        raise ConfigError([f"no configuration of one corruption: it has {len(planners)}"])
    (planner,) = planners.values()
    return planner


def read_planners(entries: object) -> dict[str, Planner | None]:
    """Return the planners of a list `corruptions` of `run.json` by label; `None` for clean.

    Raises:
        ConfigError: `entries` is no such list.
    """
    if not isinstance(entries, list):
        raise ConfigError(["corruptions: must be a list"])
    listed = cast("list[object]", entries)
    disturbing = [entry for entry in listed if entry != CLEAN]
    found: dict[str, Planner | None] = {}
    if len(disturbing) < len(listed):
        found[CLEAN] = None
    if disturbing:
        found |= load_config({"corruptions": disturbing}).corruptions
    return found
