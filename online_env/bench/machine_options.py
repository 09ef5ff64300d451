"""The options of commands that play OSWorld's tasks on machines of the user."""

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
)


def machine_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: add the options."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
