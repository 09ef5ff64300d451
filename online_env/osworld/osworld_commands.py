"""`hijack prefetch` and `hijack osworld`."""

import json
from pathlib import Path

import click

from hijack_data.cli.options import WholeSummaries
from hijack_data.errors import ParameterError
from hijack_data.file_io import write_atomic

from . import table, venv


def _venv_option(text: str):
    return click.option(
        "--venv",
        "folder",
        metavar="DIR",
        type=click.Path(path_type=Path),
        default=venv.DEFAULT,
        show_default=True,
        help=text,
    )


@click.command()
@click.argument("source", metavar="TASKS", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    required=True,
    metavar="CACHE",
    type=click.Path(path_type=Path),
    help="OSWorld's cache folder.",
)
@click.option(
    "--only",
    multiple=True,
    metavar="ID",
    help="Only this task (an id or its beginning); may be repeated.",
)
@click.option(
    "--dry-run",
    "--list",
    "list_",
    is_flag=True,
    help="Print what would be fetched, and fetch nothing.",
)
@click.option(
    "--check", "check_", is_flag=True, help="Fetch nothing; hash again what the manifest lists."
)
@click.option("--json", "json_", is_flag=True, help="Print the result as JSON.")
def prefetch(
    source: Path, out: Path, only: tuple[str, ...], list_: bool, check_: bool, json_: bool
) -> int:
    """Fill OSWorld's file cache, so that runs need no network.

    TASKS is a folder of OSWorld's task files or a tasks.jsonl. Run it again to go on after an
    interruption.
    """
    from . import prefetch as module
    from .wanted import wanted

    chosen = table.read(source)
    files = [item for task in (chosen.only(only) if only else chosen) for item in wanted(task)]
    if list_:
        rows = [{"path": item.path, "url": item.url} for item in files]
        click.echo(
            json.dumps(rows, indent=1)
            if json_
            else "\n".join(f"{row['path']}  {row['url']}" for row in rows)
        )
        return 0
    if check_:
        wrong = module.check(out)
        _say(
            json_,
            {"wrong": wrong},
            [f"{path}: {why}" for path, why in wrong.items()] or ["all files are as recorded"],
        )
        return 1 if wrong else 0
    report = module.prefetch(files, out, tell=_meter(json_))
    lines = [f"failed: {path}: {why}" for path, why in report.failed.items()]
    lines.append(
        f"{len(report.fetched)} fetched ({report.bytes / 1e6:.1f} MB), {len(report.kept)} were"
        f" there, {len(report.failed)} failed"
    )
    _say(
        json_,
        {
            "fetched": report.fetched,
            "kept": report.kept,
            "failed": report.failed,
            "bytes": report.bytes,
        },
        lines,
    )
    return 1 if report.failed else 0


@click.group(cls=WholeSummaries)
def osworld() -> None:
    """OSWorld's own environment and evaluators on our desktops."""


@osworld.command()
@click.option(
    "--tier",
    type=click.Choice(venv.TIERS),
    default="tiny",
    show_default=True,
    help="How many packages.",
)
@_venv_option("Where.")
def setup(tier: str, folder: Path) -> None:
    """Make the Python environment that OSWorld runs in.

    A second call finds it and installs nothing.
    """
    made = venv.make(folder, tier)
    click.echo(
        f"{made.folder}: {made.tier}, {made.megabytes:.0f} MB"
        + ("" if made.fresh else " (was there)")
    )


@osworld.command()
@click.argument("source", metavar="TASKS", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    required=True,
    metavar="RESULTS.json",
    type=click.Path(path_type=Path),
    help="The file to write.",
)
@click.option(
    "--markdown",
    metavar="FILE.md",
    type=click.Path(path_type=Path),
    help="Also a table for people.",
)
@click.option(
    "--only",
    multiple=True,
    metavar="ID|GROUP",
    help="These tasks: ids, their beginnings, or group names.",
)
@click.option(
    "--feasibility",
    metavar="JSON",
    type=click.Path(path_type=Path),
    help="Groups of tasks by need.",
)
@click.option(
    "--cache", metavar="DIR", type=click.Path(path_type=Path), help="OSWorld's file cache."
)
@_venv_option("Where OSWorld's Python environment is.")
def selftest(
    source: Path,
    out: Path,
    markdown: Path | None,
    only: tuple[str, ...],
    feasibility: Path | None,
    cache: Path | None,
    folder: Path,
) -> int:
    """Test whether tasks can be scored on the embedded desktop.

    Untouched they must score 0; solved, by a script or FAIL, 1.
    """
    from . import run
    from . import selftest as module

    groups = module.read_groups(feasibility) if feasibility else {}
    chosen = module.choose(table.read(source), groups, only)

    def keep(row: module.SelfTestRow, results: module.Results) -> None:
        click.echo(
            f"{row.domain} {row.id[:8]}  {row.status:8} {row.seconds:5.1f} s  {row.reason}".rstrip()
        )
        write_atomic(out, json.dumps(results.as_json(), indent=1) + "\n")

    results = run.on_embedded(chosen, groups, folder, cache or out.parent / "cache", keep)
    if markdown:
        write_atomic(markdown, results.as_markdown())
    click.echo(results.summary())
    return 0 if results.sound else 1


@osworld.command()
@click.argument("source", metavar="TASKS", type=click.Path(path_type=Path))
@_venv_option("OSWorld's Python environment, whose packages are looked at if it is there.")
@click.option("--json", "json_", is_flag=True, help="Print what each task needs.")
@click.option(
    "--working",
    is_flag=True,
    help="Print the files of the tasks that work here, as hijack bench --tasks takes them.",
)
def needs(source: Path, folder: Path, json_: bool, working: bool) -> int:
    """Say which tasks can run on the embedded desktop, and what the others lack.

    Tasks are read, not run: files, packages, programs, sites and accounts that they name.
    """
    from . import needs as module
    from .run import checker

    if working and source.is_file():
        raise ParameterError(
            f"--working: {source} is a table; hijack bench plays tasks by the files in OSWorld's"
            " folder, so name that"
        )
    chosen = table.read(source)
    with checker(folder) as check:
        found = module.needs_of_all(chosen, check)
    if working:
        works = {one.id for one in found if one.tested == module.WORKS}
        click.echo(",".join(str(task.path) for task in chosen if task.id in works))
        return 0
    if json_:
        rows = [{**vars(one), "can_be_met": one.can_be_met} for one in found]
        click.echo(json.dumps({"revision": str(chosen.revision), "tasks": rows}, indent=1))
        return 0
    lines = [
        f"{count:4}  {kinds:20}  {remedy}".rstrip()
        for kinds, count, remedy in module.summary(found)
    ]
    if check is None:
        lines.append(f"packages were not looked at: {folder} is not there; hijack osworld setup")
    click.echo("\n".join([str(chosen.revision), *lines]))
    return 0


def _say(as_json: bool, value: object, lines: list[str]) -> None:
    click.echo(json.dumps(value, indent=1) if as_json else "\n".join(lines))


def _meter(quiet: bool):
    def tell(done: int, total: int, path: str) -> None:
        if not quiet and (done == total or done % 20 == 0):
            click.echo(f"{done} of {total} files ({path})", err=True)

    return tell
