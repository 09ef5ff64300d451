"""Record the loaded files of corruptions (`hijack --load FILE.py`), and require them later.

Only the files that a build used are recorded. To resume the build or to verify the dataset, a file
with the same bytes must be loaded; its folder and its name do not matter.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

from hijack_data.loading import VARIABLE, LoadedFile, find_loaded_file, holds, loaded_files
from hijack_data.planner import Planner, tree

from ..errors import DatasetError

LOADED = "loaded"


def loaded_file_entries(planners: Iterable[Planner]) -> list[dict[str, Any]]:
    """Return the loaded files that define planners, sorted, as JSON data for the manifest."""
    files: dict[str, LoadedFile] = {}
    for planner in planners:
        for part in tree(planner):
            file = find_loaded_file(type(part))
            if file is not None:
                files[file.sha256] = file
    entries = [_entry(file) for file in files.values()]
    return sorted(entries, key=_order)


def _order(entry: Mapping[str, Any]) -> tuple[str, str]:
    return entry["file"], entry["sha256"]


def _entry(file: LoadedFile) -> dict[str, Any]:
    name = Path(file.path).name
    return {"file": name, "sha256": file.sha256, "corruptions": sorted(file.corruptions)}


def check_loaded(parameters: Mapping[str, Any], dataset: str) -> None:
    """Check that the files of corruptions that a build used are loaded.

    Args:
        parameters: those of the build, as in its manifest.
        dataset: its name, for messages.

    Raises:
        DatasetError: a file is not loaded, or another file with its name is.
    """
    for name, sha256, corruptions in _entries(parameters.get(LOADED, ()), dataset):
        if holds(sha256, corruptions):
            continue
        description = f"{name}, SHA-256 {sha256} ({', '.join(corruptions)})"
        remedy = f"{_instead(name)}: hijack --load {name} ..., or set {VARIABLE}"
        raise DatasetError(f"{dataset}: was built with {description}; {remedy}")


def _instead(name: str) -> str:
    """Return the wrong file that is loaded under a name, if any, and the remedy."""
    for file in loaded_files():
        if Path(file.path).name == name:
            return f"{file.path} is another file, SHA-256 {file.sha256}; load that one"
    return "load that file"


def _entries(listed: object, dataset: str) -> Iterable[tuple[str, str, list[str]]]:
    try:
        for entry in cast("Iterable[Mapping[str, Any]]", listed):
            corruptions = [str(name) for name in entry["corruptions"]]
            yield str(entry["file"]), str(entry["sha256"]), corruptions
    except (KeyError, TypeError) as error:
        raise DatasetError(f"{dataset}: manifest.json: {LOADED!r} is damaged ({error!r})") from None
