"""`hijack view`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hijack_data.cli.terminal import echo
from hijack_data.errors import quantity

if TYPE_CHECKING:
    from .dataset_source import DatasetSource
    from .runs import RunSource


@click.command()
@click.argument("folder", metavar="DIR|RUNS")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    metavar="N",
    help="Where to listen.  [default: a free port]",
)
@click.option(
    "--export",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the episodes of a run to one HTML file instead; it opens without a server.",
)
@click.option(
    "--episode",
    "patterns",
    multiple=True,
    metavar="PATTERN",
    help="Which episodes --export and --video write, such as '*__pop_ups__*'; repeatable."
    "  [default: all]",
)
@click.option(
    "--small",
    is_flag=True,
    help="Pictures of --export at most 960 pixels wide and lossy: a fifth of the size.",
)
@click.option(
    "--video",
    type=click.Path(path_type=Path),
    metavar="DIR|FILE.mp4",
    help="Write the episodes of a run as MP4 files instead: what the agent saw.",
)
def view(
    folder: str,
    port: int,
    file: Path | None,
    patterns: tuple[str, ...],
    small: bool,
    video: Path | None,
) -> None:
    """Look through a dataset, or the episodes of a run, in a browser."""
    from .opening import open_source
    from .server import serve

    _check_options(file, video, patterns, small)
    source = open_source(folder)
    for problem in source.problems:
        echo(f"  problem: {problem}", err=True)
    complete = True
    if file is not None:
        _export(source, folder, patterns, file, small)
    elif video is not None:
        complete = _write_videos(source, folder, patterns, video)
    else:
        serve(source, port, echo)
    sys.exit(0 if complete and not source.problems else 1)


def _check_options(
    file: Path | None, video: Path | None, patterns: tuple[str, ...], small: bool
) -> None:
    if file is not None and video is not None:
        raise click.UsageError("--export and --video write different files; give one of them")
    if patterns and file is None and video is None:
        raise click.UsageError(
            "--episode chooses what --export FILE and --video DIR write; give one, too"
        )
    if small and file is None:
        raise click.UsageError("--small is about what --export FILE writes; give that, too")


def _export(
    source: "DatasetSource | RunSource",
    folder: str,
    patterns: tuple[str, ...],
    file: Path,
    small: bool,
) -> None:
    """Write the episodes of a run to one file.

    Raises:
        UsageError: the source is a dataset.
    """
    from .runs import RunSource
    from .runs.export import export_file

    if not isinstance(source, RunSource):
        raise click.UsageError(f"{folder}: --export is for runs; hijack gallery makes such pages")
    count = export_file(source, patterns, file, small=small)
    size = file.stat().st_size / 2**20
    echo(f"{file}: {quantity(count, 'episode')}, {size:.1f} MB")


def _write_videos(
    source: "DatasetSource | RunSource", folder: str, patterns: tuple[str, ...], path: Path
) -> bool:
    """Write episodes of a run as videos; return whether each of them has one.

    Raises:
        UsageError: the source is a dataset.
    """
    from .runs import RunSource
    from .runs.video import write_videos

    if not isinstance(source, RunSource):
        raise click.UsageError(f"{folder}: --video is for runs; a dataset has no episodes")
    videos = write_videos(source, patterns, path)
    for problem in videos.problems:
        echo(f"  problem: {problem}", err=True)
    size = sum(file.stat().st_size for file in videos.files) / 2**20
    echo(f"{path}: {quantity(len(videos.files), 'episode')}, {size:.1f} MB")
    return not videos.problems
