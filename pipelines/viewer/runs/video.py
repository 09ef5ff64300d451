"""Episodes as MP4 files: what the agent saw, each observation for one second."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hijack_data import extras
from hijack_data.errors import HijackError, ParameterError
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.runs.own_files import refuse_own_file
from hijack_data.types import UInt8Array

from .export import matching_episodes
from .run_source import RunSource

SUFFIX = ".mp4"
FRAMES_PER_SECOND = 2  # players stumble over one frame a second
CRF = "23"  # x264's constant rate factor: its default


@dataclass(frozen=True)
class Videos:
    """What was written.

    Attributes:
        files: the videos.
        problems: why an episode has none, one line each.
    """

    files: tuple[Path, ...]
    problems: tuple[str, ...]


def write_videos(source: RunSource, patterns: Sequence[str], path: Path) -> Videos:
    """Write a video of each episode whose id matches any pattern; of all without patterns.

    Args:
        source: the run.
        patterns: as in a shell.
        path: the file of the one episode that matches, if it ends in .mp4; else a folder, in which
            each file has the id of its episode as its name.

    Raises:
        MissingDependencyError: PyAV is not installed.
        ParameterError: no episode matches, several match for one file, or the run is one of
            answers to rows, which has no episodes.
        HijackError: the path is that of a file of the run, or cannot be written.
        StorageError: the disk is full or fails.
    """
    av = extras.load("av", "hijack view --video", "video")
    refuse_own_file(path, "--video")
    if source.is_scored:
        raise ParameterError("--video: hijack score asks about single pictures; it has no episodes")
    numbers = list(matching_episodes(source, patterns))
    if not numbers:
        hint = f"; ids look like {source.entries[0].id}" if source.entries else ""
        raise ParameterError(f"--video: no episode matches --episode {', '.join(patterns)}{hint}")
    is_file = path.suffix == SUFFIX
    if is_file and len(numbers) > 1:
        raise ParameterError(
            f"--video {path}: {len(numbers)} episodes match, the first"
            f" {source.entries[numbers[0]].id}; choose one with --episode ID, or give a folder"
        )
    if not is_file:
        make_folder(path)
    files: list[Path] = []
    problems: list[str] = []
    for number in numbers:
        try:
            pictures = _observations(source, number)
            file = path if is_file else path / f"{source.entries[number].id}{SUFFIX}"
        except HijackError as error:
            problems.append(str(error))
            continue
        write_atomic(file, _encode(av, pictures))
        files.append(file)
    return Videos(tuple(files), tuple(problems))


def _observations(source: RunSource, number: int) -> list[UInt8Array]:
    """Return what the agent saw, uint8 RGB `[H, W, 3]` each.

    Raises:
        HijackError: the episode has none, or one is lost; or its id is not the name of a file.
    """
    entry = source.entries[number]
    if not entry.id or Path(entry.id).name != entry.id:
        raise HijackError(f"an episode is called {entry.id!r}, which cannot be the name of a file")
    steps = source.episode(number)["steps"]
    if not steps:
        raise HijackError(f"{entry.id}: has no observations; it was not played, or is damaged")
    return [source.pixels(number, step["step"], before=False) for step in steps]


def _encode(av: Any, pictures: Sequence[UInt8Array]) -> bytes:
    """Return pictures of one size as an MP4 file with H.264."""
    height, width = pictures[0].shape[:2]
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=FRAMES_PER_SECOND)
        stream.options = {"crf": CRF}
        # 4:2:0 wants even sides: an odd one gets its last row or column twice.
        stream.width, stream.height = width + width % 2, height + height % 2
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            even = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            for _ in range(FRAMES_PER_SECOND):
                frame = av.VideoFrame.from_ndarray(even, format="rgb24")
                container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return file.getvalue()
