"""What tasks of OSWorld need that an embedded desktop does not have, read from their files.

Nothing is run. A task without needs is one to try: the self-test says whether it works.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, cast
from urllib.parse import urlsplit

from .cache_files import list_cache_files
from .tasks import OsworldTask, TaskSet

TESTED = Path(__file__).with_name("selftest.json")
RUNS_HERE = "works"
FAILED = ("excluded", "error")
PackageCheck: TypeAlias = Callable[[Mapping[str, Any]], list[str]]
FILES, PACKAGES = "files", "packages"
# How each need is met; what has no command cannot be met here.
REMEDIES = {
    FILES: "hijack osworld prefetch TASKS --out CACHE, on a connected machine",
    PACKAGES: "hijack osworld setup --tier mid",
    "program": "none: no profile installs the program",
    "gnome": "none: the desktop is Xfce",
    "web": "none: the desktop has no internet",
    "account": "none: the account is somebody's",
}
_ACCOUNT_STEPS = frozenset({"googledrive", "login"})
_HISTORY_STEPS = frozenset({"update_browse_history"})
_PROGRAMS = {"code": "VS Code", "nautilus": "GNOME's Files", "picard": "MusicBrainz Picard"}
_CODE_APPS = frozenset({"vscode", "vs_code"})
_GNOME_COMMANDS = re.compile(r"\b(?:gsettings|dconf|nautilus|gnome[-.]|org\.gnome)")
_INSTALL_COMMANDS = re.compile(r"\b(?:apt(?:-get)?|pip3?|snap|npm) install\b")
_ADDRESS = re.compile(r"https?://[^\s\"'\\<>)]+")
_LOOPBACK = re.compile(r"^(?:localhost|127\.0\.0\.1|0\.0\.0\.0)$")
# Tasks that nobody can do without the internet, as only their instructions say.
_IN_WORDS_ONLY = frozenset(
    {
        "48d05431-6cd5-4e76-82eb-12b60d823f7d",  # conda
        "68a25bd4-59c7-4f4d-975e-da0c8509c848",  # the PDF of a paper
        "6f4073b8-d8ea-4ade-8a18-c5d1d5d5aa9a",  # cities of conferences
        "7ff48d5b-2df2-49da-b500-a5150ffc7f18",  # addresses in Shenzhen
        "873cafdd-a581-47f6-8b33-b9696ddb7b05",  # plug-ins from Chrome's store
        "94d95f96-9699-4208-98ba-3c3119edf9c2",  # Spotify
        "c7c1e4c3-9e92-4eba-a4b8-689953975ea4",  # home pages of professors
        "deec51c9-3b1e-4b9e-993c-4776f20e8bb2",  # arXiv
        "e1fc0df3-c8b9-4ee7-864c-d0b590d3aa56",  # LanguageTool
    }
)
# Getters that read sites which their arguments do not name.
_LIVE_GETTERS = frozenset({"gotoRecreationPage_and_get_html_content", "info_from_website"})


@dataclass(frozen=True)
class TaskNeeds:
    """What one task needs.

    Args:
        id: The task's id.
        domain: Its domain.
        feasible: Whether it can be done at all.
        needs: What is missing, by kind (a key of `REMEDIES`), in words.
        tested: The task's status in the self-test of this revision that comes with the library;
            empty if it was not tested.
    """

    id: str
    domain: str
    feasible: bool
    needs: Mapping[str, str] = field(default_factory=dict[str, str])
    tested: str = ""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of what is missing, in the order of `REMEDIES`."""
        return tuple(kind for kind in REMEDIES if kind in self.needs)

    @property
    def can_be_met(self) -> bool:
        """Whether commands of ours bring all that is missing."""
        return self.needs.keys() <= {FILES, PACKAGES}


def list_all_needs(tasks: TaskSet, check: PackageCheck | None = None) -> list[TaskNeeds]:
    """Return what each task needs, and how its self-test ended.

    Args:
        tasks: The task set.
        check: Returns why the content of a task cannot be evaluated, as `OsworldEnv.check`;
            `None` leaves packages out.
    """
    tested = read_tested(str(tasks.revision))
    return [
        TaskNeeds(
            task.id, task.domain, task.feasible, list_needs(task, check), tested.get(task.id, "")
        )
        for task in tasks
    ]


def read_tested(revision: str | None = None) -> dict[str, str]:
    """Return the status of each task in the self-test that comes with the library, by id.

    Args:
        revision: The revision of the tasks; if another one was tested, nothing is returned. `None`
            for that which was tested.
    """
    data = _read_selftest()
    if revision not in (None, data["revision"]):
        return {}
    return {row["id"]: row["status"] for row in data["tasks"]}


def read_excluded() -> dict[str, str]:
    """Return why tasks failed that self-test, by id, such as one that scores 1 untouched."""
    rows = _read_selftest()["tasks"]
    return {row["id"]: row["reason"] for row in rows if row["status"] in FAILED}


