"""The output folder of a build: its lock, its state, and the shards that an earlier run finished.

While a build runs, `.build/` holds its parameters and one small file for each finished shard.
`manifest.json` is written last, so a folder without it is not a dataset, and a build that is killed
at any point can be resumed.
"""

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hijack_data.errors import StorageError
from hijack_data.file_io import is_full, unwritable, write_atomic
from hijack_data.locking import Lock, LockedError, lock

from ..dataset.manifest import FILES, MANIFEST, PARAMETERS, STATE, read_manifest
from ..dataset.shard import ShardRecord, file_sha256, record_from
from ..errors import OVERWRITE, RESUME, BuildError, DatasetError
from .planner_identity import check_comparable
from .shards import DATA, ShardTask, inputs_hash, picture_stamps
from .splits import NAMES


def parameters_in(path: Path) -> dict[str, Any]:
    """Return the parameters of the build in a folder, finished or not; empty if there is none."""
    try:
        if (path / MANIFEST).is_file():
            return read_manifest(path)["parameters"]
        parameters = json.loads((path / STATE / PARAMETERS).read_bytes())
    except (OSError, ValueError):  # `opened` will report what is wrong
        return {}
    return parameters if isinstance(parameters, dict) else {}


def lock_folder(path: Path) -> Lock:
    """Lock the folder of a dataset for one build; it is created if it is missing.

    Raises:
        BuildError: another build has locked it, or it cannot be made or opened.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        return lock(path.resolve())  # the folder may be reached through a symbolic link
    except LockedError:
        raise BuildError(f"{path}: another build is writing to this folder; wait for it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BuildError(f"{path}: cannot be made or opened as a folder ({reason})") from None


class OutFolder:
    """The folder to which a build writes. Use it inside `open`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.state = path / STATE
        self._records: dict[int, ShardRecord] = {}

    @contextmanager
    def open(self, parameters: Mapping[str, Any], resume: bool) -> Iterator[None]:
        """Lock the folder for one build.

        Args:
            parameters: those of the manifest, JSON data.
            resume: whether to continue the build in the folder.

        Raises:
            BuildError: the folder cannot be written to, is in use, contains other files, or
                contains a build although `resume` is false or the parameters differ.
            StorageError: the disk is full.
        """
        is_new = not self.path.exists()
        folder_lock = lock_folder(self.path)
        try:
            self._begin(json.loads(json.dumps(parameters)), resume)
            try:
                yield
            except BaseException:
                self._withdraw(is_new)
                raise
            finally:
                with suppress(OSError):
                    self._sweep()
        except StorageError:
            raise
        except OSError as error:
            if is_full(error):
                problem = unwritable(self.path, error)
                raise problem from None
            raise BuildError(
                f"{self.path}: cannot be written to ({error.strerror or error})"
            ) from None
        finally:
            folder_lock.release()

    def keep(self, task: ShardTask) -> ShardRecord | None:
        """Return the record of a shard that an earlier run finished, or `None`.

        It is kept if it has the same records and the same pictures, byte for byte, and its file is
        undamaged. Pictures whose files were not written to since they were read are not read again.
        """
        record = self._records.get(task.index)
        if record is None or record.file != task.file or record.records != task.records:
            return None
        file = self.path / task.file
        if not file.is_file() or file_sha256(file) != record.sha256:
            return None
        if record.stamps and record.stamps == picture_stamps(task):
            return record
        return record if inputs_hash(task) == record.inputs else None

    def save(self, record: ShardRecord) -> None:
        """Record that a shard is finished."""
        data = {**record.to_data(), "stamps": record.stamps}
        write_atomic(self.state / f"{record.index:05d}.json", json.dumps(data))

    def finish(self, shards: Iterable[ShardRecord]) -> None:
        """Remove the shards of other builds, and the state of this one."""
        names = {Path(shard.file).name for shard in shards}
        for split in NAMES:
            for file in (self.path / DATA).glob(f"{split}-*.parquet"):
                if file.name not in names:
                    file.unlink()
        shutil.rmtree(self.state)

    def _begin(self, parameters: dict[str, Any], resume: bool) -> None:
        if not resume and self._holds_nothing():
            self._clear()
        names = {entry.name for entry in self.path.iterdir()}
        if names and not resume:
            raise BuildError(f"{self.path}: {_occupied(names)}")
        if names and not {MANIFEST, STATE} & names:
            raise BuildError(
                f"{self.path}: holds neither a dataset nor an unfinished build of ours; choose"
                " another folder"
            )
        before = self._load()
        if before is not None:
            self._check_same(before, parameters)
        self._sweep()
        self.state.mkdir(exist_ok=True)
        (self.path / DATA).mkdir(exist_ok=True)
        write_atomic(self.state / PARAMETERS, json.dumps(parameters))
        for record in self._records.values():
            self.save(record)
        # without its manifest, the folder is an unfinished build again
        (self.path / MANIFEST).unlink(missing_ok=True)

    def _holds_nothing(self) -> bool:
        """Return whether the folder holds only the remains of a build that made no row."""
        if (self.path / MANIFEST).is_file():
            with suppress(DatasetError):
                return read_manifest(self.path).get("rows") == 0
            return False
        extra_names = {entry.name for entry in self.path.iterdir()} - {STATE, DATA}
        shards = any((self.path / DATA).glob("*.parquet"))
        return self.state.is_dir() and not extra_names and not shards

    def _clear(self) -> None:
        """Remove the files that `_holds_nothing` has checked."""
        for name in (MANIFEST, *FILES):
            (self.path / name).unlink(missing_ok=True)
        for folder in (self.path / DATA, self.state):
            shutil.rmtree(folder, ignore_errors=True)

    def _withdraw(self, is_new: bool) -> None:
        """Remove a build that failed before it had made a file."""
        with suppress(OSError):
            if any((self.path / DATA).glob("[!.]*.parquet")) or any(self.state.glob("[0-9]*.json")):
                return
            shutil.rmtree(self.state, ignore_errors=True)
            self._sweep()
            (self.path / DATA).rmdir()
            if is_new:
                self.path.rmdir()

    def _load(self) -> dict[str, Any] | None:
        # returns the parameters of an earlier run, and the records of its finished shards
        if (self.path / MANIFEST).is_file():
            manifest = read_manifest(self.path)
            self._records = {shard["index"]: record_from(shard) for shard in manifest["shards"]}
            return manifest["parameters"]
        try:
            for file in self.state.glob("[0-9]*.json"):
                record = record_from(json.loads(file.read_bytes()))
                self._records[record.index] = record
            return json.loads((self.state / PARAMETERS).read_bytes())
        except FileNotFoundError:
            return None
        except (ValueError, TypeError) as error:
            raise DatasetError(
                f"{self.state}: damaged ({error}); remove {self.path} and build again"
            ) from None

    def _check_same(self, before: dict[str, Any], current: dict[str, Any]) -> None:
        check_comparable(current, str(self.path))
        differing = [
            key for key in sorted({*before, *current}) if before.get(key) != current.get(key)
        ]
        if differing:
            differences = (
                f"{key} was {_short(before.get(key))}, is {_short(current.get(key))}"
                for key in differing
            )
            raise BuildError(
                f"{self.path}: was begun with other parameters: {'; '.join(differences)}; resume"
                " with the same, or choose another folder"
            )

    def _sweep(self) -> None:
        """Remove the temporary files of workers that were killed."""
        for folder in (self.path, self.path / DATA, self.state):
            for file in folder.glob(".*.tmp"):
                with suppress(FileNotFoundError):
                    file.unlink()


def _occupied(names: set[str]) -> str:
    """Return why a build cannot begin in a folder with these files, and the remedy."""
    if MANIFEST in names:
        state = "holds a dataset"
    elif STATE in names:
        state = "holds an unfinished build"
    else:
        return "is not empty; choose another folder"
    return f"{state}; choose another folder, or replace it: {OVERWRITE}; {RESUME} goes on with it"


def _short(value: object) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= 300 else f"{text[:297]}..."
