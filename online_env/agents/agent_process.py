"""Run an agent in a process of its own.

The process gets instruction and picture and nothing else: no object of the runner, no descriptor
but its connection and the pictures, no name of a task. Whatever ends it (a crash, `os._exit`, too
much memory, no answer in time) is an `AgentError`; the next `make` starts another process.
"""

import contextlib
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from hijack_data.errors import HijackError, ParameterError, PluginError, UnknownNameError

from .agent_calls import (
    MAX_FRAMES,
    MAX_LINE,
    MAX_PROBLEM,
    AgentAnswer,
    AgentError,
    AgentGoneError,
    AgentTraits,
)
from .agent_server import HEADER, MAX_REPLY, Message, encode, read_answer
from .base import Observation
from .references import AgentReference, absolute_reference
from .supervisor import EXIT_TIMEOUT_S, KILL_TIMEOUT_S, kill_descendants

START_TIMEOUT_S = 900.0  # until an agent is made for the first time: weights may be large
MEMORY_SHARE = 0.75  # of the machine's memory that an agent may use, by default
MAX_PRINTED = 64 * 2**10  # bytes of what an agent prints that are passed on, for each object
_MAX_TAIL_BYTES = 8192  # bytes of what it printed that are kept for the message of a crash
_DESCRIBE_TIMEOUT_S = 300.0  # until a module is imported for the first look at its agent
_REFUSALS = {kind.__name__: kind for kind in (ParameterError, PluginError, UnknownNameError)}
_SECRETS = ("AGENTHIJACK_SERVE_TOKEN", "AGENTHIJACK_TOKEN")  # of servers of ours
_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]);"
    " numbers = map(int, sys.argv[2:]); sys.argv = ['agent'];"
    " from online_env.agents.supervisor import main; main(*numbers)"
)


def default_memory() -> int:
    """Return how many bytes an agent may use unless a limit is given."""
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return int(total * MEMORY_SHARE)


