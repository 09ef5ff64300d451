"""What is wrong with a task: its words, its judgement of results, and what it does on a desktop.

Words and judgement are checked in a folder, with results that are brought about by files. Only the
oracle needs a desktop.
"""

import string
import sys
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from hijack_data.conformance.base import Result
from hijack_data.errors import HijackError
from hijack_data.loading import LoadedFile

from ..embedded.sites.state import SiteState
from ..errors import DesktopError, MissingPackageError
from . import TASKS
from .base import Outcome, Task
from .folder_desktop import FolderDesktop
from .hand import GiveUpError, Hand
from .kit.apps import APPS
from .machine import Machine
from .plan_words import PlanWordsError, read_plan

if TYPE_CHECKING:
    from ..embedded.desktop import EmbeddedDesktop

WRONG_RESULTS = 3  # so many a task of the suite has at least
PHRASINGS = 3
SEEDS = 3  # variants that are checked
_BYSTANDER = "Documents/bystander.txt"


def task_names(file: LoadedFile) -> list[str]:
    """Return the names of the tasks in a loaded file: those it registers, and its own classes."""
    named = list(file.names.get("task", ()))
    known = [TASKS.get(name) for name in named]
    for title, value in vars(sys.modules[file.module]).items():
        is_own = isinstance(value, type) and value.__module__ == file.module
        if is_own and issubclass(value, Task) and value not in known:
            named.append(TASKS.find(f"{file.path}:{title}"))
    return named


def check(name: str, with_desktop: bool) -> Iterator[Result | str]:
    """Yield the outcome of each check of a task, or why it is not checked.

    Args:
        name: Of a registered task.
        with_desktop: Whether to play it on a desktop.
    """
    task_class = TASKS.get(name)
    judged = _first_problems(task_class)
    about = f"instruction, right and wrong results, collateral damage (seeds 0 to {SEEDS - 1})"
    notes: tuple[str, ...] = ()
    try:
        notes = (*shortcomings(task_class(0)), *unchecked(task_class(0)))
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        judged = judged or f"another seed: {_raised(task_class, error)}"
    yield Result("judgement", about, judged, notes)
    if not with_desktop:
        yield "oracle, doing nothing and teardown on a desktop: left out (--no-desktop)"
        return
    try:
        from ..embedded.desktop import EmbeddedDesktop

        desktop = EmbeddedDesktop.up()
    except DesktopError as error:
        yield f"oracle, doing nothing and teardown: no desktop on this machine: {error}"
        return
    with desktop:
        yield from _played(task_class(0), desktop)


def _first_problems(task_class: type[Task]) -> str:
    """Return what is wrong at the first seed at which something is; "" if nothing is."""
    for seed in range(SEEDS):
        try:
            found = list(problems(task_class(seed)))
        except Exception as error:  # noqa: BLE001  (a task may raise anything)
            found = [_raised(task_class, error)]
        if found:
            return f"seed {seed}: {'; '.join(found)}"
    return ""


def _raised(task_class: type[Task], error: Exception) -> str:
    """Return an error with the line of the task's file that led to it."""
    own = getattr(sys.modules.get(task_class.__module__), "__file__", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == own]
    where = f" ({Path(own).name}, line {lines[-1]})" if own and lines else ""
    return f"{type(error).__name__}: {error}{where}"


def _played(task: Task, desktop: "EmbeddedDesktop") -> Iterator[Result | str]:
    """Yield what happens on a desktop."""
    machine = Machine(desktop, SiteState(desktop.record["sites"]))
    at_first = machine.snapshot().files
    try:
        task.setup(machine)
    except MissingPackageError as error:
        yield f"oracle, doing nothing and teardown: {error}"
        return
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        problem = _raised(type(task), error)
        yield Result("setup", "the task is prepared on a desktop", problem)
        return
    idle = task.validate(machine)
    problem = f"doing nothing is judged {idle.score:g}" if idle.score else ""
    yield Result("do_nothing", "doing nothing scores 0", problem)
    desktop.reset()  # a task is not played on after it was judged
    machine = Machine(desktop, SiteState(desktop.record["sites"]))
    task.setup(machine)
    yield Result("oracle", "the oracle does the task", _solved(task, machine))
    task.teardown(machine)
    left = sorted(machine.snapshot().files.keys() - at_first.keys())
    problem = f"teardown leaves {', '.join(left[:5])}" if left else ""
    yield Result("teardown", "teardown removes what the task added", problem)


def _solved(task: Task, machine: Machine) -> str:
    """Return why the oracle did not do the task; "" if it did."""
    answer = "DONE"
    try:
        task.oracle(Hand(machine.desktop))
    except GiveUpError:
        answer = "FAIL"
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        return _raised(type(task), error)
    verdict = task.validate(machine, answer)
    return "" if verdict.passed else verdict.reason


def unchecked(task: Task) -> Iterator[str]:
    """Yield what the instruction names and the judgement seems to ignore.

    Each value of the instruction is replaced in turn by that of another variant; the right result
    of the present one should then be wrong. That is a hint: a value may only say where to look.
    """
    if task.infeasible:
        return
    used: set[str] = set()
    for phrasing in task.phrasings:
        used |= {name for _, name, _, _ in string.Formatter().parse(phrasing) if name}
    for key in sorted(used):
        other = _with_another(task, key)
        if other is None:
            continue
        if _is_judged_alike(other, task):
            yield f"the instruction names {key!r}, and another value would be judged the same"


