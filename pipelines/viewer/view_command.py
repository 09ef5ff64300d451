"""`hijack view`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hijack_data.cli.terminal import echo
from hijack_data.errors import counted

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
    help="Which episodes --export writes, such as '*__pop_ups__*'; repeatable.  [default: all]",
)
@click.option(
    "--small",
    is_flag=True,
    help="Pictures of --export at most 960 pixels wide and lossy: a fifth of the size.",
)
def view(folder: str, port: int, file: Path | None, patterns: tuple[str, ...], small: bool) -> None:
    """Look through a dataset, or the episodes of a run, in a browser."""
    from .opening import open_source
    from .server import serve

    _check_options(file, patterns, small)
    source = open_source(folder)
    for problem in source.problems:
        echo(f"  problem: {problem}", err=True)
    if file is None:
        serve(source, port, echo)
    else:
        _export(source, folder, patterns, file, small)
    sys.exit(1 if source.problems else 0)


def _check_options(file: Path | None, patterns: tuple[str, ...], small: bool) -> None:
    if patterns and file is None:
        raise click.UsageError("--episode chooses what --export FILE writes; give that, too")
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
    echo(f"{file}: {counted(count, 'episode')}, {size:.1f} MB")
