"""Folders of results as OSWorld's scripts leave them: `.../MODEL/DOMAIN/TASK/result.txt`.

Above the model are the action space and the observation, in runs of OSWorld and OSWorld-Verified;
runs under corruptions have a folder with the name of the corruption anywhere above the domain.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hijack_data.corruption import corruption_names
from hijack_data.errors import shorten_list
from hijack_data.plan import CLEAN

from ..outcomes import EpisodeOutcome, OutcomeError

RESULT = "result.txt"
_TASK_FILES = frozenset({RESULT, "traj.jsonl", "runtime.log"})  # any of these makes a task's folder
_ACTION_SPACES = frozenset({"pyautogui", "computer_13", "claude_computer_use"})
_OBSERVATIONS = frozenset({"screenshot", "a11y_tree", "screenshot_a11y_tree", "som"})


@dataclass(frozen=True)
class _Layout:
    """Which folder above the domain says what, by its position from the source.

    Attributes:
        agent: the folder of the model; `None` if the source is it.
        condition: the folder of the corruption; `None` if all is clean.
        protocol: the folders of action space and observation.
    """

    agent: int | None
    condition: int | None
    protocol: tuple[int, ...]


class OSWorldReader:
    """Reads a folder of results; a task without `result.txt` has no outcome.

    `--columns condition=N,agent=N` say which folder below the source has them, counted from 1,
    where names do not tell.
    """

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
        protocols = {tuple(parts[at] for at in layout.protocol) for parts in above.values()}
        for folder, parts in above.items():
            agent = source.resolve().name if layout.agent is None else parts[layout.agent]
            if len(protocols) > 1:  # models may have been played in two ways
                agent += f" ({'/'.join(parts[at] for at in layout.protocol)})"
            label = CLEAN if layout.condition is None else parts[layout.condition]
            score = _read_score(folder / RESULT)
            yield EpisodeOutcome(
                agent=agent,
                task=f"{folder.parent.name}/{folder.name}",
                condition=_condition(label) or label,
                score=score,
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
    condition = _stated(source, values, columns, "condition")
    agent = _stated(source, values, columns, "agent")
    protocol: list[int] = []
    others: list[int] = []
    for at, names in enumerate(values):
        unknown = [name for name in names if _condition(name) is None]
        if at in (condition, agent):
            continue
        if set(names) <= _ACTION_SPACES | _OBSERVATIONS:
            protocol.append(at)
        elif len(unknown) == len(names):
            others.append(at)
        elif unknown or condition is not None:
            raise OutcomeError(
                f"{source}: it is not clear whether {shorten_list(unknown or names, 5)} are"
                f" conditions; --columns condition={at + 1} says so"
            )
        else:
            condition = at
    varying = [at for at in others if len(values[at]) > 1]
    if len(varying) > (agent is None):
        raise OutcomeError(
            f"{source}: it is not clear what its folders say"
            f" ({'; '.join(shorten_list(values[at], 3) for at in varying)}); give the number of"
            f" each, such as --columns condition={varying[0] + 1},agent={varying[-1] + 1}"
        )
    if agent is None:
        agent = next(iter([*varying, *others[::-1]]), None)
    return _Layout(agent, condition, tuple(protocol))


def _stated(
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


def _condition(part: str) -> str | None:
    """Return the corruption that a folder is named after, whatever joins its words."""
    plain = _plain(part)
    for name in (CLEAN, *corruption_names()):
        if plain == _plain(name):
            return name
    return None


def _plain(text: str) -> str:
    return "".join(filter(str.isalnum, text.lower()))


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
    try:
        score = float(text)
    except ValueError:
        score = -1.0
    if not 0 <= score <= 1:
        raise OutcomeError(
            f"{path}: must hold a score from 0 to 1, got {text[:60]!r}; remove the file if the"
            " episode has no outcome"
        )
    return score
