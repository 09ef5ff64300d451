"""Threads that read rows, put them to an agent of their own, and judge its answers.

The agent of a user has a process of its own (`agents.agent_process`): one that hangs, dies or forks
costs its row, not the run. Rows of a batch that failed are put to the agent again, one by one.
"""

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

from ..agents.agent_calls import AgentError, RunningAgent
from ..agents.agent_process import AgentProcess
from ..agents.agent_thread import AgentThread
from ..agents.references import is_user_code, reference_to
from ..agents.registry import AGENTS, make
from ..results.reading import ResultRecord
from .cases import Case, RowPlans, open_feed
from .row_asker import AskSettings, RowAsker

CHUNK = 16  # rows that a thread takes at a time: as many as a row group of a dataset
JOIN_TIMEOUT_S = 10.0  # seconds for a thread to notice that the run is over
Listener: TypeAlias = Callable[[str], object]
Judged: TypeAlias = tuple[Case, ResultRecord]


class WorkerPool:
    """Threads that put rows to one agent each; use it in a `with` statement.

    Args:
        folder: the dataset.
        settings: how rows are put to the agent.
        count: how many threads.
        timeout: seconds an agent has for a row.
        notice: called with what a user should know.
        memory: bytes that each agent's process may use; `None` for the default.
        plans: corruptions that are applied to the rows; `None` for none.
    """

    def __init__(
        self,
        folder: Path,
        settings: AskSettings,
        *,
        count: int,
        timeout: float,
        notice: Listener,
        memory: int | None = None,
        plans: RowPlans | None = None,
    ) -> None:
        self._plans = plans
        self._folder = folder
        self._settings = settings
        self._count = count
        self._timeout = timeout
        self._notice = notice
        self._memory = memory
        self._shares: deque[Sequence[Case]] = deque()
        self._results: queue.SimpleQueue[Judged | BaseException] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._agents: list[RunningAgent] = []
        self._stopped = False
        self._notices_given: set[str] = set()
        self._lock = threading.Lock()

    def __enter__(self) -> "WorkerPool":
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped = True
        for agent in list(self._agents):
            if isinstance(agent, AgentProcess):
                agent.kill()  # so that the thread which waits for it ends
        for thread in self._threads:
            thread.join(JOIN_TIMEOUT_S)

    def run(self, cases: Sequence[Case]) -> Iterator[Judged]:
        """Yield the record of each case, as they come.

        Raises:
            AgentSetupError: the agent cannot be made.
        """
        self._shares.extend(cases[at : at + CHUNK] for at in range(0, len(cases), CHUNK))
        for _ in range(min(self._count, len(self._shares))):
            # Daemon threads, so that Ctrl-C need not wait for the answer of an agent in a thread.
            thread = threading.Thread(target=self._work, name="rows", daemon=True)
            self._threads.append(thread)
            thread.start()
        for _ in cases:
            judged = self._results.get()
            if isinstance(judged, BaseException):
                raise judged
            yield judged

    def _work(self) -> None:
        """Put shares of rows to an agent of this thread until none is left."""
        try:
            feed = open_feed(self._folder, self._settings.question, self._plans)
            asker = RowAsker(self._settings, feed, self._start)
            try:
                while not self._stopped:
                    try:
                        share = self._shares.popleft()
                    except IndexError:
                        return
                    self._ask_share(asker, share)
            finally:
                asker.close()
        except BaseException as error:  # noqa: BLE001  (the thread of the run raises it)
            self._results.put(error)

    def _start(self) -> RunningAgent:
        """Return an agent with an object.

        Raises:
            AgentError: it cannot be made.
        """
        settings = self._settings
        entry = AGENTS.get(settings.agent)
        if settings.in_process or not is_user_code(entry):
            return AgentThread(partial(make, settings.agent), self._timeout)
        reference = reference_to(entry, settings.agent)
        agent = AgentProcess(reference, self._timeout, memory=self._memory)
        with self._lock:
            self._agents.append(agent)
        try:
            agent.make()
        except AgentError:
            agent.close()
            raise
        return agent

    def _ask_share(self, asker: RowAsker, share: Sequence[Case]) -> None:
        for start in range(0, len(share), asker.batch):
            part = share[start : start + asker.batch]
            if len(part) > 1:
                try:
                    self._put_results(part, asker.ask_rows(part))
                    continue
                except AgentError as error:
                    self._notify_once(
                        f"predict_batch fails, so its rows are asked one by one: {error}"
                    )
            for case in part:
                if self._stopped:
                    return
                self._put_results([case], [asker.ask_row(case)])

    def _put_results(self, cases: Sequence[Case], records: Sequence[ResultRecord]) -> None:
        for judged in zip(cases, records, strict=True):
            self._results.put(judged)

    def _notify_once(self, text: str) -> None:
        with self._lock:
            if text not in self._notices_given:
                self._notices_given.add(text)
                self._notice(f"{self._settings.agent}: {text}"[:400])
