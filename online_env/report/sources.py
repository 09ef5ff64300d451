"""What a command reports on: a run of this library, or results of other harnesses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hijack_data.choices import CLEAN
from hijack_data.cli.completion import complete
from hijack_data.runs.run_log import EPISODES, RUN, find_run

from ..results.outcome_formats import FIELDS, READERS
from .model import ReportError

if TYPE_CHECKING:
    from ..results.reading import Run

SOURCES = click.argument(
    "sources", nargs=-1, required=True, metavar="SOURCE...", type=click.Path(path_type=Path)
)
# Of `source_options`; a command lists those that only `--help-all` shows.
READING = ("reader", "columns", "clean")
PAIRING = ("common_tasks", "unpaired")


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """How results of other harnesses are read, as a command was told.

    Attributes:
        reader: the name of the reader; `None` to ask each source what it is.
        columns: where the sources have each field, as `parse_columns` takes it.
        clean: the condition that the others are compared with; `None` for `clean`.
        common_tasks: compare over the tasks that conditions share.
        unpaired: compare conditions of different tasks.
    """

    reader: str | None = None
    columns: str = ""
    clean: str | None = None
    common_tasks: bool = False
    unpaired: bool = False

    @property
    def stated(self) -> list[str]:
        """The options that were given."""
        options = {
            "--from": self.reader,
            "--columns": self.columns,
            "--clean": self.clean,
            "--common-tasks": self.common_tasks,
            "--unpaired": self.unpaired,
        }
        return [name for name, value in options.items() if value]

    def read(self, sources: Sequence[Path], read_own: Callable[[Path], "Run"]) -> "Run":
        """Read one run of this library, or the results of others as one run.

        Args:
            sources: files and folders.
            read_own: reads a run of this library.

        Raises:
            ReportError: a run of this library is one of several sources, or options are not for it.
            OutcomeError: the results of others cannot be read.
        """
        if is_own_run(sources):
            if self.stated:
                raise ReportError(
                    f"{sources[0]}: is a run of this library, which {self.stated[0]} is not for"
                )
            return read_own(sources[0])
        from ..results.outcomes import collect_run, parse_columns

        return collect_run(
            sources,
            reader=self.reader,
            columns=parse_columns(self.columns),
            clean=self.clean or CLEAN,
            common_tasks=self.common_tasks,
            unpaired=self.unpaired,
        )


def is_own_run(sources: Sequence[Path]) -> bool:
    """Return whether the only source is a run of this library or a finished report.

    Raises:
        ReportError: there is such a one beside other sources.
    """
    own_source = next((source for source in sources if _is_own(source)), None)
    if own_source is not None and len(sources) > 1:
        raise ReportError(f"{own_source}: is a run of this library, and is reported alone")
    return own_source is not None


def _is_own(source: Path) -> bool:
    """Return whether a source is a run of this library or a finished report, or is not there."""
    from ..results.outcomes import is_result

    if source.is_dir():
        folder = find_run(source)
        return (folder / RUN).exists() or (folder / EPISODES).is_dir()
    if not source.exists():
        return True
    return source.suffix == ".json" and not is_result(source)


def source_options(*names: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator: give a click command `names` of `READING` and `PAIRING`, as `options`."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def called(*arguments: Any, **values: Any) -> Any:
            options = SourceOptions(**{name: values.pop(name) for name in names})
            return command(*arguments, options=options, **values)

        decorated: Callable[..., Any] = called
        for name in reversed(names):
            decorated = _OPTIONS[name](decorated)
        return decorated

    return decorate


_OPTIONS: dict[str, Callable[[Callable[..., Any]], Callable[..., Any]]] = {
    "reader": click.option(
        "--from",
        "reader",
        metavar="NAME",
        shell_complete=complete("online_env.results.outcome_formats:READERS"),
        help=f"Format of others: {', '.join(READERS)}.",
    ),
    "columns": click.option(
        "--columns",
        default="",
        metavar="FIELD=COLUMN,...",
        help=f"Where others have {', '.join(FIELDS)}.",
    ),
    "clean": click.option(
        "--clean", metavar="NAME", help="Condition that the others are compared with."
    ),
    "common_tasks": click.option(
        "--common-tasks", is_flag=True, help="Compare over the tasks that conditions share."
    ),
    "unpaired": click.option(
        "--unpaired", is_flag=True, help="Compare conditions of different tasks."
    ),
}
