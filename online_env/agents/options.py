"""Options of the commands that run agents."""

import click

from hijack_data.cli.options import FiniteRange

in_process_option = click.option(
    "--in-process",
    is_flag=True,
    help="Run your agent in the runner's process, for debugging; records and reports say so.",
)
guard_option = click.option(
    "--guard",
    metavar="NAME",
    help="Let an onlooker watch every agent: rules, model, or an agent file.",
)
agent_memory_option = click.option(
    "--agent-memory",
    type=FiniteRange(min=0.1),
    metavar="GIB",
    help="Memory that an agent and all that it starts may use; by default 75 % of the machine's.",
)
