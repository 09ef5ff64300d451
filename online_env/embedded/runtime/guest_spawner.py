"""The spawner process forks guest servers; it loads their code before it enters the desktop.

Process 1 forks the spawner while both can see the machine's files. The spawner loads the guest
server, joins process 1's mount namespace, and forks a child for each request of process 1. So no
Python, package or path of ours has to be shown inside, not even to root; and a guest server that
has died is there again at once.
"""

import gc
import json
import os
import signal
import socket
import sys
import traceback
from collections.abc import Iterable, Mapping
from typing import NoReturn

from . import image_python, kernel, limits, seccomp, session
from .desktop_config import DesktopConfig
from .identity import Identity

MAX_MESSAGE_BYTES = 4096
SERVER_PROCESS_NAME = "desktop-server"  # the name of guest servers in lists of processes


class GuestServerSpawner:
    """Forks guest servers on behalf of process 1.

    All methods raise `OSError` if the spawner process has ended.

    Args:
        order: The desktop's configuration.
        identity: The users of the desktop's processes.
        log: The descriptor of the spawner's own log.
    """

    def __init__(self, order: DesktopConfig, identity: Identity, log: int) -> None:
        self._line, child_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.pid = os.fork()
        if self.pid == 0:
            self._line.close()
            _SpawnerProcess(order, identity, child_socket).start(log)
        child_socket.close()

    def close(self) -> None:
        """Close the socket; the spawner exits."""
        self._line.close()

    def send_mount_namespace(self) -> None:
        """Let the spawner join this process' mount namespace."""
        namespace = os.open("/proc/self/ns/mnt", os.O_RDONLY | os.O_CLOEXEC)
        self._send({}, [namespace])
        os.close(namespace)

    def report_windows(
        self, windows: Iterable[str], environment: Mapping[str, str], descriptors: tuple[int, int]
    ) -> None:
        """Start a process that reports windows as they appear.

        Args:
            windows: The windows to wait for (see `window_report.report`).
            environment: The environment of the process.
            descriptors: Where the process writes its report, and its log.
        """
        request = {"windows": list(windows), "environment": dict(environment)}
        self._send(request, list(descriptors))

    def start_guest_server(
        self, environment: Mapping[str, str], osworld: bool, descriptors: tuple[int, ...]
    ) -> None:
        """Start a guest server, which becomes a child of process 1.

        `read_server_pid` returns its process number.

        Args:
            environment: The environment of the server.
            osworld: Whether it serves OSWorld's routes without a token.
            descriptors: A listening socket for requests, one for requests to freeze the screen, the
                reading end of a pipe with the token, a pipe that gets a line when the server
                serves, and a log.
        """
        request = {"serve": osworld, "environment": dict(environment)}
        self._send(request, list(descriptors))

    def read_server_pid(self, timeout: float) -> int:
        """Return the process number of the guest server that was started last.

        Args:
            timeout: Seconds until it must have started.

        Raises:
            ConnectionError: The spawner has ended.
        """
        self._line.settimeout(timeout)
        text = self._line.recv(MAX_MESSAGE_BYTES)
        self._line.settimeout(None)
        if not text:
            raise ConnectionError("the spawner sent no process number")
        return int(text)

    def _send(self, request: Mapping[str, object], descriptors: list[int]) -> None:
        socket.send_fds(self._line, [json.dumps(request).encode()], descriptors)


