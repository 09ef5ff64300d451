"""Tasks of MiniWoB++, from the pages of the user's `miniwob` package, as one of `tasks.FAMILIES`.

Pages and validators stay as they are: a page words its task by the seed, judges it, and gives the
score. `--tasks miniwob/click-test.html` names the installed page, a path any other copy of it.
"""

import contextlib
import hashlib
import importlib.util
import json
import time
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar

from hijack_data.apps import normalize_app
from hijack_data.errors import ConfigError, ParameterError, ParameterTypeError, suggest
from hijack_data.extras import remedy
from hijack_data.file_io import read_regular
from hijack_data.types import Size

from .. import tasks
from ..environment.stage import Setting, TaskHolder
from ..errors import DesktopError, DesktopTimeoutError
from ..tasks.base import FAIL, Task, Verdict
from ..tasks.careful_hand import CarefulHand
from ..tasks.hand import Hand
from ..tasks.machine import Machine
from ..tasks.machines import MachineSettings
from .chromium import find_program
from .desktop import BrowserDesktop
from .miniwob_oracles import ORACLES, ShownPage
from .miniwob_plans import PLANS, plan_page
from .site import FolderSite

FOLDER = "miniwob"  # the folder of the pages, inside the one that is served
HOST = "miniwob.test"
SUFFIX = ".html"
APPS = ("chrome",)
START_TIMEOUT_S = 5.0  # for a page to word its task
LEAST_VIEW: Size = (240, 320)  # CSS pixels that a page needs, (height, width)
MAX_SCALE = 4
# Starts the one episode of a page, each time that it is loaded: with our seed and without its limit
# of ten seconds, whose clock would change every picture. The display of rewards is not for agents.
_START = """addEventListener('load', () => setTimeout(() => {
  if (typeof core === 'undefined') return;
  Math.seedrandom(%s);
  core.EPISODE_MAX_TIME = 1e9;
  core.startEpisodeReal();
  core.clearTimer();
  core.hideDisplay();
}, 0));"""
_READY = "typeof core !== 'undefined' && core.EP_TIMER !== null && WOB_TASK_READY"
_QUESTION = "(q => typeof q === 'string' ? q : q.utterance)(core.getUtterance())"
_RESULT = "typeof core === 'undefined' ? null : {done: WOB_DONE_GLOBAL, raw: WOB_RAW_REWARD_GLOBAL}"


class MiniwobTask(Task):
    """A page of MiniWoB++; the seed is that of its random numbers.

    Attributes:
        page: The path of the page.
        source: The same, with its SHA-256, which a run records.
        shown_instruction: The task as the page words it; "" until a browser has read it.
    """

    family: ClassVar[str] = "miniwob"
    domain: ClassVar[str] = "miniwob"
    apps: ClassVar[tuple[str, ...]] = APPS
    page: ClassVar[Path]
    source: ClassVar[Mapping[str, str]]
    shown_instruction = ""

    @property
    def instruction(self) -> str:
        """That the page has the words, which only a browser can read."""
        return f"the task of MiniWoB++'s page {self.page.name} for seed {self.seed}"

    def setup(self, machine: Machine) -> None:
        """Raise: only `MiniwobTasks` sets these tasks up.

        Raises:
            DesktopError: Always.
        """
        raise DesktopError(f"{self.name} is set up in a browser: play it by hijack bench --tasks")

    def problems(self, machine: Machine) -> Iterator[str]:
        """Raise: only the page judges these tasks.

        Raises:
            DesktopError: Always.
        """
        raise DesktopError(f"{self.name} is judged by its page, not by files")

    def oracle(self, hand: Hand) -> None:
        """Play the script of the page.

        Raises:
            DesktopError: There is none.
            NotImplementedError: The hand is that of a careful user of desktops: `recovering` would
                score 0 for what it does not know, which must not pass for a ceiling.
        """
        if isinstance(hand, CarefulHand):
            raise NotImplementedError("the agent recovering knows no browsers; use oracle")
        script = ORACLES.get(self.page.stem)
        if script is None:
            raise DesktopError(
                f"no script solves {self.page.stem}; there are scripts of {', '.join(ORACLES)}"
            )
        script(ShownPage(hand))

    def plan(self) -> Sequence[str]:
        """Return the plan in words, once a browser has read the instruction."""
        return plan_page(self.page.stem, self.shown_instruction)

    @property
    def has_plan(self) -> bool:
        """Whether there is a plan for the page."""
        return self.page.stem in PLANS


