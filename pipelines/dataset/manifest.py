"""The manifest of a dataset: its sources, its parameters, and the hash of every file."""

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from PIL import features

from hijack_data.choices import LAZY
from hijack_data.file_io import read_versioned_json, write_atomic

from ..errors import RESUME, DatasetError
from .shard import ShardRecord, file_sha256

MANIFEST = "manifest.json"
# The folder of an unfinished build, and the parameters in it.
STATE = ".build"
PARAMETERS = "parameters.json"
FORMAT = "agenthijack-dataset"
# A manifest names its format at its beginning.
_HEAD_BYTES = 200
VERSION = 1
# The files next to the shards; the manifest contains their hashes.
FILES = ("README.md", "config.yaml", "quarantine.jsonl")
FILE_HASHES = "files"
DIGEST = "digest"
# The count of pictures with transparent pixels, absent where it is 0.
TRANSPARENT = "transparent"
# The libraries that, in addition to our own code, decide the bytes of a row.
LIBRARIES = ("agenthijack", "numpy", "pillow", "pyarrow", "isal")


def libraries(detect: bool) -> dict[str, str]:
    """Return the versions of the libraries that a build depends on; `detect` adds the detector."""
    names = (*LIBRARIES, "opencv-python-headless") if detect else LIBRARIES
    versions = {name: _version(name) for name in names}
    versions["freetype"] = str(features.version("freetype2"))
    return versions


def total_counts(shards: Iterable[ShardRecord]) -> dict[str, Any]:
    """Return rows, dropped and not applicable samples of all shards together."""
    rows = Counter[str]()
    dropped = Counter[str]()
    reasons: dict[str, Counter[str]] = {}
    transparent = 0
    for shard in shards:
        rows.update(shard.counts["rows"])
        dropped.update(shard.counts["dropped"])
        transparent += shard.counts.get(TRANSPARENT, 0)
        for label, shard_reasons in shard.counts["not_applicable"].items():
            reasons.setdefault(label, Counter()).update(shard_reasons)
    return {
        "rows": dict(rows),
        "dropped": dict(dropped),
        "not_applicable": {
            label: dict(sorted(shard_reasons.items()))
            for label, shard_reasons in sorted(reasons.items())
        },
        **({TRANSPARENT: transparent} if transparent else {}),
    }


def make_manifest(
    parameters: Mapping[str, Any],
    config: str | None,
    source: Iterable[str],
    shards: list[ShardRecord],
    rejected: Mapping[str, int],
) -> dict[str, Any]:
    """Return the manifest as JSON data.

    Args:
        parameters: see `building.settings.manifest_parameters`; a resumed build must have the same.
        config: YAML of the same build, if a file can hold it.
        source: the sources as they are published, none of them an absolute path.
        shards: records in order.
        rejected: number of rejected inputs by field.
    """
    fingerprint = hashlib.sha256("".join(shard.inputs for shard in shards).encode()).hexdigest()
    return {
        "format": FORMAT,
        "version": VERSION,
        "source": {
            "paths": list(source),
            "fingerprint": fingerprint,
            "trajectories": sum(shard.trajectories for shard in shards),
            "steps": sum(shard.steps for shard in shards),
        },
        "parameters": dict(parameters),
        "config": config,
        "rows": sum(shard.rows for shard in shards),
        "counts": {**total_counts(shards), "rejected": dict(sorted(rejected.items()))},
        "shards": [shard.to_data() for shard in shards],
    }


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a finished dataset.

    The hashes of the files next to it and of its own content are added.
    """
    files = {name: file_sha256(folder / name) for name in FILES if (folder / name).is_file()}
    content = {**manifest, FILE_HASHES: files}
    content[DIGEST] = manifest_digest(content)
    write_atomic(folder / MANIFEST, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


def manifest_digest(manifest: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the content of a manifest, excluding the digest itself."""
    content = {key: value for key, value in manifest.items() if key != DIGEST}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a dataset.

    Raises:
        DatasetError: there is no manifest, or it is damaged or newer than this library.
    """
    path = folder / MANIFEST
    state = "not a dataset of ours" if os.path.isdir(folder) else "no such folder"
    if (folder / STATE).is_dir():
        state = f"an unfinished build: the same build with {RESUME} finishes it"
    manifest = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        description="the manifest of a dataset of ours",
        error=DatasetError,
        missing=f"{folder}: {state} ({MANIFEST} is missing)",
    )
    if not isinstance(manifest.get("shards"), list) or not isinstance(
        manifest.get("parameters"), dict
    ):
        raise DatasetError(f"{path}: damaged: no list of shards, or no parameters")
    return manifest


def holds_build(folder: Path) -> bool:
    """Return whether a folder is a dataset of ours, also an unfinished, newer or damaged one."""
    if (folder / STATE / PARAMETERS).is_file():
        return True
    try:
        with (folder / MANIFEST).open("rb") as manifest:
            return FORMAT.encode() in manifest.read(_HEAD_BYTES)
    except OSError:  # there is none
        return False


def is_lazy(manifest: Mapping[str, Any]) -> bool:
    """Return whether the rows of a dataset hold plans instead of corrupted pictures."""
    return manifest["parameters"].get("output") == LAZY


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