def _is_judged_alike(other: Task, task: Task) -> bool:
    """Return whether a task with another value takes the right result of the first for right."""
    try:
        return any(_judged(other, task, (task.right_result,), "DONE", 0.0, ""))
    except Exception:  # noqa: BLE001  (values that two seeds drew need not go together)
        return False


def _with_another(task: Task, key: str) -> Task | None:
    """Return the task with the value of one key from another variant, if one has another."""
    for seed in range(1, 12):
        value = getattr(task.variant(seed).values, key)
        if value != getattr(task.values, key):
            other = task.variant(task.seed)
            setattr(other.values, key, value)
            return other
    return None


def problems(task: Task) -> Iterator[str]:
    """Yield what is wrong with a task, at its seed."""
    found = list(_words(task))
    yield from found
    if found:
        return
    try:
        yield from _results(task)
    except HijackError as error:
        yield f"it cannot be judged in a folder: {type(error).__name__}: {error}"


def shortcomings(task: Task) -> Iterator[str]:
    """Yield what a task of the suite must have, and others should."""
    if len(task.phrasings) < PHRASINGS:
        yield f"it has {len(task.phrasings)} phrasings, not {PHRASINGS}"
    if len(task.wrong_results()) < WRONG_RESULTS and not task.infeasible:
        yield f"it has {len(task.wrong_results())} wrong results, not {WRONG_RESULTS}"
    if len({task.variant(seed).instruction for seed in range(12)}) < PHRASINGS:
        yield "its instruction hardly varies with the seed"
    for app in task.apps:
        if app not in APPS:
            yield f"application {app!r} is not in the table of kit/apps.py"


def _words(task: Task) -> Iterator[str]:
    """Yield what is wrong with the instruction."""
    keys = set(vars(task.values))
    for phrasing in task.phrasings:
        try:
            used = {name for _, name, _, _ in string.Formatter().parse(phrasing)} - {None}
        except ValueError as error:
            yield f"the phrasing {phrasing!r}: {error} (a brace of the text is written twice)"
            continue
        unknown = sorted(f"{{{name}}}" for name in used - keys)
        if unknown:
            yield f"a phrasing uses {', '.join(unknown)}, which draw does not return"
    if len(set(task.phrasings)) < len(task.phrasings):
        yield "two phrasings are the same"
    try:
        read_plan(task.plan())
    except PlanWordsError as error:
        yield f"plan: {error}"


def _results(task: Task) -> Iterator[str]:
    """Yield results that are judged wrongly."""
    good_answer = "FAIL" if task.infeasible else "DONE"
    bad_answer = "DONE" if task.infeasible else "FAIL"
    yield from _judged(task, task, (), "DONE", 0.0, "doing nothing")
    if task.infeasible:
        yield from _judged(task, task, (), "FAIL", 1.0, "FAIL")
    else:
        yield from _judged(
            task, task, (task.right_result,), bad_answer, 0.0, "a right result, and FAIL"
        )
        yield from _judged(task, task, (task.right_result,), good_answer, 1.0, "the right result")
    for label, wrong in task.wrong_results().items():
        yield from _judged(task, task, (wrong,), good_answer, 0.0, f"the wrong result {label!r}")
    done = () if task.infeasible else (task.right_result,)
    for label, damage in _DAMAGES.items():
        yield from _judged(task, task, (*done, damage), good_answer, 0.0, label)


def _remove_bystander(machine: Machine) -> None:
    machine.run("rm", _BYSTANDER)


def _add_file(machine: Machine) -> None:
    machine.write("Documents/left over.txt", "left over")


_DAMAGES: dict[str, Outcome] = {
    "the right result, and another file removed": _remove_bystander,
    "the right result, and another file added": _add_file,
}


def _judged(
    judge: Task, task: Task, steps: Iterable[Outcome], answer: str, score: float, what: str
) -> Iterator[str]:
    """Yield a problem if a result, brought about in a new folder, is not judged as it should be.

    Args:
        judge: The task that judges; the same, or one that asks for something else.
        task: The task that is prepared.
        steps: What brings the result about.
        answer: The last action of the agent.
        score: What it should score.
        what: The result in words.
    """
    with tempfile.TemporaryDirectory(prefix="agenthijack-task-") as folder:
        root = Path(folder)
        home = root / "home"
        home.mkdir()
        machine = Machine(FolderDesktop(home), SiteState(root / "sites"))
        for name in ("Desktop", "Documents", "Downloads", "Music", "Pictures", "Videos"):
            (home / name).mkdir()
        machine.write(_BYSTANDER, "This file was there before.\n")
        task.prepare(machine)
        machine.remember()
        for step in steps:
            step(machine)
        verdict = judge.validate(machine, answer)
    if verdict.score != score:
        yield f"{what} is judged {verdict.score:g}, not {score:g}: {verdict.reason}"
