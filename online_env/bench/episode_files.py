"""Send the files of an episode from the machine that played it, and store them here.

An episode is complete if it has its `episode.json` (see `hijack_data.runs.run_log`), so that file
is sent last and written by rename. If the machine dies, the files that have arrived are removed.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from hijack_data.file_io import unwritable, write_atomic
from hijack_data.runs.run_log import EPISODE, EPISODES

from ..agents.chat.request_log import FOLDER as REQUESTS
from ..errors import ClusterError

_SENT_FOLDERS = (EPISODES, REQUESTS)


def take_files(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the files of an episode with their names relative to the folder of the run.

    Args:
        folder: A folder with only this episode; it is empty afterwards.
    """
    paths = [
        path for name in _SENT_FOLDERS for path in (folder / name).rglob("*") if path.is_file()
    ]
    for path in sorted(paths, key=_rank):
        yield path.relative_to(folder).as_posix(), path.read_bytes()
    for name in _SENT_FOLDERS:
        shutil.rmtree(folder / name, ignore_errors=True)


def _rank(path: Path) -> tuple[bool, Path]:
    return path.name == EPISODE, path


class ReceivedEpisode:
    """Stores the files of one episode in the folder of its run.

    Args:
        run: The folder of the run.
    """

    def __init__(self, run: Path) -> None:
        self._run = run
        self._written_paths: list[Path] = []  # files and folders written for this episode

    def put(self, name: str, content: bytes) -> None:
        """Write a file; the folder of the episode is emptied before its first one.

        Args:
            name: The name yielded by `take_files`.
            content: Its bytes.

        Raises:
            ClusterError: The name is not that of an episode's file, or the episode is complete
                already.
            unwritable: The file cannot be written.
        """
        relative_path = PurePosixPath(name)
        is_inside = len(relative_path.parts) > 1 and relative_path.parts[0] in _SENT_FOLDERS
        if not is_inside or ".." in relative_path.parts:
            raise ClusterError(f"a node sent the file {name!r}, which is none of an episode")
        path = self._run / relative_path
        try:
            self._make_room(path, relative_path)
            if path.name != EPISODE:
                path.write_bytes(content)
                return
        except OSError as error:
            raise unwritable(path, error) from None
        write_atomic(path, content)

    def undo(self) -> None:
        """Remove the files that have arrived."""
        for path in self._written_paths:
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)

    def _make_room(self, path: Path, relative_path: PurePosixPath) -> None:
        folder = self._run / PurePosixPath(*relative_path.parts[:2])
        if folder not in self._written_paths:
            if (folder / EPISODE).exists():
                raise ClusterError(f"{folder}: holds an episode already; go on with --resume")
            shutil.rmtree(folder, ignore_errors=True)  # remains of an interrupted episode
            self._written_paths.append(folder)
        # Private, as `EpisodeLog` makes it.
        (self._run / EPISODES).mkdir(mode=0o700, exist_ok=True)
        path.parent.mkdir(parents=True, exist_ok=True)
