"""`hijack search` and `hijack mine`.

Exit codes: 0 done, 2 bad usage or configuration, 3 the disk is full or fails, 130 Ctrl-C.
"""

from pathlib import Path
from typing import Any

import click

from hijack_data.cli.completion import complete
from hijack_data.cli.options import BriefCommand, desktops_option, new_run_options, seed_option


@click.command(cls=BriefCommand, more=("desktops", "keep", "limit", "seeds", "workers"))
@click.argument("source", metavar="CONFIG|DATASET")
@click.option(
    "--agent",
    required=True,
    metavar="A",
    shell_complete=complete("online_env.agents.registry:AGENTS"),
    help="One agent, as for hijack bench: pixel, my_agent.py:MyAgent, my_agent.yaml.",
)
@new_run_options
@click.option(
    "--budget",
    type=click.IntRange(1),
    required=True,
    metavar="N",
    help="Episodes that are played at most, or rows that are asked about.",
)
@click.option("--tasks", metavar="A,B", help="Tasks, instead of those of CONFIG: a set, or names.")
@click.option("--seeds", type=click.IntRange(1, 10_000), metavar="N", help="Seeds 0 to N-1.")
@click.option(
    "--corruptions",
    metavar="A,B|all",
    help="What is searched: names, all, everyday; by default all that can be played.",
)
@click.option("--pairs", is_flag=True, help="Search pairs of two corruptions, too.")
@click.option(
    "--keep",
    type=click.IntRange(1, 100),
    default=5,
    show_default=True,
    metavar="N",
    help="How many of the worst are confirmed on held-out cases.",
)
@seed_option("Seed of the search.")
@click.option(
    "--limit", type=click.IntRange(2), metavar="N", help="The first N trajectories of each half."
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    metavar="N",
    help="Agents that answer side by side, for rows.  [default: 1]",
)
@desktops_option
@click.option("--dry-run", is_flag=True, help="Say what would be played, and play nothing.")
def search(**options: Any) -> None:
    """Find the corruptions under which an agent does worst, within a budget.

    Such as: hijack search embedded_small --agent pixel --budget 60 -o worst
    """
    from .run_command import run_search

    run_search(**options)


@click.command()
@click.argument("runs", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "-o",
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="A new folder for the configurations.",
)
def mine(runs: Path, out: Path) -> None:
    """Group the lost episodes of a run, and write a benchmark for each group.

    Such as: hijack mine runs/small -o lost, then: hijack bench lost/01_....yaml --out runs/again
    """
    from .mining import write_groups

    write_groups(runs, out)
