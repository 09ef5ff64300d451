"""An index of a run's journal in columns, so that a large run opens fast the second time.

It lies in the user's cache and never in the folder of the run, which stays as it was written. Its
name is the hash of all that decides its content: the journal, the head of the run, and the code
that reads them. So an index is never stale; a journal that grew has another one.
"""

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import HijackError
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.runs import privileged_inputs

from . import episode_entry
from .episode_entry import EpisodeEntry

MIN_JOURNAL_BYTES = 4 * 2**20  # smaller journals are read faster than an index pays off
MAX_INDEXES = 16  # the least recently written are removed
_NAMES = tuple(field.name for field in fields(EpisodeEntry))


def index_path(journal: bytes, head: bytes) -> Path:
    """Return where the index of a journal is, whether it exists or not."""
    digest = sha256(f"{len(head)} {_code_digest()}\n".encode())
    digest.update(head)
    digest.update(journal)
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "agenthijack" / "viewer" / f"{digest.hexdigest()}.json"


def read_index(path: Path) -> tuple[list[EpisodeEntry], list[str]] | None:
    """Return the entries and problems of a journal; `None` without a usable index."""
    try:
        content = json.loads(path.read_bytes())
        columns = [_decoded(content["columns"][name]) for name in _NAMES]
        return list(map(EpisodeEntry, *columns)), content["problems"]
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None


def write_index(path: Path, entries: Sequence[EpisodeEntry], problems: Sequence[str]) -> None:
    """Write an index and remove old ones; a cache that cannot be written stays without it."""
    columns = {name: _encoded([getattr(entry, name) for entry in entries]) for name in _NAMES}
    with suppress(OSError, HijackError):
        make_folder(path.parent)
        write_atomic(path, json.dumps({"columns": columns, "problems": list(problems)}))
        by_age = sorted(path.parent.glob("*.json"), key=lambda file: file.stat().st_mtime)
        for old in by_age[:-MAX_INDEXES]:
            old.unlink(missing_ok=True)


def _encoded(values: list[Any]) -> dict[str, list[Any]]:
    """Return a column as its different values and the position of each among them."""
    positions: dict[tuple[type, Any], int] = {}
    codes = [positions.setdefault((type(value), value), len(positions)) for value in values]
    return {"values": [value for _, value in positions], "codes": codes}


def _decoded(column: dict[str, list[Any]]) -> list[Any]:
    return list(map(cast("list[Any]", column["values"]).__getitem__, column["codes"]))


@lru_cache(1)
def _code_digest() -> str:
    """Return the hash of the code that makes entries: another one makes other entries."""
    files = [
        Path(__file__).with_name("listing.py"),
        episode_entry.__file__,
        privileged_inputs.__file__,
    ]
    return sha256(b"\0".join(Path(file).read_bytes() for file in files)).hexdigest()
