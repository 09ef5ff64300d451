"""Play episodes on a Ray cluster: one actor for each desktop, on any node with room.

A thread of the pool starts as many actors as fit on the living nodes, and starts more when an actor
has ended or a node has joined. The threads of the run take ready desktops. If an actor dies, its
episode is lost, as with a local process. If its whole node has died, the agent is not to blame: the
same attempt is played elsewhere, without a record of the loss.
"""

import contextlib
import importlib
import math
import threading
import time
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from hijack_data.errors import HijackError, StorageError

from ..errors import ClusterError
from ..results.records import ResultRecord
from .episode_files import ReceivedEpisode
from .episodes import lost_record
from .jobs import Job
from .ray_node import EpisodeEnd, NodeDesktop, NodeReport
from .worker_bundle import pack
from .workers import (
    BYTES_PER_DESKTOP,
    CORES_PER_DESKTOP,
    SHUTDOWN_TIMEOUT_S,
    WorkerSetup,
    desktops_in,
)

POLL_S = 0.5  # seconds between two checks of the nodes
PING_TIMEOUT_S = 30.0  # seconds within which a free desktop must answer
NODE_DEATH_TIMEOUT_S = 60.0  # seconds until Ray is certain whether a node has died
NODE_DEATH_DELAY_S = 3.0  # seconds between Ray's reports of an actor's death and of its node's
MAX_NODE_DEATHS = 3  # deaths of nodes that one attempt may survive
MAX_FAILED_STARTS = 5  # processes in a row that may die while they start
ROOM_TIMEOUT_S = 600.0  # seconds that a run waits for nodes when none has room
MAX_FILES_AHEAD = 8  # files that a node may send ahead of the runner
GIB = 2**30


@dataclass(frozen=True)
class _Desktop:
    """An actor that is ready, and where it runs."""

    actor: Any
    report: NodeReport


def is_started_here(address: str | None) -> bool:
    """Return whether an address stands for a Ray that the run itself starts and stops."""
    connection = _connection()
    return connection.resolve_address(address) == connection.LOCAL


def _connection() -> Any:
    """Return the module that connects to Ray, which builds share."""
    return importlib.import_module("pipelines.engines.ray_connection")


