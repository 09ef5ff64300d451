"""Replace an AgentHijack dataset: the old one stays until the new one is complete."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..dataset.manifest import MANIFEST, STATE
from ..errors import BuildError
from .dataset_card import CARD, CONFIG
from .output_folder import lock_folder
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

    Raises:
        BuildError: `out` is not an AgentHijack dataset, contains other files, or another build is
            writing to it.
    """
    if not overwrite or not _is_filled(out):
        yield out
        return
    target = out.resolve()
    # Until the end, so that no other build writes to the old dataset or begins the same new one.
    with lock_folder(target):
        _check(target, out)
        fresh = target.with_name(f".{target.name}.new")
        old = target.with_name(f".{target.name}.old")
        if _is_filled(fresh):
            _check(fresh, fresh)
            shutil.rmtree(fresh)
        try:
            yield fresh
        except BaseException:
            shutil.rmtree(fresh, ignore_errors=True)
            raise
        _swap(fresh, target, old)


def _swap(fresh: Path, target: Path, old: Path) -> None:
    try:
        shutil.rmtree(old, ignore_errors=True)
        target.rename(old)
        try:
            fresh.rename(target)
        except OSError:
            old.rename(target)
            raise
    except OSError as error:
        reason = error.strerror or error
        raise BuildError(
            f"{target}: cannot be replaced ({reason}); the new dataset is {fresh}"
        ) from None
    shutil.rmtree(old, ignore_errors=True)


def _is_filled(folder: Path) -> bool:
    with suppress(OSError):
        return folder.is_dir() and any(folder.iterdir())
    return False


def _check(folder: Path, reported: Path) -> None:
    # the folder may contain only an AgentHijack dataset, finished or not
    names_present = {entry.name for entry in folder.iterdir()}
    if not names_present & {MANIFEST, STATE}:
        raise BuildError(
            f"{reported}: is not a dataset of ours, so --overwrite does not replace it"
        )
    names = os.listdir(folder / DATA) if DATA in names_present else []
    foreign_names = sorted(names_present - _DATASET_FILES) + [
        f"{DATA}/{n}" for n in sorted(names) if not _SHARD.fullmatch(n)
    ]
    if foreign_names:
        examples = ", ".join(foreign_names[:3])
        raise BuildError(
            f"{reported}: holds files that are no part of the dataset ({examples}); move them away"
        )
