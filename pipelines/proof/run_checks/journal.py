"""Check the journal of a run, `run.json` and `records.jsonl`, also against the episodes."""

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.file_io import read_regular
from hijack_data.planner import Planner
from hijack_data.runs.run_head import check_head
from hijack_data.runs.run_log import (
    CHAINED,
    EPISODE,
    EPISODES,
    GIVEN,
    GIVEN_KINDS,
    GIVING,
    LINKS,
    RECORDS,
    RUN,
    SCORE_RUN,
    SESSIONS,
    VERSION,
    digest_of,
    file_digest,
)
from hijack_data.runs.run_planners import read_planners

from ...readers import fields
from ...readers.fields import FieldError, FieldTypeError
from ...readers.safe_files import parse, parse_file
from . import field_checks
from .field_checks import first_attempt_id
from .library import Library

LISTED = ("agents", "tasks", "seeds", "corruptions")  # of a configuration
# In version 1, only the journal had this field, and not the episode.
SAID_LATER = frozenset({"said"})
NAME_BYTES = 255  # of a folder, at most


@dataclass
class Journal:
    """The journal of a run.

    Args:
        folder: of the run.
        head: the content of `run.json`; empty if there is none.
        exists: whether there is a journal; environments outside `hijack bench` write none.
        planners: those of `run.json`, by label; `None` if it names none.
        found: the problems of the files themselves.
        lines: those of `records.jsonl`, as bytes.
        records: the parsed lines.
        oldest: the lowest version of the journal and its episodes.
        sessions: the lines of `sessions.jsonl`.
    """

    folder: Path
    head: Mapping[str, Any] = field(default_factory=dict[str, Any])
    exists: bool = False
    planners: Mapping[str, Planner | None] | None = None
    found: list[str] = field(default_factory=list[str])
    lines: list[bytes] = field(default_factory=list[bytes])
    records: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    oldest: int = VERSION
    sessions: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    _episodes: dict[str, tuple[Path, Mapping[str, Any]]] = field(default_factory=dict[str, Any])

    @property
    def config(self) -> Mapping[str, Any]:
        """The configuration; empty if there is none."""
        found = self.head.get("config")
        return found if isinstance(found, dict) else {}

    @property
    def is_scored(self) -> bool:
        """Whether it is a run of `hijack score`, whose records are answers to rows."""
        return self.config.get("kind") == SCORE_RUN

    @cached_property
    def library(self) -> Library:
        """What is known of the version of the library that played the run."""
        return Library.for_run(self.head.get("versions"))

    @property
    def version(self) -> int:
        """The version of `run.json`; the current version if there is no such file."""
        found = self.head.get("version", VERSION)
        return found if isinstance(found, int) else VERSION

    @cached_property
    def lacks_episodes(self) -> bool:
        """Whether there are records of episodes, but no folder of any; for a journal that is read.

        It is asked for each record, so it is looked up once.
        """
        if self.is_scored or (self.folder / EPISODES).is_dir():
            return False
        return any(record.get("steps") for record in self.records)

    def note(self, folder: Path, record: Mapping[str, Any]) -> None:
        """Add the record of an episode."""
        self._episodes[folder.name] = folder, record
        version = record.get("version", 1)
        self.oldest = min(self.oldest, version if isinstance(version, int) else 1)
        if self.exists and not self._goes_with(version):
            what = f"is of version {version}, {RUN} is of version {self.version}"
            self.found.append(f"{EPISODES}/{folder.name}/{EPISODE}: {what}")

    def _goes_with(self, version: object) -> bool:
        """Return whether an episode of a version may be in this run.

        A newer library may continue a run with hashes; an older library never may.
        """
        if version == self.version or not isinstance(version, int):
            return version == self.version
        return CHAINED <= self.version < version

    def problems(self) -> Iterator[str]:
        """Yield the problems of the journal; call it after all episodes were added."""
        yield from self.found
        listed = self.head.get("episodes")
        names = listed if isinstance(listed, list) else []
        yield from field_checks.file_problems(self.folder, names, self.records)
        if not self.exists:
            return
        for text in field_checks.head_problems(self.head, tuple(self.planners or ()), self.library):
            yield f"{RUN}: {text}"
        made = len(self.records)
        for text in field_checks.session_problems(self.sessions, self.head, made):
            yield f"{SESSIONS}: {text}"
        if self.version >= CHAINED:
            yield from self._broken_links()
        found = Counter(str(record.get("id")) for record in self.records)
        for name, times in found.items():
            if times > 1:
                yield f"{RECORDS}: {name} is there {times} times"
        if self.lacks_episodes:
            yield (
                f"{EPISODES}: is not there, so no record can be compared with its episode; verify"
                " the run where it was played, or copy its whole folder"
            )
        for number, record in enumerate(self.records, 1):
            for text in self._record(record):
                yield f"{RECORDS}: line {number}: {text}"
        yield from self._given_otherwise()
        if not self.is_scored:
            for text in field_checks.alike_problems(self.records):
                yield f"{RECORDS}: {text}"
        for name in self._episodes.keys() - found.keys():
            yield f"{RECORDS}: has no line of {EPISODES}/{name}"
        yield from self._missing()

    def _broken_links(self) -> Iterator[str]:
        before = file_digest(self.folder / RUN)
        name = RUN
        pairs = zip(self.lines, self.records, strict=True)
        for number, (line, record) in enumerate(pairs, 1):
            here = f"line {number}"
            if record.get("previous") != before:
                yield f"{RECORDS}: {here}: does not follow on {name} (previous)"
            before = digest_of(line)
            name = here
            if self.lacks_episodes:
                continue
            path = f"{EPISODES}/{record.get('id')}/{EPISODE}"
            if record.get("episode_sha256") != file_digest(self.folder / path):
                yield f"{RECORDS}: {here}: {path} is not what it was (episode_sha256)"

    def _record(self, record: Mapping[str, Any]) -> Iterator[str]:
        """Yield the differences of one record from the configuration and from its episode."""
        yield from self._planned(record)
        if self.is_scored:
            yield from privileged_input_problems(record)
            return  # rows of a dataset, not episodes
        yield from field_checks.unknown_fields(record, EPISODE, LINKS)
        yield from field_checks.record_problems(record, self.config, self.library)
        yield from field_checks.outcome_problems(record)
        name = str(record.get("id"))
        if name not in self._episodes:
            if record.get("status") != "ok" and not record.get("steps"):
                return  # no desktop started, so there is nothing to compare
            if self.lacks_episodes:
                return
            yield f"there is no {EPISODES}/{name}"
            return
        _, episode = self._episodes[name]
        left_out = set(LINKS)
        if self.version < CHAINED:
            left_out |= SAID_LATER
        for key in sorted({*record, *episode} - left_out):
            if record.get(key) != episode.get(key):
                yield f"{key} of {name} is another than in its {EPISODE}"

    def _given_otherwise(self) -> Iterator[str]:
        """Yield the agents that were not given the same in all episodes."""
        kinds: dict[str, set[str]] = {}
        for record in self.records:
            given = record.get(GIVEN)
            if isinstance(given, list):
                said = ", ".join(map(str, given)) or "nothing"
                kinds.setdefault(str(record.get("agent")), set()).add(said)
        for agent, found in kinds.items():
            if len(found) > 1:
                listed = "; ".join(sorted(found))
                yield f"{RECORDS}: {agent} was not always given the same ({GIVEN}): {listed}"

    def _planned(self, record: Mapping[str, Any]) -> Iterator[str]:
        config = self.config
        expected = {"agents": record.get("agent"), "seeds": record.get("seed")}
        for key, value in expected.items():
            if key in config and value not in config[key]:
                yield f"{value!r} is none of the {key} of {RUN}"
        episodes = self.head.get("episodes")
        first = first_attempt_id(record)
        if isinstance(episodes, list) and first not in episodes:
            yield f"{first} was not planned ({RUN})"
        if record.get("attempt", 0) > config.get("retries", 0):
            yield f"{record.get('id')} is one attempt more than retries allow ({RUN})"

    def _missing(self) -> Iterator[str]:
        """Yield the planned episodes and the due attempts that are missing."""
        made: dict[str, list[Mapping[str, Any]]] = {}
        for record in self.records:
            made.setdefault(first_attempt_id(record), []).append(record)
        retries = self.config.get("retries", 0)
        for name, attempts in made.items():
            if len(attempts) <= retries and _ours(attempts[-1]):
                yield f"{RUN}: {name} was not run again, and retries is {retries}"
        episodes = self.head.get("episodes")
        if isinstance(episodes, list):
            planned = len(episodes)
            missing = [name for name in episodes if name not in made]
            count = len(missing)
        else:
            planned = self._planned_number()
            missing = []
            count = max(0, planned - len(made))
        example = f", such as {missing[0]}" if missing else ""
        if count:
            yield f"{RUN}: {count} of {planned} planned episodes are not there{example}"

    def _planned_number(self) -> int:
        """Return the number of episodes that the configuration asks for."""
        return prod(len(self.config.get(key, ())) for key in LISTED)


