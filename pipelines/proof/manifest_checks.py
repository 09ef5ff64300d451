"""Check the files of a dataset against its manifest, and the manifest against its own content."""

import json
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr

from ..building.row_settings import build_config, in_order
from ..building.splits import Splits
from ..building.step_rows import RowSettings
from ..dataset.manifest import (
    DIGEST,
    FILE_HASHES,
    FILES,
    LIBRARIES,
    MANIFEST,
    libraries,
    make_manifest,
    manifest_digest,
)
from ..dataset.shard import ShardRecord, file_sha256, record_from
from ..errors import RESUME, DatasetError

_CARD, _CONFIG, _QUARANTINE = FILES
# Files that users keep in the folder of a dataset, and that `load_dataset` never reads as rows.
HARMLESS = ("", ".md", ".html", ".yaml", ".yml", ".cff", ".bib")


def shard_records(manifest: Mapping[str, Any], folder: Path) -> list[ShardRecord]:
    """Return the records of the shards in a manifest.

    Raises:
        DatasetError: a record is damaged, or names a file outside the dataset.
    """
    try:
        records = [record_from(shard) for shard in manifest["shards"]]
    except TypeError as error:
        raise DatasetError(f"{folder / MANIFEST}: damaged: a shard's record ({error})") from None
    for index, record in enumerate(records):
        path = Path(record.file)
        if record.index != index or path.is_absolute() or ".." in path.parts:
            raise DatasetError(f"{folder / MANIFEST}: damaged: shard {index} is {record.file!r}")
    return records


def stray_files(folder: Path, records: list[ShardRecord]) -> Iterator[str]:
    """Yield a problem for each file in the folder that does not belong to the dataset.

    Hidden files and folders belong to tools that keep or upload a dataset; loaders skip them.
    """
    members = {MANIFEST, *FILES, *(record.file for record in records)}
    data = {str(Path(record.file).parent) for record in records}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        is_hidden = any(part.startswith(".") for part in name.parts)
        is_folder = path.is_dir() and not path.is_symlink()
        if is_hidden or is_folder or str(name) in members:
            continue
        if str(name.parent) in data:
            yield f"{name}: not in the manifest"
        elif path.suffix.lower() not in HARMLESS:
            yield (
                f"{name}: not in the manifest; load_dataset may read it as rows: move it elsewhere"
            )


def companion_files(folder: Path, manifest: Mapping[str, Any]) -> Iterator[str]:
    """Yield the problems of the files next to the shards, and of the digest of the manifest."""
    hashes = manifest.get(FILE_HASHES)
    if not isinstance(hashes, dict) or DIGEST not in manifest:
        yield (
            f"{MANIFEST}: has no hashes of the files beside the rows ({FILE_HASHES}, {DIGEST}); the"
            f" same build with {RESUME} adds them"
        )
        return
    if manifest[DIGEST] != manifest_digest(manifest):
        yield (
            f"{MANIFEST}: {DIGEST} is not that of what it says; the manifest was changed or damaged"
        )
    for name in FILES:
        path = folder / name
        expected = hashes.get(name)
        digest = file_sha256(path) if path.is_file() else None
        if digest != expected:
            yield f"{name}: {_difference(digest, expected)}"


def _difference(digest: str | None, expected: object) -> str:
    if digest is None:
        return "missing"
    if expected is None:
        return "not in the manifest"
    return (
        f"its SHA-256 is {digest[:12]}, the manifest says {short_repr(expected)[:13]}; the file was"
        " changed or damaged"
    )


def derived_fields(
    folder: Path,
    manifest: Mapping[str, Any],
    records: list[ShardRecord],
    settings: RowSettings | None,
) -> Iterator[str]:
    """Yield the fields of a manifest that contradict its other fields or the files next to it."""
    parameters = manifest["parameters"]
    splits = Splits(parameters.get("splits"))
    config = manifest.get("config") if settings is None else build_config(settings, splits)
    paths = manifest["source"]["paths"]
    again = make_manifest(parameters, config, paths, records, _rejected_counts(folder))
    if settings is not None:
        again["counts"]["rows"] = in_order(again["counts"]["rows"], settings)
    for path, stored, expected in _differences("", manifest, again):
        yield f"{MANIFEST}: {path} is {short_repr(stored)}, it should be {short_repr(expected)}"
    if config is not None and _text(folder / _CONFIG) != config:
        yield f"{_CONFIG}: is not the configuration of the manifest's parameters"
    late = [rejected for record in records for rejected in record.rejected]
    if late and [json.loads(line) for line in deque(_lines(folder), len(late))] != late:
        yield (
            f"{_QUARANTINE}: its end is not what was rejected while the rows were made (manifest:"
            " shards)"
        )


def _differences(path: str, stored: Any, expected: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the places at which JSON data differs; at the top, `stored` may have extra keys."""
    if isinstance(expected, dict) and isinstance(stored, dict):
        keys = list(expected)
        if path:
            keys += [key for key in stored if key not in expected]
        for key in keys:
            key_path = f"{path}.{key}" if path else key
            yield from _differences(key_path, stored.get(key), expected.get(key))
    elif stored != expected:
        yield path, stored, expected


def library_notes(parameters: Mapping[str, Any]) -> Iterator[str]:
    """Yield the libraries whose version is not the one of the build."""
    built_with = parameters.get("libraries", {})
    installed = libraries(parameters.get("elements") == "picture")
    for name in (*LIBRARIES, "freetype"):
        if name in ("pyarrow", "isal") or name not in built_with:
            continue
        if built_with[name] != installed[name]:
            yield (
                f"built with {name} {built_with[name]}, here is {installed[name]}: "
                "plans and pictures may come out differently"
            )


def shard_problems(file: Path, record: ShardRecord) -> Iterator[str]:
    """Yield the problems of a file as a whole."""
    size = file.stat().st_size
    if file_sha256(file) != record.sha256:
        yield (
            f"{record.file}: its SHA-256 is not that of the manifest; the file was changed or"
            " damaged"
        )
    elif size != record.bytes:
        yield f"{record.file}: {size} bytes, the manifest says {record.bytes}"


def _rejected_counts(folder: Path) -> Counter[str]:
    # returns the number of inputs in `quarantine.jsonl`, by field
    counts = Counter[str]()
    for number, line in enumerate(_lines(folder), 1):
        try:
            counts[json.loads(line)["field"] or "(record)"] += 1
        except (ValueError, KeyError, TypeError) as error:
            raise DatasetError(
                f"{folder / _QUARANTINE}: line {number} is not a rejected input ({error})"
            ) from None
    return counts


def _lines(folder: Path) -> Iterator[str]:
    try:
        with (folder / _QUARANTINE).open(encoding="utf-8") as file:
            yield from file
    except (OSError, UnicodeDecodeError):  # `companion_files` says what is wrong with the file
        return


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):  # `companion_files` says what is wrong with the file
        return ""
