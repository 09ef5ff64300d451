"""A server's parts on desktops that are none."""

import contextlib
import socket
import threading
import time

import hijack_data as hj
from online_env.environment import EvalSettings
from online_env.errors import DesktopError
from online_env.serving.drawing import EpisodeDraws
from online_env.serving.pool import DesktopPool
from online_env.serving.service import DesktopService

from support.live import AT_ONCE, FakeDesktop, FakeStage

TASKS = ("write_note", "rename_file")


class Desktops:
    """Makes stages; those in `stages` are up. `failures` many do not start, for `problem`."""

    def __init__(self):
        self.stages = []
        self.made = 0
        self.failures = 0
        self.problem = DesktopError("no desktop today")

    @contextlib.contextmanager
    def make(self):
        if self.failures:
            self.failures -= 1
            raise self.problem
        self.made += 1
        stage = FakeStage(FakeDesktop())
        self.stages.append(stage)
        yield stage
        self.stages.remove(stage)


def pool_of(desktops, count=1, *, line=1, patience=5.0):
    return DesktopPool(desktops.make, count=count, line=line, patience=patience)


@contextlib.contextmanager
def service_on(
    desktops,
    count=1,
    *,
    planners=None,
    lease=600.0,
    log=None,
    line=1,
    patience=5.0,
    held_out=(),
    **draws,
):
    """A service that runs, and is ended after the block."""
    if planners is None:
        planners = {
            "clean": None,
            "marks": hj.make_corruption("marks"),
            "subtitle": hj.make_corruption("subtitle"),
        }
    settings = EvalSettings(max_steps=4, settle=AT_ONCE, log=log, agent="client")
    service = DesktopService(
        pool_of(desktops, count, line=line, patience=patience),
        EpisodeDraws(TASKS, planners, held_out=held_out, **draws),
        settings,
        lease=lease,
    )
    service.start()
    try:
        yield service
    finally:
        service.close()


def until(condition, seconds=10.0):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "that did not happen"
        time.sleep(0.01)


@contextlib.contextmanager
def server(desktops=None, count=1, *, token=None, sessions=4, **options):
    """A server in a thread; yields its address and its service."""
    from online_env.serving.app import make_app
    from online_env.serving.running import make_web_server

    with service_on(desktops or Desktops(), count, **options) as service:
        app = make_app(service, sessions=sessions, token=token)
        running = make_web_server(app, sessions)
        with socket.create_server(("127.0.0.1", 0)) as listener:
            thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
            thread.start()
            try:
                yield f"http://127.0.0.1:{listener.getsockname()[1]}", service
            finally:
                running.should_exit = True
                thread.join()
