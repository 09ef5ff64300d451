"""Starts a server from its options, and ends it with all its desktops."""

import contextlib
import ctypes
import re
import signal
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NoReturn

from hijack_data.errors import ParameterError
from hijack_data.types import Size

from ..bench.config import Bench
from ..bench.playable import check_machines
from ..bench.providers import check_installed
from ..bench.workers import open_stage
from ..environment.script import check_corruptions
from ..environment.stage import Stage
from ..tasks import find_family
from ..tasks.machines import MachineSettings
from .access import bind, is_loopback
from .episode_draws import HELD_OUT, TRAINING, EpisodeDraws, sides
from .errors import HeldOutTaskError
from .pool import DesktopPool, StageMaker
from .service import DesktopService

TOKEN = "AGENTHIJACK_SERVE_TOKEN"
ENDLESS = 2**31  # episodes: a server does not know how many it will play
MAX_MESSAGE_BYTES = 2**20  # most bytes of a message from a client
PING_INTERVAL_S = 20.0  # seconds between two pings
PING_TIMEOUT_S = 120.0  # seconds within which a client must answer a ping
SHUTDOWN_GRACE_S = 10  # seconds that sessions have to end when the server stops
# malloc.h
MMAP_THRESHOLD = -3
ARENA_MAX = -8
MMAP_MIN_BYTES = 2**19  # allocations of at least this many bytes get a mapping of their own
MAX_ARENAS = 2


@dataclass(frozen=True, kw_only=True)
class ServeOptions:
    """The options of a server.

    Args:
        bench: The benchmark with tasks, corruptions, desktop and limits; agents and seeds are not
            used.
        desktops: How many desktops there are.
        host: The address to listen at.
        port: 0 takes a free one.
        token: What clients have to send; `None` for nothing.
        is_evaluation: Whether held-out tasks are served as well.
        osworld_split: Whose held-out tasks of OSWorld these are: `osworld` for ours, `agenthijack`
            for all but the 128 on which the paper's authors train.
        per: As in `CorruptionSampler`.
        clean: The share of clean episodes; `None` for that of one condition among all.
        seed: Of all draws.
        sessions: How many clients may be connected; by default 4 for each desktop.
        line: How many of them may wait for a desktop; by default 2 for each desktop.
        wait_timeout: Seconds that they wait at most.
        lease: Seconds of silence after which a client loses its desktop.
        log: The folder for the episodes; `None` writes none.
    """

    bench: Bench
    desktops: int = 1
    host: str = "127.0.0.1"
    port: int = 8000
    token: str | None = None
    is_evaluation: bool = False
    osworld_split: str = "osworld"
    per: str = "rollout"
    clean: float | None = None
    seed: int = 0
    sessions: int | None = None
    line: int | None = None
    wait_timeout: float = 45.0
    lease: float = 600.0
    log: Path | None = None

    def draws(self) -> EpisodeDraws:
        """Return the object that decides what resets play.

        Raises:
            HeldOutTaskError: All tasks are held out.
        """
        split = sides(self.bench.tasks, self.osworld_split)
        tasks = self.bench.tasks if self.is_evaluation else split[TRAINING]
        if not tasks and split[HELD_OUT]:
            raise HeldOutTaskError(
                f"all {len(split[HELD_OUT])} tasks are held out: results are reported on them, so"
                " nothing may be trained on them; --evaluation serves them for scoring"
            )
        return EpisodeDraws(
            tasks,
            self.bench.planners,
            per=self.per,
            seed=self.seed,
            clean=self.clean,
            held_out=() if self.is_evaluation else split[HELD_OUT],
            osworld_split=self.osworld_split,
        )


def override_size(bench: Bench, size: str | None) -> Bench:
    """Return a benchmark with another size of the screens, if one is given.

    Args:
        bench: As it is configured.
        size: WIDTHxHEIGHT in pixels.

    Raises:
        ParameterError: `size` is not WIDTHxHEIGHT.
    """
    return bench if size is None else replace(bench, size=_parse_size(size))


def make_service(options: ServeOptions) -> DesktopService:
    """Return the shared part of a server; nothing is started yet.

    Raises:
        ParameterError: An option does not fit.
        MissingPackageError: A package of a task is missing.
    """
    bench = options.bench
    draws = options.draws()
    if find_family(draws.tasks) is None:
        check_installed(bench.provider, draws.tasks)
    check_machines(bench, episodes=ENDLESS)
    desktops = options.desktops
    machines = desktops if bench.machines is None else len(bench.machines.single_machines())
    if desktops > machines:
        raise ParameterError(
            f"--desktops {desktops}: only {machines} machines are named, and each is one desktop;"
            " name more (--vm, --machines), or leave out --desktops"
        )
    pool = DesktopPool(
        stage_maker(bench, options.log),
        count=desktops,
        line=2 * desktops if options.line is None else options.line,
        wait_timeout=options.wait_timeout,
    )
    settings = bench.settings("client", options.log)
    return DesktopService(pool, draws, settings, lease=options.lease)


