"""Check the journal of a run, `run.json` and `records.jsonl`, also against the episodes."""

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError, short_repr
from hijack_data.file_io import read_regular
from hijack_data.planner import Planner
from hijack_data.runs.run_head import check_head
from hijack_data.runs.run_log import (
    EPISODE,
    EPISODES,
    GIVEN,
    GIVEN_KINDS,
    LINKS,
    RECORDS,
    RUN,
    SCORE_RUN,
    SESSIONS,
    VERSION,
    file_digest,
    sha256_hex,
)
from hijack_data.runs.run_planners import read_planners

from ...readers import fields
from ...readers.fields import FieldError, FieldTypeError
from ...readers.safe_files import parse, parse_file
from . import field_checks
from .field_checks import first_attempt_id
from .library import Library

LISTED = ("agents", "tasks", "seeds", "corruptions")  # of a configuration
NAME_BYTES = 255  # of a folder, at most


@dataclass
class Journal:
    """The journal of a run.

    Args:
        folder: of the run.
        head: the content of `run.json`; empty if there is none.
        exists: whether there is a journal; environments outside `hijack bench` write none.
        planners: those of `run.json`, by label; `None` if it names none.
        file_problems: the problems of the files themselves.
        lines: those of `records.jsonl`, as bytes.
        records: the parsed lines.
        sessions: the lines of `sessions.jsonl`.
    """

    folder: Path
    head: Mapping[str, Any] = field(default_factory=dict[str, Any])
    exists: bool = False
    planners: Mapping[str, Planner | None] | None = None
    file_problems: list[str] = field(default_factory=list[str])
    lines: list[bytes] = field(default_factory=list[bytes])
    records: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    sessions: list[Mapping[str, Any]] = field(default_factory=list[Mapping[str, Any]])
    _episodes: dict[str, tuple[Path, Mapping[str, Any]]] = field(default_factory=dict[str, Any])

    @property
    def config(self) -> Mapping[str, Any]:
        """The configuration; empty if there is none."""
        config = self.head.get("config")
        return config if isinstance(config, dict) else {}

    @property
    def is_scored(self) -> bool:
        """Whether it is a run of `hijack score`, whose records are answers to rows."""
        return self.config.get("kind") == SCORE_RUN

    @cached_property
    def library(self) -> Library:
        """What is known of the version of the library that played the run."""
        return Library.for_run(self.head.get("versions"))

    @cached_property
    def lacks_episodes(self) -> bool:
        """Whether there are records of episodes, but no folder of any; for a journal that is read.

        It is asked for each record, so it is looked up once.
        """
        if self.is_scored or (self.folder / EPISODES).is_dir():
            return False
        return any(record.get("steps") for record in self.records)

    def add_episode(self, folder: Path, record: Mapping[str, Any]) -> None:
        """Add the record of an episode."""
        self._episodes[folder.name] = folder, record

    def problems(self) -> Iterator[str]:
        """Yield the problems of the journal; call it after all episodes were added."""
        yield from self.file_problems
        listed = self.head.get("episodes")
        names = listed if isinstance(listed, list) else []
        yield from field_checks.file_problems(self.folder, names, self.records)
        if not self.exists:
            return
        for text in field_checks.head_problems(self.head, tuple(self.planners or ()), self.library):
            yield f"{RUN}: {text}"
        count = len(self.records)
        for text in field_checks.session_problems(self.sessions, self.head, count):
            yield f"{SESSIONS}: {text}"
        yield from self._broken_links()
        occurrences = Counter(str(record.get("id")) for record in self.records)
        for name, times in occurrences.items():
            if times > 1:
                yield f"{RECORDS}: {name} is there {times} times"
        for number, record in enumerate(self.records, 1):
            for text in self._record_problems(record):
                yield f"{RECORDS}: line {number}: {text}"
        yield from self._changing_inputs()
        if not self.is_scored:
            for text in field_checks.alike_problems(self.records):
                yield f"{RECORDS}: {text}"
        for name in self._episodes.keys() - occurrences.keys():
            yield f"{RECORDS}: has no line of {EPISODES}/{name}"
        yield from self._missing_episodes()

    def _broken_links(self) -> Iterator[str]:
        before = file_digest(self.folder / RUN)
        name = RUN
        pairs = zip(self.lines, self.records, strict=True)
        for number, (line, record) in enumerate(pairs, 1):
            line_name = f"line {number}"
            if record.get("previous") != before:
                yield f"{RECORDS}: {line_name}: does not follow on {name} (previous)"
            before = sha256_hex(line)
            name = line_name
            if self.lacks_episodes:
                continue
            path = f"{EPISODES}/{record.get('id')}/{EPISODE}"
            if record.get("episode_sha256") != file_digest(self.folder / path):
                yield f"{RECORDS}: {line_name}: {path} is not what it was (episode_sha256)"

    def _record_problems(self, record: Mapping[str, Any]) -> Iterator[str]:
        """Yield the differences of one record from the configuration and from its episode."""
        yield from self._plan_problems(record)
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
        for key in sorted({*record, *episode} - set(LINKS)):
            if record.get(key) != episode.get(key):
                yield f"{key} of {name} is another than in its {EPISODE}"

    def _changing_inputs(self) -> Iterator[str]:
        """Yield the agents that were not given the same in all episodes."""
        kinds: dict[str, set[str]] = {}
        for record in self.records:
            inputs = record.get(GIVEN)
            if isinstance(inputs, list):
                text = ", ".join(map(str, inputs)) or "nothing"
                kinds.setdefault(str(record.get("agent")), set()).add(text)
        for agent, texts in kinds.items():
            if len(texts) > 1:
                listed = "; ".join(sorted(texts))
                yield f"{RECORDS}: {agent} was not always given the same ({GIVEN}): {listed}"

    def _plan_problems(self, record: Mapping[str, Any]) -> Iterator[str]:
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

    def _missing_episodes(self) -> Iterator[str]:
        """Yield the planned episodes and the due attempts that are missing."""
        attempts_by_id: dict[str, list[Mapping[str, Any]]] = {}
        for record in self.records:
            attempts_by_id.setdefault(first_attempt_id(record), []).append(record)
        retries = self.config.get("retries", 0)
        for name, attempts in attempts_by_id.items():
            if len(attempts) <= retries and _needs_retry(attempts[-1]):
                yield f"{RUN}: {name} was not run again, and retries is {retries}"
        planned_ids = self.head.get("episodes")
        if not isinstance(planned_ids, list):
            yield f"{RUN}: episodes: must be a list of ids, got {short_repr(planned_ids)}"
            return
        try:
            due = self.library.due_episodes(self.config, planned_ids, self.records)
        except HijackError as error:
            yield f"{RUN}: config.{error}"
            return
        missing = [name for name in due if name not in attempts_by_id]
        if missing:
            yield (
                f"{RUN}: {len(missing)} of {len(planned_ids)} planned episodes are not there, such"
                f" as {missing[0]}"
            )


