"""Every text that a task asks for is judged as a whole: denied, doubted, cut or doubled, it is wrong.

The right result of each task is brought about by files, and then each text that it left, in a file
or in the state of a site, is changed. Documents, pictures and settings are tried by the tasks' own
wrong results (`test_suite.py`).
"""

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites.state import SITES, SiteState
from online_env.tasks import Machine, Task, get, names
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit.mail import own_text

CHANGES: dict[str, Callable[[str], str]] = {
    "denied": lambda text: f"not {text}",
    "denied at the end": lambda text: f"{text.rstrip()}\nThat is wrong.\n",
    "doubted": lambda text: f"{text.rstrip()} or not\n",
    "twice": lambda text: f"{text.rstrip()}\n{text}",
    "empty": lambda text: "",
}
DOMAINS = ("editor", "forms", "mail", "research", "shop", "terminal", "workflows")
# Kept beside what is asked: what the site makes up itself, or the task leaves open.
OPEN = ("id", "number", "by", "when", "subject", "summary", "product", "name")


def begin_done(task: Task, folder: str) -> Machine:
    """Bring the right result of a task about in an empty folder."""
    home = Path(folder, "home")
    home.mkdir()
    machine = Machine(FolderDesktop(home), SiteState(Path(folder, "sites")))
    for name in ("Desktop", "Documents", "Downloads"):
        (home / name).mkdir()
    task.prepare(machine)
    machine.remember()
    task.right_result(machine)
    return machine


def left_files(machine: Machine) -> Iterator[str]:
    """Yield the text files that the right result added or changed."""
    before = machine.before.files
    for path, look in machine.snapshot().files.items():
        if look.startswith("f") and before.get(path) != look:
            try:
                (machine.read(path) or b"").decode()
            except UnicodeDecodeError:
                continue
            yield path


def leaves(value: Any, *path: Any) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the places and values of stored state."""
    if isinstance(value, dict):
        for key, part in cast("dict[str, Any]", value).items():
            yield from leaves(part, *path, key)
    elif isinstance(value, list):
        for index, part in enumerate(cast("list[Any]", value)):
            yield from leaves(part, *path, index)
    else:
        yield path, value


def left_texts(machine: Machine) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield site and place of the longer texts that the right result stored."""
    now = machine.snapshot().sites
    for site in SITES:
        before = dict(leaves(machine.before.sites[site]))
        entries = dict(leaves(now[site]))
        for key, value in entries.items():
            starts = (key[:length] for length in range(len(key)))
            is_cancelled = any(entries.get((*start, "cancelled")) for start in starts)
            is_text = isinstance(value, str) and value and key[-1] not in OPEN and not is_cancelled
            if is_text and before.get(key) != value:
                yield site, key


def change_file(path: str, change: Callable[[str], str]) -> Callable[[Machine], None]:
    return lambda machine: machine.write(path, change((machine.read(path) or b"").decode()))


def change_text(
    site: str, place: tuple[Any, ...], change: Callable[[str], str]
) -> Callable[[Machine], None]:
    def outcome(machine: Machine) -> None:
        with machine.sites.update(site) as state:
            part: Any = state
            for key in place[:-1]:
                part = part[key]
            part[place[-1]] = change(own_text(part[place[-1]]))  # lines that a mail quotes are open

    return outcome


NAMES = [name for name in names() if get(name).domain in DOMAINS]


@pytest.mark.parametrize("name", NAMES)
def test_a_right_text_that_is_denied_doubted_or_doubled_is_wrong(name: str) -> None:
    task = get(name)
    with tempfile.TemporaryDirectory() as folder:
        machine = begin_done(task, folder)
        assert task.validate(machine).passed
        outcomes = [
            (f"{path} {label}", change_file(path, change))
            for path in left_files(machine)
            for label, change in CHANGES.items()
        ]
        outcomes += [
            (f"{site} {key} {label}", change_text(site, key, change))
            for site, key in left_texts(machine)
            for label, change in CHANGES.items()
            if label != "twice"  # an answer that is given twice is no other answer
        ]
    for label, outcome in outcomes:
        with tempfile.TemporaryDirectory() as folder:
            machine = begin_done(task, folder)
            outcome(machine)
            assert not task.validate(machine).passed, label
