"""`hijack osworld`."""

import json
from pathlib import Path

import click

from hijack_data.cli.options import WholeSummaries
from hijack_data.cli.terminal import echo
from hijack_data.errors import ParameterError
from hijack_data.file_io import write_atomic

from . import venv


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


@click.group(cls=WholeSummaries)
def osworld() -> None:
    """OSWorld's own environment and evaluators on our desktops."""


@osworld.command()
@click.argument("source", metavar="OSWORLD_EXAMPLES", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    required=True,
    metavar="TASKS.jsonl",
    type=click.Path(path_type=Path),
    help="The file to write.",
)
@click.option("--clean", is_flag=True, help="Also one row a task without corruption.")
def tasks(source: Path, out: Path, clean: bool) -> None:
    """Write one row for every task of OSWorld and every corruption (369 x 9 = 3321).

    For a folder of OSWorld 2.0's tasks, rows that say what each needs (108 x 9 = 972).
    """
    from . import task_table, version_2
    from .tasks import is_version_2, load

    if is_version_2(source):
        listed = version_2.load(source)
        count = version_2.write_rows(listed, task_table.corruption_names(clean), out)
        echo(f"{out}: {count} rows, {len(listed.tasks)} tasks, revision {listed.revision}")
        echo(f"none of them can be played: {version_2.REFUSAL}")
        return
    examples = load(source)
    count = task_table.write(examples, out, clean)
    echo(f"{out}: {count} rows, {len(examples)} tasks, revision {examples.revision}")


@osworld.command()
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
@click.option("--dry-run", is_flag=True, help="Print what would be fetched, and fetch nothing.")
@click.option("--verify", is_flag=True, help="Fetch nothing; hash again what the manifest lists.")
@click.option("--json", "json_", is_flag=True, help="Print the result as JSON.")
def prefetch(
    source: Path, out: Path, only: tuple[str, ...], dry_run: bool, verify: bool, json_: bool
) -> int:
    """Fill OSWorld's file cache, so that runs need no network.

    TASKS is a folder of OSWorld's task files or a tasks.jsonl. Run it again to go on after an
    interruption.
    """
    from . import prefetch as module
    from . import task_table
    from .cache_files import list_cache_files

    tasks = task_table.read(source)
    files = [
        item for task in (tasks.only(only) if only else tasks) for item in list_cache_files(task)
    ]
    if dry_run:
        rows = [{"path": item.path, "url": item.url} for item in files]
        echo(
            json.dumps(rows, indent=1)
            if json_
            else "\n".join(f"{row['path']}  {row['url']}" for row in rows)
        )
        return 0
    if verify:
        damaged = module.check(out)
        _say(
            json_,
            {"wrong": damaged},
            [f"{path}: {problem}" for path, problem in damaged.items()]
            or ["all files are as recorded"],
        )
        return 1 if damaged else 0
    report = module.prefetch(files, out, tell=_meter(json_))
    lines = [f"failed: {path}: {problem}" for path, problem in report.failed.items()]
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


@osworld.command()
@click.option(
    "--tier",
    type=click.Choice(venv.TIERS),
    default="tiny",
    show_default=True,
    help="How many packages.",
)
@click.option(
    "--provider",
    "providers",
    multiple=True,
    type=click.Choice(tuple(venv.PROVIDER_PACKAGES)),
    help="Also the packages of this provider of machines; may be repeated.",
)
@click.option(
    "--osworld",
    "checkout",
    metavar="DIR",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A checkout of OSWorld, instead of its release on PyPI; later calls keep it.",
)
@_venv_option("Where.")
def setup(tier: str, providers: tuple[str, ...], checkout: Path | None, folder: Path) -> None:
    """Make the Python environment that OSWorld runs in.

    A second call finds it and installs nothing.
    """
    if "daytona" in providers and checkout is None:
        raise ParameterError(
            f"--provider daytona: {venv.PACKAGE} has no such provider; name a checkout of OSWorld"
            " that has it with --osworld DIR"
        )
    report = venv.make(folder, tier, providers=providers, osworld=checkout)
    echo(
        f"{report.folder}: {report.tier}, {report.megabytes:.0f} MB"
        + ("" if report.fresh else " (was there)")
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
def check(
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
    from . import run, task_table
    from . import selftest as module

    groups = module.read_groups(feasibility) if feasibility else {}
    tasks = module.choose(task_table.read(source), groups, only)

    def keep(row: module.SelfTestRow, results: module.Results) -> None:
        echo(
            f"{row.domain} {row.id[:8]}  {row.status:8} {row.seconds:5.1f} s  {row.reason}".rstrip()
        )
        write_atomic(out, json.dumps(results.as_json(), indent=1) + "\n")

    results = run.run_selftest(tasks, groups, folder, cache or out.parent / "cache", keep)
    if markdown:
        write_atomic(markdown, results.as_markdown())
    echo(results.summary())
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

    Tasks are read, not run: files, packages, programs, sites and accounts that they name. Of
    OSWorld 2.0's tasks none can run, and the command says what they need.
    """
    from . import task_needs as module
    from . import task_table, version_2
    from .run import checker
    from .tasks import is_version_2

    if not working and is_version_2(source):
        listed = version_2.load(source)
        _say(json_, version_2.to_data(listed), version_2.summary(listed))
        return 0
    if working:
        _check_folder(source)
    tasks = task_table.read(source)
    with checker(folder) as check:
        needs_by_task = module.list_all_needs(tasks, check)
    if working:
        works = {
            task_needs.id for task_needs in needs_by_task if task_needs.tested == module.RUNS_HERE
        }
        echo(",".join(str(task.path) for task in tasks if task.id in works))
        return 0
    if json_:
        rows = [
            {**vars(task_needs), "can_be_met": task_needs.can_be_met}
            for task_needs in needs_by_task
        ]
        echo(json.dumps({"revision": str(tasks.revision), "tasks": rows}, indent=1))
        return 0
    lines = [
        f"{count:4}  {kinds:20}  {remedy}".rstrip()
        for kinds, count, remedy in module.summary(needs_by_task)
    ]
    if check is None:
        lines.append(f"packages were not looked at: {folder} is not there; hijack osworld setup")
    echo("\n".join([str(tasks.revision), *lines]))
    return 0


def _check_folder(source: Path) -> None:
    """Check that tasks are read from a folder.

    Raises:
        ParameterError: They are read from a table.
    """
    if source.is_file():
        raise ParameterError(
            f"--working: {source} is a table; hijack bench plays tasks by the files in OSWorld's"
            " folder, so name that"
        )


def _say(as_json: bool, value: object, lines: list[str]) -> None:
    echo(json.dumps(value, indent=1) if as_json else "\n".join(lines))


def _meter(quiet: bool):
    def tell(count: int, total: int, path: str) -> None:
        if not quiet and (count == total or count % 20 == 0):
            echo(f"{count} of {total} files ({path})", err=True)

    return tell
