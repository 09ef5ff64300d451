"""Test whether tasks can be scored here: 0 if evaluated untouched, 1 once solved.

An error of the evaluator is neither.
"""

import json
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from hijack_data.errors import ConfigError, HijackError, suggest

from .env import OsworldEnv
from .errors import EvaluatorError, TaskRefusedError
from .player import Player, PlayError
from .solutions import SOLUTIONS
from .tasks import OsworldTask, Revision, TaskSet

_Status = Literal["works", "untried", "excluded", "error"]
Groups = Mapping[str, frozenset[str]]
NO_GROUP = "-"
# Seconds of doing nothing before the second evaluation of an untouched task, and before that of a
# solved one.
IDLE_S = 6.0
SETTLE_S = 10.0


@dataclass
class SelfTestRow:
    """The result of one task.

    Args:
        id: The task's id.
        domain: Its domain.
        group: Its group by need, or `NO_GROUP`.
        revision: The revision of the task set.
        instruction: The instruction that the agent gets.
        status: `works` (0 untouched, 1 solved by script or by `FAIL`), `untried` (0 untouched, no
            script here), `excluded` (with the reason), `error` (OSWorld's own code raised).
        reason: Why it is excluded or failed.
        untouched: The score without any action, or `None`.
        solved: The score after the solution, or `None`.
        how: What solved it.
        seconds: How long the test took.
        log: Errors that OSWorld logged while it set the task up or judged it.
    """

    id: str
    domain: str
    group: str
    revision: str
    instruction: str
    status: _Status = "error"
    reason: str = ""
    untouched: float | None = None
    solved: float | None = None
    how: str = ""
    seconds: float = 0.0
    log: list[str] = field(default_factory=list)

    def end(self, status: _Status, reason: str) -> None:
        """Set how the test ended, and why."""
        self.status = status
        self.reason = reason


class _Excluded(HijackError):
    """The reason why a task is not counted."""


def run(
    env: OsworldEnv, task: OsworldTask, revision: Revision, group: str = NO_GROUP
) -> SelfTestRow:
    """Test one task on `env`.

    Errors of OSWorld's own code and of a scripted solution are recorded in the row; the desktop's
    are raised.
    """
    row = SelfTestRow(task.id, task.domain, group, str(revision), task.instruction)
    start = time.monotonic()
    try:
        _judge(env, task, row)
    except TaskRefusedError as error:
        row.end("excluded", "; ".join(error.reasons))
    except _Excluded as error:
        row.end("excluded", str(error))
    except PlayError as error:
        row.end("error", f"its scripted solution failed: {error}")
    except EvaluatorError as error:
        row.end("error", str(error))
        row.log += error.log
    row.seconds = round(time.monotonic() - start, 1)
    return row


def _judge(env: OsworldEnv, task: OsworldTask, row: SelfTestRow) -> None:
    row.untouched = _untouched(env, task, row)
    if row.untouched != 0:
        raise _Excluded(f"scores {row.untouched:g} untouched")
    solution = SOLUTIONS.get(task.id)
    if not task.feasible:
        row.how = "FAIL"
        env.step("FAIL", pause=0)
    elif solution is None:
        row.end("untried", "no scripted solution here")
        return
    else:
        row.how = solution.how
        _reset(env, task, row)
        solution.play(Player(env))
        # OSWorld sleeps twice; its own runs wait 20 s before they evaluate
        env.step("WAIT", pause=SETTLE_S / 2)
    row.solved = _evaluate(env, row)
    if row.solved != 1:
        raise _Excluded(f"scores {row.solved:g} after its solution ({row.how})")
    row.status = "works"


def _untouched(env: OsworldEnv, task: OsworldTask, row: SelfTestRow) -> float:
    """Return the score without any action: after the reset and, if that is 0, some seconds later.

    Applications write their files late: chrome 99146c54 scores 0 at once and 1 some seconds later.
    """
    _reset(env, task, row)
    score = _evaluate(env, row)
    if score == 0 and task.feasible:
        env.step("WAIT", pause=IDLE_S / 2)  # OSWorld sleeps twice
        score = _evaluate(env, row)
    return score


