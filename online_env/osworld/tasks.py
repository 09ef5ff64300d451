"""OSWorld's task files: 369 JSON files in a folder by domain, in one revision or another.

The revisions differ in instructions and evaluators while the ids are the same, so every result
names its revision: always by a digest of the files, and by a name if that is known.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import ConfigError, ParameterError

from . import version_2

_Task = dict[str, Any]
# Digests of whole sets, as `load` computes them.
KNOWN_REVISIONS = {"55ea33168597": "osworld-verified", "7acd17614676": "agenthijack-fork"}
DIGEST_CHARS = 12


@dataclass(frozen=True)
class Revision:
    """A set of task files; `name` is `"unknown"` if `digest` is not that of a known set."""

    name: str
    digest: str

    def __str__(self) -> str:
        return f"{self.name}@{self.digest}"


@dataclass(frozen=True)
class OsworldTask:
    """One task: `config` is the file's content as OSWorld takes it."""

    id: str
    domain: str
    config: _Task
    path: Path

    @property
    def instruction(self) -> str:
        """The instruction that the agent gets."""
        return self.config["instruction"]

    @property
    def apps(self) -> tuple[str, ...]:
        """The applications that the task names, in its order."""
        return tuple(self.config.get("related_apps", ()))

    @property
    def feasible(self) -> bool:
        """Whether it can be done; if not, the right last action is `FAIL`."""
        return self.config["evaluator"].get("func") != "infeasible"


@dataclass(frozen=True)
class TaskSet:
    """Tasks in order of domain and id, and the revision that they are of."""

    revision: Revision
    tasks: tuple[OsworldTask, ...]

    def __iter__(self) -> Iterator[OsworldTask]:
        return iter(self.tasks)

    def __len__(self) -> int:
        return len(self.tasks)

    def only(self, ids: Iterable[str]) -> "TaskSet":
        """Return the tasks with these ids, or unique beginnings of ids.

        Raises:
            ParameterError: One fits no task, or several.
        """
        kept_ids = {self._find_id(prefix) for prefix in ids}
        return TaskSet(self.revision, tuple(task for task in self.tasks if task.id in kept_ids))

    def _find_id(self, prefix: str) -> str:
        matches = [task.id for task in self.tasks if task.id.startswith(prefix)] if prefix else []
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise ParameterError(f"task {prefix!r} fits {len(matches)} tasks; write more of it")
        raise ParameterError(f"task {prefix!r} is not in this set")


def load(folder: Path) -> TaskSet:
    """Read a task set.

    Args:
        folder: It holds `examples/<domain>/<id>.json`, or `<domain>/<id>.json` itself.

    Raises:
        ConfigError: Lists every file and field that is wrong.
    """
    root, paths = _task_files(folder)
    if is_version_2(folder):
        raise ConfigError([f"{folder}: {version_2.REFUSAL}"])
    if not paths:
        raise ConfigError(
            [f"{folder}: no task files; expected examples/<domain>/<id>.json as in OSWorld"]
        )
    problems: list[str] = []
    hasher = hashlib.sha256()
    tasks: list[OsworldTask] = []
    for path in paths:
        data = _read(path, problems)
        name = path.relative_to(root).as_posix()
        content = hashlib.sha256(data).hexdigest()
        hasher.update(f"{name}\0{content}\n".encode())
        config = _parse(data, path, problems)
        if config is not None:
            tasks.append(OsworldTask(config["id"], path.parent.name, config, path))
    problems.extend(_doubles(tasks))
    if problems:
        raise ConfigError(problems)
    digest = hasher.hexdigest()[:DIGEST_CHARS]
    revision = Revision(KNOWN_REVISIONS.get(digest, "unknown"), digest)
    return TaskSet(revision, tuple(tasks))


def is_version_2(folder: Path) -> bool:
    """Return whether a folder has tasks of OSWorld 2.0, and none of those that `load` reads."""
    return not _task_files(folder)[1] and bool(version_2.find_files(folder))


def _task_files(folder: Path) -> tuple[Path, list[Path]]:
    """Return the folder that holds the domains, and the task files in it."""
    root = folder / "examples" if (folder / "examples").is_dir() else folder
    return root, sorted(root.glob("*/*.json")) if root.is_dir() else []


def load_file(path: Path) -> OsworldTask:
    """Read one task from its file, `<domain>/<id>.json`.

    Raises:
        ConfigError: Lists every field that is wrong.
    """
    problems: list[str] = []
    config = _parse(_read(path, problems), path, problems)
    if config is None:
        raise ConfigError(problems or [f"{path}: is empty; a task of OSWorld is an object"])
    return OsworldTask(config["id"], path.resolve().parent.name, config, path)


