"""The folder of an export: it appears whole or not at all.

It is written under another name beside it and renamed at the end. An export that was killed leaves that other folder
behind, which the next one to the same place removes.
"""

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.errors import HijackError
from hijack_data.files import write_atomic

from ..errors import BuildError

REPORT = "export.json"
Progress: TypeAlias = Callable[[int, int, str], object]


@contextmanager
def new_folder(out: Path, source: Path) -> Iterator[Path]:
    """Give a folder to write to that becomes `out` when all went well, and is removed when not.

    Raises `BuildError` when `out` is in the way, lies in `source` (the dataset) or cannot be written.
    """
    out = Path(os.path.abspath(out))
    try:
        if out.resolve().is_relative_to(source.resolve()):
            raise BuildError(f"{out}: lies in the dataset; choose a folder outside it")
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise BuildError(f"{out}: is in the way; choose a folder that is not there")
        out.parent.mkdir(parents=True, exist_ok=True)
        place = out.parent / f".{out.name}.exporting"
        with _held(place):
            yield place
            if out.exists():
                out.rmdir()
            place.rename(out)
    except (OSError, ValueError) as error:
        if isinstance(error, HijackError):
            raise
        raise BuildError(f"{out}: cannot be written ({getattr(error, 'strerror', None) or error})") from None


def write_report(place: Path, data: Mapping[str, Any]) -> None:
    """Write what the export did beside its files, without the name of the folder: equal exports are equal bytes."""
    about = {key: value for key, value in data.items() if key != "out"}
    write_atomic(place / REPORT, json.dumps(about, indent=1, ensure_ascii=False) + "\n")


@contextmanager
def _held(place: Path) -> Iterator[None]:
    """Make an empty folder that no other export writes to; remove it unless it was renamed."""
    place.mkdir(exist_ok=True)
    handle = os.open(place, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise BuildError(f"{place}: another export is writing to this folder; wait for it") from None
    try:
        for entry in place.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        yield
    finally:
        shutil.rmtree(place, ignore_errors=True)
        os.close(handle)