def stage_maker(bench: Bench, log: Path | None) -> StageMaker:
    """Return what starts one desktop of a server.

    Machines of the user are started in turn; one that failed comes last, so that a machine which
    stands by is used before it is tried again.

    Args:
        bench: The benchmark.
        log: The folder for the episodes, which the desktops must not see.
    """
    if bench.machines is None:
        return lambda: open_stage(bench, log)
    waiting: SimpleQueue[MachineSettings] = SimpleQueue()
    for settings in bench.machines.single_machines():
        waiting.put(settings)

    @contextlib.contextmanager
    def next_machine() -> Generator[Stage]:
        settings = waiting.get()
        try:
            with open_stage(replace(bench, machines=settings), log) as stage:
                yield stage
        finally:
            waiting.put(settings)

    return next_machine


def check_desktops(service: DesktopService) -> None:
    """Check that the desktops support every corruption, before any client asks for one.

    Raises:
        MissingCapabilityError: They lack a capability.
    """
    desktop = service.pool.any_seat().stage.desktop
    planners, settings = service.draws.planners.values(), service.settings
    check_corruptions(planners, settings.max_steps, desktop, settings.layer)


def serve(options: ServeOptions, say: Callable[[str], object]) -> None:
    """Serve until SIGTERM or Ctrl-C; all desktops have ended when this returns.

    Args:
        options: What is served, and how.
        say: Called with lines for the user.

    Raises:
        ParameterError: An option does not fit, or the port is taken.
        DesktopError: A desktop does not start.
    """
    from .app import make_app

    if options.token is None and not is_loopback(options.host):
        raise ParameterError(
            f"{options.host} can be reached from other machines, which needs a token: set"
            f" {TOKEN}, or give --token-file"
        )
    _return_freed_memory()
    service = make_service(options)
    sessions = options.sessions or 4 * options.desktops
    app = make_app(service, sessions=sessions, token=options.token)
    with bind(options.host, options.port) as listener:
        signal.signal(signal.SIGTERM, _interrupt)
        try:
            service.start()
            check_desktops(service)
            web_server = make_web_server(app, sessions)
            listener.listen()  # from here on, early clients wait
            say(_describe(options, service, listener.getsockname()[1]))
            web_server.run(sockets=[listener])
        except KeyboardInterrupt:
            pass
        finally:
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, signal.SIG_IGN)  # nothing must interrupt the shutdown
            service.close()
    say("the server has ended")


def make_web_server(app: Any, sessions: int) -> Any:
    """Return uvicorn's server of an application, with the limits of connections and requests.

    Args:
        app: The application of `make_app`.
        sessions: How many clients may be connected at a time.
    """
    import uvicorn

    from .limits import SPARE_CONNECTIONS, bounded_protocol

    config = uvicorn.Config(
        app,
        http=bounded_protocol(sessions + SPARE_CONNECTIONS),
        log_level="warning",
        access_log=False,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_ping_interval=PING_INTERVAL_S,
        ws_ping_timeout=PING_TIMEOUT_S,
        # Compressing a PNG again does not make it smaller, and takes longer than sending it.
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=SHUTDOWN_GRACE_S,
    )
    return uvicorn.Server(config)


def _parse_size(text: str) -> Size:
    match = re.fullmatch(r"([0-9]{3,4})[xX]([0-9]{3,4})", text)
    if match is None:
        raise ParameterError(f"--size must be WIDTHxHEIGHT, such as 1280x720, got {text!r:.80}")
    width, height = map(int, match.groups())
    return height, width


def _describe(options: ServeOptions, service: DesktopService, port: int) -> str:
    draws = service.draws
    host = f"[{options.host}]" if ":" in options.host else options.host
    held_out = len(draws.held_out)
    without = f" ({held_out} held-out left out)" if held_out else ""
    access = "with a token" if options.token else "without a token"
    plural = "s" if options.desktops > 1 else ""
    return (
        f"{len(draws.tasks)} tasks{without}, {len(draws.planners)} conditions,"
        f" {options.desktops} desktop{plural} at http://{host}:{port}, {access}  (Ctrl-C ends)"
    )


def _return_freed_memory() -> None:
    """Let glibc return the memory of every picture to the system as soon as it is free.

    Otherwise it keeps freed memory for each of the threads that come and go with the sessions.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # other C libraries have none
    if mallopt is not None:
        mallopt(MMAP_THRESHOLD, MMAP_MIN_BYTES)
        mallopt(ARENA_MAX, MAX_ARENAS)


def _interrupt(*_: object) -> NoReturn:
    """End the server as Ctrl-C does.

    Raises:
        KeyboardInterrupt: Always.
    """
    raise KeyboardInterrupt
