"""OSWorld 2.0's tasks: listed and planned here, and played by none of our commands.

A task is a Python module `task_NNN.py` with a subclass of OSWorld 2.0's `BaseTask`, whose methods
`setup` and `evaluate` drive its own environment. The modules are parsed and never run, so what they
compute is not known: `instruction` may have `{...}` where only running the module would tell.
"""

import ast
import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import ConfigError
from hijack_data.file_io import write_atomic

NAME = "osworld-2.0"
TASK_FILES = "task_*.py"
FOLDERS = ("", "task_class", "evaluation_examples/task_class")  # where a checkout has the files
REFUSAL = (
    "these are tasks of OSWorld 2.0, Python programs for its own environment, guest image and"
    " services: they can be listed (hijack osworld needs, hijack osworld tasks), and not be played;"
    " docs/osworld.md says what is missing"
)
MAX_BYTES = 2**21
DIGEST_CHARS = 12
MAX_DEPTH = 16  # of constants that are made of constants
_BASES = ("BaseTask", "MultiPhaseTask")
_TEXTS = ("id", "instruction")
_SIMULATOR = "user_simulator"
_MISSING = object()
# What brings each kind of need. Nothing of ours brings any of them.
NEEDS: Mapping[str, str] = {
    "runner": "OSWorld 2.0's DesktopEnv, which runs the task's Python on the machine, and its guest"
    " image (Ubuntu with GNOME)",
    "phases": "a runner that plays several phases, each with an instruction of its own",
    "user": "its user simulator, which answers questions of the agent",
    "judge": "a model that judges the result, with a key",
    "sites": "its mocked web sites, served under WEBSITE_HOST_SUFFIX",
    "gitlab": "a GitLab of its own (GITLAB_URL, GITLAB_PRIVATE_TOKEN)",
    "proxy": "a proxy to sites of the internet",
    "assets": "its gated files (OSWORLD_FILE_BASE_URL)",
    "software": "the internet, from which its set-up installs software",
    "disk": "a larger machine",
}
# Identifiers that a module has if it needs something; `*` stands for any beginning.
_MARKS: Mapping[str, tuple[str, ...]] = {
    "phases": ("MultiPhaseTask", "get_phases"),
    "user": (),
    "judge": ("model_client", "llm_metrics", "generate_text", "*_with_llm"),
    "sites": ("build_website_url", "prepare_stateful_website_urls", "WEBSITE_HOST_SUFFIX"),
    "gitlab": ("GITLAB_URL", "gitlab"),
    "assets": ("asset",),
}
_SITE_MODULE = "desktop_env.controllers.website"
_INSTALLS = re.compile(r"\b(?:apt(?:-get)?|pip3?|snap|flatpak|npm) install\b")


@dataclass(frozen=True, kw_only=True)
class Version2Task:
    """What a task's file says.

    Attributes:
        id: the task's id, such as `"001"`.
        instruction: what the agent gets; `{...}` where only running the file would tell.
        apps: the applications, and sites, that the task names.
        needs: what it needs by kind (a key of `NEEDS`), in words.
        path: the file.
    """

    id: str
    instruction: str
    apps: tuple[str, ...]
    needs: Mapping[str, str]
    path: Path


@dataclass(frozen=True)
class Version2Set:
    """Tasks in order of their files, and the digest of these."""

    digest: str
    tasks: tuple[Version2Task, ...]

    @property
    def revision(self) -> str:
        """The benchmark and the digest of the files."""
        return f"{NAME}@{self.digest}"


def find_files(folder: Path) -> list[Path]:
    """Return the task files of a folder, or of a checkout of OSWorld 2.0; empty without any."""
    for name in FOLDERS:
        paths = sorted((folder / name).glob(TASK_FILES))
        if paths:
            return paths
    return []