def _read(path: Path, problems: list[str]) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        problems.append(f"{path}: cannot be read ({error.strerror})")
        return b""


def _parse(data: bytes, path: Path, problems: list[str]) -> _Task | None:
    try:
        config: object = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # UnicodeDecodeError is a ValueError
        if data:
            problems.append(f"{path}: not JSON in UTF-8 ({error})")
        return None
    file_problems = list(mistakes(config, path.stem))
    problems.extend(f"{path}: {text}" for text in file_problems)
    return None if file_problems else cast(_Task, config)


def mistakes(config: object, name: str | None = None) -> Iterator[str]:
    """Yield the mistakes in one task's content, field by field.

    Args:
        config: The content of a task file.
        name: What its id has to be, if that is known.
    """
    if not isinstance(config, Mapping):
        yield f"the file must hold an object, not {type(config).__name__}"
        return
    task = cast(Mapping[str, Any], config)
    for field in ("id", "instruction"):
        value = task.get(field)
        if not isinstance(value, str) or not value:
            yield f"{field}: must be a text that is not empty, got {value!r}"
    if name is not None and isinstance(task.get("id"), str) and task["id"] != name:
        yield f"id: is {task['id']!r}, the file's name says {name!r}"
    apps = task.get("related_apps", [])
    if not _is_list(apps, str):
        yield f"related_apps: must be a list of texts, got {apps!r}"
    yield from _bad_steps(task.get("config", []), "config")
    evaluator = task.get("evaluator")
    if isinstance(evaluator, Mapping):
        yield from _bad_evaluator(cast(Mapping[str, Any], evaluator))
    else:
        yield f"evaluator: must be an object, got {evaluator!r}"


def _bad_evaluator(evaluator: Mapping[str, Any]) -> Iterator[str]:
    func = evaluator.get("func")
    names = _as_list(func)
    if not names or not all(isinstance(item, str) and item for item in names):
        yield f"evaluator.func: must be a name or a list of names, got {func!r}"
    for field in ("result", "expected"):
        for index, row in enumerate(_as_list(evaluator.get(field))):
            if row and not isinstance(_object(row).get("type"), str):
                yield f"evaluator.{field}[{index}]: must be an object with a `type`, got {row!r}"
    if isinstance(func, list) and "infeasible" in names:
        yield f"evaluator.func: 'infeasible' stands alone, and not in a list, got {func!r}"
    # OSWorld takes any other word for "or".
    conj = evaluator.get("conj", "and")
    if conj not in ("and", "or"):
        yield f"evaluator.conj: must be 'and' or 'or', got {conj!r}"
    for field in ("result", "expected", "options"):
        value = evaluator.get(field)
        is_alike = isinstance(value, list) == isinstance(func, list)
        if value and not (is_alike and len(_as_list(value)) == len(names)):
            rule = f"a list of {len(names)}, one for each" if isinstance(func, list) else "one, for"
            yield f"evaluator.{field}: must be {rule} evaluator.func, got {value!r:.200}"
    yield from _bad_steps(evaluator.get("postconfig", []), "evaluator.postconfig")


def _bad_steps(steps: object, field: str) -> Iterator[str]:
    if not isinstance(steps, list):
        yield f"{field}: must be a list of steps, got {steps!r}"
        return
    for index, step in enumerate(cast(list[Any], steps)):
        kind = _object(step).get("type")
        parameters = _object(step).get("parameters")
        if not isinstance(kind, str) or not isinstance(parameters, Mapping):
            yield f"{field}[{index}]: must be an object with `type` and `parameters`, got {step!r}"
        elif kind == "download" and not _is_list(_object(parameters).get("files", []), Mapping):
            files = _object(parameters).get("files")
            rule = "must be a list of objects with `url` and `path`"
            yield f"{field}[{index}].parameters.files: {rule}, got {files!r}"


def _is_list(value: object, item_type: type) -> bool:
    if not isinstance(value, list):
        return False
    return all(isinstance(item, item_type) for item in cast(list[Any], value))


def _as_list(value: object) -> list[Any]:
    return cast(list[Any], value) if isinstance(value, list) else [value]


def _object(value: object) -> Mapping[str, Any]:
    """Return an object of JSON as it is, and anything else as an empty one."""
    return cast(Mapping[str, Any], value) if isinstance(value, Mapping) else {}


def _doubles(tasks: list[OsworldTask]) -> Iterator[str]:
    paths: dict[str, Path] = {}
    for task in tasks:
        if task.id in paths:
            yield f"{task.path}: id: {task.id!r} is also that of {paths[task.id]}"
        paths[task.id] = task.path
