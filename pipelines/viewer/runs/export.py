"""Selected episodes as one self-contained HTML file that makes no network requests.

It is the page of the viewer with its data inside: the same script reads either.
"""

import hashlib
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError, ParameterError
from hijack_data.file_io import write_atomic
from hijack_data.gallery.data_uris import embed, scale_for
from hijack_data.gallery.markup import Html, script_json, source_hash
from hijack_data.runs.own_files import refuse_own_file

from ..page_files import RUN_SCRIPTS, page_file, run_page
from .entry_columns import columns
from .run_source import RunSource

MAX_PAGE_EPISODES = 30  # the most episodes that the page itself exports, because the browser waits
MAX_WIDTH_PX = 1280  # wider pictures are scaled down
SMALL_WIDTH_PX = 960
STYLES = ("view.css",)


def export_file(
    source: RunSource, patterns: Sequence[str], path: Path, *, small: bool = False
) -> int:
    """Write the episodes whose ids match any pattern (as in a shell) to one file.

    With `small`, pictures are at most `SMALL_WIDTH_PX` wide, and lossy.

    Returns:
        How many there are.

    Raises:
        ParameterError: no episode matches.
        HijackError: the file is one of the run itself, or cannot be written.
        StorageError: the disk is full or fails.
    """
    refuse_own_file(path, "--export")
    if not source.entries:
        raise ParameterError("--export: the run has no episodes yet")
    numbers = list(matching_episodes(source, patterns))
    if not numbers:
        listed = ", ".join(patterns)
        example = source.entries[0].id
        raise ParameterError(
            f"--episode {listed}: no episode has such an id; ids look like {example}"
        )
    write_atomic(path, export_page(source, numbers, small=small))
    return len(numbers)


def matching_episodes(source: RunSource, patterns: Sequence[str]) -> Iterator[int]:
    """Yield the numbers of the episodes whose ids match any pattern; all without patterns."""
    for number, entry in enumerate(source.entries):
        if not patterns or any(fnmatchcase(entry.id, pattern) for pattern in patterns):
            yield number


def export_page(source: RunSource, numbers: Sequence[int], *, small: bool = False) -> str:
    """Return the page with these episodes.

    Args:
        source: the run.
        numbers: numbers of the episodes, in the order of the list.
        small: whether pictures are stored as `export_file` describes.

    Raises:
        HijackError: there is no episode of such a number.
    """
    unique = list(dict.fromkeys(numbers))
    pictures: dict[str, str] = {}
    places: dict[str, str] = {}
    episodes: list[dict[str, Any]] = []
    for page_number, number in enumerate(unique):
        data = source.episode(number)
        data["number"] = page_number
        data["checked"] = source.check(number)
        for step in data["steps"]:
            _add(source, number, step, f"{page_number}/{step['step']}", pictures, places, small)
        episodes.append(data)
    entries = [source.entries[number] for number in unique]
    style = "".join(page_file(name) for name in STYLES)
    script = "".join(page_file(name) for name in RUN_SCRIPTS)
    about = source.about()
    data = {
        **{key: about[key] for key in ("title", "problems", "scored")},
        **columns(entries, source.config),
        "facts": f"{len(unique):,} of {source.facts}, exported",
        "episodes": episodes,
        "pictures": pictures,
        "places": places,
    }
    policy = (
        "default-src 'none'; img-src data:; "
        f"style-src '{source_hash(style)}'; script-src '{source_hash(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )
    head = Html(
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<style>{style}</style>\n<script>{script}</script>"
    )
    return run_page(head, script_json(data))


def _add(
    source: RunSource,
    number: int,
    step: dict[str, Any],
    step_key: str,
    pictures: dict[str, str],
    places: dict[str, str],
    small: bool,
) -> None:
    """Add the pictures of a step; the same picture is stored once. A lost one is noted."""
    kinds = ["seen"] if step["no_before"] else ["seen", "clean"]
    for kind in [] if step["lost"] else kinds:
        try:
            pixels = source.pixels(number, step["step"], kind == "clean")
        except HijackError as error:
            if kind == "seen":
                step["lost"] = str(error)
            else:
                step["no_before"] = str(error)
            continue
        key = hashlib.sha256(pixels.tobytes()).hexdigest()[:24]
        if key not in pictures:
            height, width = pixels.shape[:2]
            scale = scale_for((height, width), SMALL_WIDTH_PX if small else MAX_WIDTH_PX)
            pictures[key] = embed(pixels, scale, small=small).uri
        places[f"{kind}/{step_key}"] = key
