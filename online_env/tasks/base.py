"""What a task is: an instruction, how a desktop is prepared for it, and how success is judged."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar, TypeAlias

from hijack_data.rng import Stream

from .hand import Hand
from .machine import Machine

FAIL = "FAIL"
Outcome: TypeAlias = Callable[[Machine], object]


@dataclass(frozen=True)
class Verdict:
    """How well a task was done, 0 to 1, and why."""

    score: float
    reason: str

    @property
    def passed(self) -> bool:
        """Whether the score is 1."""
        return self.score == 1.0


@dataclass(frozen=True)
class Task(ABC):
    """A task with its seed; another seed gives the same task with other words, names and numbers.

    A subclass sets the class variables and defines `problems` and `oracle`; it overrides `draw`,
    `prepare`, `initial_app`, `plan`, `wrong_results` and `right_result` where it needs them. All
    that a seed decides comes from `draw`, so instruction, preparation and judgement cannot
    disagree. Paths are relative to the home folder of the desktop's user. All methods raise
    `DesktopError` (or a subclass) if the desktop fails.

    Attributes:
        name: The name, in snake_case.
        domain: The kind of work, such as `files`; the folder of a task of the suite.
        apps: The applications that the task uses, as `task_apps.APPS` names them. The first one is
            open at the start, unless `initial_app` says otherwise.
        phrasings: The instruction in several wordings, of which the seed chooses one. `{key}` is
            replaced by what `draw` returns.
        infeasible: Why the task cannot be done, so that `FAIL` is the right answer; "" if it can.
        unsolvable: Why not even a careful user can do the task under a corruption, by its name.
        sites: The local sites whose stored state the task may change.
        in_browser: Whether a page and its site are enough: no file, no setting and no address bar.
        family: The family that plays the task, a key of `families.FAMILIES`; "" for `SmallTasks`.
        fixed_waits: Seconds that pass in an episode by rule, for estimates.
    """

    seed: int = 0
    name: ClassVar[str]
    domain: ClassVar[str] = "other"
    apps: ClassVar[tuple[str, ...]]
    phrasings: ClassVar[tuple[str, ...]] = ()
    infeasible: ClassVar[str] = ""
    unsolvable: ClassVar[Mapping[str, str]] = {}
    sites: ClassVar[tuple[str, ...]] = ()
    in_browser: ClassVar[bool] = False
    family: ClassVar[str] = ""
    fixed_waits: ClassVar[float] = 0.0

    @property
    def id(self) -> str:
        """The name and the seed, such as `write_note-3`."""
        return f"{self.name}-{self.seed}"

    @property
    def instruction(self) -> str:
        """What the agent is asked to do."""
        stream = Stream(self.seed, f"task-{self.name}-phrasing")
        phrasing = stream.choice(self.phrasings)
        return phrasing.format(**vars(self.values))

    @cached_property
    def values(self) -> SimpleNamespace:
        """What the seed decides, by the keys of `draw`."""
        return SimpleNamespace(**self.draw(self.stream()))

    def draw(self, stream: Stream) -> Mapping[str, Any]:
        """Return what the seed decides: names, numbers, texts, places; nothing by default.

        Args:
            stream: The random draws of this variant, from the start.
        """
        return {}

    def prepare(self, machine: Machine) -> object:
        """Put files and stored state in place, behind the screen; nothing by default."""
        return None

    def initial_app(self, machine: Machine) -> Sequence[str]:
        """Return the application that is open at the start, and its arguments; () for none.

        A careful user who loses the window starts the same again.
        """
        return self.apps[:1]

    @abstractmethod
    def problems(self, machine: Machine) -> Iterator[str]:
        """Yield what is wrong with the result; nothing if the task is done.

        Judge by files and by what applications and sites stored, never by pixels, and change
        nothing. Begin with `yield from machine.unexpected_changes(...)`, so that collateral damage
        counts.
        """
        ...

    @abstractmethod
    def oracle(self, hand: Hand) -> None:
        """Do the task as a person would, with pointer and keyboard.

        It starts in the application of `initial_app`, and is called a second time if the first
        attempt fails. The oracle of an infeasible task looks where a person would look, and gives
        up.
        """
        ...

    def plan(self) -> Sequence[str]:
        """Return how a person would be told to do the task, step by step; () for nothing.

        `plan_words` has the grammar. The plan starts in the application of `initial_app`. It names
        the values that the seed drew and what can be read on the screen, nothing else. Only agents
        with `uses_plan` get it.
        """
        return ()

    @property
    def has_plan(self) -> bool:
        """Whether there is a plan; for one that a page words, before the page was read."""
        return bool(self.plan())

    def wrong_results(self) -> Mapping[str, Outcome]:
        """Return wrong results by what is wrong: functions that bring them about by files.

        Each of them, after `prepare`, must be judged 0.
        """
        return {}

    def right_result(self, machine: Machine) -> object:
        """Bring a right result about by files, and not byte for byte as the oracle does.

        It must be judged 1.
        """
        return None

    # What follows is common to all tasks.

    def setup(self, machine: Machine) -> None:
        """Prepare, note what is there, and open the application; its window is there then."""
        machine.check_installed(self.apps)
        machine.begin()
        self.prepare(machine)
        machine.remember()
        app = self.initial_app(machine)
        if app:
            machine.open(*app)

    def validate(self, machine: Machine, answer: str = "DONE") -> Verdict:
        """Judge the result; an error of `problems` is passed on, and is never a 0.

        The applications may first finish what is under way (at most 20 s). Those that keep what
        they know to themselves, Chromium and the server of Xfce's settings, are ended before their
        files are read, so a task is not played on after it was judged.

        Args:
            machine: The one that `setup` got.
            answer: The last action of the agent.
        """
        gave_up = answer.strip() == FAIL
        if gave_up and not self.infeasible:
            return Verdict(0.0, "the agent answered FAIL, but the task can be done")
        if self.infeasible and not gave_up:
            return Verdict(
                0.0, f"the task cannot be done ({self.infeasible}): FAIL would have been right"
            )
        machine.wait_until_idle(self.apps)
        problems = list(self.problems(machine))
        problems += machine.unexpected_site_changes(but=self.sites)
        if problems:
            return Verdict(0.0, "; ".join(problems))
        return Verdict(1.0, "FAIL was right" if self.infeasible else "done as asked")

    def teardown(self, machine: Machine) -> None:
        """End the applications and remove what was added, for a desktop that is not reset.

        It may be called twice.
        """
        machine.clear(self.apps)

    def variant(self, seed: int) -> "Task":
        """The same task for another seed, 0 to 2**64 - 1."""
        return type(self)(seed)

    def stream(self) -> Stream:
        """The random draws of this variant, from the start."""
        return Stream(self.seed, f"task-{self.name}-v1")