def _reset(env: OsworldEnv, task: OsworldTask, row: SelfTestRow) -> None:
    env.reset(task.config)
    failed = [line for line in env.warnings if line.startswith("ERROR")]
    row.log += failed
    if failed:
        raise _Excluded(f"its setup fails here: {failed[0]}")


def _evaluate(env: OsworldEnv, row: SelfTestRow) -> float:
    score = env.evaluate()
    row.log += env.warnings
    return score


@dataclass
class Results:
    """Rows of one run and what they were obtained with."""

    revision: Revision
    about: dict[str, Any]
    rows: list[SelfTestRow] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Whether no task ended in an error."""
        return not any(row.status == "error" for row in self.rows)

    def count(self, status: _Status) -> int:
        """Return how many tasks have a status."""
        return sum(row.status == status for row in self.rows)

    def summary(self) -> str:
        """Return one line."""
        parts = ", ".join(f"{self.count(status)} {status}" for status in get_args(_Status))
        return f"{len(self.rows)} tasks of {self.revision}: {parts}"

    def as_json(self) -> dict[str, Any]:
        """Return all of it as JSON data."""
        return {
            "revision": str(self.revision),
            "about": self.about,
            "tasks": [asdict(row) for row in self.rows],
        }

    def as_markdown(self) -> str:
        """Return a table, one row a task."""
        head = "| group | task | untouched | solved | by | status |\n|---|---|---|---|---|---|\n"
        return head + "".join(f"{_line(row)}\n" for row in self.rows)


def _line(row: SelfTestRow) -> str:
    text = f"{row.status}: {row.reason}" if row.reason else row.status
    cells = (
        row.group,
        f"{row.domain} {row.id[:8]}",
        _score(row.untouched),
        _score(row.solved),
        row.how or "-",
        text.replace("|", "/").replace("\n", " "),
    )
    return f"| {' | '.join(cells)} |"


def _score(score: float | None) -> str:
    return "-" if score is None else f"{score:g}"


def run_all(
    env: OsworldEnv,
    tasks: TaskSet,
    groups: Groups,
    about: Mapping[str, Any],
    tell: Callable[[SelfTestRow, Results], object] = lambda *_: None,
) -> Results:
    """Test all tasks, one after the other; `tell` is called with each row, and all so far."""
    results = Results(tasks.revision, dict(about))
    for task in tasks:
        row = run(env, task, tasks.revision, _find_group(task.id, groups))
        results.rows.append(row)
        tell(row, results)
    return results


def read_groups(path: Path) -> Groups:
    """Read groups of tasks from a file such as `feasibility.json`.

    Args:
        path: The file; it holds `{group: [[domain, id], ...]}`.

    Returns:
        `{group: ids}`.

    Raises:
        ConfigError: The file cannot be read, or holds something else.
    """
    groups: dict[str, frozenset[str]] = {}
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
        for name, pairs in value.items():
            groups[str(name)] = frozenset(str(task) for _, task in pairs)
        return groups
    except (OSError, ValueError, AttributeError, TypeError, RecursionError) as error:
        raise ConfigError([f"{path}: must hold {{group: [[domain, id], ...]}} ({error})"]) from None


def choose(tasks: TaskSet, groups: Groups, names: Iterable[str]) -> TaskSet:
    """Return the tasks that `names` lists, or all if it is empty.

    Args:
        tasks: The task set.
        groups: Groups of tasks.
        names: Names of groups, ids, or beginnings of ids.

    Raises:
        ConfigError: A name is neither.
    """
    ids: list[str] = []
    for name in names:
        if name in groups:
            ids += [task.id for task in tasks if task.id in groups[name]]
        elif any(task.id.startswith(name) for task in tasks):
            ids.append(name)
        else:
            raise ConfigError([f"{name!r} is neither a group nor a task{suggest(name, groups)}"])
    if not ids:
        return tasks
    return tasks.only(ids)


def _find_group(task: str, groups: Groups) -> str:
    return next((name for name, ids in groups.items() if task in ids), NO_GROUP)
