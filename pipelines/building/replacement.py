"""Replace an AgentHijack dataset: the old one stays until the new one is complete."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..dataset.manifest import MANIFEST
from ..errors import BuildError
from .dataset_card import CARD, CONFIG
from .output_folder import STATE
from .quarantine import QUARANTINE
from .shards import DATA

_DATASET_FILES = {CARD, CONFIG, MANIFEST, QUARANTINE, DATA, STATE}
_SHARD = re.compile(r"(train|validation|test)-\d{5}\.parquet|\..*\.tmp")


@contextmanager
def replacement_folder(out: Path, overwrite: bool) -> Iterator[Path]:
    """Yield the folder to build in; with `overwrite`, it replaces `out` once it is complete.

    The new dataset is built in `.NAME.new` next to the old one. When it is complete, the old one is
    renamed to `.NAME.old`, the new one to `NAME`, and the old one is removed; after a crash between
    the two renames, both are complete under those names. If the build fails, the old one stays.
    Raises `BuildError` if `out` is not an AgentHijack dataset, or contains other files.
    """
    if not overwrite or not _is_filled(out):
        yield out
        return
    place = out.resolve()
    _check(place, out)
    fresh = place.with_name(f".{place.name}.new")
    old = place.with_name(f".{place.name}.old")
    if _is_filled(fresh):
        _check(fresh, fresh)
        shutil.rmtree(fresh)
    try:
        yield fresh
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    _swap(fresh, place, old)


def _swap(fresh: Path, place: Path, old: Path) -> None:
    try:
        shutil.rmtree(old, ignore_errors=True)
        place.rename(old)
        try:
            fresh.rename(place)
        except OSError:
            old.rename(place)
            raise
    except OSError as error:
        reason = error.strerror or error
        raise BuildError(
            f"{place}: cannot be replaced ({reason}); the new dataset is {fresh}"
        ) from None
    shutil.rmtree(old, ignore_errors=True)


def _is_filled(folder: Path) -> bool:
    with suppress(OSError):
        return folder.is_dir() and any(folder.iterdir())
    return False


def _check(folder: Path, shown: Path) -> None:
    # the folder may contain only an AgentHijack dataset, finished or not
    found = {entry.name for entry in folder.iterdir()}
    if not found & {MANIFEST, STATE}:
        raise BuildError(f"{shown}: is not a dataset of ours, so --overwrite does not replace it")
    names = os.listdir(folder / DATA) if DATA in found else []
    others = sorted(found - _DATASET_FILES) + [
        f"{DATA}/{n}" for n in sorted(names) if not _SHARD.fullmatch(n)
    ]
    if others:
        what = ", ".join(others[:3])
        raise BuildError(
            f"{shown}: holds files that are no part of the dataset ({what}); move them away"
        )
