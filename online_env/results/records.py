"""The folder of a run: `run.json` holds the configuration, `records.jsonl` one episode per line.

Lines are only appended, and are on the disk before the next episode begins, so that finished
episodes are kept however a run ends. `hijack_data.runs.run_log` describes how the parts are
chained; `reading` reads the folder.
"""

import contextlib
import fnmatch
import importlib.metadata
import json
import os
import platform
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import shorten_list
from hijack_data.file_io import unwritable, write_atomic
from hijack_data.locking import Lock, LockedError, lock
from hijack_data.runs.run_log import (
    EPISODE,
    EPISODES,
    FORMAT,
    LOCK,
    RECORDS,
    RUN,
    VERSION,
    file_digest,
    sha256_hex,
)

from . import origin
from .reading import (
    MAX_LINE,
    Damage,
    ResultRecord,
    Run,
    RunError,
    first_id,
    read,
    read_head,
    read_record,
)

__all__ = [
    "Damage",
    "ResultRecord",
    "Run",
    "RunError",
    "append",
    "append_all",
    "begin",
    "create",
    "difference",
    "hold",
    "read",
    "read_head",
    "resume",
    "stored_record",
    "versions",
]

PACKAGES = ("agenthijack", "numpy", "pillow", "gymnasium", "rapidocr", "onnxruntime", "openvino")

MAX_SETTING_CHARS = 200  # letters of a setting in a message
MAX_LISTED_ENTRIES = 5  # entries of a long list in a message
_START_FILES = (LOCK, RECORDS)  # files in a folder where a run was about to begin
_HALF_WRITTEN = f".{RUN}.*.tmp"  # temporary files that a killed `write_atomic` leaves


def begin(
    folder: Path,
    config: Mapping[str, Any],
    episodes: Sequence[str],
    *,
    goes_on: bool,
    notice: Callable[[str], object] = lambda text: None,
    **used: int,
) -> Lock:
    """Begin or continue a run, and record the machine and the code.

    Errors and result are those of `create` and `resume`.

    Args:
        folder: The folder.
        config: The configuration.
        episodes: Ids of the first attempts at all that is planned.
        goes_on: Continue the run in the folder, if there is one.
        notice: Called with messages for the user.
        used: How many `desktops`, or `workers`, are used side by side.
    """
    made_by = origin.describe(config, **used)
    start = resume if goes_on else create
    folder_lock = start(folder, config, episodes, made_by)
    code_change = origin.other_code(read_head(folder), made_by)
    if code_change:
        notice(f"{folder}: {code_change}")
    return folder_lock


def check_folder(
    folder: Path, config: Mapping[str, Any], episodes: Sequence[str], *, goes_on: bool
) -> bool:
    """Check that a run could begin or continue in a folder; nothing is changed.

    Arguments as for `begin`.

    Returns:
        Whether it would continue.

    Raises:
        RunError: The folder is not empty, or holds another run.
    """
    if goes_on and (folder / RUN).exists():
        _check_same(folder, config, episodes)
        return True
    _check_empty(folder)
    return False


def create(
    folder: Path,
    config: Mapping[str, Any],
    episodes: Sequence[str] = (),
    made_by: Mapping[str, Any] | None = None,
) -> Lock:
    """Begin a run in a folder that is new or empty.

    Args:
        folder: The folder, which is created if it is missing.
        config: The benchmark, as `Bench.to_data` gives it.
        episodes: Ids of the first attempts at all that is planned.
        made_by: The origin of the run, from `origin.describe`.

    Returns:
        The lock of the folder, which keeps others out until it is released.

    Raises:
        unwritable: A file cannot be written; see `hijack_data.file_io`.
        RunError: The folder is not empty, cannot be created, or is in use by another process.
    """
    _check_distinct(episodes)
    _check_empty(folder)
    folder_lock = hold(folder)
    try:
        _check_empty(folder)  # checked again under the lock
        head = {
            "format": FORMAT,
            "version": VERSION,
            "config": dict(config),
            "episodes": list(episodes),
            "versions": versions(),
            "created": time.time(),
            **(made_by or {}),
        }
        for temporary in folder.glob(_HALF_WRITTEN):
            temporary.unlink()
        (folder / RECORDS).touch()
        write_atomic(folder / RUN, json.dumps(head, indent=1, ensure_ascii=False) + "\n")
    except OSError as error:
        folder_lock.release()
        raise unwritable(folder, error) from None
    except BaseException:
        folder_lock.release()
        raise
    return folder_lock