def privileged_input_problems(record: Mapping[str, Any]) -> Iterator[str]:
    """Yield the problems of a record's field `given`."""
    version = record.get("version", 1)
    if isinstance(version, int) and version < GIVING and GIVEN not in record:
        return
    if GIVEN not in record:
        yield f"{GIVEN} is missing; records have it since version {GIVING}"
        return
    given = record[GIVEN]
    if given is None:
        return
    known = isinstance(given, list) and all(kind in GIVEN_KINDS for kind in given)
    if not known or len(set(given)) != len(given):
        wanted = f"null or a list of {', '.join(GIVEN_KINDS)}"
        yield f"{GIVEN} must be {wanted}, got {fields.shown(given)}"


def _ours(record: Mapping[str, Any]) -> bool:
    """Return whether an episode failed in a way that calls for another attempt."""
    return record.get("status") == "invalid" or record.get("cause") == "machine"


def read_journal(folder: Path) -> Journal:
    """Read `run.json` and `records.jsonl`; their problems are noted in the journal."""
    journal = Journal(folder)
    if not (folder / RUN).is_file():
        if (folder / RECORDS).is_file():
            journal.found.append(f"{RUN}: is missing")
        return journal
    try:
        _read_head(journal)
    except HijackError as error:
        journal.found.append(f"{RUN}: {error}")
    _read_records(journal)
    return journal


