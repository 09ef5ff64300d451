"""Options that commands share, so that each has the same name, meaning and help everywhere."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from .completion import complete
from .terminal import echo

_ALL = "hijack_data.cli.options.all"  # in a context: list every option
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


class BriefCommand(click.Command):
    """A command whose `--help` fits a screen, and whose `--help-all` lists every option.

    Args:
        more: names of the parameters that only `--help-all` lists.
        settings: those of `click.Command`.
    """

    def __init__(self, *settings: Any, more: Sequence[str] = (), **options: Any) -> None:
        super().__init__(*settings, **options)
        self.more = frozenset(more)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the parameters, with `--help-all` before `--help` where options are left out."""
        parameters = super().get_params(ctx)
        if not self.more:
            return parameters
        option = click.Option(
            ["--help-all"],
            is_flag=True,
            is_eager=True,
            expose_value=False,
            help="Show every option and exit.",
            callback=self._show_all,
        )
        return [*parameters[:-1], option, *parameters[-1:]]

    def _show_all(self, ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
        if not value or ctx.resilient_parsing:
            return
        ctx.meta[_ALL] = True
        echo(self.get_help(ctx))
        ctx.exit()

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the options, or those that most calls need."""
        rows = [
            record
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option)
            if ctx.meta.get(_ALL) or parameter.name not in self.more
            if (record := parameter.get_help_record(ctx)) is not None
        ]
        with formatter.section("Options"):
            formatter.write_dl(rows)


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
    shell_complete=complete("hijack_data.corruption:corruption_names", "all", "clean"),
    help="Labels of CONFIG, names, or a file; all: clean, the nine, plug-ins; everyday: clean, that"
    " set.",
)
