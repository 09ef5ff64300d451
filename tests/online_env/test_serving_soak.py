"""A server under clients that vanish, lie and hang: afterwards it holds no more than before.

SOAK_S sets how long: 15 seconds by default, ten minutes in CI's long part (.ci/openenv).
"""

import json
import os
import random
import socket
import threading
import time
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("prometheus_client", reason=needs.SERVE)
pytest.importorskip("openenv", reason=needs.SERVE)

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from support.serving import Desktops, server, until

TOKEN = "correct-horse-battery-staple"
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
SECONDS = float(os.environ.get("SOAK_S", "15"))
MAX_GROWTH = 96 * 2**20  # bytes that the process may be larger at the end than after a warm-up
FRAMES = ("null", "[]", "{", '{"type": "fly"}', '{"type": "step", "data": {"action": 5}}')
pytestmark = pytest.mark.filterwarnings("ignore")


def resident() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


class Client:
    """One client, which does one thing after another until the time is over."""

    def __init__(self, url: str, seed: int, end: float) -> None:
        self.url = url
        self.random = random.Random(seed)
        self.end = end
        self.solved = 0
        self.problems: list[str] = []
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self) -> None:
        visits = (self.play, self.vanish, self.lie, self.hang, self.intrude)
        while time.monotonic() < self.end:
            try:
                self.random.choices(visits, (6, 2, 2, 1, 1))[0]()
            except (OSError, TimeoutError, WebSocketException):
                pass  # the server was full: a client comes back
            except Exception as error:  # noqa: BLE001  (told at the end)
                self.problems.append(repr(error))

    def session(self) -> ClientConnection:
        address = self.url.replace("http", "ws") + "/ws"
        return connect(address, additional_headers=HEADERS, proxy=None, open_timeout=20)

    def ask(self, wire: ClientConnection, kind: str, **data: object) -> dict:
        wire.send(json.dumps({"type": kind, "data": data}))
        return json.loads(wire.recv(60))

    def play(self) -> None:
        with self.session() as wire:
            if self.ask(wire, "reset", seed=self.random.randrange(99))["type"] == "error":
                return  # no desktop is free
            answer = self.ask(wire, "step", action="DONE")
            assert answer["data"]["done"], answer
            self.solved += 1

    def vanish(self) -> None:
        wire = self.session()
        wire.send(json.dumps({"type": "reset", "data": {}}))
        if self.random.random() < 0.5:
            wire.recv(60)
        wire.socket.shutdown(socket.SHUT_RDWR)  # as when its process is killed

    def lie(self) -> None:
        with self.session() as wire:
            for frame in self.random.sample(FRAMES, 3):
                wire.send(frame)
                assert json.loads(wire.recv(60))["type"] == "error", frame

    def hang(self) -> None:
        port = int(self.url.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
            connection.sendall(b"POST /reset HTTP/1.1\r\nHost: a\r\nContent-Le")
            time.sleep(self.random.random())

    def intrude(self) -> None:
        with pytest.raises(WebSocketException), connect(self.url.replace("http", "ws") + "/ws"):
            pass


def test_clients_that_vanish_lie_and_hang_leave_nothing_behind() -> None:
    with server(Desktops(), 2, token=TOKEN, sessions=8) as (url, service):

        def soak(seconds: float) -> list[Client]:
            end = time.monotonic() + seconds
            clients = [Client(url, seed, end) for seed in range(6)]
            for client in clients:
                client.thread.join()
            until(lambda: service.pool.counts().free == 2)
            return clients

        soak(min(SECONDS / 3, 30))
        memory, threads, files = resident(), threading.active_count(), descriptors()
        clients = soak(SECONDS)
        assert [problem for client in clients for problem in client.problems] == []
        assert sum(client.solved for client in clients) >= SECONDS / 5
        until(lambda: descriptors() <= files + 8)
        assert threading.active_count() <= threads + 8
        assert resident() <= memory + MAX_GROWTH
