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
from .machine import Machine
from .plan_words import PlanWordsError, read_plan
from .task_apps import APPS

if TYPE_CHECKING:
    from ..embedded.desktop import EmbeddedDesktop

MIN_WRONG_RESULTS = 3  # of a task of the suite
MIN_PHRASINGS = 3
SEEDS = 3  # variants that are checked
_BYSTANDER = "Documents/bystander.txt"


def task_names(file: LoadedFile) -> list[str]:
    """Return the names of the tasks in a loaded file: those it registers, and its own classes."""
    names = list(file.names.get("task", ()))
    classes = [TASKS.get(name) for name in names]
    for title, value in vars(sys.modules[file.module]).items():
        is_own = isinstance(value, type) and value.__module__ == file.module
        if is_own and issubclass(value, Task) and value not in classes:
            names.append(TASKS.find(f"{file.path}:{title}"))
    return names


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
        notes = (*shortcomings(task_class(0)), *ignored_values(task_class(0)))
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        judged = judged or f"another seed: {_describe_error(task_class, error)}"
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
        yield from _desktop_results(task_class(0), desktop)


def _first_problems(task_class: type[Task]) -> str:
    """Return what is wrong at the first seed at which something is; "" if nothing is."""
    for seed in range(SEEDS):
        try:
            task_problems = list(problems(task_class(seed)))
        except Exception as error:  # noqa: BLE001  (a task may raise anything)
            task_problems = [_describe_error(task_class, error)]
        if task_problems:
            return f"seed {seed}: {'; '.join(task_problems)}"
    return ""


def _describe_error(task_class: type[Task], error: Exception) -> str:
    """Return an error with the line of the task's file that led to it."""
    task_file = getattr(sys.modules.get(task_class.__module__), "__file__", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == task_file]
    location = f" ({Path(task_file).name}, line {lines[-1]})" if task_file and lines else ""
    return f"{type(error).__name__}: {error}{location}"


def _desktop_results(task: Task, desktop: "EmbeddedDesktop") -> Iterator[Result | str]:
    """Yield what happens on a desktop."""
    machine = Machine(desktop, SiteState(desktop.record["sites"]))
    at_first = machine.snapshot().files
    try:
        task.setup(machine)
    except MissingPackageError as error:
        yield f"oracle, doing nothing and teardown: {error}"
        return
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        problem = _describe_error(type(task), error)
        yield Result("setup", "the task is prepared on a desktop", problem)
        return
    idle = task.validate(machine)
    problem = f"doing nothing is judged {idle.score:g}" if idle.score else ""
    yield Result("do_nothing", "doing nothing scores 0", problem)
    desktop.reset()  # a task is not played on after it was judged
    machine = Machine(desktop, SiteState(desktop.record["sites"]))
    task.setup(machine)
    yield Result("oracle", "the oracle does the task", _oracle_problem(task, machine))
    task.teardown(machine)
    leftover_files = sorted(machine.snapshot().files.keys() - at_first.keys())
    problem = f"teardown leaves {', '.join(leftover_files[:5])}" if leftover_files else ""
    yield Result("teardown", "teardown removes what the task added", problem)


def _oracle_problem(task: Task, machine: Machine) -> str:
    """Return why the oracle did not do the task; "" if it did."""
    answer = "DONE"
    try:
        task.oracle(Hand(machine.desktop))
    except GiveUpError:
        answer = "FAIL"
    except Exception as error:  # noqa: BLE001  (a task may raise anything)
        return _describe_error(type(task), error)
    verdict = task.validate(machine, answer)
    return "" if verdict.passed else verdict.reason


def ignored_values(task: Task) -> Iterator[str]:
    """Yield what the instruction names and the judgement seems to ignore.

    Each value of the instruction is replaced in turn by that of another variant; the right result
    of the present one should then be wrong. That is a hint: a value may only say where to look.
    """
    if task.infeasible:
        return
    keys: set[str] = set()
    for phrasing in task.phrasings:
        keys |= {name for _, name, _, _ in string.Formatter().parse(phrasing) if name}
    for key in sorted(keys):
        changed_task = _with_changed_value(task, key)
        if changed_task is None:
            continue
        if _is_judged_alike(changed_task, task):
            yield f"the instruction names {key!r}, and another value would be judged the same"


