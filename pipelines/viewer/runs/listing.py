"""The episodes of a run, one light entry each, from its journal and its folders.

The journal comes first. Episodes that it does not name, or whose line is damaged, are taken from
their folders: so a cut journal loses nothing, and each entry states its problems.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.file_io import read_regular
from hijack_data.runs.privileged_inputs import describe_privileged_inputs, read_privileged_inputs
from hijack_data.runs.run_log import EPISODE, EPISODES, RECORDS, RUN, VERSION, sha256_hex

from ...errors import DatasetError
from ...readers.fields import FieldError, mapping
from ...readers.safe_files import parse, parse_file
from . import listing_index
from .episode_entry import (
    AGENT_ERROR,
    FAILURE,
    INVALID,
    MACHINE_ERROR,
    PARTIAL,
    SUCCESS,
    UNFINISHED,
    UNREADABLE,
    EpisodeEntry,
)

MAX_SAID_CHARS = 160  # characters of the agent's last words that are searched
MAX_NOTE_CHARS = 300  # characters of the reason for an episode's end that the list shows
REQUIRED_FIELDS = ("agent", "task", "corruption", "status", "id")
_ID = re.compile(rb'"id": ?"([^"\\]{1,200})"')


@dataclass(kw_only=True)
class RunListing:
    """All episodes of a folder, and the problems of the journal as a whole."""

    entries: list[EpisodeEntry]
    journal: bytes
    problems: list[str]

    @cached_property
    def lines(self) -> list[bytes]:
        """The lines of the journal."""
        return self.journal.split(b"\n")


def read_listing(folder: Path, head: bytes) -> RunListing:
    """Read all entries of a run.

    Args:
        folder: of the run.
        head: the content of `run.json`, which the first line of the journal names; empty if it
            cannot be read.

    Raises:
        DatasetError: the folder of the episodes cannot be read.
    """
    journal = _read_records(folder)
    listing = RunListing(entries=[], journal=journal or b"", problems=[])
    if journal is not None:
        _read_indexed_journal(folder, listing, head)
    listed = {entry.id for entry in listing.entries}
    for name in _episode_folders(folder):
        if name not in listed:
            listing.entries.append(_from_folder(folder, name, journal is not None))
    return listing


def make_entry(record: Mapping[str, Any]) -> EpisodeEntry:
    """Return the entry of a record; whatever is missing stays empty."""
    seed = word(record.get("seed"))
    variant = word(record.get("task_seed"))
    if variant and variant != seed:
        seed = f"{seed} / {variant}"
    usage = record.get("usage")
    counts: Mapping[str, Any] = usage if isinstance(usage, dict) else {}
    note = record.get("problem") or record.get("reason") or ""
    outcome = episode_outcome(record)
    has_score = record.get("status") == "ok" and outcome != UNREADABLE
    return EpisodeEntry(
        id=word(record.get("id")),
        agent=word(record.get("agent")),
        task=word(record.get("task")),
        corruption=word(record.get("corruption")),
        seed=seed,
        attempt=int(number(record.get("attempt")) or 0),
        outcome=outcome,
        score=number(record.get("score")) if has_score else None,
        steps=_integer(record.get("steps")),
        seconds=number(record.get("seconds")),
        tokens=_tokens(counts),
        usd=number(counts.get("usd")),
        instruction=word(record.get("instruction")),
        note=word(note)[:MAX_NOTE_CHARS],
        said=word(record.get("said"))[:MAX_SAID_CHARS],
        counts=outcome != UNREADABLE and _counts(record),
        problem=_version_problem(record) or _score_problem(record, outcome),
        given=_privileged_inputs(record),
    )


def episode_outcome(record: Mapping[str, Any]) -> str:
    """Return the outcome of a record, one of `OUTCOMES`."""
    status = record.get("status")
    score = number(record.get("score"))
    if status == "invalid":
        return INVALID
    if status == "error":
        return AGENT_ERROR if record.get("cause", "agent") == "agent" else MACHINE_ERROR
    if status != "ok" or score is None or not 0 <= score <= 1:
        return UNREADABLE
    if score == 1:
        return SUCCESS
    return PARTIAL if score > 0 else FAILURE


def word(value: object) -> str:
    """Return a value as text; nothing for `None`."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)


def number(value: object) -> float | None:
    """Return a number that JSON and people can take; `None` for anything else, and for NaN."""
    kind = type(value)
    if kind is not int and kind is not float:
        return None
    return value if -1e15 < value < 1e15 else None  # type: ignore[operator]


def _integer(value: object) -> int | None:
    count = number(value)
    return None if count is None else int(count)


def _tokens(usage: Mapping[str, Any]) -> int | None:
    counts = [number(usage.get(key)) for key in ("input_tokens", "output_tokens")]
    numbers = [count for count in counts if count is not None]
    return int(sum(numbers)) if numbers else None


def _privileged_inputs(record: Mapping[str, Any]) -> str:
    inputs = read_privileged_inputs(record)
    return describe_privileged_inputs(inputs) if inputs else ""


def _counts(record: Mapping[str, Any]) -> bool:
    """Return whether the report counts an episode: the rule of `online_env.results.scores`."""
    if record.get("status") != "error":
        return record.get("status") == "ok"
    cause = record.get("cause", "agent")
    again = (number(record.get("attempt")) or 0) > 0
    return cause == "agent" or (cause == "machine" and again)


def _version_problem(record: Mapping[str, Any]) -> str:
    version = record.get("version")
    if version == VERSION:
        return ""
    return f"was written by version {version!r} of the log; this library reads {VERSION}"


