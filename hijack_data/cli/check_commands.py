"""`hijack check` and `hijack doctor`: test a plug-in, and list what this machine has installed."""

import ctypes
import importlib
import importlib.metadata
import json
import platform
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import click

from .. import extras
from ..errors import PluginError
from ..loading import SUFFIX, LoadedFile, run_file
from ..shadowed import OTHERS, find_shadow
from . import doctor_rows
from .options import FiniteRange
from .plugin_rows import BROKEN, plugin_rows
from .terminal import console, echo

_CHECKED_KINDS = ("corruption", "effect", "agent", "task")
DoctorRow: TypeAlias = tuple[str, str, str, str]


@click.command()
@click.argument("target", metavar="FILE.py|AGENT")
@click.option(
    "--desktop/--no-desktop",
    default=True,
    help="Whether to try effects and oracles of tasks on real desktops.",
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.1),
    default=120.0,
    show_default=True,
    metavar="S",
    help="Seconds that an agent has for each answer.",
)
def check(target: str, desktop: bool, timeout: float) -> None:
    """Run the conformance suites on what a file holds: corruptions, live effects, agents, tasks.

    An agent may also be named as for `hijack bench --agent`: my_agent.py:MyAgent, random.
    """
    out = console()
    failed = 0
    if target.endswith(SUFFIX):
        file = run_file(target)
        agents = _find_agents(file)
        failed = _check_file(out, file, desktop)
        tasks = _find_tasks(file)
        _check_content(file, target, [*agents, *tasks])
        failed += sum(_check_task(out, name, desktop) for name in tasks)
    else:
        agents = [target]
    failed += sum(_check_agent(out, name, timeout) for name in agents)
    if failed:
        out.print(f"{failed} checks failed")
        sys.exit(1)


def _check_content(file: LoadedFile, target: str, plugins: list[str]) -> None:
    """Check that a file holds something to check.

    Raises:
        PluginError: it registers nothing, and has neither agents nor tasks.
    """
    if not file.names and not plugins:
        raise PluginError(
            f"{target}: registers nothing, and has no class with predict(instruction, obs)"
        )
    unchecked = [
        f"{kind} {name}"
        for kind, names in file.names.items()
        if kind not in _CHECKED_KINDS
        for name in names
    ]
    for text in unchecked:
        _show(console(), f"{text}: there are no checks of this kind")
    if unchecked and not plugins and not file.corruptions and not file.effects:
        raise PluginError(
            f"{target}: registers nothing that hijack check can check, which is corruptions, live"
            f" effects, agents and tasks; test {', '.join(unchecked)} by use"
        )


def _check_file(out: Any, file: LoadedFile, desktop: bool) -> int:
    """Check corruptions and effects; return how many checks failed."""
    from rich.markup import escape

    from .. import conformance
    from ..corruption import find_corruption

    failed = 0
    corruptions = [find_corruption(name) for name in file.corruptions]
    for cls in corruptions:
        out.print(f"[bold]{cls().id}[/] {escape(cls.summary())}")
        failed += sum(not _show(out, result) for result in conformance.run(cls))
    for kind in file.effects:
        effects: Any = importlib.import_module("online_env.effects.checking")
        out.print(f"[bold]effect {kind}[/] {escape(effects.summary(kind))}")
        results = effects.check(kind, effects.params_for(kind, corruptions), desktop)
        failed += sum(not _show(out, result) for result in results)
    return failed


def _find_agents(file: LoadedFile) -> list[str]:
    """Return the agents of a file; a file without agents imports nothing."""
    classes = [
        value
        for value in vars(sys.modules[file.module]).values()
        if isinstance(value, type) and value.__module__ == file.module
    ]
    if not any(hasattr(cls, "predict") for cls in classes) and "agent" not in file.names:
        return []
    return importlib.import_module("online_env.agents.checking").agents_in_file(file)


def _find_tasks(file: LoadedFile) -> list[str]:
    """Return the tasks of a file; a file without tasks imports nothing."""
    module = vars(sys.modules[file.module])
    has_phrasings = any(getattr(value, "phrasings", None) for value in module.values())
    if not has_phrasings and "task" not in file.names:
        return []
    return importlib.import_module("online_env.tasks.checking").task_names(file)