def load(folder: Path) -> Version2Set:
    """Read the tasks of a folder.

    Raises:
        ConfigError: Lists every file that is wrong, or says that there is none.
    """
    paths = find_files(folder)
    if not paths:
        raise ConfigError([f"{folder}: no {TASK_FILES}; those of OSWorld 2.0 are gated data"])
    problems: list[str] = []
    hasher = hashlib.sha256()
    tasks: dict[str, Version2Task] = {}
    for path in paths:
        try:
            data = path.read_bytes()
        except OSError as error:
            problems.append(f"{path}: cannot be read ({error.strerror})")
            continue
        hasher.update(f"{path.name}\0{hashlib.sha256(data).hexdigest()}\n".encode())
        task = _read(data, path, problems)
        if task is not None and task.id in tasks:
            problems.append(f"{path}: id: {task.id!r} is also that of {tasks[task.id].path}")
        elif task is not None:
            tasks[task.id] = task
    if problems:
        raise ConfigError(problems)
    return Version2Set(hasher.hexdigest()[:DIGEST_CHARS], tuple(tasks.values()))


def write_rows(tasks: Version2Set, corruptions: Sequence[str], out: Path) -> int:
    """Write a row for every task and corruption, each with what the task needs; return how many.

    Raises:
        HijackError: `out` cannot be written; then nothing is left.
    """
    rows = [
        {
            "id": f"{task.id}/{corruption}",
            "benchmark": NAME,
            "task_id": task.id,
            "corruption": corruption,
            "revision": tasks.revision,
            "instruction": task.instruction,
            "apps": list(task.apps),
            "needs": dict(task.needs),
            "can_be_played": False,
        }
        for task in tasks.tasks
        for corruption in corruptions
    ]
    write_atomic(out, "".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows))
    return len(rows)


def summary(tasks: Version2Set) -> list[str]:
    """Return lines that say how many tasks need what."""
    counts = Counter(kind for task in tasks.tasks for kind in task.needs)
    lines = [f"{tasks.revision}: {len(tasks.tasks)} tasks, 0 can be played here"]
    lines += [f"{counts[kind]:4}  {kind:9} {text}" for kind, text in NEEDS.items() if counts[kind]]
    return lines


def to_data(tasks: Version2Set) -> dict[str, Any]:
    """Return the tasks with their needs as JSON data."""
    rows = [
        {"id": task.id, "apps": list(task.apps), "needs": dict(task.needs), "can_be_met": False}
        for task in tasks.tasks
    ]
    return {"revision": tasks.revision, "tasks": rows}


def _read(data: bytes, path: Path, problems: list[str]) -> Version2Task | None:
    if len(data) > MAX_BYTES:
        problems.append(f"{path}: larger than {MAX_BYTES} bytes; is it a task?")
        return None
    try:
        module = ast.parse(data, str(path))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        problems.append(f"{path}: cannot be parsed as Python ({error})")
        return None
    task_class = _find_class(module)
    if task_class is None:
        problems.append(f"{path}: no class with the base {' or '.join(_BASES)}")
        return None
    constants = _Constants(module.body, task_class.body)
    values = {name: constants.value(name) for name in _TEXTS}
    wrong = [name for name, value in values.items() if not isinstance(value, str) or not value]
    problems.extend(f"{path}: {task_class.name}.{name}: is not a text" for name in wrong)
    if "{...}" in str(values["id"]):
        problems.append(f"{path}: {task_class.name}.id: is known only if the file is run")
    elif not wrong:
        apps = constants.value("related_apps")
        listed = apps if isinstance(apps, list) else []
        return Version2Task(
            id=values["id"],
            instruction=values["instruction"],
            apps=tuple(str(app) for app in listed),
            needs=dict(_needs(module, constants)),
            path=path,
        )
    return None


def _find_class(module: ast.Module) -> ast.ClassDef | None:
    """Return the class of the task: the one named in `TASK_CLASS`, or the first subclass."""
    classes = {node.name: node for node in module.body if isinstance(node, ast.ClassDef)}
    for node in module.body:
        match node:
            case ast.Assign(targets=[ast.Name("TASK_CLASS")], value=ast.Name(name)):
                return classes.get(name)
            case _:
                pass
    for task_class in classes.values():
        if any(_last_name(base) in _BASES for base in task_class.bases):
            return task_class
    return None


