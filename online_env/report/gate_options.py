"""The options `--fail-under` and `--junit` of a command, and the scores that they know."""

from pathlib import Path

import click

from hijack_data.cli.options import Command

OPTION = "--fail-under"
EXAMPLE = f"such as {OPTION} retention=0.8 or {OPTION} success.network_error=0.5"
RETENTION_LOW = "retention_low"  # the lower end of the interval of the retention
# Scores of one condition (NAME.CORRUPTION), which are columns of the report's table. Without a
# condition the first two are those of the clean one, the others are over all corrupted cases.
OF_CONDITION = ("success", "ci_low", "retention", RETENTION_LOW, "delta")
CLEAN_FIRST = ("success", "ci_low")
PAIRED = ("retention", RETENTION_LOW, "delta")  # with the clean condition
# Scores of an agent, by their names in its summary.
OF_AGENT = {"average": "paper_average", "corrupted": "corrupted", "worst": "worst_success"}
OVER_CORRUPTIONS = ("corrupted", "worst")
KNOWN = (*OF_CONDITION, *OF_AGENT)


def gate_options(command: Command) -> Command:
    """Decorator: give a click command the options of a gate.

    They come as `fail_under`, a tuple of texts, and `junit`, a path or `None`.
    """
    file = click.option(
        "--junit",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help="Write a JUnit XML: a test case for each episode and each --fail-under.",
    )
    gates = click.option(
        OPTION,
        "fail_under",
        multiple=True,
        metavar="SCORE=X",
        help=(
            "Exit with 1 if a score of an agent is below X (a share, 0 to 1); may be repeated."
            f" SCORE: {', '.join(KNOWN)}, success.CORRUPTION, AGENT:SCORE."
        ),
    )
    return gates(file(command))
