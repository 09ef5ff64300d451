"""The folder of a scoring run: the same as that of a benchmark, and read by the same report."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.errors import ParameterError
from hijack_data.loading import find_source
from hijack_data.locking import Lock
from hijack_data.registry import is_ours
from hijack_data.runs.run_log import SCORE_RUN

from ..agents.agent_calls import method_names
from ..agents.guards import check_guard, is_file
from ..agents.references import AgentReference, is_user_code
from ..agents.registry import AGENTS
from ..choices import ROW_TIMEOUT_S, Question
from ..results import records
from ..results.reading import ResultRecord
from .cases import Case, CaseKey, CaseList, RowPlans, Selection, open_feed, select_cases
from .row_asker import AskSettings
from .rules import NEAR, Distance
from .workers import Listener, WorkerPool

WRITE_PERIOD_S = 1.0  # s until answered rows are written at the latest
MAX_UNWRITTEN_ROWS = 32  # rows that are held until then
_METHODS: Mapping[Question, str] = {
    "steps": "predict",
    "reminders": "check",
    "summaries": "summarise",
}
Ticker = Callable[[str, ResultRecord], object]


@dataclass(frozen=True, kw_only=True)
class ScoreSettings:
    """What is scored, and how.

    Args:
        dataset: the folder of a dataset, or of an export for onlookers.
        agents: names in `agents.AGENTS`.
        question: what the agents are asked.
        selection: which rows.
        near: how far a point may be off where no box is known.
        timeout: seconds an agent has for a row.
        workers: processes, each with an agent of its own; they do not change what is recorded.
        batch: rows that `predict_batch` is given at a time.
        in_process: whether agents of users run in this process, for debugging.
        agent_memory: GiB that an agent's process may use; 0 for the default.
        guard: what watches every agent; "" for nothing. It sees the row's picture only.
        plans: corruptions that are applied to the clean rows while they are read.
    """

    dataset: Path
    agents: tuple[str, ...]
    question: Question = "steps"
    selection: Selection = field(default_factory=Selection)
    near: Distance = NEAR
    timeout: float = ROW_TIMEOUT_S
    workers: int = 1
    batch: int = 8
    in_process: bool = False
    agent_memory: float = 0.0
    guard: str = ""
    plans: RowPlans | None = None

    def ask_settings(self, agent: str) -> AskSettings:
        """How rows are put to one of the agents."""
        in_runner = self.in_process and is_user_code(AGENTS.get(agent))
        return AskSettings(
            agent=agent,
            question=self.question,
            near=self.near,
            batch=self.batch,
            in_process=self.in_process,
            guard=self.guard,
            privileged_inputs=("process",) if in_runner else (),
        )


class ScoreRun:
    """Everything that a scoring run consists of, before it begins.

    Args:
        settings: what is scored.

    Raises:
        ParameterError: the dataset has no such rows, or an agent cannot answer the question.
    """

    def __init__(self, settings: ScoreSettings) -> None:
        self.settings = settings
        feed = open_feed(settings.dataset, settings.question, settings.plans)
        self._content = feed.content
        self._entries = feed.entries
        self.cases: CaseList = select_cases(feed, settings.question, settings.selection)
        for agent in settings.agents:
            _check_agent(agent, settings.question)
        if settings.guard and settings.question != "steps":
            raise ParameterError(
                f"--guard: agents are guarded when --ask is steps, not {settings.question}"
            )
        check_guard(settings.guard, settings.agents)
        guards = (settings.guard,) if is_file(settings.guard) else ()
        codes = map(_agent_code, (*settings.agents, *guards))
        self._code = {agent: code for agent, code in codes if code}

    @property
    def episodes(self) -> list[str]:
        """The ids of all records."""
        return [case.id(agent) for agent in self.settings.agents for case in self.cases.cases]

    def config(self) -> dict[str, Any]:
        """Return the configuration for `run.json`; a run is resumed with the same one."""
        settings = self.settings
        seeds = sorted({case.seed for case in self.cases.cases})
        in_process = {"in_process": True} if settings.in_process else {}
        guard = {"guard": settings.guard} if settings.guard else {}
        unchanged = {"unchanged": self.cases.unchanged} if self.cases.unchanged else {}
        plans = {} if settings.plans is None else {"plans": settings.plans.to_data()}
        return {
            **in_process,
            **guard,
            **unchanged,
            **plans,
            "kind": SCORE_RUN,
            "source": str(settings.dataset),
            "content": self._content,
            "question": settings.question,
            "agents": list(settings.agents),
            "corruptions": [self._entries.get(label, label) for label in self.cases.labels],
            "seeds": seeds,
            "split": settings.selection.split,
            "limit": settings.selection.limit,
            "distance": str(settings.near),
            "timeout": settings.timeout,
            "unscored": self.cases.unscored,
            "unpaired": self.cases.unpaired,
            "code": self._code,
        }

    def begin(
        self, out: Path, resume: bool, notice: Callable[[str], object] = lambda text: None
    ) -> Lock:
        """Begin the run in a new folder, or go on with it; the folder is locked.

        Args:
            out: The folder of the run.
            resume: Whether to go on with a run that is there.
            notice: Called with what a user should know.

        Raises:
            RunError: As by `records.create` and `records.resume`.
        """
        return records.begin(
            out,
            self.config(),
            self.episodes,
            goes_on=resume,
            notice=notice,
            workers=self.settings.workers,
        )

    def remaining_cases(self, out: Path) -> dict[str, list[Case]]:
        """Return the cases of each agent that have no record yet."""
        keys_by_agent: dict[str, set[CaseKey]] = {}
        for record in records.read(out).records:
            key = (record["task"], record["task_seed"], record["corruption"], record["seed"])
            keys_by_agent.setdefault(record["agent"], set()).add(key)
        return {
            agent: [
                case for case in self.cases.cases if case.key not in keys_by_agent.get(agent, ())
            ]
            for agent in self.settings.agents
        }

    def play(
        self, out: Path, remaining: Mapping[str, Sequence[Case]], tick: Ticker, notice: Listener
    ) -> None:
        """Put the cases to the agents, and write a record of each.

        Args:
            out: the folder of the run, which this process holds.
            remaining: the cases of each agent.
            tick: called with the agent and each record.
            notice: called with what a user should know.
        """
        settings = self.settings
        for agent, cases in remaining.items():
            if not cases:
                continue
            pool = WorkerPool(
                settings.dataset,
                settings.ask_settings(agent),
                count=settings.workers,
                timeout=settings.timeout,
                notice=notice,
                memory=int(settings.agent_memory * 2**30) or None,
                plans=settings.plans,
            )
            with pool:
                _write(
                    out, (record for _, record in pool.run(cases)), lambda r, a=agent: tick(a, r)
                )


def _write(
    out: Path, results: Iterable[ResultRecord], tick: Callable[[ResultRecord], object]
) -> None:
    """Append records, several at a time, since each write waits for the disk."""
    unwritten: list[ResultRecord] = []
    last_write = time.monotonic()
    try:
        for record in results:
            unwritten.append(record)
            tick(record)
            is_due = time.monotonic() - last_write > WRITE_PERIOD_S
            if is_due or len(unwritten) >= MAX_UNWRITTEN_ROWS:
                # Nothing is held any more if Ctrl-C comes while it is written: a record that was
                # appended twice would damage the run.
                batch = unwritten
                unwritten = []
                records.append_all(out, batch)
                last_write = time.monotonic()
    finally:
        records.append_all(out, unwritten)


def _check_agent(agent: str, question: Question) -> None:
    """Check that a class has the method that it will be asked by.

    Raises:
        ParameterError: it lacks it.
    """
    maker = AGENTS.get(agent)
    method = _METHODS[question]
    is_class = maker.is_class if isinstance(maker, AgentReference) else isinstance(maker, type)
    if not is_class:
        return
    methods = maker.methods if isinstance(maker, AgentReference) else method_names(maker)
    if "prepare" in methods:
        raise ParameterError(f"--agent: {agent!r} needs a task and a machine; no dataset has them")
    if method not in methods:
        raise ParameterError(f"--agent: {agent!r} has no {method}, which {question} are scored by")


def _agent_code(agent: str) -> tuple[str, dict[str, Any]]:
    """Return what names the code of an agent: its file, and the settings that it gives itself."""
    maker: Any = AGENTS.get(agent)
    if isinstance(maker, AgentReference):
        settings = {} if maker.settings is None else {"settings": dict(maker.settings)}
        return agent, {**maker.source, **settings}
    code: dict[str, Any] = {}
    source = None if is_ours(maker) else find_source(maker)
    if source is not None:
        code.update(source)
    settings = getattr(maker, "settings", None)
    if callable(settings):
        code["settings"] = settings()
    return agent, code