def privileged_input_problems(record: Mapping[str, Any]) -> Iterator[str]:
    """Yield the problems of a record's field `given`."""
    if GIVEN not in record:
        yield f"{GIVEN} is missing: every record says what its agent was given, or null"
        return
    inputs = record[GIVEN]
    if inputs is None:
        return
    is_valid = isinstance(inputs, list) and all(kind in GIVEN_KINDS for kind in inputs)
    if not is_valid or len(set(inputs)) != len(inputs):
        expected = f"null or a list of {', '.join(GIVEN_KINDS)}"
        yield f"{GIVEN} must be {expected}, got {short_repr(inputs)}"


def _needs_retry(record: Mapping[str, Any]) -> bool:
    """Return whether an episode failed in a way that calls for another attempt."""
    return record.get("status") == "invalid" or record.get("cause") == "machine"


def read_journal(folder: Path) -> Journal:
    """Read `run.json` and `records.jsonl`; their problems are noted in the journal."""
    journal = Journal(folder)
    if not (folder / RUN).is_file():
        if (folder / RECORDS).is_file():
            journal.file_problems.append(f"{RUN}: is missing")
        return journal
    try:
        _read_head(journal)
    except HijackError as error:
        journal.file_problems.append(f"{RUN}: {error}")
    _read_records(journal)
    return journal


def _read_head(journal: Journal) -> None:
    head = check_head(parse_file(journal.folder / RUN))
    _check_config(head.get("config", {}))
    if head["version"] != VERSION:
        raise FieldError("version", f"is {head['version']}; this library reads {VERSION}")
    journal.head = head
    journal.exists = True
    journal.sessions = list(_sessions(journal.folder / SESSIONS))
    # The rows of a dataset may have labels of corruptions that no configuration can hold.
    if "corruptions" in journal.config and not journal.is_scored:
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
        FieldTypeError: one of them is of another kind.
    """
    for key in LISTED:
        if not isinstance(config.get(key, []), list):
            raise FieldTypeError(f"config.{key}", "a list", config[key])
    if not _is_whole(config.get("retries", 0)):
        raise FieldTypeError("config.retries", "a whole number", config["retries"])


def _check_record(record: Mapping[str, Any]) -> None:
    """Check the fields that say which episode a line of `records.jsonl` is about.

    Raises:
        FieldTypeError: one of them is of another kind.
        FieldError: `id` is missing.
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
        journal.file_problems.append(f"{RECORDS}: cannot be read ({error.strerror or error})")
        return
    if content and not content.endswith(b"\n"):
        journal.file_problems.append(f"{RECORDS}: the last line is cut off")
    for number, line in enumerate(content.split(b"\n"), 1):
        if not line.strip():
            continue
        try:
            record = fields.mapping(parse(line), "")
            _check_record(record)
        except FieldError as error:
            journal.file_problems.append(f"{RECORDS}: line {number}: {error}")
            continue
        journal.lines.append(line)
        journal.records.append(record)
