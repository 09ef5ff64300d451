"""`hijack view`."""

from pathlib import Path

import click

from hijack_data.errors import counted

from .opening import open_source
from .server import serve


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
def view(folder: str, port: int, file: Path | None, patterns: tuple[str, ...]) -> None:
    """Look through a dataset, or the episodes of a run, in a browser."""
    from .runs import RunSource
    from .runs.export import export_file

    if patterns and file is None:
        raise click.UsageError("--episode chooses what --export FILE writes; give that, too")
    source = open_source(folder)
    for problem in source.problems:
        click.echo(f"  problem: {problem}", err=True)
    if file is None:
        serve(source, port, click.echo)
    elif isinstance(source, RunSource):
        count = export_file(source, patterns, file)
        size = file.stat().st_size / 2**20
        click.echo(f"{file}: {counted(count, 'episode')}, {size:.1f} MB")
    else:
        raise click.UsageError(f"{folder}: --export is for runs; hijack gallery makes such pages")
    raise SystemExit(1 if source.problems else 0)