def _last_name(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


class _Constants:
    """The values that a class, or else its module, assigns to names, as far as they are literal."""

    def __init__(self, module: Iterable[ast.stmt], task_class: Iterable[ast.stmt]) -> None:
        self._values = {**dict(_assignments(module)), **dict(_assignments(task_class))}

    def value(self, name: str) -> Any:
        """Return the value of a name; `None` if nothing is assigned to it, or only running tells.

        In a text, what only running tells is `{...}`.
        """
        node = self._values.get(name)
        value = _MISSING if node is None else self._fold(node, 0)
        return None if value is _MISSING else value

    def _fold(self, node: ast.expr, depth: int) -> Any:
        if depth > MAX_DEPTH:
            return _MISSING
        match node:
            case ast.Constant(value):
                return value
            case ast.Name(name) if name in self._values:
                return self._fold(self._values[name], depth + 1)
            case ast.JoinedStr(parts):
                return "".join(self._fold_part(part, depth) for part in parts)
            case ast.BinOp(left, ast.Add(), right):
                sides = self._fold(left, depth + 1), self._fold(right, depth + 1)
                if any(isinstance(side, str) for side in sides):
                    return "".join(side if isinstance(side, str) else "{...}" for side in sides)
                return _MISSING
            case ast.Call(ast.Attribute(text, "strip"), []):
                value = self._fold(text, depth + 1)
                return value.strip() if isinstance(value, str) else _MISSING
            case ast.List(items) | ast.Tuple(items):
                values = [self._fold(item, depth + 1) for item in items]
                return _MISSING if any(value is _MISSING for value in values) else values
            case ast.Dict(keys, items):
                folded = [self._fold(key, depth + 1) if key else _MISSING for key in keys]
                values = [self._fold(item, depth + 1) for item in items]
                pairs = zip(folded, values, strict=True)
                return {key: value for key, value in pairs if isinstance(key, str)}
            case _:
                return _MISSING

    def _fold_part(self, part: ast.expr, depth: int) -> str:
        node = part.value if isinstance(part, ast.FormattedValue) else part
        value = self._fold(node, depth + 1)
        return "{...}" if value is _MISSING else str(value)


def _assignments(body: Iterable[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    for node in body:
        match node:
            case ast.Assign(targets=[ast.Name(name)], value=value):
                yield name, value
            case ast.AnnAssign(target=ast.Name(name), value=ast.expr() as value):
                yield name, value
            case _:
                pass


def _needs(module: ast.Module, constants: _Constants) -> Iterator[tuple[str, str]]:
    yield "runner", "setup and evaluate are Python of OSWorld 2.0"
    words = set(_words(module))
    for kind, marks in _MARKS.items():
        if kind == "user":
            simulator = constants.value(_SIMULATOR)
            if simulator is not None or _SIMULATOR in words:
                how = simulator.get("type") if isinstance(simulator, dict) else None
                yield kind, str(how) if isinstance(how, str) else "named in its file"
            continue
        named = sorted({word for word in words for mark in marks if _is_marked(word, mark)})
        if kind == "sites" and _SITE_MODULE in words:
            named.append(_SITE_MODULE)
        if named:
            yield kind, ", ".join(named)
    if constants.value("proxy"):
        yield "proxy", "proxy is true"
    if any(_INSTALLS.search(text) for text in _texts(module)):
        yield "software", "installed by its set-up"
    sizes = {name: constants.value(name) for name in ("instance_type", "volume_size")}
    requirements = [f"{name} {value}" for name, value in sizes.items() if value]
    if requirements:
        yield "disk", ", ".join(requirements)


def _is_marked(word: str, mark: str) -> bool:
    return word.endswith(mark[1:]) if mark.startswith("*") else word == mark


def _words(module: ast.Module) -> Iterator[str]:
    """Yield the identifiers of a module, the modules that it imports, and its short texts."""
    for node in ast.walk(module):
        match node:
            case ast.Name(name) | ast.Attribute(attr=name):
                yield name
            case ast.FunctionDef(name=name):
                yield name
            case ast.alias(name=name):
                yield name
                yield from name.split(".")
            case ast.ImportFrom(module=str(name)):
                yield name
                yield from name.split(".")
            case ast.Constant(str(text)) if text.isidentifier():
                yield text
            case _:
                pass


def _texts(module: ast.Module) -> Iterator[str]:
    """Yield the texts of a module, and its lists of texts as command lines."""
    for node in ast.walk(module):
        match node:
            case ast.Constant(str(text)):
                yield text
            case ast.List(items):
                yield " ".join(
                    item.value
                    for item in items
                    if isinstance(item, ast.Constant) and isinstance(item.value, str)
                )
            case _:
                pass
