"""`hijack browser up`."""

import contextlib

import click

from hijack_data.cli.options import WholeSummaries, seed_option
from hijack_data.cli.terminal import echo


@click.group(cls=WholeSummaries)
def browser() -> None:
    """A corrupted Chromium for Playwright, browser-use and other DevTools clients."""


@browser.command()
@click.option("--headed", is_flag=True, help="Show its windows on this machine's display.")
@click.option(
    "--size", default="1280x720", show_default=True, metavar="WxH", help="WIDTHxHEIGHT in pixels."
)
@click.option(
    "--corruption", metavar="NAME", help="One of hijack list, but not resolution and network_error."
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a parameter of it; may be repeated.",
)
@seed_option()
@click.option(
    "--port",
    type=click.IntRange(0, 65_535),
    default=0,
    metavar="N",
    help="Port of 127.0.0.1, on which any user of this machine may connect.  [default: a free one]",
)
def up(
    headed: bool, size: str, corruption: str | None, settings: tuple[str, ...], seed: int, port: int
) -> None:
    """Start a Chromium, print its DevTools address, and corrupt what clients open until Ctrl-C.

    Pop-ups, marks and subtitles are nodes of each page; the other corruptions come once the first
    page of a site has loaded. Each client begins with a fresh profile.
    """
    from hijack_data.cli.picture_plans import parse_settings
    from hijack_data.corruption import find_corruption

    from ..record_command import parse_size
    from .shared_browser import SharedBrowser

    planner = None
    if corruption is not None:
        cls = find_corruption(corruption)
        planner = cls(**parse_settings(cls, settings))
    elif settings:
        raise click.UsageError("--set is for a corruption: give --corruption NAME")
    shared = SharedBrowser(parse_size(size), planner, seed, headed=headed, port=port)
    with shared, contextlib.suppress(KeyboardInterrupt):
        echo(shared.address)
        for words in shared.follow():
            echo(words, err=True)
