"""Running commands as the desktop's user, with time-outs and capped output.

A time-out ends all that was started.
"""

import asyncio
import contextlib
import os
import shlex
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ...errors import DesktopError, DesktopTimeoutError

OUTPUT_CAP = 8 * 2**20
CAP_NOTE = b"\n[output cut: more than 8 MiB]"
COMMAND_TIMEOUT_S = 120.0
MAX_TIMEOUT = 600.0
GRACE = 0.3  # s that the output of a command may stay open behind it
TOOLS = "/usr/local/lib/desktop/bin"
# What belongs to the server and not to what it starts.
PRIVATE = ("PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV", "PYTHONSTARTUP")

_Command = Sequence[str] | str


@dataclass(frozen=True)
class CommandResult:
    """The outcome of a command.

    Attributes:
        output: decoded.
        error: decoded.
        returncode: minus the signal that ended it, if one did.
    """

    output: str
    error: str
    returncode: int


def parse_command(command: object, shell: bool) -> list[str]:
    """Return the arguments to run for a `command` field.

    As in OSWorld's server, `~/` at the start of an argument is the home folder.

    Args:
        command: a list, or a string that the shell or `shlex` splits.
        shell: whether the shell runs it.

    Raises:
        ValueError: It is neither, or empty.
    """
    if isinstance(command, str):
        words = [command] if shell else shlex.split(command)
    elif isinstance(command, list) and all(isinstance(word, str) for word in command):
        words = list(command)
    else:
        raise ValueError(f"command must be a string or a list of strings, got {command!r:.200}")
    if not (shell and isinstance(command, str)):  # there the shell does it
        words = [os.path.expanduser(word) if word.startswith("~/") else word for word in words]
    if not words or not words[0]:
        raise ValueError("command is empty")
    if any("\0" in word for word in words):
        raise ValueError("command has a zero byte")
    return ["/bin/sh", "-c", *words] if shell else words


class Runner:
    """Starts commands in the desktop's environment.

    The folder of our wrappers comes first in its PATH.
    """

    def __init__(self, tools: str = TOOLS) -> None:
        self.environment = {key: value for key, value in os.environ.items() if key not in PRIVATE}
        path = os.environ.get("PATH", "/usr/local/bin:/usr/bin:/bin")
        self.environment["PATH"] = path if tools in path.split(":") else f"{tools}:{path}"
        self._background: set[asyncio.Task[None]] = set()

    async def run(
        self,
        argv: Sequence[str],
        timeout: float = COMMAND_TIMEOUT_S,
        folder: str | None = None,
        merge: bool = False,
    ) -> CommandResult:
        """Run a command to its end; programs that it leaves in the background go on.

        Args:
            argv: the command.
            timeout: in seconds.
            folder: where to run it.
            merge: send its errors to its output.

        Raises:
            DesktopTimeoutError: It takes longer; it and all that it started are killed.
            CancelledError: The request was given up; the same.
        """
        process = self._start(argv, folder, subprocess.PIPE, merge)
        streams = [_Stream(pipe) for pipe in (process.stdout, process.stderr) if pipe]
        for stream in streams:
            self._keep(asyncio.create_task(stream.drain()))
        try:
            await asyncio.wait_for(ended(process), timeout)
        except TimeoutError:
            await _kill(process)
            raise DesktopTimeoutError(
                f"Command {list(argv)!r:.300} timed out after {timeout:g} seconds; it was killed"
                " with all it started"
            ) from None
        except asyncio.CancelledError:
            await _kill(process)
            raise
        waiting = [asyncio.create_task(stream.finished.wait()) for stream in streams]
        await asyncio.wait(waiting, timeout=GRACE)
        output = streams[0].text()
        error = "" if merge else streams[1].text()
        return CommandResult(output, error, process.returncode)

    async def launch(self, argv: Sequence[str], folder: str | None = None) -> int:
        """Start a program that goes on by itself; a failure is a `DesktopError`.

        Returns:
            Its process id.
        """
        process = self._start(argv, folder, subprocess.DEVNULL, merge=False)
        self._keep(asyncio.create_task(ended(process)))
        return process.pid

    def _start(
        self, argv: Sequence[str], folder: str | None, output: int, merge: bool
    ) -> "subprocess.Popen[bytes]":
        try:
            return subprocess.Popen(
                argv,
                env=self.environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT if merge else output,
                start_new_session=True,
                bufsize=0,
            )
        except OSError as error:
            raise DesktopError(
                f"{argv[0]!r:.200} does not start: {error.strerror or error}"
            ) from None

    def _keep(self, task: "asyncio.Task[None]") -> None:
        self._background.add(task)
        task.add_done_callback(self._background.discard)


async def ended(process: "subprocess.Popen[bytes]") -> None:
    """Return when the process itself has ended; asyncio's own wait lasts until its children do."""
    if process.poll() is not None:
        return
    loop = asyncio.get_running_loop()
    over = asyncio.Event()
    descriptor = os.pidfd_open(process.pid)
    loop.add_reader(descriptor, over.set)
    try:
        await over.wait()
    finally:
        loop.remove_reader(descriptor)
        os.close(descriptor)
    process.wait()


async def _kill(process: "subprocess.Popen[bytes]") -> None:
    kill_all(process.pid)
    await ended(process)


class _Stream:
    """Reads one output to its end and keeps its start.

    It goes on behind the command, so that nobody blocks on a full pipe.
    """

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe
        self._kept = bytearray()
        self._cut = False
        self.finished = asyncio.Event()

    async def drain(self) -> None:
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader()
        transport, _ = await loop.connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), self._pipe
        )
        try:
            while data := await reader.read(65536):
                room = OUTPUT_CAP - len(self._kept)
                self._cut = self._cut or len(data) > room
                self._kept += data[:room]
        finally:
            transport.close()
            self.finished.set()

    def text(self) -> str:
        return (bytes(self._kept) + (CAP_NOTE if self._cut else b"")).decode("utf-8", "replace")


def kill_all(pid: int) -> None:
    """Kill a process, its group, and all its descendants, also those that left the group."""
    family = [pid, *_descendants(pid)]
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)
    for member in family:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(member, signal.SIGKILL)


def _descendants(pid: int) -> list[int]:
    try:
        texts = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:
        return []
    children = [int(word) for text in texts for word in text.split()]
    return [*children, *(below for child in children for below in _descendants(child))]
