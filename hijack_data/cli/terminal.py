"""What commands print: texts of agents, models and recordings must not control the terminal."""

import sys
from typing import Any

import click

from ..printable import printable


def echo(message: object = "", *, err: bool = False, nl: bool = True) -> None:
    """Print a text, with its control characters as escapes.

    Args:
        message: the text, or what `str` makes one of.
        err: print to the standard error.
        nl: end the line.
    """
    click.echo(printable(str(message)), err=err, nl=nl)


def console(*, stderr: bool = False) -> Any:
    """Return a rich console; lines are 120 wide unless a terminal has another width.

    Control characters in what it prints are escaped.

    Args:
        stderr: print to the standard error.
    """
    from .printable_console import PrintableConsole

    stream = sys.stderr if stderr else sys.stdout
    return PrintableConsole(highlight=False, width=None if stream.isatty() else 120, stderr=stderr)