def _score_problem(record: Mapping[str, Any], outcome: str) -> str:
    """Return why a report leaves out an episode that can be read, or nothing."""
    if outcome != UNREADABLE:
        return ""
    if record.get("status") == "ok":
        return f"score {short_repr(record.get('score'))} is no number in 0..1"
    return f"status {short_repr(record.get('status'))} is none of ok, invalid, error"


def _read_records(folder: Path) -> bytes | None:
    """Return the journal; `None` if there is none."""
    try:
        return read_regular(folder / RECORDS)
    except OSError:
        return None


def _read_indexed_journal(folder: Path, listing: RunListing, head: bytes) -> None:
    """Add the entries of the journal, of a large one from its index if it has one."""
    if len(listing.journal) < listing_index.MIN_JOURNAL_BYTES:
        _read_journal(folder, listing, head)
        return
    path = listing_index.index_path(listing.journal, head)
    indexed_entries = listing_index.read_index(path)
    if indexed_entries is not None:
        listing.entries, listing.problems = indexed_entries
        return
    is_whole = _read_journal(folder, listing, head)
    if is_whole:
        listing_index.write_index(path, listing.entries, listing.problems)


def _read_journal(folder: Path, listing: RunListing, before: bytes) -> bool:
    """Add the entries of the journal; its first line must name the hash of `before`, if any.

    Returns:
        Whether all lines could be read: the entry of another one may come from its folder.
    """
    is_whole = True
    last: EpisodeEntry | None = None
    first_lines: dict[str, int] = {}  # the lines that episodes are on
    for line_number, line in enumerate(listing.lines, 1):
        if not line.strip():
            continue
        record: Mapping[str, Any] = {}
        try:
            record = mapping(parse(line), "")
            entry = _checked_entry(record)
        except FieldError as error:
            is_whole = False
            entry = _damaged_entry(folder, line, f"line {line_number} of {RECORDS}: {error}")
        if before and record:  # a head that cannot be read links to nothing
            _check_link(record, before, last, listing.problems)
        before = line
        last = entry
        first = first_lines.setdefault(entry.id, line_number) if entry.id else line_number
        if first != line_number:
            listing.problems.append(
                f"line {line_number} of {RECORDS}: episode {entry.id} is on line {first} already,"
                " which counts"
            )
        elif entry.id:
            entry.number = line_number
            listing.entries.append(entry)
        else:
            listing.problems.append(entry.problem)
    return is_whole


def _checked_entry(record: Mapping[str, Any]) -> EpisodeEntry:
    for name in REQUIRED_FIELDS:
        if not isinstance(record.get(name), str):
            raise FieldError(name, "is missing, or no text")
    return make_entry(record)


def _check_link(
    record: Mapping[str, Any], before: bytes, last: EpisodeEntry | None, problems: list[str]
) -> None:
    """Note a problem if the previous line was changed after the next one was written."""
    if "previous" not in record:
        problem = f"lines of {RECORDS} do not name the hash of the line before"
        problems += [] if problem in problems else [problem]
        return
    if record["previous"] == sha256_hex(before):
        return
    if last is None:
        problems.append(f"{RUN} was changed after the run began, or the first record was removed")
    elif not last.problem:
        last.problem = (
            f"line {last.number} of {RECORDS} was changed, or one after it removed: the next line"
            " names another hash"
        )


def _damaged_entry(folder: Path, line: bytes, problem: str) -> EpisodeEntry:
    """Return the entry of a line that cannot be read, from the folder that it names if it can."""
    match = _ID.search(line)
    name = match[1].decode("utf-8", "replace") if match else ""
    if name and (folder / EPISODES / name).is_dir():
        entry = _from_folder(folder, name, False)
        entry.problem = f"{problem}; shown from its folder"
        return entry
    entry = _entry_from_id(name)
    entry.problem = problem
    entry.note = problem
    return entry


def _episode_folders(folder: Path) -> list[str]:
    """Return the names of the episodes' folders.

    Raises:
        DatasetError: they cannot be listed.
    """
    try:
        # scandir tells the kind of an entry; to ask about each folder takes long on a cold disk
        with os.scandir(folder / EPISODES) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir())
    except FileNotFoundError:
        return []
    except OSError as error:
        reason = error.strerror or error
        raise DatasetError(f"{folder / EPISODES}: cannot be read ({reason})") from None


def _from_folder(folder: Path, name: str, journal: bool) -> EpisodeEntry:
    """Return the entry of an episode that the journal does not have, from its own record."""
    entry = _entry_from_id(name)
    path = folder / EPISODES / name / EPISODE
    if not path.exists():
        entry.outcome = UNFINISHED
        entry.note = "has no record: it is being played, or was broken off"
        return entry
    try:
        recorded = make_entry(parse_file(path))
    except FieldError as error:
        entry.problem = f"{EPISODE}: {error}"
        entry.note = entry.problem
        return entry
    recorded.id = name
    if journal and not recorded.problem:
        recorded.problem = f"{RECORDS} has no line of it; shown from its {EPISODE}"
    return recorded


def _entry_from_id(name: str) -> EpisodeEntry:
    """Return the entry of an episode of which only the id is known, with what the id shows."""
    parts = name.split("__")
    if len(parts) < 4:
        return EpisodeEntry(id=name, task=name)
    return EpisodeEntry(
        id=name, task=parts[0], corruption=parts[1], seed=parts[2].removeprefix("s"), agent=parts[3]
    )
