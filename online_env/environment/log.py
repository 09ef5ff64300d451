"""The log of one episode: `steps.jsonl` line by line, the frames as PNG, and finally the record.

RUNS/episodes/<slug>/
    episode.json            the record, written last and whole: without it the episode is not over
    steps.jsonl             line k: observation k, and the action that was taken on seeing it
    frames/0000.png         the clean screen of observation 0
    frames/0000.seen.png    what the agent saw, if that differs
"""

import json
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hijack_data.errors import ParameterError
from hijack_data.file_io import unwritable, write_atomic
from hijack_data.locking import Lock, LockedError, lock
from hijack_data.picture_io import pixel_sha256
from hijack_data.png import encode
from hijack_data.runs.run_log import EPISODE, EPISODES, FRAMES, STEPS, episode_slug, sha256_hex
from hijack_data.types import UInt8Array


def dump(data: object) -> bytes:
    """Return JSON in UTF-8; halves of surrogate pairs in agents' texts stay escaped."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False).encode("utf-8", "backslashreplace")


class EpisodeLog:
    """Writes one episode, and chains its lines (see `hijack_data.runs.run_log`).

    The remains of an interrupted episode with the same name are removed.

    Args:
        runs: The folder of the run, which is created if it is missing.
        slug: The name of the episode's folder, see `episode_slug`.

    Raises:
        ParameterError: A complete episode is there already, or another process is writing it.
        HijackError: The folder cannot be written.
    """

    def __init__(self, runs: Path, slug: str) -> None:
        self.folder = runs / EPISODES / slug
        try:
            # Readable by this user only: desktops see some folders of this machine, and names and
            # records reveal the corruption.
            (runs / EPISODES).mkdir(mode=0o700, parents=True, exist_ok=True)
            self.folder.mkdir(exist_ok=True)
            # If an episode is dropped without an end, the lock is released with this object.
            self._lock = _locked(self.folder / STEPS)
            self._clear()
            self._steps = (self.folder / STEPS).open("ab")
        except OSError as error:
            raise unwritable(self.folder, error) from None
        self._lines = 0
        self._last = sha256_hex(slug.encode())
        self._pool = ThreadPoolExecutor(2)

    def frames(self, step: int, clean: UInt8Array, corrupted: UInt8Array) -> dict[str, Any]:
        """Store the screen and the agent's picture.

        Args:
            step: The number of the observation.
            clean: The screen, uint8 RGB `[H, W, 3]`.
            corrupted: What the agent saw; the same object if nothing was drawn.

        Returns:
            The fields for the line of the log, which name the files.
        """
        pictures = {f"{FRAMES}/{step:04d}.png": clean}
        if corrupted is not clean:
            pictures[f"{FRAMES}/{step:04d}.seen.png"] = corrupted
        jobs = [self._pool.submit(self._write, name, picture) for name, picture in pictures.items()]
        digests = [pixel_sha256(picture) for picture in pictures.values()]
        for job in jobs:
            job.result()
        names = list(pictures)
        return {
            "image": names[0],
            "image_sha256": digests[0],
            "seen": names[1] if len(names) > 1 else None,
            "seen_sha256": digests[-1],
        }

    def line(self, data: Mapping[str, Any]) -> None:
        """Append a step.

        Raises:
            unwritable: The file cannot be written.
        """
        line = dump({"said": None, **data, "previous": self._last})
        try:
            self._steps.write(line + b"\n")
            self._steps.flush()
        except OSError as error:
            raise unwritable(self.folder / STEPS, error) from None
        self._lines += 1
        self._last = sha256_hex(line)

    def finish(self, record: Mapping[str, Any]) -> dict[str, Any]:
        """Write the record, which ends the episode, and return it as written."""
        self._pool.shutdown()
        signed = {**record, "lines": self._lines, "chain": self._last}
        try:
            write_atomic(self.folder / EPISODE, dump(signed) + b"\n")
        finally:
            self._steps.close()
            self._lock.release()
        return signed

    def __del__(self) -> None:
        steps = getattr(self, "_steps", None)
        if steps is not None:
            steps.close()

    def _clear(self) -> None:
        """Remove the remains of an interrupted episode.

        Raises:
            ParameterError: A complete episode is there.
        """
        if (self.folder / EPISODE).exists():
            advice = "give another attempt, or another log"
            raise ParameterError(f"{self.folder}: holds an episode already; {advice}")
        shutil.rmtree(self.folder / FRAMES, ignore_errors=True)
        (self.folder / FRAMES).mkdir()
        (self.folder / STEPS).write_bytes(b"")

    def _write(self, name: str, picture: UInt8Array) -> None:
        try:
            (self.folder / name).write_bytes(encode(picture))
        except OSError as error:
            raise unwritable(self.folder / name, error) from None


def free_attempt(runs: Path, task: str, label: str, seed: int, agent: str) -> int:
    """Return the number of the first attempt at an episode that has no folder yet."""
    attempt = 0
    while (runs / EPISODES / episode_slug(task, label, seed, agent, attempt)).exists():
        attempt += 1
    return attempt


def _locked(path: Path) -> Lock:
    """Lock the file of an episode's lines against other environments.

    Raises:
        ParameterError: Another environment writes it.
    """
    try:
        return lock(path)
    except LockedError:
        message = f"{path.parent}: is being written by another environment; give another attempt"
        raise ParameterError(message) from None
