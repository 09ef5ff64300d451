"""The first process inside a desktop.

It builds the file system, starts the session, reaps, and starts again programs that ended. It is
forked by the keeper (keeper.py) into new namespaces; when it ends, the kernel ends everything
inside.
"""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NoReturn, TypeVar

from .. import window_report
from . import account, kernel, limits, root_file_system, seccomp, session
from .desktop_config import DesktopConfig, SetupError
from .framebuffer import DesktopEndpoints
from .guest_spawner import GuestServerSpawner
from .identity import Identity
from .logs import BoundedLogs

Found = TypeVar("Found")
SPAWNER = "spawner"
GUEST = "guest"
SERVERS = ("Xvfb", "dbus-daemon")  # nothing works without them, and nothing can go on after them
# So often may one program die within a minute before the desktop is given up.
MAX_RESTARTS = 8
RESTART_WINDOW_S = 60.0
WAKE_BYTES = 4096
FAMILY_LOCAL = 256
FAMILY_WILD = 65535


class Init:
    """Process 1 of one desktop.

    Args:
        order: what to build.
        folder: the desktop's run folder on the machine.
        token: what clients of the guest server must show.
        identity: who the processes inside are.
        endpoints: the memory to draw in, and sockets to serve.
        logs: descriptor of the folder of the logs, if it is not the one in `folder`.
    """

    def __init__(
        self,
        order: DesktopConfig,
        folder: Path,
        token: str,
        identity: Identity,
        endpoints: DesktopEndpoints,
        logs: int | None = None,
    ) -> None:
        self.order = order
        self.folder = folder
        self.token = token
        self.identity = identity
        self.endpoints = endpoints
        # Attached nowhere: who looks at the descriptors of a program sees no path of the machine's.
        self.logs = BoundedLogs(kernel.open_tree(str(folder / "logs")) if logs is None else logs)
        self.environment = session.environment() | order.environment
        self.deadline = time.monotonic() + order.time_out
        self.running: dict[int, str] = {}
        self.commands: dict[str, tuple[str, ...]] = {}
        self.deaths: dict[str, list[float]] = {}
        self.wake = -1

    def run(self, ready: Callable[[], None]) -> NoReturn:
        """Build, start, call `ready`, then watch for ever.

        A part that does not come up is a `SetupError`.
        """
        kernel.set_process_name("init")
        self._start_spawner()
        kernel.unshare(kernel.CLONE_NEWNS)
        root_file_system.enter_root(self.order, self.identity, self.folder)
        self._ask_spawner(self.spawner.send_mount_namespace)
        kernel.set_host_name(account.HOST_NAME)
        self.identity.enter()
        kernel.forbid_reading()
        kernel.die_with_parent()  # again: who becomes another forgets it
        seccomp.forbid()
        self._write_authority()
        self._start_servers()
        self._start_session()
        ready()
        for name, program in session.LATE.items():
            self.start(name, program.argv)
        while True:
            self.attend(RESTART_WINDOW_S)

    def _start_spawner(self) -> None:
        self.wake = wake_on_children()
        self.spawner = GuestServerSpawner(self.order, self.identity, self.logs.writer(SPAWNER))
        self.running[self.spawner.pid] = SPAWNER

    def attend(self, timeout: float, descriptors: Iterable[int] = ()) -> set[int]:
        """Keep logs and look after processes until one of `descriptors` can be read.

        Args:
            timeout: seconds that it may take at most.
            descriptors: what else to wait for.

        Returns:
            Those of `descriptors` that can be read.

        Raises:
            SetupError: A process has ended that the desktop cannot go on without.
        """
        ready = self.logs.wait(timeout, (self.wake, *descriptors))
        if self.wake in ready:
            os.read(self.wake, WAKE_BYTES)
        self._reap()
        return ready - {self.wake}

    def start(
        self, name: str, argv: tuple[str, ...], inherited: tuple[int, ...] = (), again: bool = True
    ) -> int:
        """Start a program of the session with its own log and the descriptors `inherited`.

        With `again` it is started again when it ends.
        """
        log = self.logs.writer(name)
        pid = os.fork()
        if pid == 0:
            self._become(log, argv, inherited)
        self.running[pid] = name
        if again:
            self.commands[name] = argv
        return pid

    def _become(self, log: int, argv: tuple[str, ...], inherited: tuple[int, ...]) -> NoReturn:
        try:
            os.setsid()
            os.dup2(os.open("/dev/null", os.O_RDONLY), 0)
            for descriptor in (1, 2):
                os.dup2(log, descriptor)
            for descriptor in inherited:
                os.set_inheritable(descriptor, True)
            limits.limit_process(self.order)
            self.identity.become_user()
            os.chdir(account.HOME)
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)
            os.execvpe(argv[0], argv, self.environment)
        except OSError as error:
            os.write(2, f"{argv[0]} does not start: {error}\n".encode())
        finally:
            os._exit(127)

    def _write_authority(self) -> None:
        authority = os.open(session.AUTHORITY, os.O_WRONLY | os.O_CREAT, 0o600)
        os.write(authority, _authority_entries())
        if not self.order.rootless:
            os.fchown(authority, account.UID, account.UID)
        os.close(authority)

    def _start_servers(self) -> None:
        """Start the display and the bus side by side, and wait until both answer."""
        framebuffer = self.endpoints.framebuffer
        framebuffer.show(Path(session.SCREEN_FOLDER))

        def display_server(report: int) -> tuple[str, ...]:
            return session.display_server(self.order.screen, report)

        readers = {
            "Xvfb": self._start_server("Xvfb", display_server, (framebuffer.memory,)),
            "dbus-daemon": self._start_server("dbus-daemon", session.session_bus),
        }
        for name, reader in readers.items():
            self._read(reader, name, f"{name} to answer")
            os.close(reader)

    def _start_server(
        self, name: str, command: Callable[[int], tuple[str, ...]], inherited: tuple[int, ...] = ()
    ) -> int:
        reader, writer = os.pipe()
        self.start(name, command(writer), (writer, *inherited), again=False)
        os.close(writer)
        return reader

    def _start_session(self) -> None:
        apps = {name: session.APPS[name] for name in self.order.apps}
        serving = self._start_guest()
        for name, program in session.SERVICES.items():
            self.start(name, program.argv)
        programs = [*session.SHELL.values(), *apps.values()]
        expected = [program.window for program in programs]
        announced = [window_report.MANAGER, window_report.SETTINGS, *expected]
        reader, writer = os.pipe()
        log = self.logs.writer("windows")
        self._ask_spawner(
            lambda: self.spawner.report_windows(announced, self.environment, (writer, log))
        )
        os.close(writer)
        # A program that starts before the fonts are published may keep drawing with others.
        present = self._await(reader, {window_report.SETTINGS}, set())
        for name, program in session.SHELL.items():
            self.start(name, program.argv)
        present = self._await(reader, {window_report.MANAGER}, present)
        for name, program in apps.items():
            self.start(name, program.argv, again=False)
        self._await(reader, set(expected), present)
        os.close(reader)
        self._register_guest()
        self._read(serving, "guest", "the guest server to answer")
        os.close(serving)

    def _await(self, reader: int, expected: set[str], present: set[str]) -> set[str]:
        while not expected <= present:
            missing = ", ".join(sorted(expected - present))
            present |= set(self._read(reader, "windows", f"the window of {missing}").split())
        return present

    def _read(self, reader: int, name: str, event: str) -> str:
        """Read whole lines: Xvfb dies when the pipe closes before its second write.

        Raises:
            SetupError: They do not come in time.
        """
        text = ""
        while not text.endswith("\n"):
            remaining_s = self.deadline - time.monotonic()
            if not self.logs.wait(remaining_s, (reader,)):
                if remaining_s <= 0:
                    raise self._not_read(name, event, has_ended=False)
                continue
            piece = os.read(reader, 4096).decode()
            if not piece:
                raise self._not_read(name, event, has_ended=True)
            text += piece
        return text

    def _not_read(self, name: str, event: str, has_ended: bool) -> SetupError:
        waited = f"waited {self.order.time_out:.0f} s in vain"
        looks = 1
        if has_ended:
            waited = "stopped waiting"
            looks = 50  # a server that closed its pipe may take a little to be gone
        for _ in range(looks):
            self._check_servers()
            time.sleep(0.02)
        return SetupError(f"{waited} for {event}; {self._tail(name)}")

    def _check_servers(self) -> None:
        """Check that the display and the bus run: their end is the reason for what followed.

        Raises:
            SetupError: One of them has ended.
        """
        for pid, name in self.running.items():
            if name in (*SERVERS, SPAWNER) and os.waitpid(pid, os.WNOHANG)[0]:
                raise SetupError(f"{name} ended; {self._tail(name)}")

    def _start_guest(self) -> int:
        """Have a guest server started; returns a pipe that has a line once it serves."""
        secret, token_writer = os.pipe()
        serving, writer = os.pipe()
        os.write(token_writer, self.token.encode())
        os.close(token_writer)
        endpoints = (
            self.endpoints.guest.fileno(),
            self.endpoints.framebuffer.freeze_socket.fileno(),
            secret,
            writer,
            self.logs.writer(GUEST),
        )
        self._ask_spawner(
            lambda: self.spawner.start_guest_server(self.environment, self.order.osworld, endpoints)
        )
        for descriptor in (secret, writer):
            os.close(descriptor)
        return serving

    def _register_guest(self) -> None:
        timeout = max(20.0, self.deadline - time.monotonic())
        self.running[self._ask_spawner(lambda: self.spawner.read_server_pid(timeout))] = GUEST

    def _ask_spawner(self, ask: "Callable[[], Found]") -> "Found":
        try:
            return ask()
        except OSError as error:
            reason = f"the spawner of guest servers does not answer ({error})"
            raise SetupError(f"{reason}; {self._tail(SPAWNER)}") from None

    def _tail(self, name: str) -> str:
        return f"the end of {name}.log: {self.logs.tail(name) or '(empty)'}"

    def _reap(self) -> None:
        with contextlib.suppress(ChildProcessError):
            while (child := os.waitpid(-1, os.WNOHANG | os.WUNTRACED))[0]:
                self._handle_exit(*child)

    def _handle_exit(self, pid: int, status: int) -> None:
        if os.WIFSTOPPED(status):
            # A part of the session; what users stop stays stopped, and so do applications.
            if self.running.get(pid, "") not in ("", *self.order.apps):
                os.kill(pid, signal.SIGCONT)
            return
        name = self.running.pop(pid, None)
        if name in SERVERS:
            raise SetupError(
                f"{name} ended ({_describe_status(status)}), and with it the desktop;"
                f" {self._tail(name)}"
            )
        if name == SPAWNER:
            raise SetupError(f"the spawner of guest servers ended; {self._tail(SPAWNER)}")
        if name == GUEST or name in self.commands:
            self._restart(name, status)

    def _restart(self, name: str, status: int) -> None:
        now_s = time.monotonic()
        before = self.deaths.get(name, [])
        recent = [death for death in before if now_s - death < RESTART_WINDOW_S]
        recent.append(now_s)
        self.deaths[name] = recent
        if len(recent) > MAX_RESTARTS:
            raise SetupError(
                f"{name} ended {len(recent)} times within {RESTART_WINDOW_S:.0f} s"
                f" ({_describe_status(status)}); {self._tail(name)}"
            )
        if len(recent) > 1:
            time.sleep(0.1)
        if name != GUEST:
            self.start(name, self.commands[name])
            return
        os.close(self._start_guest())
        self._register_guest()


def wake_on_children() -> int:
    """Return a descriptor that can be read after a child of this process has ended or stopped."""
    reader, writer = os.pipe()
    for descriptor in (reader, writer):
        os.set_blocking(descriptor, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)  # without a handler nothing is written
    former = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    if former >= 0:  # of the session before, in a container
        os.close(former)
    return reader


def _describe_status(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _authority_entries() -> bytes:
    """Xauthority entries for this host's name and for any.

    python-xlib finds only the first, libX11 (family "wild") the second.
    """
    cookie = os.urandom(16)
    number = session.DISPLAY.lstrip(":").encode()
    entry = _authority_entry(FAMILY_LOCAL, os.uname().nodename.encode(), number, cookie)
    return entry + _authority_entry(FAMILY_WILD, b"", b"", cookie)


def _authority_entry(family: int, host: bytes, display: bytes, cookie: bytes) -> bytes:
    entry = family.to_bytes(2, "big")
    for field in (host, display, b"MIT-MAGIC-COOKIE-1", cookie):
        entry += len(field).to_bytes(2, "big") + field
    return entry


def quit_on_signals() -> None:
    """Process 1 has no default actions: without this a polite SIGTERM would do nothing."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: sys.exit(0))