def task_class(path: str) -> type[MiniwobTask]:
    """Return the class of the task on a page.

    Raises:
        ConfigError: There is no such page, or it is none of MiniWoB++.
    """
    page = _find_page(path).resolve()
    if not (page.parent.parent / "core/core.js").is_file():
        raise ConfigError([f"{path}: is no page of MiniWoB++: there is no ../core/core.js"])
    body = {
        "name": f"{FOLDER}.{page.stem}",
        "page": page,
        "source": {"path": str(page), "sha256": hashlib.sha256(read_regular(page)).hexdigest()},
        "__module__": __name__,
        "__qualname__": f"MiniwobTask[{page}]",
    }
    return type("MiniwobTask", (MiniwobTask,), body)


def _find_page(path: str) -> Path:
    """Return the path of a page, which may be named relative to the installed package.

    Raises:
        ConfigError: There is no such page.
    """
    file = Path(path)
    if file.is_file():
        return file
    if file.parent != Path(FOLDER):
        raise ConfigError([f"{path}: there is no such file"])
    spec = importlib.util.find_spec("miniwob")
    if spec is None or not spec.submodule_search_locations:
        raise ConfigError([f"{path}: the pages are in the package miniwob: {remedy('browser')}"])
    folder = Path(spec.submodule_search_locations[0]) / "html" / FOLDER
    page = folder / file.name
    if not page.is_file():
        close = suggest(file.stem, [file.stem for file in folder.glob(f"*{SUFFIX}")])
        raise ConfigError([f"{path}: the package miniwob has no such page{close}"])
    return page


