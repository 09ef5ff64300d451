"""Options that commands share, so that each has the same name, meaning and help everywhere."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


class WholeSummaries(click.Group):
    """A group whose help shows the summaries of its commands in full."""

    def summary(self, ctx: click.Context, name: str) -> str:
        """Return the first sentence of a command's help."""
        command = self.get_command(ctx, name)
        return "" if command is None else command.get_short_help_str(limit=300)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, self.summary(ctx, name)) for name in self.list_commands(ctx)]
            )


class FiniteRange(click.FloatRange):
    """A number in a range, which `nan` and `inf` are not: no JSON holds them, no limit is kept."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number, or end the command with a message."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number


class OutOption(click.Option):
    """`-o`, `--out`; some commands took `--output`, which still works and is not shown."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the names and the text of the help."""
        record = super().get_help_record(ctx)
        return record and (record[0].replace(", --output", ""), record[1])


def seed_option(help: str = "Random seed.") -> Callable[[Command], Command]:
    """`--seed N`; the library checks its range."""
    return click.option("--seed", type=int, default=0, show_default=True, metavar="N", help=help)


def new_run_options(command: Command) -> Command:
    """Add `-o RUNS` and `--resume`, for commands that play agents and write a run."""
    out = click.option(
        "-o",
        "--out",
        type=click.Path(file_okay=False, path_type=Path),
        metavar="RUNS",
        help="Folder of the run: new.",
    )
    resume = click.option(
        "--resume", is_flag=True, help="Go on with the run in RUNS where it was broken off."
    )
    return out(resume(command))


# Options of the commands that take the CONFIG of a benchmark.
desktops_option = click.option(
    "--desktops",
    type=click.IntRange(1, 256),
    metavar="N",
    help="Desktops side by side; by default as many as cores and memory allow.",
)
conditions_option = click.option(
    "--corruptions",
    metavar="A,B|all",
    help="Labels of CONFIG or names; all is clean and every corruption.",
)
