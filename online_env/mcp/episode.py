"""`McpEpisode`: the episode of an MCP client, played and recorded as one of `hijack bench`."""

import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

from hijack_data.errors import HijackError, ParameterError
from hijack_data.runs.run_log import episode_slug

from ..agents.guarded import Onlooker
from ..agents.guards import is_file, make_onlooker
from ..bench.config import Bench
from ..bench.episodes import play
from ..bench.jobs import Job, jobs
from ..bench.models import ModelOptions, begin, prepare
from ..bench.playable import only_playable
from ..bench.providers import EMBEDDED, check_installed
from ..bench.runner import needs_attempt
from ..bench.workers import open_stage
from ..environment import CorruptedEnv
from ..environment.script import check_corruptions
from ..environment.settle import Settle
from ..results import records
from ..results.records import ResultRecord
from ..tasks import find_family
from .tool_client import ToolClient

BROWSER = "browser"
POLL_S = 0.25  # seconds between two looks whether the client is there


@dataclass(frozen=True, kw_only=True)
class McpOptions:
    """The options of an episode.

    Args:
        bench: The benchmark: one agent, the name of the client, at one task under one condition.
        folder: The folder of the run, which is new.
        with_tree: Whether the client may ask for the accessibility tree.
        tell_score: Whether the client is told its score at the end.
        lease: Seconds of silence after which the client counts as gone.
    """

    bench: Bench
    folder: Path
    with_tree: bool = True
    tell_score: bool = False
    lease: float = 600.0


def check_bench(bench: Bench) -> Job:
    """Return the one episode of a benchmark, and check that it can be played here.

    Raises:
        ParameterError: There are several, or the task is played on another kind of desktop.
        ConfigError: The task cannot be played here.
        MissingPackageError: A package of the task is missing.
    """
    listed = jobs(bench)
    if len(listed) != 1:
        raise ParameterError(
            f"a client plays one episode, and --task and --corruption name {len(listed)}: give one"
            " task and one corruption"
        )
    family = find_family(bench.tasks)
    expected = EMBEDDED if family is None else family.provider
    if expected != bench.provider:
        option = "--browser" if expected == BROWSER else "--desktop"
        raise ParameterError(f"--task {bench.tasks[0]}: give {option}, where this task is played")
    only_playable(bench, "refuse", lambda text: None)
    if family is None:
        check_installed(bench.provider, bench.tasks)
    return listed[0]


class McpEpisode:
    """Plays the episode in a thread; use it in a `with` statement, whose end ends the desktop.

    Args:
        options: What is played.

    Attributes:
        client: The agent, which acts when tools are called.
        record: The last record of the run; `None` before there is one.
    """

    def __init__(self, options: McpOptions) -> None:
        self.client = ToolClient()
        self.record: ResultRecord | None = None
        self._options = options
        self._job = check_bench(options.bench)
        self._error: BaseException | None = None
        self._last_call = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="episode")

    def __enter__(self) -> "McpEpisode":
        """Start the desktop, and wait until the client may act.

        Raises:
            HijackError: The desktop does not start, or the episode cannot be played.
        """
        options = self._options
        config = options.bench.to_data()
        # The client needs nothing of the run's, its guard may.
        prepare(replace(options.bench, agents=()), ModelOptions(), options.folder)
        self._lock = records.begin(
            options.folder, config, [self._job.id], goes_on=False, desktops=1
        )
        self._thread.start()
        try:
            self.client.look()
        except BaseException as error:
            self.__exit__()
            if self._error is not None:
                raise self._error from None
            if self.record is not None:
                raise HijackError(f"the episode did not begin: {self.record['problem']}") from error
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.client.leave()
        self._thread.join()
        self._lock.release()

    def read_score(self) -> float | None:
        """Return the score of the episode; `None` if it does not count."""
        self._thread.join()
        return None if self.record is None else self.record["score"]

    def note_call(self) -> None:
        """Note that the client is there."""
        self._last_call = time.monotonic()

    def end_if_silent(self) -> bool:
        """End the episode if the client was silent for too long; return whether it was."""
        lease = self._options.lease
        is_silent = time.monotonic() - self._last_call > lease
        if is_silent:
            self.client.leave(f"the client was silent for {lease:g} s")
        return is_silent

    def _run(self) -> None:
        try:
            attempts: list[ResultRecord] = []
            # A client that has acted cannot be taken back to the beginning.
            while not self.client.has_acted and needs_attempt(
                attempts, self._options.bench.retries
            ):
                record = self._play(len(attempts))
                folder = self._options.folder
                record = records.stored_record(folder, record)
                records.append(folder, record)
                self.record = record
                attempts.append(record)
        except BaseException as error:  # noqa: BLE001  (the main thread raises it)
            self._error = error
        finally:
            self.client.end()

    def _play(self, attempt: int) -> ResultRecord:
        """Play the episode on a desktop of its own, and return its record."""
        options, job = self._options, self._job
        bench = options.bench
        planner = bench.planners[job.corruption]
        with open_stage(bench, options.folder) as stage:
            check_corruptions([planner], bench.max_steps, stage.desktop, bench.layer)
            self.client.desktop = stage.desktop
            settle = getattr(stage.desktop, "settle", Settle())
            settings = replace(bench.settings(job.agent, options.folder), settle=settle)
            env = CorruptedEnv(stage, settings=settings)
            return play(
                env,
                self.client,
                job,
                attempt,
                planner,
                privileged_inputs=("tree",) if options.with_tree else (),
                limit=bench.episode_timeout,
                onlooker=self._make_onlooker(attempt),
            )

    def _make_onlooker(self, attempt: int) -> Onlooker | None:
        """Return the guard of an attempt; a model's requests are logged."""
        guard, job = self._options.bench.guard, self._job
        if not guard:
            return None
        episode = episode_slug(*job.key[1:3], job.seed, job.agent, attempt)
        chat_run = begin(guard, "", episode) if is_file(guard) else None
        return make_onlooker(guard, job.agent, chat_run)
