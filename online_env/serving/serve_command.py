"""`hijack serve`.

Exit codes: 0 ended by SIGTERM or Ctrl-C, 2 bad usage or configuration, or a desktop that does not
start, 3 the disk is full or fails.
"""

from importlib import metadata
from pathlib import Path

import click

from hijack_data import extras
from hijack_data.cli.completion import complete, complete_configuration
from hijack_data.cli.options import (
    BriefCommand,
    FiniteRange,
    conditions_option,
    desktops_option,
    seed_option,
)
from hijack_data.cli.terminal import echo

from ..bench.machine_options import MORE, machine_options
from .client_options import client_options

MODULES = ("openenv", "prometheus_client", "uvicorn", "gymnasium")
OPENENV = "0.10"


@click.command(
    cls=BriefCommand,
    more=(
        *MORE,
        "clean",
        "evaluation",
        "lease",
        "line",
        "max_steps",
        "osworld_split",
        "per",
        "sessions",
        "size",
        "token_file",
        "wait",
    ),
)
@click.argument("config", shell_complete=complete_configuration("benchmark"))
@desktops_option
@click.option(
    "--tasks",
    metavar="A,B",
    shell_complete=complete("online_env.tasks:names"),
    help="Tasks or a set, instead of those of CONFIG: suite, core, write_note, my_task.py:MyTask.",
)
@conditions_option
@machine_options
@click.option(
    "--evaluation",
    is_flag=True,
    help="Serve held-out tasks as well: for scoring, never for training.",
)
@click.option(
    "--osworld-split",
    type=click.Choice(("osworld", "agenthijack")),
    default="osworld",
    show_default=True,
    help="Whose tasks of OSWorld are held out: ours, or all but the 128 of the paper's authors.",
)
@click.option(
    "--per",
    type=click.Choice(("rollout", "group", "worker")),
    default="rollout",
    show_default=True,
    help="What gets a corruption of its own: each reset, each task and seed, or each session.",
)
@click.option(
    "--clean",
    type=FiniteRange(0, 1),
    metavar="P",
    help="Share of clean episodes.  [default: as likely as each of the others]",
)
@seed_option("Seed of all draws.")
@click.option(
    "--max-steps",
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Actions until an episode is cut off, instead of CONFIG's.",
)
@click.option("--size", metavar="WIDTHxHEIGHT", help="Of the screens, instead of CONFIG's.")
@client_options(
    port=8000,
    port_help="Where to listen; 0 takes a free one.",
    token="AGENTHIJACK_SERVE_TOKEN",
    lease_help="A client that is silent for so long in mid-episode loses its desktop.",
)
@click.option(
    "--sessions",
    type=click.IntRange(1, 4096),
    metavar="N",
    help="Clients that may be connected.  [default: 4 a desktop]",
)
@click.option(
    "--line",
    type=click.IntRange(0, 4096),
    metavar="N",
    help="Clients that may wait for a desktop; others have to come back.  [default: 2 a desktop]",
)
@click.option(
    "--wait",
    type=FiniteRange(0, 3600),
    default=45,
    show_default=True,
    metavar="SECONDS",
    help="How long they wait at most; below the time-out of the clients.",
)
@click.option(
    "-o",
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="RUNS",
    help="Log every episode there, for hijack view and verify.  [default: none is logged]",
)
@click.option("--dry-run", is_flag=True, help="Check everything and list the tasks; start nothing.")
def serve(
    config: str,
    desktops: int | None,
    tasks: str | None,
    corruptions: str | None,
    vm: tuple[str, ...],
    machines: int,
    vm_options: tuple[str, ...],
    reset_command: str,
    osworld_files: str | None,
    unplayable: str,
    evaluation: bool,
    osworld_split: str,
    per: str,
    clean: float | None,
    seed: int,
    max_steps: int | None,
    size: str | None,
    host: str,
    port: int,
    token_file: Path | None,
    sessions: int | None,
    line: int | None,
    wait: float,
    lease: float,
    out: Path | None,
    dry_run: bool,
) -> None:
    """Serve desktops with the tasks of a benchmark to trainers, as an OpenEnv environment.

    Such as: hijack serve embedded --desktops 4
    """
    if unplayable == "zero":
        raise click.UsageError(
            "--unplayable zero: a server plays what its clients ask for, and counts nothing; leave"
            " these tasks out with --unplayable skip"
        )
    extras.require("hijack serve", "serve", MODULES)
    _check_openenv()
    from ..bench.config import load_bench, on_machines, override
    from ..bench.playable import check_machines, only_playable
    from ..bench.workers import default_desktops
    from . import server
    from .access import read_token

    token = read_token(token_file, server.TOKEN)
    bench = override(
        load_bench(config),
        task=tasks,
        corruption=corruptions,
        osworld_files=osworld_files,
        max_steps=max_steps,
    )
    bench = on_machines(bench, vm, machines, vm_options, reset_command)
    bench = only_playable(bench, unplayable, lambda text: echo(text, err=True))
    own_machines = 0 if bench.machines is None else len(bench.machines.single_machines())
    options = server.ServeOptions(
        bench=server.override_size(bench, size),
        desktops=desktops or own_machines or default_desktops(),
        host=host,
        port=port,
        token=token,
        is_evaluation=evaluation,
        osworld_split=osworld_split,
        per=per,
        clean=clean,
        seed=seed,
        sessions=sessions,
        line=line,
        wait_timeout=wait,
        lease=lease,
        log=out,
    )
    if dry_run:
        check_machines(bench, server.ENDLESS)
        for name in options.draws().tasks:
            echo(name)
        return
    server.serve(options, echo)


def _check_openenv() -> None:
    """Check the version of OpenEnv; its interface changes with each 0.x.

    Raises:
        MissingDependencyError: Another version is installed, or an older package of that name.
    """
    try:
        version = metadata.version("openenv")
    except metadata.PackageNotFoundError:  # openenv-core has the same modules
        version = "another package that has its modules"
    if version.split(".")[:2] != OPENENV.split("."):
        error = extras.missing(f"hijack serve needs openenv {OPENENV}, found {version}", "serve")
        raise error