class _SpawnerProcess:
    """The spawner: the loop that runs in the forked process."""

    def __init__(self, order: DesktopConfig, identity: Identity, line: socket.socket) -> None:
        self.order = order
        self.identity = identity
        self.line = line

    def start(self, log: int) -> NoReturn:
        """Run with the descriptor `log`, in the image's Python if the desktop has an image."""
        try:
            _to_log(log)
            if self.order.image:
                image_python.become(self.order, self.identity, self.line)
            self.run()
        finally:
            _end()

    def run(self) -> NoReturn:
        """Load a guest server, enter the desktop, and answer the requests of process 1."""
        try:
            kernel.set_process_name("session")
            self._load()
            self._enter_desktop()
            while True:
                self._fork_child()
        finally:  # whatever happened, it must not go on as a second process 1
            _end()

    def _load(self) -> None:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGCHLD):
            signal.signal(number, signal.SIG_DFL)
        os.environ["OPENBLAS_NUM_THREADS"] = "1"  # no threads: they would not survive a fork
        sys.path[:0] = () if self.order.image else self.order.search_path
        from .. import window_report  # `_run_child` uses it  # noqa: F401
        from ..guest import __main__ as guest
        from ..guest import preload

        preload.everything()
        if self.order.image:
            image_python.forget_modules()
        self.guest = guest
        gc.freeze()

    def _enter_desktop(self) -> None:
        if self.identity.namespace < 0:  # in a container, where there is no other file system
            kernel.forbid_reading()
            return
        _, (namespace,) = self._receive()
        kernel.join(namespace, kernel.CLONE_NEWNS)
        os.close(namespace)
        self.identity.enter()
        kernel.forbid_reading()
        seccomp.forbid()

    def _receive(self) -> tuple[dict[str, object], list[int]]:
        text, descriptors, _, _ = socket.recv_fds(self.line, MAX_MESSAGE_BYTES, 5)
        if not text:
            raise EOFError
        return json.loads(text), list(descriptors)

    def _fork_child(self) -> None:
        request, descriptors = self._receive()
        reader, writer = os.pipe()
        between = os.fork()
        if between == 0:
            # Its parent ends at once, so that process 1 inherits it and knows of its end.
            child = os.fork()
            if child == 0:
                os.close(reader)
                os.close(writer)
                self._run_child(request, descriptors)
            os.write(writer, str(child).encode())
            os._exit(0)
        os.close(writer)
        os.waitpid(between, 0)
        child_text = os.read(reader, 32)
        for descriptor in (reader, *descriptors):
            os.close(descriptor)
        if "serve" in request:
            self.line.send(child_text)

    def _run_child(self, request: dict[str, object], descriptors: list[int]) -> NoReturn:
        try:
            os.setsid()
            _to_log(descriptors.pop())
            kernel.set_process_name(SERVER_PROCESS_NAME)
            limits.limit_process(self.order)
            self.identity.become_user(guarded=True)
            kernel.forbid_reading()
            close_others({0, 1, 2, *descriptors})
            os.environ.clear()
            os.environ.update(request["environment"])  # type: ignore[call-overload]
            os.chdir(session.HOME)
            if "serve" not in request:
                from .. import window_report

                window_report.report(descriptors[0], request["windows"])  # type: ignore[arg-type]
                os._exit(0)
            requests, freeze, token, ready = map(str, descriptors)
            arguments = ["--host", "", "--listen", requests, "--freeze", freeze]
            arguments += ["--token-from", token, "--ready", ready]
            arguments += ["--osworld"] if request["serve"] else []
            os._exit(self.guest.main(arguments))
        finally:
            _end()


def _to_log(log: int) -> None:
    for target, source in ((0, os.open("/dev/null", os.O_RDONLY)), (1, log), (2, log)):
        os.dup2(source, target)


def resume(text: int, line: int, namespace: int, base: int, rootless: int) -> NoReturn:
    """Run the spawner in the image's Python, after `image_python.become`.

    Args:
        text: The descriptor of the desktop's configuration, in JSON.
        line: The descriptor of the socket to process 1.
        namespace: The descriptor of the identity's user namespace.
        base: `Identity.base`.
        rootless: `Identity.rootless`, as 0 or 1.
    """
    with open(text, encoding="utf-8") as file:
        order = DesktopConfig.from_json(file.read())
    for descriptor in (line, namespace):
        os.set_inheritable(descriptor, False)
    identity = Identity(namespace, base, bool(rootless))
    _SpawnerProcess(order, identity, socket.socket(fileno=line)).run()


def _end() -> NoReturn:
    """End this process at once; what went wrong is in its log."""
    if sys.exc_info()[0] is not None:
        traceback.print_exc()
    sys.stderr.flush()
    os._exit(1)


def close_others(exempt: set[int]) -> None:
    """Close all descriptors of this process but `exempt`."""
    low = 0
    for descriptor in [*sorted(exempt), os.sysconf("SC_OPEN_MAX")]:
        if low < descriptor:  # of an empty range from 0 the system makes all there are
            os.closerange(low, descriptor)
        low = descriptor + 1
