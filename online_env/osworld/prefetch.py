"""Fill OSWorld's file cache while there is a network, so that runs need none.

A complete file is never fetched again, a download that was cut off resumes where it stopped, and no
file appears under its own name before it is complete. `manifest.json` in the cache holds size and
SHA-256 of each.

Neither pooch nor `hf_hub_download` fits: the hashes are not known beforehand, the addresses are of
several hosts, and a file must get OSWorld's own name. pooch starts a broken download over from its
first byte, and the hub client speaks the hub's API only.
"""

import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.errors import ConfigError, HijackError
from hijack_data.file_io import make_folder, replace_atomic, write_atomic
from hijack_data.locking import Lock, LockedError, lock

from .. import extra
from .cache_files import CacheFile

try:
    import httpx
except ModuleNotFoundError as _error:
    raise extra.import_error(_error, "fetching files") from None

MANIFEST = "manifest.json"
PARTS_FOLDER = ".parts"
LOCK = ".lock"
MAX_TRIES = 5
RETRY_PAUSES_S = (1.0, 2.0, 4.0, 8.0)  # seconds between tries
# HTTP codes after which another try may succeed.
RETRIED_STATUSES = frozenset({408, 425, 429, 500, 502, 503, 504})


class _CutOffError(HijackError):
    """The connection ended before the file did."""


class _PassingError(HijackError):
    """A failure that another try may not have."""


@dataclass
class PrefetchReport:
    """The result of `prefetch`.

    Args:
        fetched: Paths in the cache of the files that were fetched.
        kept: Paths of the files that were there already.
        failed: Files that could not be had, as `{path: reason}`.
        bytes: How much was fetched.
    """

    fetched: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    bytes: int = 0


def prefetch(
    files: Iterable[CacheFile],
    cache: Path,
    client: httpx.Client | None = None,
    tell: Callable[[int, int, str], object] = lambda *_: None,
    sleep: Callable[[float], object] = time.sleep,
) -> PrefetchReport:
    """Fetch the files that `cache` lacks; the others go on if one cannot be had.

    Each address is fetched once, however many tasks need it. A damaged manifest raises
    `ConfigError`.

    Args:
        files: What is to be there.
        cache: OSWorld's cache folder; it is made if it is missing.
        client: The HTTP client; one of our own if omitted.
        tell: Called after each file with how many are done, how many there are, and its path.
        sleep: Called with the seconds between two tries.

    Raises:
        HijackError: The cache cannot be written, or another prefetch fills it.
    """
    ordered = sorted(set(files), key=lambda item: (item.path, item.url))
    report = PrefetchReport()
    if client is None:
        timeout = httpx.Timeout(30, read=120)
        client = httpx.Client(follow_redirects=True, timeout=timeout)
    try:
        with _locked(cache), client:
            record = read_manifest(cache)
            download = _Download(cache, record, client, sleep)
            for number, item in enumerate(ordered, 1):
                download.fetch(item, report)
                tell(number, len(ordered), item.path)
            if not report.failed:
                shutil.rmtree(cache / PARTS_FOLDER, ignore_errors=True)
    except OSError as error:
        raise HijackError(f"{cache}: cannot be written ({error.strerror or error})") from None
    return report


def _locked(cache: Path) -> Lock:
    cache.mkdir(parents=True, exist_ok=True)
    try:
        return lock(cache / LOCK)
    except LockedError:
        problem = "another `hijack osworld prefetch` is filling it; wait for that one"
        raise HijackError(f"{cache}: {problem}") from None


def check(cache: Path) -> dict[str, str]:
    """Hash every file of the manifest again; return the wrong ones as `{path: reason}`."""
    damaged: dict[str, str] = {}
    for path, entry in read_manifest(cache).items():
        if not (cache / path).is_file():
            damaged[path] = "missing"
            continue
        digest = sha256(cache / path)
        if digest != entry["sha256"]:
            damaged[path] = f"SHA-256 is {digest}, the manifest says {entry['sha256']}"
    return damaged


def read_manifest(cache: Path) -> dict[str, Any]:
    """Return `{path: {"url", "size", "sha256"}}`, which is empty if there is no manifest.

    Raises:
        ConfigError: The manifest is damaged.
    """
    path = cache / MANIFEST
    if not path.exists():
        return {}
    try:
        record: Any = json.loads(path.read_text(encoding="utf-8"))
        if all({"url", "size", "sha256"} <= entry.keys() for entry in record.values()):
            return record
        problem: object = "an entry lacks url, size or sha256"
    except (OSError, ValueError, AttributeError, TypeError, RecursionError) as error:
        problem = error
    raise ConfigError([f"{path}: damaged ({problem}); remove it, and the files are hashed again"])


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


