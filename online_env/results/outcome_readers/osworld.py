"""Folders of results as OSWorld's scripts leave them: `.../MODEL/DOMAIN/TASK/result.txt`.

OSWorld and OSWorld-Verified write `ACTION_SPACE/OBSERVATION/MODEL/DOMAIN/TASK`. The authors of
AgentHijack write `ACTION_SPACE/OBSERVATION/NOISE/MODEL/DOMAIN/TASK`, and with several machines
`.../MODEL/TRIAL/DOMAIN/TASK`, where TRIAL is a number. The noise is read wherever a folder has the
name of a corruption, also where it is the source itself, or the folder that the source lies in.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hijack_data.errors import shorten_list
from hijack_data.plan import CLEAN

from ..outcomes import EpisodeOutcome, OutcomeError
from .result_folders import condition_name

RESULT = "result.txt"
_TASK_FILES = frozenset({RESULT, "traj.jsonl", "runtime.log"})  # any of these makes a task's folder
_ACTION_SPACES = frozenset({"pyautogui", "computer_13", "claude_computer_use"})
_OBSERVATIONS = frozenset({"screenshot", "a11y_tree", "screenshot_a11y_tree", "som"})


@dataclass(frozen=True)
class _Layout:
    """Which folder above the domain says what, by its position from the source.

    Attributes:
        agent: the folder of the model; `None` if the source is it.
        condition: the folder of the corruption; `None` if none below the source is named so.
        trial: the folder of the repetition; `None` if there is none.
        protocol: the folders of action space and observation.
    """

    agent: int | None
    condition: int | None
    trial: int | None
    protocol: tuple[int, ...]


class OSWorldReader:
    """Reads a folder of results; a task without `result.txt` has no outcome.

    `--columns condition=N,agent=N` say which folder below the source has them, counted from 1,
    where names do not tell.
    """

    fields = ("condition", "agent")

    def detect(self, source: Path) -> bool:
        """Return whether a folder holds a `result.txt` in the folder of a task."""
        return source.is_dir() and any(
            (folder / RESULT).exists() for folder in _task_folders(source)
        )

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcome of each task, in the order of the folders.

        Args:
            source: the folder.
            columns: the number of a folder for `condition` and `agent`.

        Raises:
            OutcomeError: a `result.txt` holds no score, or a number names no folder.
        """
        folders = sorted(_task_folders(source))
        above = {folder: folder.relative_to(source).parts[:-2] for folder in folders}
        layout = _find_layout(source, list(above.values()), columns)
        outer = _outer_condition(source)
        protocols = {tuple(parts[at] for at in layout.protocol) for parts in above.values()}
        for folder, parts in above.items():
            agent = source.resolve().name if layout.agent is None else parts[layout.agent]
            if len(protocols) > 1:  # models may have been played in two ways
                agent += f" ({'/'.join(parts[at] for at in layout.protocol)})"
            label = outer if layout.condition is None else parts[layout.condition]
            score = _read_score(folder / RESULT)
            yield EpisodeOutcome(
                agent=agent,
                task=f"{folder.parent.name}/{folder.name}",
                condition=condition_name(label) or label,
                score=score,
                seed=None if layout.trial is None else int(parts[layout.trial]),
                problem="" if score is not None else f"has no {RESULT}",
            )


def _task_folders(source: Path) -> Iterator[Path]:
    """Yield the folders of tasks: DOMAIN/TASK below the source."""
    for base, folders, files in os.walk(source):
        folders.sort()
        if not _TASK_FILES.isdisjoint(files) and Path(base) != source:
            folders.clear()
            if len(Path(base).relative_to(source).parts) >= 2:
                yield Path(base)


def _find_layout(
    source: Path, above: Sequence[tuple[str, ...]], columns: Mapping[str, str]
) -> _Layout:
    """Return which folder says what; one that nothing explains is an error.

    Raises:
        OutcomeError: tasks lie at different depths, or it is not clear what a folder says.
    """
    depths = {len(parts) for parts in above}
    if len(depths) > 1:
        raise OutcomeError(
            f"{source}: its tasks lie at different depths; give the folders as several sources"
        )
    values = [sorted(set(column)) for column in zip(*above, strict=True)]
    condition = _column_position(source, values, columns, "condition")
    agent = _column_position(source, values, columns, "agent")
    protocol: list[int] = []
    other_levels: list[int] = []
    trial: int | None = None
    for at, names in enumerate(values):
        unknown = [name for name in names if condition_name(name) is None]
        if at in (condition, agent):
            continue
        if set(names) <= _ACTION_SPACES | _OBSERVATIONS:
            protocol.append(at)
        elif at == len(values) - 1 and all(map(str.isdecimal, names)):
            trial = at
        elif len(unknown) == len(names):
            other_levels.append(at)
        elif unknown or condition is not None:
            raise OutcomeError(
                f"{source}: it is not clear whether {shorten_list(unknown or names, 5)} are"
                f" conditions; --columns condition={at + 1} says so"
            )
        else:
            condition = at
    varying = [at for at in other_levels if len(values[at]) > 1]
    # After action space and observation comes the model: another folder may be a condition.
    inner = [at for at in other_levels if at > max(protocol, default=-1)]
    if len(varying) <= (agent is None) < len(inner):
        varying = inner
    if len(varying) > (agent is None):
        raise OutcomeError(
            f"{source}: it is not clear what its folders say"
            f" ({'; '.join(shorten_list(values[at], 3) for at in varying)}); give the number of"
            f" each, such as --columns condition={varying[0] + 1},agent={varying[-1] + 1}"
        )
    if agent is None:
        agent = next(iter([*varying, *other_levels[::-1]]), None)
    return _Layout(agent, condition, trial, tuple(protocol))


def _outer_condition(source: Path) -> str:
    """Return the condition that the source, or the folder that it lies in, is named after."""
    folder = source.resolve()
    return condition_name(folder.name) or condition_name(folder.parent.name) or CLEAN


def _column_position(
    source: Path, values: Sequence[Sequence[str]], columns: Mapping[str, str], field: str
) -> int | None:
    """Return the position of the folder that `--columns` states; `None` if it states none.

    Raises:
        OutcomeError: there is no such folder.
    """
    if field not in columns:
        return None
    number = columns[field]
    if not number.isdecimal() or not 1 <= int(number) <= len(values):
        raise OutcomeError(
            f"--columns {field}={number}: must be the number of a folder between {source} and the"
            f" domain, 1 to {len(values)}"
        )
    return int(number) - 1


def _read_score(path: Path) -> float | None:
    """Return the score in a `result.txt`; `None` if there is no such file.

    Raises:
        OutcomeError: it holds anything but a number in 0..1.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace").strip()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutcomeError(f"{path}: cannot be read ({error.strerror or error})") from None
    try:  # OSWorld writes what its evaluator returns, which may be a bool
        score = float(text) if text not in ("True", "False") else float(text == "True")
    except ValueError:
        score = -1.0
    if not 0 <= score <= 1:  # nor NaN
        raise OutcomeError(
            f"{path}: must hold a score from 0 to 1, got {text[:60]!r}; remove the file if the"
            " episode has no outcome"
        )
    return score
