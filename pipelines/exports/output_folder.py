"""The folder of an export: it appears whole or not at all.

It is written under another name next to it and renamed at the end. A killed export leaves that
other folder behind; the next export to the same place removes it.
"""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.file_io import is_full, unwritable, write_atomic
from hijack_data.locking import LockedError, lock

from ..errors import BuildError

REPORT = "export.json"


@contextmanager
def new_folder(out: Path, source: Path) -> Iterator[Path]:
    """Yield a folder to write to, which becomes `out` on success and is removed on failure.

    Raises:
        BuildError: `out` exists already, is inside `source` (the dataset) or cannot be written.
        StorageError: the disk is full.
        HijackError: the code that writes to the folder raised it.
    """
    out = Path(os.path.abspath(out))
    try:
        if out.resolve().is_relative_to(source.resolve()):
            raise BuildError(f"{out}: lies in the dataset; choose a folder outside it")
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise BuildError(f"{out}: is in the way; choose a folder that is not there")
        out.parent.mkdir(parents=True, exist_ok=True)
        temporary_folder = out.parent / f".{out.name}.exporting"
        with _locked_folder(temporary_folder):
            yield temporary_folder
            if out.exists():
                out.rmdir()
            temporary_folder.rename(out)
    except HijackError:
        raise
    except (OSError, ValueError) as cause:
        error: HijackError = BuildError(
            f"{out}: cannot be written ({getattr(cause, 'strerror', None) or cause})"
        )
        if isinstance(cause, OSError) and is_full(cause):
            error = unwritable(out, cause)
        raise error from None


def write_report(folder: Path, data: Mapping[str, Any]) -> None:
    """Write the report, without the folder's name, so that equal exports have equal bytes."""
    about = {key: value for key, value in data.items() if key != "out"}
    write_atomic(folder / REPORT, json.dumps(about, indent=1, ensure_ascii=False) + "\n")


@contextmanager
def _locked_folder(folder: Path) -> Iterator[None]:
    """Create and lock an empty folder; remove it at the end unless it was renamed.

    Raises:
        BuildError: another export is writing to it.
    """
    folder.mkdir(exist_ok=True)
    try:
        folder_lock = lock(folder)
    except LockedError:
        raise BuildError(
            f"{folder}: another export is writing to this folder; wait for it"
        ) from None
    try:
        for entry in folder.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry)
            else:
                entry.unlink()
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        folder_lock.release()