class MiniwobTasks(TaskHolder):
    """The tasks of MiniWoB++ in a browser.

    Args:
        desktop: The browser, which reaches `site`.
        site: Serves the pages.
        task: The task of a `reset` that names none.
    """

    def __init__(self, desktop: BrowserDesktop, site: FolderSite, task: str | Task = "") -> None:
        self._desktop = desktop
        self._site = site
        self._default = task
        self._result: Mapping[str, Any] | None = None
        desktop.task_is_over = self._is_over

    @property
    def desktop(self) -> BrowserDesktop:
        """The browser."""
        return self._desktop

    @property
    def machine(self) -> Machine:
        """The browser in the form that tasks use."""
        return Machine(self._desktop, None)

    def reset(self, task: Any, seed: int) -> Setting:
        """Open the page of a task in a fresh profile.

        Args:
            task: A name, or a task; `None` for the default.
            seed: Chooses the variant of a task that is given by name.

        Raises:
            ParameterTypeError: `task` is none of MiniWoB++'s.
            DesktopError: The page does not load.
            DesktopTimeoutError: The page words no task.
        """
        miniwob_task: object = self._default if task is None else task
        if isinstance(miniwob_task, str):
            miniwob_task = tasks.get(miniwob_task, seed)
        if not isinstance(miniwob_task, MiniwobTask):
            raise ParameterTypeError(f"a task of MiniWoB++ is wanted, got {miniwob_task!r:.80}")
        self._task = None
        self._result = None
        root = miniwob_task.page.parent.parent
        self._site.folder = root
        url = self._site.url(miniwob_task.page.relative_to(root).as_posix())
        script = _START % json.dumps(miniwob_task.seed)
        self._desktop.reset({"url": url, "scripts": [script]})
        deadline = time.monotonic() + START_TIMEOUT_S
        while self._desktop.evaluate(_READY) is not True:
            if time.monotonic() > deadline:
                raise DesktopTimeoutError(
                    f"{miniwob_task.page.name} did not begin within {START_TIMEOUT_S:g} s"
                )
            time.sleep(0.005)
        instruction = " ".join(str(self._desktop.evaluate(_QUESTION)).split())
        miniwob_task.shown_instruction = instruction
        self._task = miniwob_task
        return Setting(
            miniwob_task.id,
            instruction,
            tuple(map(normalize_app, miniwob_task.apps)),
            False,
            miniwob_task.seed,
        )

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Return the page's own score without its discount for time, 0 where it is negative.

        The first result counts: who starts the page's next episode does not change it.
        """
        if history and history[-1] == FAIL:
            return Verdict(0.0, "the agent answered FAIL, but the task can be done")
        if not self._is_over() or self._result is None:
            return Verdict(0.0, "the page has not ended the task")
        raw = float(self._result["raw"])
        return Verdict(min(max(raw, 0.0), 1.0), f"the page's reward is {raw:g}")

    def close(self) -> None:
        """End the browser and the site."""
        self._desktop.close()
        self._site.close()

    def _is_over(self) -> bool:
        """Return whether the page has ended its task, and keep the result of the first time."""
        page = self._desktop.task_page
        if self._result is None and page in self._desktop.pages:
            result = self._desktop.evaluate(_RESULT, page)
            if result and result["done"]:
                self._result = result
        return self._result is not None


def choose_scale(size: Size) -> int:
    """Return the largest device pixel ratio at which a screen of `size` holds a page.

    Raises:
        ParameterError: The screen is too small for any page.
    """
    if size[0] < LEAST_VIEW[0] or size[1] < LEAST_VIEW[1]:
        raise ParameterError(
            f"a page of MiniWoB++ needs a screen of {LEAST_VIEW[1]}x{LEAST_VIEW[0]} pixels or more,"
            f" and this one has {size[1]}x{size[0]}"
        )
    scales = [
        scale
        for scale in range(1, MAX_SCALE + 1)
        if all(
            side % scale == 0 and side // scale >= least
            for side, least in zip(size, LEAST_VIEW, strict=True)
        )
    ]
    return max(scales)


def open_miniwob(size: Size, task: str | Task = "") -> MiniwobTasks:
    """Start a browser with the tasks of MiniWoB++; `close` of the result ends it.

    Args:
        size: `(height, width)` of the screen in pixels.
        task: The task of a `reset` that names none.
    """
    scale = choose_scale(size)
    site = FolderSite(HOST)
    try:
        desktop = BrowserDesktop.up(size, scale, site.arguments)
    except BaseException:
        site.close()
        raise
    return MiniwobTasks(desktop, site, task)


class MiniwobFamily:
    """Reads, checks and plays the pages of MiniWoB++."""

    title = "MiniWoB++"
    provider = "browser"

    def read_task(self, path: str) -> type[Task]:
        """Return the class of the task on a page; mistakes are a `ConfigError`."""
        return task_class(path)

    def list_files(self, folder: str) -> list[str]:
        """Return all pages in a folder, by name.

        Raises:
            ConfigError: There are none.
        """
        pages = sorted(map(str, Path(folder).glob(f"*{SUFFIX}")))
        if not pages:
            raise ConfigError([f"{folder}: no page of MiniWoB++ (*{SUFFIX})"])
        return pages

    def read_options(self, texts: tuple[str, ...]) -> dict[str, str | bool]:
        """Refuse machines of the user.

        Raises:
            ParameterError: Always.
        """
        raise ParameterError(f"--vm plays OSWorld's tasks; {self.title} is played in a browser")

    def check_machines(self, machines: MachineSettings, episodes: int) -> None:
        """Machines of the user are refused by `read_options`."""

    def find_unplayable(
        self, tasks: Iterable[type[Task]], files: Path | None, machines: MachineSettings | None
    ) -> dict[str, str]:
        """Check that a Chromium is installed; if not, it is a `MissingPackageError`."""
        find_program()
        return {}

    @contextlib.contextmanager
    def _stage(self, size: Size) -> Generator[MiniwobTasks]:
        stage = open_miniwob(size)
        try:
            yield stage
        finally:
            stage.close()

    def judging_code(self) -> Mapping[str, Mapping[str, str]]:
        """Return nothing: pages judge themselves, and a run has their SHA-256."""
        return {}

    def open_stage(
        self, size: Size, files: Path | None, machine: AbstractContextManager[Any] | None = None
    ) -> AbstractContextManager[Any]:
        """Start a browser with these tasks."""
        return self._stage(size)


FAMILY = MiniwobFamily()
