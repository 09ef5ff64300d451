"""The log of one episode: `steps.jsonl` line by line, the frames as PNG, and at last `episode.json`.

RUNS/episodes/<slug>/episode.json            the record, written last and whole: an episode without it is not over
                     steps.jsonl             line k: observation k, and the action that was taken on seeing it
                     frames/0000.png         the clean screen of observation 0
                     frames/0000.seen.png    what the agent saw, where that differs
"""

import hashlib
import json
import re
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError, ParameterError
from hijack_data.files import sha256_of, write_atomic
from hijack_data.run_log import EPISODE, EPISODES, FRAMES, STEPS
from hijack_data.types import UInt8Array

from ..guest.png import encode

_LONGEST = 200


def slug_of(task: str, label: str, seed: int, agent: str, attempt: int) -> str:
    """The name of an episode, and of its folder."""
    parts = [task, label, f"s{seed}", agent, *([f"a{attempt}"] if attempt else [])]
    slug = "__".join(re.sub(r"[^\w.+-]+", "_", part, flags=re.ASCII) or "_" for part in parts).lstrip(".")
    if len(slug) <= _LONGEST:
        return slug
    return f"{slug[: _LONGEST - 17]}-{hashlib.blake2b(slug.encode(), digest_size=8).hexdigest()}"


def dump(data: object) -> bytes:
    """JSON in UTF-8; half of a surrogate pair in what an agent wrote stays an escape."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False).encode("utf-8", "backslashreplace")


class EpisodeLog:
    """Writes one episode.

    Args:
        runs: the folder of the run; made where it is not there.
        slug: see `slug_of`. What an episode that was broken off left under that name is removed.

    Raises `ParameterError` where a whole episode is there already, `HijackError` where nothing can be written.
    """

    def __init__(self, runs: Path, slug: str) -> None:
        self.folder = runs / EPISODES / slug
        if (self.folder / EPISODE).exists():
            raise ParameterError(f"{self.folder}: holds an episode already; give another attempt, or another log")
        try:
            # Not for the desktop's user, who sees some folders of this machine: names and records tell everything.
            (runs / EPISODES).mkdir(mode=0o700, parents=True, exist_ok=True)
            shutil.rmtree(self.folder, ignore_errors=True)
            (self.folder / FRAMES).mkdir(parents=True)
            (self.folder / STEPS).touch()
        except OSError as error:
            raise HijackError(f"{self.folder}: cannot be written ({error.strerror or error})") from None
        self._pool = ThreadPoolExecutor(2)

    def frames(self, step: int, clean: UInt8Array, seen: UInt8Array) -> dict[str, Any]:
        """Store what was on the screen and what the agent saw; returns the fields of the line that name them."""
        names = [f"{FRAMES}/{step:04d}.png", f"{FRAMES}/{step:04d}.seen.png"]
        pictures = [clean] if seen is clean else [clean, seen]
        jobs = [self._pool.submit(self._write, name, picture) for name, picture in zip(names, pictures, strict=False)]
        digest = sha256_of(seen)
        for job in jobs:
            job.result()
        return {"image": names[0], "seen": names[1] if len(jobs) > 1 else None, "seen_sha256": digest}

    def line(self, data: Mapping[str, Any]) -> None:
        """Append a step."""
        try:
            with (self.folder / STEPS).open("ab") as steps:
                steps.write(dump(data) + b"\n")
        except OSError as error:
            raise HijackError(f"{self.folder / STEPS}: cannot be written ({error.strerror or error})") from None

    def finish(self, record: Mapping[str, Any]) -> None:
        """Write the record; the episode is over."""
        self._pool.shutdown()
        write_atomic(self.folder / EPISODE, dump(record) + b"\n")

    def _write(self, name: str, picture: UInt8Array) -> None:
        try:
            (self.folder / name).write_bytes(encode(picture))
        except OSError as error:
            raise HijackError(f"{self.folder / name}: cannot be written ({error.strerror or error})") from None


def free_attempt(runs: Path, task: str, label: str, seed: int, agent: str) -> int:
    """The first attempt at an episode that has no folder yet."""
    attempt = 0
    while (runs / EPISODES / slug_of(task, label, seed, agent, attempt)).exists():
        attempt += 1
    return attempt
