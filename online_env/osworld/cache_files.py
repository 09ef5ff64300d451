"""The files that OSWorld would download for a task, and their names in its cache."""

import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, TypeGuard, cast

from hijack_data.errors import ConfigError
from hijack_data.surrogates import has_half

from .tasks import OsworldTask

# This one is in desktop-env 1.0.2 itself (setup step update_browse_history), not in the task.
HISTORY_URL = (
    "https://huggingface.co/datasets/xlangai/ubuntu_osworld_file_cache/resolve/main/chrome/"
    "44ee5668-ecd5-4366-a6ce-c1c9b8d4e938/history_empty.sqlite?download=true"
)
HISTORY_NAME = "history_new.sqlite"
MAX_NAME_BYTES = 255  # bytes of a name in a folder


@dataclass(frozen=True)
class CacheFile:
    """One file: where it comes from and its path in the cache, `<task>/<name>`."""

    url: str
    path: str


def list_cache_files(task: OsworldTask) -> list[CacheFile]:
    """Return the files of a task, each once.

    Raises:
        ConfigError: An address or a name is bad; the message names its field.
    """
    problems: list[str] = []
    files: dict[CacheFile, None] = {}
    for url, name, field in _pairs(task):
        location = f"{task.path}: {field}"
        if not _can_be_asked_for(url):
            rule = "the address must start with http:// or https://"
            problems.append(f"{location}: {rule}, got {url!r}")
        elif not _plain(name):
            rule = "the file's name must stay in the task's folder"
            problems.append(f"{location}: {rule}, got {name!r}")
        else:
            files[CacheFile(url, f"{task.id}/{name}")] = None
    if not _plain(task.id) or "/" in task.id:
        problems.append(f"{task.path}: id: must do as the name of a folder, got {task.id!r}")
    if problems:
        raise ConfigError(problems)
    return list(files)


def _can_be_asked_for(url: object) -> TypeGuard[str]:
    if not isinstance(url, str) or has_half(url):
        return False
    return url.startswith(("http://", "https://"))


def _plain(name: object) -> bool:
    if not isinstance(name, str) or not name or "\0" in name or "\\" in name:
        return False
    path = PurePosixPath(name)
    if has_half(name) or any(len(part.encode()) > MAX_NAME_BYTES for part in path.parts):
        return False
    return not path.is_absolute() and ".." not in path.parts and bool(path.parts)


def _pairs(task: OsworldTask) -> Iterator[tuple[Any, Any, str]]:
    """Yield address, name and field of each file."""
    evaluator = task.config["evaluator"]
    steps = {
        "config": task.config.get("config", []),
        "evaluator.postconfig": evaluator.get("postconfig", []),
    }
    for field, listed in steps.items():
        for index, step in enumerate(listed):
            yield from _step_files(step, f"{field}[{index}]")
    for key in ("result", "expected"):
        yield from _getter_files(evaluator.get(key), f"evaluator.{key}")


def _step_files(step: dict[str, Any], field: str) -> Iterator[tuple[Any, Any, str]]:
    if step["type"] == "update_browse_history":
        yield HISTORY_URL, HISTORY_NAME, field
    if step["type"] != "download":
        return
    files = cast("list[dict[str, Any]]", step["parameters"].get("files", []))
    for index, entry in enumerate(files):
        url = entry.get("url")
        path = entry.get("path")
        name = None
        if _can_be_asked_for(url) and isinstance(path, str):
            number = uuid.uuid5(uuid.NAMESPACE_URL, url)
            name = f"{number}_{path.rpartition('/')[2]}"
        yield url, name, f"{field}.parameters.files[{index}]"


def _getter_files(value: Any, field: str) -> Iterator[tuple[Any, Any, str]]:
    if isinstance(value, list):
        for index, item in enumerate(cast("list[Any]", value)):
            yield from _getter_files(item, f"{field}[{index}]")
    elif isinstance(value, dict):
        getter = cast("dict[str, Any]", value)
        if getter.get("type") == "cloud_file":
            yield from _cloud_files(getter, field)
            return
        for key, item in getter.items():
            yield from _getter_files(item, f"{field}.{key}")


def _cloud_files(getter: dict[str, Any], field: str) -> Iterator[tuple[Any, Any, str]]:
    urls: Any = getter.get("path")
    names: Any = getter.get("dest")
    if not getter.get("multi", False):
        yield urls, names, field
    elif not isinstance(urls, list) or not isinstance(names, list) or len(urls) != len(names):  # type: ignore[arg-type]
        yield None, None, field
    else:
        pairs = zip(cast("list[Any]", urls), cast("list[Any]", names), strict=True)
        for index, (url, name) in enumerate(pairs):
            yield url, name, f"{field}.path[{index}]"
