"""The first process inside a desktop: builds its file system, starts the session, reaps, and starts again what died.

It is forked by the keeper (keeper.py) into new namespaces; when it ends, the kernel ends everything inside.
"""

import os
import select
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from . import account, files, kernel, limits, rootless, session, windows
from .framebuffer import Doors
from .plain import Order, SetupError

SERVERS = ("Xvfb", "dbus-daemon")  # nothing works without them, and nothing can go on after them
# So often may one program die within a minute before the desktop is given up.
RESTARTS, WINDOW = 8, 60.0


class Init:
    """Process 1 of one desktop.

    Args:
        order: what to build.
        folder: the desktop's run folder on the machine.
        token: what clients of the guest server must show.
        address: the guest's end of the control cable.
        doors: the memory to draw in, and sockets to serve.
    """

    def __init__(self, order: Order, folder: Path, token: str, address: str, doors: Doors) -> None:
        self.order, self.folder, self.token, self.address = order, folder, token, address
        self.doors = doors
        self.user_namespace = -1
        self.logs = os.open(folder / "logs", os.O_RDONLY | os.O_DIRECTORY)
        self.environment = session.environment() | order.environment
        self.deadline = time.monotonic() + order.time_out
        self.running: dict[int, str] = {}
        self.commands: dict[str, tuple[tuple[str, ...], tuple[int, ...], bool]] = {}
        self.deaths: dict[str, list[float]] = {}

    def run(self, ready: Callable[[], None]) -> NoReturn:
        """Build, start, call `ready`, then watch for ever; raises `SetupError` where something does not come up."""
        files.enter_root(self.order, self.folder)
        kernel.set_host_name(account.HOST_NAME)
        if self.order.rootless:
            self.user_namespace = rootless.user_namespace()
        kernel.drop_capabilities()
        self._write_secrets()
        self._start_servers()
        self._start_session()
        ready()
        for name, program in session.LATE.items() if not self.order.rootless else ():
            self.start(name, program.argv)
        self._watch()

    def start(
        self, name: str, argv: tuple[str, ...], kept: tuple[int, ...] = (), root: bool = False, again: bool = True
    ) -> int:
        """Start a program of the session with its own log and the descriptors `kept`; `again` has it started again
        when it ends."""
        pid = os.fork()
        if pid == 0:
            self._become(name, argv, kept, root)
        self.running[pid] = name
        if again:
            self.commands[name] = (argv, kept, root)
        return pid

    def _become(self, name: str, argv: tuple[str, ...], kept: tuple[int, ...], root: bool) -> NoReturn:
        try:
            os.setsid()
            log = self._open_log(name)
            for target, source in ((0, os.open("/dev/null", os.O_RDONLY)), (1, log), (2, log)):
                os.dup2(source, target)
            for descriptor in kept:
                os.set_inheritable(descriptor, True)
            limits.limit_process(self.order)
            if self.order.rootless:
                rootless.become_user(self.user_namespace)
            elif not root:
                os.setgroups([])
                os.setresgid(account.UID, account.UID, account.UID)
                os.setresuid(account.UID, account.UID, account.UID)
            os.chdir(account.HOME)
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)
            os.execvpe(argv[0], argv, self.environment)
        except OSError as error:
            os.write(2, f"{argv[0]} does not start: {error}\n".encode())
        finally:
            os._exit(127)

    def _open_log(self, name: str) -> int:
        return os.open(f"{name}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600, dir_fd=self.logs)

    def _write_secrets(self) -> None:
        secret = os.open(session.TOKEN_FILE, os.O_WRONLY | os.O_CREAT, 0o600)
        os.write(secret, self.token.encode())
        os.close(secret)
        authority = os.open(session.AUTHORITY, os.O_WRONLY | os.O_CREAT, 0o600)
        os.write(authority, _authority_entries())
        if not self.order.rootless:
            os.fchown(authority, account.UID, account.UID)
        os.close(authority)

    def _start_servers(self) -> None:
        """Start the display and the bus side by side, and wait until both answer."""
        screen, memory = self.order.screen, self.doors.framebuffer.memory
        self.doors.framebuffer.show(Path(session.SCREEN_FOLDER))
        readers = {
            "Xvfb": self._start_server("Xvfb", lambda report: session.display_server(screen, report), (memory,)),
            "dbus-daemon": self._start_server("dbus-daemon", session.session_bus),
        }
        for name, reader in readers.items():
            self._read(reader, name, f"{name} to answer")
            os.close(reader)

    def _start_server(self, name: str, command: Callable[[int], tuple[str, ...]], kept: tuple[int, ...] = ()) -> int:
        reader, writer = os.pipe()
        self.start(name, command(writer), (writer, *kept), again=False)
        os.close(writer)
        return reader

    def _start_session(self) -> None:
        order, shell = self.order, session.SHELL
        apps = {name: session.APPS[name] for name in order.apps}
        self._start_guest()
        for name, program in shell.items():
            self.start(name, program.argv)
        wanted = [p.window for p in (*shell.values(), *apps.values()) if p.window]
        reader, writer = os.pipe()
        watcher = os.fork()
        if watcher == 0:
            self._report_windows(writer, wanted)
        os.close(writer)
        seen = self._await(reader, {windows.MANAGER}, set())
        for name, program in apps.items():
            self.start(name, program.argv, again=False)
        self._await(reader, set(wanted), seen)
        os.close(reader)
        self._await_guest()

    def _report_windows(self, writer: int, wanted: list[str]) -> NoReturn:
        os.dup2(self._open_log("windows"), 2)
        try:
            windows.report(writer, [windows.MANAGER, *wanted], self.order.search_path, self.environment)
        finally:  # whatever happened, this child must not go on as a second process 1
            if sys.exc_info()[0] is not None:
                traceback.print_exc()
            os._exit(0)

    def _await(self, reader: int, wanted: set[str], seen: set[str]) -> set[str]:
        while not wanted <= seen:
            left = ", ".join(sorted(wanted - seen))
            seen |= set(self._read(reader, "windows", f"the window of {left}").split())
        return seen

    def _read(self, reader: int, name: str, what: str) -> str:
        """Read whole lines: Xvfb dies when the pipe closes before its second write."""
        text = ""
        while not text.endswith("\n"):
            ready, _, _ = select.select([reader], [], [], max(0.0, self.deadline - time.monotonic()))
            piece = os.read(reader, 4096).decode() if ready else ""
            text += piece
            if piece:
                continue
            for _ in range(50 if ready else 1):  # a server that closed its pipe may take a moment to be gone
                self._blame_servers()
                time.sleep(0.02)
            waited = "stopped waiting" if ready else f"waited {self.order.time_out:.0f} s in vain"
            raise SetupError(f"{waited} for {what}; {self._tail(name)}")
        return text

    def _blame_servers(self) -> None:
        """Where the display or the bus has ended, that is the reason to tell, not what followed from it."""
        for pid, name in self.running.items():
            if name in SERVERS and os.waitpid(pid, os.WNOHANG)[0]:
                raise SetupError(f"{name} ended; {self._tail(name)}")

    def _start_guest(self) -> None:
        order, still = self.order, self.doors.framebuffer.door.fileno()
        search_path = (files.PACKAGES, *order.search_path)
        kept = (still,) if self.doors.guest is None else (still, self.doors.guest.fileno())
        argv = session.guest_server(order.python, search_path, self.address, kept, order.osworld)
        self.start("guest", argv, kept, root=True)

    def _await_guest(self) -> None:
        while time.monotonic() < self.deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", session.GUEST_PORT)) == 0:
                    return
            time.sleep(0.01)
        raise SetupError(f"the guest server did not open port {session.GUEST_PORT}; {self._tail('guest')}")

    def _tail(self, name: str) -> str:
        try:
            descriptor = os.open(f"{name}.log", os.O_RDONLY, dir_fd=self.logs)
            with open(descriptor, "rb") as handle:
                text = handle.read()[-800:].decode("utf-8", "replace").strip()
        except OSError:
            return f"it left no log {name}.log"
        return f"the end of {name}.log: {text or '(empty)'}"

    def _watch(self) -> NoReturn:
        while True:
            pid, status = os.wait()
            name = self.running.pop(pid, None)
            if name in SERVERS:
                raise SetupError(f"{name} ended ({_how(status)}), and with it the desktop; {self._tail(name)}")
            if name in self.commands:
                self._again(name, status)

    def _again(self, name: str, status: int) -> None:
        now = time.monotonic()
        recent = [t for t in self.deaths.get(name, []) if now - t < WINDOW] + [now]
        self.deaths[name] = recent
        if len(recent) > RESTARTS:
            raise SetupError(
                f"{name} ended {len(recent)} times within {WINDOW:.0f} s ({_how(status)}); {self._tail(name)}"
            )
        if len(recent) > 1:
            time.sleep(0.1)
        argv, kept, root = self.commands[name]
        self.start(name, argv, kept, root)


def _how(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _authority_entries() -> bytes:
    """Xauthority entries for this host's name (python-xlib knows no other) and for any (family "wild": libX11)."""
    cookie, number = os.urandom(16), session.DISPLAY.lstrip(":").encode()
    entries = b""
    for family, host, display in ((256, account.HOST_NAME.encode(), number), (65535, b"", b"")):
        fields = (host, display, b"MIT-MAGIC-COOKIE-1", cookie)
        entries += family.to_bytes(2, "big") + b"".join(len(field).to_bytes(2, "big") + field for field in fields)
    return entries


def quit_on_signals() -> None:
    """Process 1 has no default actions: without this a polite SIGTERM would do nothing."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: sys.exit(0))