def _read_selftest() -> dict[str, Any]:
    return json.loads(TESTED.read_text(encoding="utf-8"))


def list_needs(task: OsworldTask, check: PackageCheck | None = None) -> dict[str, str]:
    """Return what a task needs, by kind; the arguments are those of `list_all_needs`.

    Raises:
        ConfigError: An address or a name in the task is bad.
    """
    needs: dict[str, str] = {}
    files = list_cache_files(task)
    if files:
        needs[FILES] = f"{len(files)} to fetch"
    missing = check(task.config) if check is not None else []
    if missing:
        needs[PACKAGES] = "; ".join(missing)
    programs = sorted(set(_programs(task)))
    if programs:
        needs["program"] = ", ".join(programs)
    if _GNOME_COMMANDS.search(
        json.dumps([task.config.get("config"), task.config.get("evaluator")])
    ):
        needs["gnome"] = "GNOME's settings or its file manager"
    sites = sorted(set(_sites(task, {file.url for file in files})))
    if task.id in _IN_WORDS_ONLY:
        sites.append("what its instruction asks for")
    if sites:
        needs["web"] = ", ".join(sites)
    if any(step.get("type") in _ACCOUNT_STEPS for step in _steps(task)):
        needs["account"] = "Google Drive, or a login"
    return needs


def _steps(task: OsworldTask) -> Iterator[Mapping[str, Any]]:
    evaluator = cast("Mapping[str, Any]", task.config.get("evaluator") or {})
    yield from task.config.get("config") or []
    yield from evaluator.get("postconfig") or []


def _sources(task: OsworldTask) -> Iterator[Mapping[str, Any]]:
    """Yield what the evaluator reads: its results and what they should be."""
    evaluator = cast("Mapping[str, Any]", task.config.get("evaluator") or {})
    for part in ("result", "expected"):
        listed = evaluator.get(part)
        for source in listed if isinstance(listed, list) else [listed]:
            if isinstance(source, dict):
                yield cast("Mapping[str, Any]", source)


def _programs(task: OsworldTask) -> Iterator[str]:
    if not _CODE_APPS.isdisjoint(map(str.lower, task.apps)):
        yield _PROGRAMS["code"]
    for step in _steps(task):
        command = (step.get("parameters") or {}).get("command")
        words = command if isinstance(command, list) else str(command or "").split()
        first = str(words[0]).rpartition("/")[2] if words else ""
        if first in _PROGRAMS:
            yield _PROGRAMS[first]


def _sites(task: OsworldTask, fetched: set[str]) -> Iterator[str]:
    """Yield the hosts of the addresses in a task that are not those of its files.

    Sites that the history says were visited are not read again.
    """
    if task.config.get("proxy"):
        yield "sites behind OSWorld's proxy"
    for source in _sources(task):
        if source.get("type") in _LIVE_GETTERS:
            yield f"what {source['type']} reads"
    steps = [step for step in _steps(task) if step.get("type") not in _HISTORY_STEPS]
    if any(_INSTALL_COMMANDS.search(json.dumps(step.get("parameters"))) for step in steps):
        yield "where its setup installs software from"
    text = json.dumps([task.instruction, steps, list(_sources(task))], ensure_ascii=False)
    for address in _ADDRESS.findall(text):
        host = _host(address)
        if host and address not in fetched and not _LOOPBACK.match(host):
            yield host


def _host(address: str) -> str:
    """Return the host of an address; "" for what only looks like one: `http://[your-host]/`."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def summary(needs: Iterable[TaskNeeds]) -> list[tuple[str, int, str]]:
    """Return rows of what is needed, how many tasks need that, and what brings it.

    Tasks that were tested are counted by how that ended, the others by their needs; of those that
    cannot be met, by the first.
    """
    needs = list(needs)
    tested = Counter(task.tested for task in needs if task.tested)
    rows = [(f"self-test: {status}", count, "") for status, count in tested.most_common()]
    untested = Counter(_deciding(task) for task in needs if not task.tested)
    met_kinds = {FILES, PACKAGES}
    ordered = sorted(untested.items(), key=lambda row: (not met_kinds.issuperset(row[0]), -row[1]))
    rows += [(" + ".join(kinds) or "nothing", count, _remedy(kinds)) for kinds, count in ordered]
    return rows


def _deciding(row: TaskNeeds) -> tuple[str, ...]:
    """Return the needs that can be met, or else the first one that cannot."""
    if row.can_be_met:
        return row.kinds
    return next((kind,) for kind in row.kinds if kind not in (FILES, PACKAGES))


def _remedy(kinds: tuple[str, ...]) -> str:
    return " and ".join(REMEDIES[kind] for kind in kinds) or "hijack osworld check TASKS"