class RayPool:
    """Desktops on the nodes of a Ray cluster: an `EpisodePool`.

    Args:
        setup: The settings for an actor.
        max_desktops: The most desktops at once.
        address: Of the cluster; see `pipelines.engines.ray_connection.session`.
    """

    def __init__(self, setup: WorkerSetup, max_desktops: int, address: str | None = None) -> None:
        self.desktops = max_desktops
        self.max_episodes = max_desktops
        self._setup = setup
        self._address = address
        self._stack = ExitStack()
        self._condition = threading.Condition()
        self._local = threading.local()
        self._free_desktops: list[_Desktop] = []
        self._actors: set[Any] = set()  # actors that were started, except those known to have ended
        self._starting: dict[Any, Any] = {}  # actors by the future result of their `begin`
        self._problem: Exception | None = None
        self._stopped = threading.Event()
        self._failures = 0
        self._room_seen = math.inf
        self._supplier: threading.Thread | None = None

    def __enter__(self) -> "RayPool":
        """Connect to the cluster.

        Raises:
            MissingDependencyError: Ray is not installed.
            ClusterError: There is no cluster, or no node has room for a desktop.
        """
        bundle = pack(self._setup)
        with ExitStack() as stack:
            session = _connection().session(
                self.max_episodes * CORES_PER_DESKTOP,
                self._address,
                memory=self.max_episodes * BYTES_PER_DESKTOP,
                error=ClusterError,
            )
            self._ray: Any = stack.enter_context(session)
            self.desktops = min(self.max_episodes, self._count_room())
            self._actor = self._ray.remote(
                num_cpus=CORES_PER_DESKTOP,
                memory=BYTES_PER_DESKTOP,
                max_restarts=0,
                scheduling_strategy="SPREAD",
            )(NodeDesktop)
            self._parcel = self._ray.put(bundle)
            stack.callback(self._join_supplier)
            stack.callback(self.stop)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @contextmanager
    def reserve(self) -> Generator[None]:
        """Return a context that is entered once a desktop is free for this thread."""
        self._local.desktop = self._take()
        try:
            yield
        finally:
            if self._local.desktop is not None:
                self._put_back(self._local.desktop)

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Play an episode; see `EpisodePool`."""
        start = time.monotonic()
        problem = ""
        for _ in range(MAX_NODE_DEATHS):
            desktop = self._live_desktop()
            try:
                return self._play(desktop, job, attempt)
            except self._ray.exceptions.RayError as error:
                self._drop(desktop.actor)
                self._local.desktop = None
                host = desktop.report.host
                problem = f"the process that played the episode on {host} ended: {_reason(error)}"
                if not self._has_died(desktop.report.node, error):
                    break
            except BaseException:
                self._drop(desktop.actor)  # the actor may still be playing
                self._local.desktop = None
                raise
        return lost_record(job, attempt, problem, start=start)

    def stop(self) -> None:
        """End all desktops; those that play break their episodes off."""
        with self._condition:
            self._stopped.set()
            self._condition.notify_all()
            free = list(self._free_desktops)
            self._free_desktops.clear()
            actors = list(self._actors)
        ending = [desktop.actor.end.remote() for desktop in free]
        if ending:
            self._ray.wait(ending, num_returns=len(ending), timeout=SHUTDOWN_TIMEOUT_S)
        for actor in actors:
            self._drop(actor)

    # The thread that starts desktops, which begins with the first episode

    def _join_supplier(self) -> None:
        if self._supplier is not None:
            self._supplier.join()

    def _start_desktops(self) -> None:
        while not self._stopped.is_set():
            try:
                self._start_actors()
                self._collect_ready()
            except Exception as error:  # noqa: BLE001  (the run's own threads raise it)
                with self._condition:
                    self._problem = error
                    self._condition.notify_all()
                return

    def _start_actors(self) -> None:
        """Start an actor for each desktop that fits on the nodes.

        Raises:
            ClusterError: There has been no room for too long.
        """
        time_now = time.monotonic()
        try:
            room = self._count_room()
        except ClusterError:
            if time_now - self._room_seen > ROOM_TIMEOUT_S:
                raise
            return
        self._room_seen = time_now
        with self._condition:
            while len(self._actors) < min(self.max_episodes, room) and not self._stopped.is_set():
                actor = self._actor.remote()
                self._actors.add(actor)
                self._starting[actor.begin.remote(self._parcel)] = actor

    def _collect_ready(self) -> None:
        """Make the desktops that have become ready available.

        Raises:
            ClusterError: A node cannot play, or processes keep dying.
            _with_node_name: The error that a node reported, with the node's name.
        """
        if not self._starting:
            self._stopped.wait(POLL_S)
            return
        ready, _ = self._ray.wait(list(self._starting), timeout=POLL_S)
        for answer in ready:
            actor = self._starting.pop(answer)
            try:
                report: NodeReport = self._ray.get(answer)
            except self._ray.exceptions.RayError as error:
                self._drop(actor)
                self._count_failure(error)
                continue
            if report.problem is not None:
                raise _with_node_name(report, report.problem)
            self._failures = 0
            self._put_back(_Desktop(actor, report))

    def _count_failure(self, error: Exception) -> None:
        """Count a process that died while it started.

        Raises:
            ClusterError: The process could not even begin, or too many have died in a row.
        """
        self._failures += 1
        never_began = getattr(error, "actor_init_failed", False)
        is_ours = isinstance(error, self._ray.exceptions.RayTaskError)
        if never_began or is_ours:
            raise ClusterError(
                f"a node cannot start a desktop ({_reason(error)}); install the same agenthijack,"
                " with the extras [online,ray], on every node"
            )
        if self._failures >= MAX_FAILED_STARTS and not self._stopped.is_set():
            raise ClusterError(
                f"{self._failures} processes in a row ended before their desktop was up"
                f" ({_reason(error)}); the logs of Ray on the nodes say more"
            )

    def _count_room(self) -> int:
        """Return how many desktops the living nodes can hold.

        Raises:
            ClusterError: No node has room for a desktop.
        """
        nodes = [node for node in self._ray.nodes() if node["Alive"]]
        room = sum(_node_room(node) for node in nodes)
        if room:
            return room
        description = "; ".join(_describe_node(node) for node in nodes) or "no node is alive"
        raise ClusterError(
            "no node of the cluster has room for a desktop, which takes"
            f" {CORES_PER_DESKTOP} CPU and {BYTES_PER_DESKTOP / GIB:g} GiB of memory"
            f" ({description}); start nodes with more: ray start --num-cpus=N --memory=BYTES"
        )

    # Desktops

    def _take(self) -> _Desktop:
        """Wait for a free desktop, and return it.

        Raises:
            ClusterError: The run is being stopped.
        """
        with self._condition:
            if self._supplier is None:
                self._supplier = threading.Thread(
                    target=self._start_desktops, name="desktops", daemon=True
                )
                self._supplier.start()
            self._condition.wait_for(
                lambda: self._free_desktops or self._problem is not None or self._stopped.is_set()
            )
            if self._problem is not None:
                raise self._problem
            if self._stopped.is_set():
                raise ClusterError("the desktops of this run were ended")
            return self._free_desktops.pop(0)

    def _put_back(self, desktop: _Desktop) -> None:
        with self._condition:
            self._free_desktops.append(desktop)
            self._condition.notify()

    def _live_desktop(self) -> _Desktop:
        """Return the desktop of this thread, or another if it does not answer."""
        while True:
            if self._local.desktop is None:
                self._local.desktop = self._take()
            desktop: _Desktop = self._local.desktop
            try:
                self._ray.get(desktop.actor.ping.remote(), timeout=PING_TIMEOUT_S)
            except self._ray.exceptions.RayError:
                self._local.desktop = None
                self._drop(desktop.actor)
            else:
                return desktop

    def _drop(self, actor: Any) -> None:
        """End an actor, in whatever state it is."""
        with self._condition:
            self._actors.discard(actor)
        with contextlib.suppress(Exception):
            self._ray.kill(actor)

    def _has_died(self, node: str, error: Exception) -> bool:
        """Return whether a node has died; Ray may learn of it later than of its actors."""
        is_sure = not isinstance(error, self._ray.exceptions.ActorUnavailableError)
        end = time.monotonic() + (NODE_DEATH_DELAY_S if is_sure else NODE_DEATH_TIMEOUT_S)
        while not self._stopped.is_set():
            living = [entry["NodeID"] for entry in self._ray.nodes() if entry["Alive"]]
            if node not in living:
                return True
            if time.monotonic() > end:
                return False
            self._stopped.wait(POLL_S)
        return False

    def _play(self, desktop: _Desktop, job: Job, attempt: int) -> ResultRecord:
        """Play an episode on a desktop and place its files in the folder of the run.

        Raises:
            _with_node_name: The error that refuses the episode, with the node's name.
        """
        arrival = ReceivedEpisode(self._setup.folder)
        end = EpisodeEnd(problem=ClusterError("the episode ended without a record"))
        episode_stream = desktop.actor.play.options(
            num_returns="streaming", _generator_backpressure_num_objects=MAX_FILES_AHEAD
        )
        try:
            for part in episode_stream.remote(job, attempt):
                name, content = self._ray.get(part)
                if name:
                    arrival.put(name, content)
                else:
                    end = content
        except BaseException:
            arrival.undo()
            raise
        if end.record is None:
            raise _with_node_name(desktop.report, end.problem)
        return end.record


def _node_room(node: Mapping[str, Any]) -> int:
    resources = node["Resources"]
    return desktops_in(resources.get("CPU", 0.0), resources.get("memory", 0.0))


def _describe_node(node: Mapping[str, Any]) -> str:
    resources = node["Resources"]
    cores = f"{resources.get('CPU', 0.0):g} CPUs"
    memory = f"{resources.get('memory', 0.0) / GIB:.1f} GiB"
    return f"{node['NodeManagerHostname']} has {cores} and {memory}"


def _with_node_name(report: NodeReport, error: Exception | None) -> HijackError:
    """Return an error of a node with the node's name added."""
    kind = StorageError if isinstance(error, StorageError) else ClusterError
    return kind(f"node {report.host}: {error}")


def _reason(error: Exception) -> str:
    """Return the last line of what Ray says."""
    text = str(error).partition("\n\nThe above exception")[0].strip()
    return text.splitlines()[-1] if text else type(error).__name__