class _Download:
    """Fetches files into one cache; `record` is the content of its manifest."""

    def __init__(
        self,
        cache: Path,
        record: dict[str, Any],
        client: httpx.Client,
        sleep: Callable[[float], object],
    ) -> None:
        self._cache = cache
        self._record = record
        self._client = client
        self._sleep = sleep

    def fetch(self, item: CacheFile, report: PrefetchReport) -> None:
        """Fetch a file, unless it is there, and note in the report what came of it."""
        target = self._cache / item.path
        if self._is_there(item, target):
            report.kept.append(item.path)
            return
        try:
            source = self._same_address(item) or self._fetched(item.url)
        # A host that has no name in DNS is a `UnicodeError`.
        except (HijackError, httpx.HTTPError, httpx.InvalidURL, UnicodeError) as error:
            report.failed[item.path] = f"{item.url}: {error or type(error).__name__}"
            return
        make_folder(target.parent, target)
        # A copy, never a hard link: OSWorld opens files of its cache for writing.
        replace_atomic(target, lambda path: shutil.copyfile(source, path))
        size = target.stat().st_size
        self._record[item.path] = {"url": item.url, "size": size, "sha256": sha256(target)}
        manifest = json.dumps(self._record, indent=1, sort_keys=True)
        write_atomic(self._cache / MANIFEST, manifest + "\n")
        report.fetched.append(item.path)
        report.bytes += size

    def _is_there(self, item: CacheFile, target: Path) -> bool:
        entry = self._record.get(item.path)
        if entry is None or entry["url"] != item.url or not target.is_file():
            return False
        return target.stat().st_size == entry["size"]

    def _same_address(self, item: CacheFile) -> Path | None:
        """Return a file of the same address under another name, if it is still as fetched."""
        for name, entry in self._record.items():
            path = self._cache / name
            if entry["url"] != item.url or not path.is_file():
                continue
            if sha256(path) == entry["sha256"]:
                return path
        return None

    def _fetched(self, url: str) -> Path:
        """Fetch an address into the folder of parts, in at most `MAX_TRIES` tries.

        Raises:
            HijackError: No try succeeded.
        """
        parts = self._cache / PARTS_FOLDER
        parts.mkdir(exist_ok=True)
        part = parts / hashlib.sha256(url.encode()).hexdigest()[:32]
        for wait in RETRY_PAUSES_S[: MAX_TRIES - 1]:
            try:
                return self._try(url, part)
            except _PassingError:
                self._sleep(wait)
        try:
            return self._try(url, part)
        except _PassingError as error:
            raise HijackError(str(error)) from None

    def _try(self, url: str, part: Path) -> Path:
        try:
            return _resumed(url, part, self._client)
        except httpx.HTTPStatusError as error:
            code = error.response.status_code
            problem = f"the server answers {code}"
            if code in RETRIED_STATUSES:
                raise _PassingError(problem) from None
            raise HijackError(problem) from None
        except (httpx.TransportError, _CutOffError) as error:
            raise _PassingError(f"{error or type(error).__name__} ({MAX_TRIES} tries)") from None


def _resumed(url: str, part: Path, client: httpx.Client) -> Path:
    """Fetch the rest of `part`, or all of it if the file has changed since.

    Raises:
        _CutOffError: The transfer does not fit the stored part.
    """
    mark = part.with_suffix(".etag")
    have = part.stat().st_size if part.is_file() and mark.is_file() else 0
    # Sizes in the manifest are those of the file itself, not of a compressed transfer.
    headers = {"Accept-Encoding": "identity"}
    if have:
        headers["Range"] = f"bytes={have}-"
        headers["If-Range"] = mark.read_text(encoding="utf-8")
    with client.stream("GET", url, headers=headers) as answer:
        if answer.status_code == 416:  # the part is as long as the file, or longer
            if answer.headers.get("Content-Range", "") == f"bytes */{have}":
                return part
            part.unlink(missing_ok=True)
            mark.unlink(missing_ok=True)
            raise _CutOffError("the stored part no longer fits the file")
        answer.raise_for_status()
        resumes = answer.status_code == 206
        if resumes:
            _check_start(answer, have)
        _remember(mark, answer)
        with part.open("ab" if resumes else "wb") as stream:
            for block in answer.iter_bytes():
                stream.write(block)
            os.fsync(stream.fileno())
    return part


def _remember(mark: Path, answer: httpx.Response) -> None:
    """Store the validator of a file, which allows to resume it."""
    validator = answer.headers.get("ETag") or answer.headers.get("Last-Modified") or ""
    is_strong = bool(validator) and not validator.startswith("W/")
    if is_strong and "Content-Encoding" not in answer.headers:
        mark.write_text(validator, encoding="utf-8")
    else:
        # Nothing shows whether the rest still fits: start over next time.
        mark.unlink(missing_ok=True)


def _check_start(answer: httpx.Response, have: int) -> None:
    start = answer.headers.get("Content-Range", "").removeprefix("bytes ").partition("-")[0]
    if start != str(have):
        raise _CutOffError(f"the server sent from byte {start or '?'} where {have} was asked for")
