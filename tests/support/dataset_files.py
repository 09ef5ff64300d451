"""The files of a dataset, to compare two of them byte for byte."""

import hashlib
from pathlib import Path


def file_contents(folder: Path, *, without: str = "") -> dict[str, bytes]:
    """The bytes of all files in a folder by their paths; those named `without` are left out."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != without
    }


def shard_hashes(dataset: Path) -> dict[str, str]:
    """The SHA-256 of each shard by its name."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((dataset / "data").iterdir())
    }
