"""`hijack view`."""

import click

from .opening import open_source
from .server import serve


@click.command()
@click.argument("folder", metavar="DIR|RUNS")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Where to listen.  [default: a free port]",
)
def view(folder: str, port: int) -> None:
    """Look through a dataset, or the episodes of a run, in a browser."""
    source = open_source(folder)
    for problem in source.problems:
        click.echo(f"  problem: {problem}", err=True)
    serve(source, port, click.echo)
    raise SystemExit(1 if source.problems else 0)