def _is_judged_alike(changed_task: Task, task: Task) -> bool:
    """Return whether a task with another value takes the right result of the first for right."""
    try:
        return any(_judgement_problems(changed_task, task, (task.right_result,), "DONE", 0.0, ""))
    except Exception:  # noqa: BLE001  (values that two seeds drew need not go together)
        return False


def _with_changed_value(task: Task, key: str) -> Task | None:
    """Return the task with the value of one key from another variant, if one has another."""
    for seed in range(1, 12):
        value = getattr(task.variant(seed).values, key)
        if value != getattr(task.values, key):
            changed_task = task.variant(task.seed)
            setattr(changed_task.values, key, value)
            return changed_task
    return None


def problems(task: Task) -> Iterator[str]:
    """Yield what is wrong with a task, at its seed."""
    problems_found = list(_instruction_problems(task))
    yield from problems_found
    if problems_found:
        return
    try:
        yield from _result_problems(task)
    except HijackError as error:
        yield f"it cannot be judged in a folder: {type(error).__name__}: {error}"


def shortcomings(task: Task) -> Iterator[str]:
    """Yield what a task of the suite must have, and others should."""
    if len(task.phrasings) < MIN_PHRASINGS:
        yield f"it has {len(task.phrasings)} phrasings, not {MIN_PHRASINGS}"
    if len(task.wrong_results()) < MIN_WRONG_RESULTS and not task.infeasible:
        yield f"it has {len(task.wrong_results())} wrong results, not {MIN_WRONG_RESULTS}"
    if len({task.variant(seed).instruction for seed in range(12)}) < MIN_PHRASINGS:
        yield "its instruction hardly varies with the seed"
    for app in task.apps:
        if app not in APPS:
            yield f"application {app!r} is not in the table of tasks/task_apps.py"


def _instruction_problems(task: Task) -> Iterator[str]:
    """Yield what is wrong with the instruction."""
    keys = set(vars(task.values))
    for phrasing in task.phrasings:
        try:
            names = {name for _, name, _, _ in string.Formatter().parse(phrasing)} - {None}
        except ValueError as error:
            yield f"the phrasing {phrasing!r}: {error} (a brace of the text is written twice)"
            continue
        unknown = sorted(f"{{{name}}}" for name in names - keys)
        if unknown:
            yield f"a phrasing uses {', '.join(unknown)}, which draw does not return"
    if len(set(task.phrasings)) < len(task.phrasings):
        yield "two phrasings are the same"
    try:
        read_plan(task.plan())
    except PlanWordsError as error:
        yield f"plan: {error}"


def _result_problems(task: Task) -> Iterator[str]:
    """Yield results that are judged wrongly."""
    good_answer = "FAIL" if task.infeasible else "DONE"
    bad_answer = "DONE" if task.infeasible else "FAIL"
    yield from _judgement_problems(task, task, (), "DONE", 0.0, "doing nothing")
    if task.infeasible:
        yield from _judgement_problems(task, task, (), "FAIL", 1.0, "FAIL")
    else:
        yield from _judgement_problems(
            task, task, (task.right_result,), bad_answer, 0.0, "a right result, and FAIL"
        )
        yield from _judgement_problems(
            task, task, (task.right_result,), good_answer, 1.0, "the right result"
        )
    for label, outcome in task.wrong_results().items():
        yield from _judgement_problems(
            task, task, (outcome,), good_answer, 0.0, f"the wrong result {label!r}"
        )
    steps = () if task.infeasible else (task.right_result,)
    for label, damage in _DAMAGES.items():
        yield from _judgement_problems(task, task, (*steps, damage), good_answer, 0.0, label)


def _remove_bystander(machine: Machine) -> None:
    machine.run("rm", _BYSTANDER)


def _add_file(machine: Machine) -> None:
    machine.write("Documents/left over.txt", "left over")


_DAMAGES: dict[str, Outcome] = {
    "the right result, and another file removed": _remove_bystander,
    "the right result, and another file added": _add_file,
}


def _judgement_problems(
    judge: Task, task: Task, steps: Iterable[Outcome], answer: str, score: float, description: str
) -> Iterator[str]:
    """Yield a problem if a result, brought about in a new folder, is not judged as it should be.

    Args:
        judge: The task that judges; the same, or one that asks for something else.
        task: The task that is prepared.
        steps: What brings the result about.
        answer: The last action of the agent.
        score: What it should score.
        description: The result in words.
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
        yield f"{description} is judged {verdict.score:g}, not {score:g}: {verdict.reason}"
