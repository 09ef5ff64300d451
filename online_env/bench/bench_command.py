"""`hijack bench`.

Exit codes: 0 done, 1 finished but something is missing, invalid, failed or damaged, 2 bad usage or
configuration, 3 the disk is full or fails.
"""

from pathlib import Path
from typing import Any

import click

from hijack_data.cli.completion import complete, complete_configuration
from hijack_data.cli.options import (
    BriefCommand,
    FiniteRange,
    conditions_option,
    desktops_option,
    new_run_options,
)

from ..agents.options import agent_memory_option, guard_option, in_process_option
from ..choices import ERROR_ORDERS, LAYERS, POLICIES
from .machine_options import MORE, machine_options


@click.command(
    cls=BriefCommand,
    more=(
        *MORE,
        "agent_memory",
        "detect",
        "engine",
        "environment_errors",
        "guard",
        "in_process",
        "layer",
        "max_cost",
        "max_steps",
        "plans",
        "prompts",
        "ray_address",
        "recovery",
        "replay",
        "severities",
        "sign",
        "until_retention",
    ),
)
@click.argument("config", required=False, shell_complete=complete_configuration("benchmark"))
@new_run_options
@click.option(
    "--agent",
    metavar="A,B",
    shell_complete=complete("online_env.agents.registry:AGENTS"),
    help="Such as oracle, my_agent.py:MyAgent, my_agent.yaml or gpt-4o.",
)
@click.option(
    "--tasks",
    metavar="A,B",
    shell_complete=complete("online_env.tasks:names"),
    help="Tasks, instead of those of CONFIG: write_note, my_task.py:MyTask.",
)
@conditions_option
@click.option(
    "--plans",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Corruptions of a worst.json of hijack search; without CONFIG its tasks and agent, too.",
)
@click.option(
    "--severities",
    metavar="1-5",
    help="Each corruption at these levels, of those that have levels: a curve in the report.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 10_000),
    metavar="N",
    help="Seeds 0 to N-1, instead of CONFIG's.",
)
@desktops_option
@click.option(
    "--max-steps",
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Actions until an episode is cut off, instead of CONFIG's.",
)
@click.option(
    "--recovery",
    type=click.Choice(POLICIES),
    help="What a request for re-initialisation leads to, instead of CONFIG's.",
)
@click.option(
    "--environment-errors",
    type=click.Choice(ERROR_ORDERS),
    help="Cut the network before or after the task's pages are opened, instead of CONFIG's.",
)
@click.option(
    "--layer",
    type=click.Choice(LAYERS),
    help="Who draws pop-ups, marks and subtitles: we on the picture, or a browser in its page.",
)
@machine_options
@click.option(
    "--engine",
    type=click.Choice(("local", "ray")),
    default="local",
    show_default=True,
    help="Where the desktops are: on this machine, or on the nodes of a Ray cluster.",
)
@click.option(
    "--ray-address",
    metavar="auto|HOST:PORT",
    help="A running Ray cluster; by default RAY_ADDRESS, or a Ray that is started and ended here.",
)
@click.option(
    "--prompts",
    type=click.Path(path_type=Path),
    metavar="DIR|FILE.py",
    help="Prompts of models that replace ours by name; ui-tars says where UI-TARS' own are.",
)
@click.option(
    "--max-cost",
    type=FiniteRange(0),
    metavar="USD",
    help="Begin no episode once the models have cost that much; --resume goes on.",
)
@click.option(
    "--until-retention",
    type=FiniteRange(0, 1, min_open=True, max_open=True),
    metavar="R",
    help="Play tasks in a random order, and end once a retention above R is shown (95 %).",
)
@click.option(
    "--replay",
    type=click.Path(path_type=Path),
    metavar="RUNS",
    help="Take the models' answers from the log of an earlier run.",
)
@guard_option
@in_process_option
@agent_memory_option
@click.option("--sign", metavar="KEY", help="Sign the run at its end with this SSH key.")
@click.option("--dry-run", is_flag=True, help="List the episodes with an estimate, and run none.")
@click.option(
    "--detect",
    type=FiniteRange(0, 100, min_open=True),
    metavar="POINTS",
    help="With --dry-run: the tasks and seeds that show such a loss, with hours and cost.",
)
def bench(**options: Any) -> None:
    """Run agents on a live desktop, clean and corrupted.

    Such as: hijack bench embedded_small --out runs/small
    """
    from .run_command import run_command  # loads the web sites, which `--help` does not need

    run_command(**options)
