"""Checks of `run.json`, the head of a run, before anything in it is used."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any, cast

from ..errors import HijackError, short_repr
from ..file_io import check_versioned
from .run_log import FORMAT, VERSION


def check_head(data: object) -> dict[str, Any]:
    """Return the content of `run.json` if it is the head of a run that this library reads.

    `config` and `versions` are objects in it, if they are there, and `episodes` is a list of ids or
    `null`.

    Raises:
        HijackError: It is not; the message names the field, but not the file.
    """
    head = check_versioned(data, format=FORMAT, version=VERSION, description="the head of a run")
    for key in ("config", "versions"):
        if not isinstance(head.get(key, {}), dict):
            raise HijackError(f"{key}: must be an object, got {short_repr(head[key])}")
    listed = head.get("episodes")
    if listed is not None and not _is_list_of_ids(listed):
        raise HijackError(f"episodes: must be a list of ids, got {short_repr(listed)}")
    return head


def config_digest(config: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a configuration as canonical JSON, without the name of its file."""
    without = {key: value for key, value in config.items() if key != "source"}
    text = json.dumps(without, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _is_list_of_ids(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(name, str) for name in cast("list[Any]", value)
    )
