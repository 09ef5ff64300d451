"""Datasets that were changed by someone who knows what `hijack verify` compares."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipelines.dataset.manifest import DIGEST, FILE_HASHES, manifest_digest
from pipelines.dataset.shard import file_sha256


def renew(dataset: Path, change: Callable[[dict[str, Any]], object] | None = None) -> None:
    """Make a manifest fit the files again: their hashes, sizes, and its own digest; `change` may
    edit it first."""
    path = dataset / "manifest.json"
    manifest = json.loads(path.read_text())
    if change is not None:
        change(manifest)
    for shard in manifest["shards"]:
        file = dataset / shard["file"]
        if file.is_file():
            shard.update(sha256=file_sha256(file), bytes=file.stat().st_size)
    files = [
        name
        for name in ("README.md", "config.yaml", "quarantine.jsonl")
        if (dataset / name).is_file()
    ]
    manifest[FILE_HASHES] = {name: file_sha256(dataset / name) for name in files}
    manifest[DIGEST] = manifest_digest(manifest)
    path.write_text(json.dumps(manifest))
