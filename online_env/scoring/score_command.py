"""`hijack score`.

Exit codes: 0 done, 1 finished but something is missing, invalid, failed or damaged, 2 bad usage or
configuration, 3 the disk is full or fails.
"""

from pathlib import Path
from typing import Any

import click

from hijack_data.cli.completion import complete
from hijack_data.cli.options import BriefCommand, FiniteRange, new_run_options

from ..agents.options import agent_memory_option, guard_option, in_process_option
from ..choices import NEAR_PIXELS, QUESTIONS, ROW_TIMEOUT_S


@click.command(
    cls=BriefCommand,
    more=(
        *("agent_memory", "ask", "batch", "distance", "guard", "in_process", "plans", "split"),
        *("timeout", "workers"),
    ),
)
@click.argument("dataset", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--agent",
    required=True,
    metavar="A,B",
    shell_complete=complete("online_env.agents.registry:AGENTS"),
    help="Agents: random, fail, my_agent.py:MyAgent, package.module:MyAgent.",
)
@new_run_options
@click.option(
    "--ask",
    type=click.Choice(QUESTIONS),
    help="What is asked; steps, or reminders of an export for onlookers, by default.",
)
@click.option(
    "--plans",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Corrupt the clean rows as a worst.json of hijack search says.",
)
@click.option(
    "--corruptions",
    metavar="A,B|all",
    help="Labels in the dataset; the clean rows are always scored with them.",
)
@click.option("--split", metavar="NAME", help="train, validation or test; all by default.")
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    metavar="N",
    help="The rows of the first N trajectories only.",
)
@click.option(
    "--distance",
    default=f"{NEAR_PIXELS:g}",
    show_default=True,
    metavar="PIXELS|SHARE%",
    help="How far a point may be off where no box is known.",
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.01),
    default=ROW_TIMEOUT_S,
    show_default=True,
    metavar="S",
    help="Seconds an agent has for a row.",
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    metavar="N",
    help="How many agents answer side by side.",
)
@click.option(
    "--batch",
    type=click.IntRange(1, 1024),
    default=8,
    show_default=True,
    metavar="N",
    help="Rows at a time, for an agent with predict_batch.",
)
@guard_option
@in_process_option
@agent_memory_option
@click.option("--dry-run", is_flag=True, help="Say what would be scored, and score nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON list.")
def score(**options: Any) -> None:
    """Score agents on the rows of a dataset, clean and corrupted, without a desktop.

    Such as: hijack score my_dataset --agent my_agent.py:MyAgent -o runs/mine
    """
    from .run_command import run_command

    run_command(**options)
