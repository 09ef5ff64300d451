"""What runs in the process of an agent: it makes the agent and answers the runner's requests.

A message is its length in four bytes and JSON. Pictures are in the memory file that the runner
writes, one after the other; each request names their sizes. Nothing that the agent sends is
unpickled or run by the runner.
"""

import faulthandler
import json
import os
import socket
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, TypeAlias

import numpy as np

from hijack_data.errors import HijackError, PluginError
from hijack_data.loading import find_source, load_reference
from hijack_data.types import UInt8Array

from . import agent_calls
from .agent_calls import (
    MAX_PROBLEM,
    AgentAnswer,
    AgentError,
    InvalidAction,
    error_frames,
    error_text,
)
from .agent_checks import check_agent

HEADER = struct.Struct(">I")
MAX_REPLY = 16 * 2**20  # bytes of an agent's answer as JSON
Message: TypeAlias = dict[str, Any]


class AgentServer:
    """Answers the requests of the runner, in the main thread of the agent's process.

    Args:
        connection: to the runner.
        pictures: the descriptor of the memory file.
    """

    def __init__(self, connection: socket.socket, pictures: int) -> None:
        self._connection = connection
        self._pictures = pictures
        self._maker: Any = None
        self._agent: Any = None
        self._pid = os.getpid()
        # A forked helper of the agent must not answer in its place.
        os.register_at_fork(after_in_child=connection.close)

    def run(self) -> None:
        """Answer until the runner closes the connection."""
        faulthandler.enable()  # a crash in native code says where
        while (request := self._receive()) is not None:
            pictures = self._read_pictures(request.pop("sizes", ()))
            try:
                reply: Message = {"value": self._answer(request, pictures)}
            except BaseException as error:  # noqa: BLE001  (an agent may raise anything)
                reply = {"error": error_text(error), "where": error_frames(error)}
            self._send(reply)

    def _answer(self, request: Message, pictures: Sequence[UInt8Array]) -> Any:
        name: str = request["call"]
        if name == "load":
            return self._load(request["reference"], request["sha256"])
        if name == "make":
            self._agent = None  # the last object is freed first: it may hold much memory
            self._agent = self._maker()
            return asdict(agent_calls.read_traits(self._agent))
        if name == "predict":
            obs = {"screenshot": pictures[0]}
            return _answer_to_data(agent_calls.predict(self._agent, request["instruction"], obs))
        if name == "predict_batch":
            instructions = request["instructions"]
            return [
                _answer_to_data(a)
                for a in agent_calls.predict_batch(self._agent, instructions, pictures)
            ]
        if name == "check":
            return agent_calls.check(self._agent, pictures[0])
        if name == "summarise":
            before, after = pictures
            return agent_calls.summarise(self._agent, before, request["action"], after)
        if name == "follow":
            return agent_calls.follow(self._agent, request["lines"])
        if name == "connect":
            return agent_calls.connect(self._agent, request["address"])
        if name == "usage":
            return agent_calls.usage(self._agent)
        return agent_calls.reset(self._agent)

    def _load(self, reference: str, sha256: str | None) -> Message:
        """Import the agent's code; return what it is, or why it is refused.

        Raises:
            PluginError: Caught here: a refusal is returned as data.
        """
        try:
            self._maker = load_reference(reference)
            check_agent(self._maker)
            source = find_source(self._maker) or {}
            if sha256 is not None and source.get("sha256") != sha256:
                remedy = "was changed since the run began; begin it again"
                raise PluginError(f"{source.get('path', reference)}: {remedy}")
            return _description(self._maker, source)
        except HijackError as error:
            return {"refused": [type(error).__name__, str(error)[:MAX_PROBLEM]]}

    def _read_pictures(self, sizes: Sequence[Sequence[int]]) -> list[UInt8Array]:
        """Return copies of the pictures, which the agent may change and keep."""
        copies: list[UInt8Array] = []
        start = 0
        for height, width in sizes:
            picture = np.empty((height, width, 3), np.uint8)
            view: memoryview = picture.data.cast("B")
            copied = 0
            while copied < len(view):
                copied += os.preadv(self._pictures, [view[copied:]], start + copied)
            start += copied
            copies.append(picture)
        return copies

    def _receive(self) -> Message | None:
        head = self._read(HEADER.size)
        body = None if head is None else self._read(HEADER.unpack(head)[0])
        return None if body is None else json.loads(body)

    def _read(self, count: int) -> bytes | None:
        data = bytearray()
        while len(data) < count:
            try:
                part = self._connection.recv(count - len(data))
            except OSError:
                return None
            if not part:
                return None
            data += part
        return bytes(data)

    def _send(self, reply: Message) -> None:
        if os.getpid() != self._pid:  # a forked child that returned from the agent's call
            os._exit(0)
        data = encode(reply)
        if len(data) > MAX_REPLY:
            problem = f"an answer of {len(data)} bytes, of which {MAX_REPLY} are allowed"
            data = encode({"error": problem, "where": ()})
        sys.stdout.flush()
        sys.stderr.flush()
        self._connection.sendall(HEADER.pack(len(data)) + data)


def _description(maker: Any, source: Mapping[str, str]) -> Message:
    """Return the fields of an `AgentReference`."""
    settings = getattr(maker, "settings", None)
    is_class = isinstance(maker, type)
    return {
        "source": source,
        "methods": agent_calls.method_names(maker) if is_class else (),
        "is_class": is_class,
        "settings": settings() if callable(settings) else None,
    }


def encode(message: Message) -> bytes:
    """Return a message as JSON; half surrogate pairs, which agents may say, are kept."""
    return json.dumps(message, ensure_ascii=False).encode("utf-8", "surrogatepass")


def _answer_to_data(answer: AgentAnswer) -> list[Any]:
    """Return an answer as JSON data: the words, and each action as a text or `[class, repr]`."""
    words, actions = answer
    return [words, [_action_to_data(action) for action in actions]]


def _action_to_data(action: object) -> Any:
    return [type(action).__name__, repr(action)] if isinstance(action, InvalidAction) else action


def read_answer(data: Any) -> AgentAnswer:
    """Return an answer from JSON data of `_answer_to_data`.

    Raises:
        AgentError: it has another form, so the agent has written to our connection itself.
    """
    match data:
        case [str() as said, list() as actions]:
            return said, [_read_action(action) for action in actions]
        case _:
            raise AgentError("its process sent what is no answer")


def _read_action(data: Any) -> object:
    match data:
        case str():
            return data
        case [str() as kind, str() as shown]:
            return agent_calls.invalid_action(kind, shown)
        case _:
            raise AgentError("its process sent what is no action")