def _read_head(journal: Journal) -> None:
    head = check_head(parse_file(journal.folder / RUN))
    _check_config(head.get("config", {}))
    journal.head = head
    journal.exists = True
    journal.oldest = head["version"]
    journal.sessions = list(_sessions(journal.folder / SESSIONS))
    if "corruptions" in journal.config:
        journal.planners = read_planners(journal.config["corruptions"])


def _sessions(path: Path) -> Iterator[Mapping[str, Any]]:
    """Yield the lines of `sessions.jsonl`, without one that was cut off as the run was killed."""
    if not path.is_file():
        return
    for line in path.read_bytes().split(b"\n"):
        with contextlib.suppress(FieldError):
            yield fields.mapping(parse(line), "")


def _check_config(config: Mapping[str, Any]) -> None:
    """Check the kinds of the fields that records are compared with.

    Raises:
        FieldError: One of them is of another kind.
    """
    for key in LISTED:
        if not isinstance(config.get(key, []), list):
            raise FieldTypeError(f"config.{key}", "a list", config[key])
    if not _is_whole(config.get("retries", 0)):
        raise FieldTypeError("config.retries", "a whole number", config["retries"])


def _check_record(record: Mapping[str, Any]) -> None:
    """Check the fields that say which episode a line of `records.jsonl` is about.

    Raises:
        FieldError: One of them is of another kind, or missing.
    """
    name = fields.text(record, "id")
    if len(name.encode()) > NAME_BYTES or "/" in name or "\0" in name:
        raise FieldTypeError("id", "the name of a folder", name)
    if not _is_whole(record.get("attempt", 0)):
        raise FieldTypeError("attempt", "a whole number", record["attempt"])


def _is_whole(value: object) -> bool:
    """Return whether a value is a number of times."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _read_records(journal: Journal) -> None:
    path = journal.folder / RECORDS
    try:
        content = read_regular(path)
    except OSError as error:
        journal.found.append(f"{RECORDS}: cannot be read ({error.strerror or error})")
        return
    if content and not content.endswith(b"\n"):
        journal.found.append(f"{RECORDS}: the last line is cut off")
    for number, line in enumerate(content.split(b"\n"), 1):
        if not line.strip():
            continue
        try:
            record = fields.mapping(parse(line), "")
            _check_record(record)
        except FieldError as error:
            journal.found.append(f"{RECORDS}: line {number}: {error}")
            continue
        journal.lines.append(line)
        journal.records.append(record)
