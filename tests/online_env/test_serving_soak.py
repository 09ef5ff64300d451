"""A server under clients that vanish, lie and hang: afterwards it holds no more than before.

SOAK_S sets how long: 15 seconds by default, ten minutes in CI's long part (.ci/openenv).
"""

import os
import threading
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("prometheus_client", reason=needs.SERVE)
pytest.importorskip("openenv", reason=needs.SERVE)

from support.hostile_clients import soak
from support.serving import Desktops, server, until

TOKEN = "correct-horse-battery-staple"
SECONDS = float(os.environ.get("SOAK_S", "15"))
MAX_GROWTH = 96 * 2**20  # bytes that the process may be larger at the end than after a warm-up
CLIENTS = 6
pytestmark = pytest.mark.filterwarnings("ignore")


def resident() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_clients_that_vanish_lie_and_hang_leave_nothing_behind() -> None:
    with server(Desktops(), 2, token=TOKEN, sessions=8) as (url, service):
        soak(url, TOKEN, CLIENTS, min(SECONDS / 3, 30))
        until(lambda: service.pool.counts().free == 2)
        memory, threads, files = resident(), threading.active_count(), descriptors()
        clients = soak(url, TOKEN, CLIENTS, SECONDS)
        until(lambda: service.pool.counts().free == 2)
        assert [problem for client in clients for problem in client.problems] == []
        assert sum(client.episodes for client in clients) >= SECONDS / 5
        until(lambda: descriptors() <= files + 8)
        assert threading.active_count() <= threads + 8
        assert resident() <= memory + MAX_GROWTH
