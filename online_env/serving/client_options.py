"""The options of commands that serve one client after the other: address, token, lease."""

from collections.abc import Callable
from pathlib import Path

import click

from hijack_data.cli.options import Command, FiniteRange


def client_options(
    *, port: int | None, port_help: str, token: str, lease_help: str, only: str = ""
) -> Callable[[Command], Command]:
    """Return a decorator that adds `--host`, `--port`, `--token-file` and `--lease`.

    Args:
        port: The default; `None` for a command that serves over HTTP only with `--port`.
        port_help: What a port is for.
        token: Environment variable that may hold the token.
        lease_help: What happens to a client that is silent for that long.
        only: When address and token matter, if not always, such as ", with --port".
    """
    options = (
        click.option(
            "--host",
            default="127.0.0.1",
            show_default=True,
            metavar="ADDRESS",
            help=f"The address to listen at{only}.",
        ),
        click.option(
            "--port",
            type=click.IntRange(0, 65535),
            default=port,
            show_default=port is not None,
            metavar="PORT",
            help=port_help,
        ),
        click.option(
            "--token-file",
            type=click.Path(dir_okay=False, path_type=Path),
            metavar="FILE",
            help=f"What clients have to send{only}.  [also: {token}]",
        ),
        click.option(
            "--lease",
            type=FiniteRange(1, 86_400),
            default=600,
            show_default=True,
            metavar="SECONDS",
            help=lease_help,
        ),
    )

    def add(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return add
