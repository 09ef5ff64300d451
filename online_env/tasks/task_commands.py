"""`hijack tasks`: the tasks of the suite, or a table of OSWorld's."""

import json
from pathlib import Path

import click
from rich.table import Table

from hijack_data.cli import console
from hijack_data.file_io import write_atomic


@click.command()
@click.argument(
    "source", metavar="[OSWORLD_EXAMPLES]", required=False, type=click.Path(path_type=Path)
)
@click.option("--suite", is_flag=True, help="List the tasks that come with the library.")
@click.option("--set", "set_", metavar="NAME", help="Only those of a set, such as core.")
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
@click.option(
    "-o",
    "--out",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The file to write: TASKS.jsonl of OSWorld's tasks, or a page of the suite (.md).",
)
@click.option("--clean", is_flag=True, help="Also one row an OSWorld task without corruption.")
def tasks(
    source: Path | None, suite: bool, set_: str | None, as_json: bool, out: Path | None, clean: bool
) -> None:
    """List the tasks of the suite, or write one row for every OSWorld task and corruption.

    Such as: hijack tasks --suite; hijack tasks OSWORLD_EXAMPLES --out tasks.jsonl (369 x 9 = 3321).
    """
    if suite or set_:
        if source is not None:
            raise click.UsageError("give either OSWORLD_EXAMPLES or --suite")
        _list(set_, as_json, out)
        return
    if source is None:
        raise click.UsageError("say which tasks: --suite, or a folder of OSWorld's task files")
    if out is None:
        raise click.UsageError("--out TASKS.jsonl: say where the rows go")
    from ..osworld import table
    from ..osworld.tasks import load

    found = load(source)
    count = table.write(found, out, clean)
    click.echo(f"{out}: {count} rows, {len(found)} tasks, revision {found.revision}")


def _list(set_: str | None, as_json: bool, out: Path | None) -> None:
    from . import catalogue, task_sets

    found = catalogue.rows(task_sets.members(set_ or task_sets.SUITE))
    if out is not None:
        pictures = "images/suite" if (out.parent / "images" / "suite").is_dir() else ""
        write_atomic(out, catalogue.page(found, pictures))
        click.echo(f"{out}: {len(found)} tasks")
    elif as_json:
        click.echo(json.dumps(found, indent=1, ensure_ascii=False))
    else:
        _show(found)


def _show(found: list[dict[str, object]]) -> None:
    table = Table(box=None, pad_edge=False, expand=True)
    table.add_column("task", no_wrap=True)
    table.add_column("domain", no_wrap=True)
    table.add_column("length", justify="right", no_wrap=True)
    table.add_column("instruction", overflow="ellipsis", no_wrap=True, ratio=1)
    for row in found:
        first = str(row["instruction"]).split("\n")[0]
        table.add_row(str(row["name"]), str(row["domain"]), str(row["actions"] or ""), first)
    screen = console()
    screen.print(table)
    screen.print(f"{len(found)} tasks; --json has all of each")