def _check_task(out: Any, name: str, desktop: bool) -> int:
    """Check a task; return how many checks failed."""
    checking: Any = importlib.import_module("online_env.tasks.checking")
    return _show_all(out, "task", name, checking.check(name, desktop))


def _check_agent(out: Any, name: str, timeout: float) -> int:
    """Check an agent; return how many checks failed."""
    checking: Any = importlib.import_module("online_env.agents.checking")
    return _show_all(out, "agent", name, checking.check(name, timeout))


def _show_all(out: Any, kind: str, name: str, results: Iterable[Any]) -> int:
    """Print the outcomes of all checks of one plug-in; return how many failed."""
    out.print(f"[bold]{kind}[/] ", end="")
    out.print(name, markup=False)
    return sum(not _show(out, result) for result in results)


def _show(out: Any, result: Any) -> bool:
    """Print the outcome of a check, or why it was skipped; return whether nothing failed."""
    if isinstance(result, str):
        out.print("  [yellow]--  [/] not checked: ", end="")
        out.print(result, markup=False)
        return True
    mark = "[green]ok  [/]" if result.ok else "[red]FAIL[/]"
    out.print(f"  {mark} {result.check}: {result.about}")
    if not result.ok:
        out.print(f"       {result.problem}", markup=False)
    for note in result.notes:
        out.print("       [yellow]note[/] ", end="")
        out.print(note, markup=False)
    return bool(result.ok)


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(as_json: bool) -> None:
    """List what is installed, what is missing, and the commands that add it."""
    from rich.table import Table

    rows, remedy = list(_doctor_rows()), doctor_rows.extras_remedy()
    if as_json:
        echo(json.dumps({"found": [_row_data(row) for row in rows], "remedy": remedy}))
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("", "what", "for", "found"):
        table.add_column(column, overflow="fold")  # a truncated path would be useless
    for row in rows:
        table.add_row(*row)
    console().print(table)
    if remedy:
        echo(remedy)


def _doctor_rows() -> Iterator[DoctorRow]:
    """Yield rows of a mark, a component, its purpose, and what was found; the last is markup."""
    core = ", ".join(
        f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "pillow", "pyyaml")
    )
    versions = f"Python {platform.python_version()}, {core}"
    yield doctor_rows.OK, "core", "plans and NumPy pictures", versions
    yield from doctor_rows.extra_rows()
    yield _gpu()
    yield from plugin_rows()
    yield from _shadow_rows()
    if not find_shadow("online_env"):
        yield doctor_rows.desktop_row()


def _shadow_rows() -> Iterator[DoctorRow]:
    """Yield a row for each of our packages that a folder or file of the user's hides."""
    from rich.markup import escape

    for name in OTHERS:
        problem = find_shadow(name)
        if problem:
            yield BROKEN, name, "import", escape(problem)


def _row_data(row: DoctorRow) -> dict[str, Any]:
    """Return a row without markup, for `--json`."""
    from rich.text import Text

    mark, component, purpose, state = (Text.from_markup(cell).plain for cell in row)
    return {"ok": mark == "ok", "what": component, "for": purpose, "found": state}


def _gpu() -> tuple[str, str, str, str]:
    if extras.lacking(["torch"]):
        return "[yellow]--[/]", "gpu", "CUDA kernels", "needs the torch extra"
    no_device = "no CUDA device; everything runs on the CPU"
    if not _has_gpu_driver():
        return "[yellow]--[/]", "gpu", "CUDA kernels", no_device
    torch = importlib.import_module("torch")
    if not torch.cuda.is_available():
        return "[yellow]--[/]", "gpu", "CUDA kernels", no_device
    return "[green]ok[/]", "gpu", "CUDA kernels", torch.cuda.get_device_name(0)


def _has_gpu_driver() -> bool:
    """Return whether torch could find a GPU: importing torch to ask it takes seconds."""
    if sys.platform != "linux" or Path("/dev/kfd").exists():  # AMD's driver
        return True
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        return False
    return True
