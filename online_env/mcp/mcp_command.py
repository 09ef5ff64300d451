"""`hijack mcp`.

Exit codes: 0 the client has left, or SIGTERM or Ctrl-C ended it; 2 bad usage or configuration, or a
desktop that does not start; 3 the disk is full or fails.
"""

import os
import time
from pathlib import Path

import click
from click.core import ParameterSource

from hijack_data import extras
from hijack_data.cli.completion import complete
from hijack_data.cli.options import BriefCommand, seed_option
from hijack_data.cli.terminal import echo
from hijack_data.errors import UnknownNameError

from ..agents.options import guard_option
from ..choices import LAYERS, DrawingLayer
from ..serving.client_options import client_options

# Before version 2, the SDK has no mcp_types.
MODULES = ("mcp", "mcp_types", "starlette", "uvicorn", "gymnasium")
DEFAULT_TASKS = {"embedded": "write_note", "browser": "miniwob/click-test-2.html"}
DEFAULT_SIZES = {"embedded": "1280x720", "browser": "960x720"}


@click.command(
    cls=BriefCommand,
    more=("guard", "host", "layer", "lease", "max_steps", "name", "size", "token_file"),
)
@click.option(
    "--desktop/--browser",
    "is_desktop",
    default=None,
    help="An embedded Linux desktop, or a Chromium with tasks of MiniWoB++.",
)
@click.option(
    "--task",
    metavar="T",
    shell_complete=complete("online_env.tasks:names"),
    help="A task, such as write_note or miniwob/enter-text.html.",
)
@click.option(
    "--corruption",
    default="clean",
    show_default=True,
    metavar="C",
    shell_complete=complete("hijack_data.corruption:corruption_names", "clean"),
    help="What the client's computer does to it; the client is not told.",
)
@seed_option("Variant of the task, and all draws of the corruption.")
@click.option(
    "-o",
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="RUNS",
    help="Folder of the run: new.  [default: a folder in runs/]",
)
@click.option("--no-tree", is_flag=True, help="Offer pictures only, without the tool `tree`.")
@click.option("--tell-score", is_flag=True, help="Tell the client its score at the end.")
@client_options(
    port=None,
    port_help="Serve over HTTP, not over standard input and output; 0 takes a free port.",
    token="AGENTHIJACK_MCP_TOKEN",
    lease_help="A client that is silent for so long has left.",
    only=", with --port",
)
@click.option(
    "--name", default="mcp", show_default=True, metavar="NAME", help="The agent's name in the run."
)
@click.option(
    "--max-steps",
    type=click.IntRange(1, 1000),
    default=15,
    show_default=True,
    metavar="N",
    help="Actions until the episode is cut off.",
)
@click.option("--size", metavar="WIDTHxHEIGHT", help="Of the screen.")
@click.option(
    "--layer",
    type=click.Choice(LAYERS),
    default="picture",
    show_default=True,
    help="Who draws pop-ups, marks and subtitles: we on the picture, or a browser in its page.",
)
@guard_option
def mcp(
    is_desktop: bool | None,
    task: str | None,
    corruption: str,
    seed: int,
    out: Path | None,
    no_tree: bool,
    tell_score: bool,
    port: int | None,
    host: str,
    token_file: Path | None,
    name: str,
    max_steps: int,
    size: str | None,
    layer: DrawingLayer,
    lease: float,
    guard: str | None,
) -> None:
    """Let any MCP client play one corrupted, scored episode.

    Such as: hijack mcp --browser --corruption pop_ups
    """
    extras.require("hijack mcp", "mcp", MODULES)
    if is_desktop is None:
        raise click.UsageError("give --desktop or --browser")
    context = click.get_current_context()
    for option in ("token_file", "host"):
        is_set = context.get_parameter_source(option) is not ParameterSource.DEFAULT
        if port is None and is_set:
            flag = f"--{option.replace('_', '-')}"
            raise click.UsageError(f"{flag} is for HTTP: give --port, too")
    from ..agents.guards import MODEL, check_guard, find_guard
    from ..bench.config import Bench, override
    from ..record_command import parse_size
    from ..serving.access import read_token
    from . import server
    from .episode import McpOptions

    token = read_token(token_file, server.TOKEN)
    provider = "embedded" if is_desktop else "browser"
    bench = Bench(
        source="hijack mcp",
        provider=provider,
        size=parse_size(size or DEFAULT_SIZES[provider]),
        agents=(name,),
        seeds=(seed,),
        max_steps=max_steps,
        layer=layer,
        guard=find_guard(guard) if guard else "",
    )
    if guard == MODEL:
        raise click.UsageError(
            f"--guard {MODEL}: a client is no agent file; name rules, or the agent file of the"
            " model that is to look on"
        )
    check_guard(bench.guard, ())
    try:
        bench = override(bench, task=task or DEFAULT_TASKS[provider], corruption=corruption)
    except UnknownNameError as error:  # it names the options of `hijack bench`
        message = str(error).replace("--tasks", "--task").replace("--corruptions", "--corruption")
        raise UnknownNameError(message) from None
    options = McpOptions(
        bench=bench,
        folder=out or Path("runs") / f"mcp-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}",
        with_tree=not no_tree,
        tell_score=tell_score,
        lease=lease,
    )
    if port is None:
        server.serve_stdio(options)
    else:
        server.serve_http(options, host, port, token, echo)
        echo(f"the episode is in {options.folder}")
