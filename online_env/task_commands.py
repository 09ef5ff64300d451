"""`hijack tasks`: the tasks of the suite."""

import json
from pathlib import Path

import click

from hijack_data.cli.completion import complete
from hijack_data.cli.terminal import console, echo
from hijack_data.file_io import write_atomic


@click.command()
@click.option(
    "--set",
    "set_",
    metavar="NAME",
    shell_complete=complete("online_env.tasks.task_sets:set_names"),
    help="Only those of a set, such as core.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
@click.option(
    "-o",
    "--out",
    metavar="FILE.md",
    type=click.Path(path_type=Path),
    help="Write a page of the tasks.",
)
def tasks(set_: str | None, as_json: bool, out: Path | None) -> None:
    """List the tasks of the suite, which come with the library."""
    _list(set_, as_json, out)


def _list(set_: str | None, as_json: bool, out: Path | None) -> None:
    from .tasks import catalogue, task_sets

    rows = catalogue.rows(task_sets.members(set_ or task_sets.SUITE))
    if out is not None:
        pictures = "images/suite" if (out.parent / "images" / "suite").is_dir() else ""
        write_atomic(out, catalogue.page(rows, pictures))
        echo(f"{out}: {len(rows)} tasks")
    elif as_json:
        echo(json.dumps(rows, indent=1, ensure_ascii=False))
    else:
        _show(rows)


def _show(rows: list[dict[str, object]]) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, expand=True)
    table.add_column("task", no_wrap=True)
    table.add_column("domain", no_wrap=True)
    table.add_column("length", justify="right", no_wrap=True)
    table.add_column("instruction", overflow="ellipsis", no_wrap=True, ratio=1)
    for row in rows:
        first = str(row["instruction"]).split("\n")[0]
        table.add_row(str(row["name"]), str(row["domain"]), str(row["actions"] or ""), first)
    screen = console()
    screen.print(table)
    screen.print(f"{len(rows)} tasks; --json has all of each")