class AgentProcess:
    """Asks an agent in a process of its own; see `RunningAgent` for the methods.

    Args:
        reference: where its class is found.
        timeout: seconds that an answer may take.
        start_timeout: seconds that making an object may take.
        memory: bytes that the process and all that it starts may use; by default three quarters
            of the machine's memory, 0 for no limit.
    """

    def __init__(
        self,
        reference: AgentReference,
        timeout: float,
        *,
        start_timeout: float = START_TIMEOUT_S,
        memory: int | None = None,
    ) -> None:
        self._reference = reference
        self._timeout = timeout
        self._start_timeout = start_timeout
        self._memory = default_memory() if memory is None else memory
        self._process: _Process | None = None
        self._traits: AgentTraits | None = None

    def __enter__(self) -> "AgentProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def traits(self) -> AgentTraits:
        """What the agent can do.

        Raises:
            AgentError: it has not been made.
        """
        if self._traits is None:
            raise AgentError("the agent has not been made")
        return self._traits

    @property
    def pid(self) -> int | None:
        """The id of the supervisor's process; `None` if none runs."""
        return None if self._process is None else self._process.pid

    @property
    def alive(self) -> bool:
        """Whether its process was not found dead."""
        return self._process is not None

    def make(self) -> None:
        """Make a new object of the agent, in the running process or in a new one.

        Raises:
            AgentError: the agent's code raises, or its process ends.
        """
        if self._process is None:
            self._process = _Process(self._memory)
            try:
                self._load(self._start_timeout)
            except HijackError as error:
                raise AgentError(str(error)) from error
        self._process.printed = 0
        self._traits = _traits(self._call("make", self._start_timeout))

    def describe(self) -> AgentReference:
        """Import the agent's code in a new process, and return what a run needs to know of it.

        Raises:
            ParameterError: it is no agent.
            PluginError: its file or module cannot be imported.
            UnknownNameError: its file or module has no such name.
            ParameterError: It is not an agent.
            PluginError: Its file or module cannot be imported.
            UnknownNameError: Its file or module has no such name.
        """
        self._process = _Process(self._memory)
        try:
            fields = self._load(_DESCRIBE_TIMEOUT_S)
            return AgentReference(**{**fields, "place": self._reference.place})
        except (AgentError, TypeError) as error:
            raise PluginError(f"{self._reference.place}: cannot be imported: {error}") from error

    def _load(self, timeout: float) -> Message:
        """Let the process import the agent's code.

        Raises:
            HijackError: it is refused, see `describe`; the process is ended then.
            PluginError: The process sent no description of the agent.
        """
        sha256 = self._reference.source.get("sha256")
        complete = False
        try:
            answer = self._call("load", timeout, reference=self._reference.place, sha256=sha256)
            match answer:
                case {"refused": [str() as kind, str() as problem]}:
                    raise _REFUSALS.get(kind, PluginError)(problem)
                case {"methods": list() as methods}:
                    complete = True
                    return {**answer, "methods": tuple(methods)}
                case _:
                    raise PluginError(f"{self._reference.place}: its process sent no description")
        finally:
            if not complete:
                self.close()

    def reset(self) -> None:
        """Begin a new episode."""
        self._call("reset")

    def predict(self, instruction: str, obs: Observation) -> AgentAnswer:
        """Return the agent's words and actions."""
        pictures = [obs["screenshot"]]
        return read_answer(self._call("predict", pictures=pictures, instruction=instruction))

    def predict_batch(
        self, instructions: Sequence[str], pictures: Sequence[Any]
    ) -> list[AgentAnswer]:
        """Return the answers to several pictures; the time-out counts for each.

        Raises:
            AgentError: The process sent another number of answers, or no list.
        """
        timeout = self._timeout * len(pictures)
        texts = list(instructions)
        answers = self._call("predict_batch", timeout, pictures=pictures, instructions=texts)
        if not isinstance(answers, list) or len(answers) != len(pictures):
            raise AgentError("its process sent what is no list of answers")
        return [read_answer(answer) for answer in answers]

    def check(self, picture: Any) -> str | None:
        """Return the reminder of an onlooker, or `None`."""
        return _text(self._call("check", pictures=[picture]), optional=True)

    def summarise(self, before: Any, action: str, after: Any) -> str:
        """Return an onlooker's summary of a step."""
        summary = _text(self._call("summarise", pictures=[before, after], action=action))
        return summary or ""

    def follow(self, lines: Sequence[str]) -> None:
        """Give the agent the plan of the task in words."""
        self._call("follow", lines=list(lines))

    def connect(self, address: str) -> None:
        """Give the agent the address of the browser's DevTools."""
        self._call("connect", address=address)

    def usage(self) -> dict[str, Any] | None:
        """Return the usage that the agent reports so far."""
        value = self._call("usage")
        return value if isinstance(value, dict) else None

    def kill(self) -> None:
        """Kill the agent, so that a call which another thread waits for ends with an error."""
        process = self._process
        if process is not None:
            kill_descendants(process.pid)

    def close(self) -> None:
        """End the process with all that it started; calling this twice is allowed."""
        process, self._process = self._process, None
        if process is not None:
            process.close()

    def _call(
        self, name: str, timeout: float | None = None, pictures: Sequence[Any] = (), **values: Any
    ) -> Any:
        """Send a request and return the value of the answer.

        Raises:
            AgentError: the agent raises, or its process ends or gives no answer in time; then the
                process is ended.
            AgentGoneError: The process has ended before.
        """
        process = self._process
        if process is None:
            raise AgentGoneError("its process has ended")
        limit = self._timeout if timeout is None else timeout
        sizes = [picture.shape[:2] for picture in pictures]
        complete = False
        try:
            process.write(pictures)
            process.send({"call": name, "sizes": sizes, **values})
            reply = process.receive(time.monotonic() + limit)
            complete = True
        except _LateError:
            raise AgentError(f"no answer within {limit:g} s") from None
        except _DeadError as error:
            raise AgentError(*process.ending(error, self._memory)) from None
        finally:
            if not complete:  # also at Ctrl-C: the answer that is still due is nobody's
                self.close()
        if "error" in reply:
            frames = reply.get("where")
            lines = [str(line)[:MAX_LINE] for line in frames] if isinstance(frames, list) else []
            raise AgentError(str(reply["error"])[:MAX_PROBLEM], lines[-MAX_FRAMES:])
        return reply.get("value")