def resume(
    folder: Path,
    config: Mapping[str, Any],
    episodes: Sequence[str],
    made_by: Mapping[str, Any] | None = None,
) -> Lock:
    """Continue an interrupted run, or begin one that never began.

    If the last line of the journal was cut off, it is removed; finished episodes without a line get
    theirs. Arguments and result are those of `create`.

    Raises:
        RunError: The run is another one (the message names the first difference), it or an episode
            without a line is damaged, its format version is another, or another process has the
            folder.
    """
    if not (folder / RUN).exists():
        return create(folder, config, episodes, made_by)
    folder_lock = hold(folder)
    try:
        _check_same(folder, config, episodes)
        _drop_cut_line(folder)
        run = read(folder)
        if run.damaged:
            broken = run.damaged[0]
            location = f"{folder / RECORDS}:{broken.line}"
            raise RunError(f"{location}: {broken.problem}; a damaged run cannot be resumed")
        _adopt_episodes(folder, run, episodes)
        if made_by is not None:
            session = {**made_by, "versions": versions()}
            origin.add_session(folder, session, len(run.records))
    except BaseException:
        folder_lock.release()
        raise
    return folder_lock


def hold(folder: Path) -> Lock:
    """Lock the folder of a run for this process; a missing folder is created.

    Raises:
        RunError: Another process has locked it (the message gives its number and machine), or it
            cannot be created.
        unwritable: The lock cannot be signed.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder_lock = lock(folder / LOCK)
    except LockedError as error:
        advice = "wait for it, or give another --out"
        raise RunError(f"{folder}: is being written by {error.holder}; {advice}") from None
    except OSError as error:
        raise RunError(f"{folder}: cannot be made ({error.strerror or error})") from None
    try:
        folder_lock.sign()
    except OSError as error:
        folder_lock.release()
        raise unwritable(folder / LOCK, error) from None
    return folder_lock


def append(folder: Path, record: ResultRecord) -> None:
    """Add a finished episode; it is on the disk when this returns.

    Raises:
        unwritable: `StorageError` if the disk is full, otherwise `HijackError`.
    """
    append_all(folder, [record])


def append_all(folder: Path, records: Sequence[ResultRecord]) -> None:
    """Add finished episodes, in their order; all are on the disk when this returns.

    Raises:
        unwritable: `StorageError` if the disk is full, otherwise `HijackError`.
    """
    path = folder / RECORDS
    if not records:
        return
    try:
        before = _last_line(path) or (folder / RUN).read_bytes()
        with open(path, "ab") as handle:
            for record in records:
                line = _chain_line(folder, record, before)
                handle.write(line + b"\n")
                before = line
            handle.flush()
            os.fsync(handle.fileno())
    except OSError as error:
        raise unwritable(path, error) from None


def stored_record(folder: Path, record: ResultRecord) -> ResultRecord:
    """Return the record in the folder of an episode, if the episode was completely written.

    A process that is killed right after it wrote the last file cannot report the record; its
    episode would count as lost although it is complete.

    Args:
        folder: Of the run.
        record: The record as it was reported.

    Returns:
        The record in the episode's folder; `record` if there is none.
    """
    path = folder / EPISODES / str(record.get("id")) / EPISODE
    try:
        stored: object = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return record
    return cast("ResultRecord", stored) if isinstance(stored, dict) else record


def _chain_line(folder: Path, record: ResultRecord, before: bytes) -> bytes:
    """Return the line of a record, which names the SHA-256 of the line before it."""
    episode = folder / EPISODES / str(record.get("id")) / EPISODE
    digest = file_digest(episode)
    links = {"previous": sha256_hex(before), "episode_sha256": digest}
    line = json.dumps({**record, **links}, ensure_ascii=False, allow_nan=False)
    return line.encode("utf-8", "backslashreplace")


def difference(before: object, after: object, path: str = "") -> str:
    """Return the first difference of two JSON values in words, or "" if they are equal."""
    if before == after:
        return ""
    if isinstance(before, dict) and isinstance(after, dict):
        keys = {**before, **after}
        return _first_text(
            difference(before.get(k), after.get(k), f"{path}.{k}".lstrip(".")) for k in keys
        )
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        pairs = enumerate(zip(before, after, strict=True))
        return _first_text(difference(old, new, f"{path}[{index}]") for index, (old, new) in pairs)
    texts = json.dumps(before), json.dumps(after)
    if (
        isinstance(before, list)
        and isinstance(after, list)
        and max(map(len, texts)) > MAX_SETTING_CHARS
    ):
        entries = _other_entries(before, after)
        if entries:
            return f"{path} {entries}"
    return f"{path} was {texts[0]:.{MAX_SETTING_CHARS}}, and is {texts[1]:.{MAX_SETTING_CHARS}} now"


def _other_entries(before: Sequence[object], after: Sequence[object]) -> str:
    """Return which entries only one of two long lists has, or "" if each has all of the other."""
    removed = [json.dumps(entry) for entry in before if entry not in after]
    added = [json.dumps(entry) for entry in after if entry not in before]
    parts = [f"has lost {shorten_list(removed, MAX_LISTED_ENTRIES)}"] if removed else []
    parts += [f"has gained {shorten_list(added, MAX_LISTED_ENTRIES)}"] if added else []
    return " and ".join(parts)


def versions() -> dict[str, str]:
    """Return the versions of Python, the system and the packages that affect a run."""
    installed = {"python": platform.python_version(), "system": platform.platform()}
    for name in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return installed


def _first_text(texts: Iterable[str]) -> str:
    return next((text for text in texts if text), "")


def _check_distinct(episodes: Sequence[str]) -> None:
    """Check that no two episodes have one id, which would be one folder and one record.

    Raises:
        RunError: two have.
    """
    twice = [name for name, count in Counter(episodes).items() if count > 1]
    if twice:
        raise RunError(
            f"{len(twice)} ids stand for several episodes, such as {twice[0]!r}: their agents,"
            " tasks or labels differ only in characters that an id lacks (all but a-z, A-Z, 0-9"
            " and _ . + -); rename one of them"
        )


def _check_empty(folder: Path) -> None:
    try:
        holds = sorted(path.name for path in folder.iterdir()) if folder.exists() else []
        has_records = RECORDS in holds and (folder / RECORDS).stat().st_size > 0
    except OSError as error:
        raise RunError(f"{folder}: cannot be read ({error.strerror or error})") from None
    if RUN in holds:
        advice = f"read it with: hijack report {folder}, go on with it by --resume, or give another"
        raise RunError(f"{folder}: holds a run already; {advice} --out")
    harmless = {*_START_FILES, *fnmatch.filter(holds, _HALF_WRITTEN)}
    if has_records:
        harmless.remove(RECORDS)  # of a run whose head is gone; a new run must not count them
    foreign = [name for name in holds if name not in harmless]
    if foreign:
        listed = ", ".join(foreign[:3])
        raise RunError(f"{folder}: is not empty ({listed} ...); give --out a new folder")


def _check_same(folder: Path, config: Mapping[str, Any], episodes: Sequence[str]) -> None:
    head = read_head(folder)
    if head["version"] != VERSION:
        problem = f"has format version {head['version']}, and this library writes {VERSION}"
        raise RunError(f"{folder}: {problem}; begin a new run")
    package = PACKAGES[0]
    begun_version = head.get("versions", {}).get(package)
    present = versions().get(package)
    if begun_version != present:
        problem = f"was begun with {package} {begun_version}, this is {present}"
        raise RunError(f"{folder}: {problem}; go on with that version, or begin a new run")
    before = _without_places(head.get("config", {}))
    after = _without_places(json.loads(json.dumps(config)))
    change = difference(before, after)
    if change:
        raise RunError(f"{folder}: is another run: {change}; go on with the same configuration")
    if head.get("episodes") != list(episodes):
        raise RunError(f"{folder}: is another run: its tasks have other variants; begin a new run")


def _without_places(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration without the paths of its files, whose hashes stay: files may move."""
    code = {
        name: {key: value for key, value in source.items() if key != "path"}
        for name, source in config.get("code", {}).items()
    }
    unplayable = sorted(config.get("unplayable", ()))  # the reasons name the cache of files
    paths = {"source": "", "osworld_files": ""}
    return {**config, **paths, "unplayable": unplayable, "code": code}


