"""The options of commands that play OSWorld's tasks, on machines of the user or on desktops."""

from collections.abc import Callable
from typing import Any

import click

_OPTIONS = (
    click.option(
        "--vm",
        multiple=True,
        metavar="http://HOST:PORT|PROVIDER",
        help="Play OSWorld's tasks on this machine, or on those that docker, vmware, virtualbox,"
        " aws, azure or daytona starts; may be repeated.",
    ),
    click.option(
        "--machines",
        type=click.IntRange(1, 256),
        default=1,
        show_default=True,
        metavar="N",
        help="How many machines each provider of --vm starts.",
    ),
    click.option(
        "--vm-option",
        "vm_options",
        multiple=True,
        metavar="KEY=VALUE",
        help="An argument of OSWorld's DesktopEnv, such as region=us-east-1; may be repeated.",
    ),
    click.option(
        "--reset-command",
        default="",
        metavar="COMMAND",
        help="Makes a machine at an address pristine; it gets the address as AGENTHIJACK_VM.",
    ),
    click.option(
        "--osworld-files",
        type=click.Path(exists=True, file_okay=False),
        metavar="CACHE",
        help="Files of OSWorld's tasks, as hijack osworld prefetch fetches them.",
    ),
    click.option(
        "--unplayable",
        type=click.Choice(("refuse", "skip", "zero")),
        default="refuse",
        show_default=True,
        help="Tasks of OSWorld that can't be played: refuse to run, leave them out, or count 0.",
    ),
)
MORE = (
    "machines",
    "osworld_files",
    "reset_command",
    "unplayable",
    "vm",
    "vm_options",
)  # their names, for the second part of a command's help


def machine_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: add the options."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