def describe(text: str) -> AgentReference:
    """Return a reference to the agent that a user names, as its own process describes it.

    Args:
        text: `package.module:Name` or `path/to/file.py:Name`.
    """
    with AgentProcess(
        AgentReference(place=absolute_reference(text)), _DESCRIBE_TIMEOUT_S
    ) as process:
        return process.describe()


class _LateError(Exception):
    """No answer came in time."""


class _DeadError(Exception):
    """The process has ended, or its connection."""


class _Process:
    """The supervisor and the agent's process, with what connects them to the runner."""

    def __init__(self, memory: int) -> None:
        self._folder = tempfile.mkdtemp(prefix="agent-")
        self._pictures = _memory_file(self._folder)
        self._connection, agent_end = socket.socketpair()
        descriptors = (agent_end.fileno(), self._pictures)
        environment = {key: value for key, value in os.environ.items() if key not in _SECRETS}
        environment |= {"TMPDIR": self._folder, "PWD": self._folder}
        path = json.dumps([os.path.abspath(entry) for entry in sys.path])
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, path, *map(str, (*descriptors, memory))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=descriptors,
            cwd=self._folder,
            env=environment,
            start_new_session=True,
        )
        agent_end.close()
        self._connection.setblocking(False)
        # The descriptor on which the supervisor reports the end of the agent's process.
        self._status = -1 if self._process.stdout is None else self._process.stdout.fileno()
        self._report: Message = {}  # of the supervisor
        self.printed = 0
        self._tail = bytearray()
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    def write(self, pictures: Sequence[Any]) -> None:
        """Put pictures into the memory file, one after the other."""
        start = 0
        for picture in pictures:
            view: memoryview = np.ascontiguousarray(picture).data.cast("B")
            written_bytes = 0
            while written_bytes < len(view):
                written_bytes += os.pwrite(
                    self._pictures, view[written_bytes:], start + written_bytes
                )
            start += written_bytes

    def send(self, message: Message) -> None:
        """Send a request, which is small: no picture is in it.

        Raises:
            _DeadError: The connection is closed.
        """
        data = encode(message)
        self._connection.setblocking(True)
        try:
            self._connection.sendall(HEADER.pack(len(data)) + data)
        except OSError:
            raise _DeadError("") from None
        finally:
            self._connection.setblocking(False)

    def receive(self, deadline: float) -> Message:
        """Return the answer.

        Raises:
            _DeadError: The process has ended, or sent no valid message.
        """
        (size,) = HEADER.unpack(self._read(HEADER.size, deadline))
        if size > MAX_REPLY:
            raise _DeadError(f"sent a message of {size} bytes, of which {MAX_REPLY} are allowed")
        body = self._read(size, deadline)
        try:
            message: object = json.loads(body.decode("utf-8", "surrogatepass"))
        except (ValueError, RecursionError):
            raise _DeadError("sent a message that is no JSON") from None
        if not isinstance(message, dict):
            raise _DeadError("sent a message that is no answer")
        return message

    def _read(self, count: int, deadline: float) -> bytes:
        data = bytearray()
        poller = select.poll()
        poller.register(self._connection, select.POLLIN)
        poller.register(self._status, select.POLLIN)
        while len(data) < count:
            remaining_s = deadline - time.monotonic()
            if remaining_s <= 0:
                raise _LateError
            ready = [number for number, _ in poller.poll(1000 * remaining_s)]
            if self._connection.fileno() in ready:
                # Before the status, since an agent may answer and then end.
                with contextlib.suppress(BlockingIOError):
                    part = self._connection.recv(count - len(data))
                    if not part:
                        raise _DeadError("")
                    data += part
            elif ready and self._has_ended():
                raise _DeadError("")
        return bytes(data)

    def _has_ended(self) -> bool:
        """Read what the supervisor reports; return whether the agent's process has ended."""
        text = os.read(self._status, 1000)
        for line in text.splitlines():
            with contextlib.suppress(ValueError):
                self._report |= json.loads(line)
        return not text or "status" in self._report

    def ending(self, error: _DeadError, memory: int) -> tuple[str, tuple[str, ...]]:
        """Return how the process ended, in words, and the last lines that it printed."""
        problem = str(error)
        if problem:
            return f"its process {problem}", ()
        self._close_connections()
        deadline = time.monotonic() + EXIT_TIMEOUT_S + KILL_TIMEOUT_S
        while "status" not in self._report:
            remaining_s = max(0.0, deadline - time.monotonic())
            ready, _, _ = select.select([self._status], [], [], remaining_s)
            if not ready or self._has_ended():
                break
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(KILL_TIMEOUT_S)
        self._reader.join(1.0)
        lines = _printable(bytes(self._tail)).splitlines()[-MAX_FRAMES:]
        return _ending(self._report, memory), tuple(line[:MAX_LINE] for line in lines)

    def close(self) -> None:
        """End the process: by itself at first, then with all that it started."""
        self._close_connections()
        try:
            self._process.wait(EXIT_TIMEOUT_S + 2 * KILL_TIMEOUT_S)
        except subprocess.TimeoutExpired:  # the agent stopped its supervisor
            kill_descendants(self._process.pid)
            self._process.kill()
            self._process.wait()
        if "status" not in self._report and isinstance(self._report.get("pid"), int):
            # Its supervisor may be dead, and cannot have killed it.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._report["pid"], signal.SIGKILL)
        self._reader.join(1.0)
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None and (pipe is self._process.stdout or not self._reader.is_alive()):
                pipe.close()
        os.close(self._pictures)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _close_connections(self) -> None:
        self._connection.close()
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def _read_output(self) -> None:
        """Pass on what the agent prints, bounded, and keep the end of it."""
        pipe = self._process.stderr
        if pipe is None:
            return
        while True:
            try:
                data = os.read(pipe.fileno(), 65_536)
            except (OSError, ValueError):
                return
            if not data:
                return
            self._tail = (self._tail + data)[-_MAX_TAIL_BYTES:]
            allowance = MAX_PRINTED - self.printed
            self.printed += len(data)
            if allowance > 0:
                text = _printable(data[:allowance])
                suffix = (
                    "" if len(data) <= allowance else "\n(more that the agent prints is left out)\n"
                )
                with contextlib.suppress(OSError, ValueError):
                    sys.stderr.write(text + suffix)
                    sys.stderr.flush()


