"""`tasks.jsonl`: one row a task and corruption, complete without the folder of task files."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import ConfigError
from hijack_data.file_io import write_atomic

from . import version_2
from .tasks import OsworldTask, Revision, TaskSet, load, mistakes

CLEAN = "clean"


def paper_nine() -> list[str]:
    """Return the names of the corruptions of the paper, in its order."""
    from hijack_data import corruption

    home = "hijack_data.corruptions."
    return [
        name
        for name in corruption.corruption_names()
        if corruption.find_corruption(name).__module__.startswith(home)
    ]


def corruption_names(clean: bool) -> list[str]:
    """Return the names of the paper's corruptions; with `clean`, `"clean"` before them."""
    return [CLEAN, *paper_nine()] if clean else paper_nine()


def rows(tasks: TaskSet, corruptions: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the rows: the tasks in order, for each the corruptions in the order given."""
    for task in tasks:
        for corruption in corruptions:
            yield {
                "id": f"{task.id}/{corruption}",
                "task_id": task.id,
                "domain": task.domain,
                "corruption": corruption,
                "revision": str(tasks.revision),
                "feasible": task.feasible,
                "instruction": task.instruction,
                "apps": list(task.apps),
                "task": task.config,
            }


def write(tasks: TaskSet, out: Path, clean: bool = False) -> int:
    """Write the rows of all nine corruptions; the same tasks give the same bytes.

    Args:
        tasks: The tasks.
        out: The file.
        clean: Whether each task gets a row without a corruption first.

    Returns:
        How many rows were written.

    Raises:
        HijackError: `out` cannot be written; then nothing is left.
    """
    names = corruption_names(clean)
    lines = [json.dumps(row, ensure_ascii=False) for row in rows(tasks, names)]
    write_atomic(out, "".join(f"{line}\n" for line in lines))
    return len(lines)


def read(path: Path) -> TaskSet:
    """Return a task set from a folder, or the tasks of a `tasks.jsonl`.

    Raises:
        ConfigError: It has mistakes, each named with file, line and field.
    """
    if path.is_dir():
        return load(path)
    return _read_rows(path)


def _read_rows(path: Path) -> TaskSet:
    problems: list[str] = []
    tasks: dict[str, OsworldTask] = {}
    revisions: set[str] = set()
    for number, line in enumerate(_lines(path), 1):
        row, row_problems = _row(line)
        if (
            not row_problems
            and row["task_id"] in tasks
            and tasks[row["task_id"]].config != row["task"]
        ):
            row_problems = [f"task: is not the one of an earlier row of {row['task_id']}"]
        problems.extend(f"{path}:{number}: {text}" for text in row_problems)
        if not row_problems:
            revisions.add(row["revision"])
            tasks[row["task_id"]] = OsworldTask(row["task_id"], row["domain"], row["task"], path)
    if not problems and len(revisions) != 1:
        listed = ", ".join(sorted(revisions))
        problems.append(f"{path}: rows of {len(revisions)} revisions ({listed}); there must be one")
    if problems:
        raise ConfigError(problems)
    name, _, digest = revisions.pop().rpartition("@")
    ordered = sorted(tasks.values(), key=lambda task: (task.domain, task.id))
    return TaskSet(Revision(name, digest), tuple(ordered))


def _lines(path: Path) -> list[str]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError([f"{path}: cannot be read ({error.strerror})"]) from None
    except UnicodeDecodeError as error:
        raise ConfigError([f"{path}: not UTF-8 ({error})"]) from None
    # Not `splitlines`, which also ends a line at U+2028 and the like within an instruction.
    return text.removesuffix("\n").split("\n") if text else []


def _row(line: str) -> tuple[dict[str, Any], list[str]]:
    try:
        value: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        return {}, [f"not JSON ({error})"]
    if not isinstance(value, dict):
        return {}, [f"a row must be an object, not {type(value).__name__}"]
    row = cast("dict[str, Any]", value)
    if row.get("benchmark") == version_2.NAME:
        return row, [version_2.REFUSAL]
    names = ("task_id", "domain", "revision")
    fields = [name for name in names if not isinstance(row.get(name), str)]
    problems = [f"{name}: must be a text, got {row.get(name)!r}" for name in fields]
    if not problems:
        problems = [f"task.{text}" for text in mistakes(row.get("task"), row["task_id"])]
    return row, problems
