"""Clients of `hijack serve` that play, vanish, lie, hang and intrude, until a time is over."""

import json
import random
import socket
import threading
import time

from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import ClientConnection, connect

INVALID_FRAMES = ("null", "[]", "{", '{"type": "fly"}', '{"type": "step", "data": {"action": 5}}')
ANSWER_TIMEOUT_S = 300


class HostileClient:
    """One client, which does one thing after another in a thread of its own.

    Args:
        url: The server, such as `http://127.0.0.1:8000`.
        token: The server's token.
        seed: Of the client's choices.
        seconds: How long it goes on.

    Attributes:
        episodes: How many episodes it has played to their end.
        problems: What it did not expect of the server.
    """

    def __init__(self, url: str, token: str, seed: int, seconds: float) -> None:
        self._port = int(url.rpartition(":")[2])
        self._socket_url = url.replace("http", "ws") + "/ws"
        self._headers = {"Authorization": f"Bearer {token}"}
        self._random = random.Random(seed)
        self._end = time.monotonic() + seconds
        self.episodes = 0
        self.problems: list[str] = []
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        visits = (self._play, self._vanish, self._lie, self._hang, self._intrude)
        while time.monotonic() < self._end:
            try:
                self._random.choices(visits, (6, 2, 2, 1, 1))[0]()
            except (OSError, TimeoutError, WebSocketException):
                pass  # the server was full: a client comes back
            except Exception as error:  # noqa: BLE001  (reported at the end)
                self.problems.append(repr(error))

    def _session(self) -> ClientConnection:
        return connect(
            self._socket_url, additional_headers=self._headers, proxy=None, open_timeout=20
        )

    def _ask(self, session: ClientConnection, kind: str, **data: object) -> dict:
        session.send(json.dumps({"type": kind, "data": data}))
        return json.loads(session.recv(ANSWER_TIMEOUT_S))

    def _play(self) -> None:
        with self._session() as session:
            if self._ask(session, "reset", seed=self._random.randrange(99))["type"] == "error":
                return  # no desktop is free
            answer = self._ask(session, "step", action="DONE")
            assert answer["data"]["done"], answer
            self.episodes += 1

    def _vanish(self) -> None:
        session = self._session()
        session.send(json.dumps({"type": "reset", "data": {}}))
        if self._random.random() < 0.5:
            session.recv(ANSWER_TIMEOUT_S)
        session.socket.shutdown(socket.SHUT_RDWR)  # as when its process is killed

    def _lie(self) -> None:
        with self._session() as session:
            for frame in self._random.sample(INVALID_FRAMES, 3):
                session.send(frame)
                assert json.loads(session.recv(ANSWER_TIMEOUT_S))["type"] == "error", frame

    def _hang(self) -> None:
        with socket.create_connection(("127.0.0.1", self._port), timeout=10) as connection:
            connection.sendall(b"POST /reset HTTP/1.1\r\nHost: a\r\nContent-Le")
            time.sleep(self._random.random())

    def _intrude(self) -> None:
        try:
            connect(self._socket_url, proxy=None, open_timeout=20).close()
        except InvalidStatus as refusal:
            if refusal.response.status_code != 401:
                raise AssertionError(f"refused for another reason: {refusal}") from None
        else:
            raise AssertionError("a client without the token was let in")


def soak(url: str, token: str, clients: int, seconds: float) -> list[HostileClient]:
    """Run clients at the same time until `seconds` are over; return them with what they saw."""
    running = [HostileClient(url, token, seed, seconds) for seed in range(clients)]
    for client in running:
        client.thread.join()
    return running