def _ending(report: Message, memory: int) -> str:
    """Return in words how an agent's process ended.

    Args:
        report: of its supervisor; without `status` if that is dead, too.
        memory: the limit in bytes.
    """
    if "status" not in report:
        return "its process died, and its supervisor with it"
    status = report["status"]
    if report.get("reason") == "memory":
        return f"its process used more than {memory / 2**30:.1f} GiB of memory (--agent-memory)"
    if not isinstance(status, int):
        return "its process closed its connection and did not end"
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        try:
            return f"its process died ({signal.Signals(number).name})"
        except ValueError:
            return f"its process died (signal {number})"
    return f"its process died (exit code {os.WEXITSTATUS(status)})"


def _memory_file(folder: str) -> int:
    """Return a descriptor of shared memory; without `memfd_create`, of an unlinked file."""
    with contextlib.suppress(AttributeError, OSError):
        return os.memfd_create("pictures")
    number, path = tempfile.mkstemp(dir=folder)
    os.unlink(path)
    return number


def _printable(data: bytes) -> str:
    """Return what an agent printed without control characters, which could steer a terminal."""
    text = data.decode("utf-8", "replace")
    marks = (mark if mark.isprintable() or mark in "\n\t" else "\ufffd" for mark in text)
    return "".join(marks)


def _traits(data: Any) -> AgentTraits:
    """Return what an agent's process says about the agent.

    Raises:
        AgentError: it has another form.
    """
    try:
        return AgentTraits(**{**data, "methods": tuple(data["methods"])})
    except (TypeError, KeyError):
        raise AgentError("its process sent what does not describe an agent") from None


def _text(value: Any, optional: bool = False) -> str | None:
    """Return a text that an agent's process sent.

    Raises:
        AgentError: it is none.
    """
    if isinstance(value, str) or (optional and value is None):
        return value
    raise AgentError("its process sent what is no text")