def _drop_cut_line(folder: Path) -> None:
    path = folder / RECORDS
    content = path.read_bytes() if path.exists() else b""
    if content and not content.endswith(b"\n"):
        complete = content.rpartition(b"\n")[0]
        write_atomic(path, complete + b"\n" if complete else b"")
    path.touch()


def _adopt_episodes(folder: Path, run: Run, episodes: Sequence[str]) -> None:
    """Add the lines of episodes that ended right before the run was interrupted.

    An episode that ended because the run did (Ctrl-C, a full disk) is played again as if it had
    never begun; otherwise two such ends would count as a failure of the agent.
    """
    recorded = {record.get("id") for record in run.records}
    episode_files = sorted((folder / EPISODES).glob(f"*/{EPISODE}"))
    adopted: list[ResultRecord] = []
    for path in episode_files:
        if path.parent.name in recorded:
            continue
        record = read_record(path)
        if first_id(record) not in episodes:
            continue
        if record["status"] == "error" and record.get("cause") != "agent":
            path.unlink()
        else:
            adopted.append(record)
    append_all(folder, sorted(adopted, key=lambda record: record.get("attempt") or 0))


def _last_line(path: Path) -> bytes:
    """Return the last line of a file without its end."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - MAX_LINE))
        return file.read(MAX_LINE).rstrip(b"\n").rpartition(b"\n")[2]
