"""The process on the machine that looks after one desktop.

It makes the desktop's network, forks it off, and clears up when it ends.

    controller ~~> keeper --> launcher --> process 1 inside (init.py)
                          `--> the machine's ports (forward.py)
                          `--> the local internet (internet.py)

The kernel kills the process at the end of a straight arrow when the one at its start dies, `kill
-9` included. The keeper itself watches the controller (`~~>`) by a descriptor of that process, so
it does not matter what the controller forked, or which descriptors its children hold. SIGTERM ends
the desktop as well. The keeper prints one JSON line when the desktop is ready (`{"ready":
record}`) or cannot be built (`{"error": text}`), and one more (`{"ended": text}`) when it ends by
itself.
"""

import contextlib
import json
import os
import secrets
import signal
import socket
from collections.abc import Sequence
from typing import Any, NoReturn

from . import (
    account,
    forward,
    identity,
    init,
    kernel,
    limits,
    network,
    registry,
    root_file_system,
    rootless,
    session,
)
from .desktop_config import DesktopConfig, SetupError
from .framebuffer import GUEST_SOCKET, DesktopEndpoints
from .health import GuestHealth
from .identity import Identity
from .internet import Internet
from .logs import BoundedLogs

# Mounts follow later: the guest server is loaded before (guest_spawner.py).
NAMESPACES = (
    kernel.CLONE_NEWPID | kernel.CLONE_NEWUTS | kernel.CLONE_NEWIPC | kernel.CLONE_NEWCGROUP
)
OSWORLD_PORT = 5000
LOOK_S = 1.0  # between two looks at the desktop's processes


def main(text: str) -> int:
    """Keep one desktop until it, its controller or this process has to end.

    Returns:
        The exit code.
    """
    order = DesktopConfig.from_json(text)
    wake, woken = os.pipe()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: os.write(woken, b"x"))
    ends = [wake]
    os.umask(0o022)
    me = (os.getpid(), registry.process_start(os.getpid()))
    try:
        if order.controller is not None:
            ends.append(_open_process(*order.controller))
        # Before: they belong to the machine's network and its users.
        owners = forward.Owners()
        listener = forward.listen(forward.LOOPBACK)
        if order.rootless:
            rootless.enter()
        else:
            rootless.check_rights()
        record = registry.claim(order.name, me, order.controller, _facts(order))
    except (SetupError, OSError) as error:
        return _tell("error", str(error)) or 1
    log = os.open(
        registry.folder(record["id"]) / "logs/keeper.log",
        os.O_WRONLY | os.O_CREAT | os.O_APPEND,
        0o600,
    )
    # until here what goes wrong is the controller's to see; and it must not wait for our end of it
    os.dup2(log, 2)
    try:
        return _keep(order, record, ends, owners, listener)
    except (SetupError, OSError) as error:
        return _fail(record, str(error))
    finally:
        registry.withdraw(record)


def _open_process(pid: int, start: int) -> int:
    """Return a descriptor that can be read once the process has ended, whoever waits for it.

    Raises:
        ProcessLookupError: It has ended.
    """
    descriptor = os.pidfd_open(pid)
    if not registry.alive((pid, start)):  # the number may be another process' by now
        raise ProcessLookupError(f"process {pid}, whose desktop this is, has ended")
    return descriptor


def _facts(order: DesktopConfig) -> dict[str, Any]:
    return {
        "screen": list(order.screen),
        "display": session.DISPLAY,
        "user": account.NAME,
        "apps": list(order.apps),
        "osworld": order.osworld,
        "rootless": order.rootless,
        "image": os.path.basename(order.image),
        "system": order.system,
    }


def _keep(
    order: DesktopConfig,
    record: dict[str, Any],
    ends: list[int],
    owners: forward.Owners,
    listener: socket.socket,
) -> int:
    name = record["id"]
    folder = registry.folder(record["id"])
    network.create(name, order.system)
    token = secrets.token_urlsafe(24)
    token_file = folder / "token"
    token_file.touch(mode=0o600)
    token_file.write_text(token, encoding="ascii")
    logs = BoundedLogs(os.open(folder / "logs", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC))
    internet = Internet(order, name, logs)
    folders = [*map(str, root_file_system.shown_folders(order.system)), f"{order.layer}/home"]
    user = identity.make(record["slot"], order.rootless, folders)
    user.chown(folder / "logs", 0)  # process 1 writes there
    endpoints = DesktopEndpoints.make(order.screen, folder, user)
    ports, reached = _ports(order, record["slot"], str(folder / GUEST_SOCKET), listener)
    record |= {
        **reached,
        "netns": network.desktop_namespace(name),
        "web_netns": network.web_namespace(name),
        "token_file": str(token_file),
        "door": str(folder / GUEST_SOCKET),
        "memory": endpoints.framebuffer.memory,
        "sites": str(internet.state),
        "shifted": bool(user.base),
    }
    forwarder = forward.start(
        ports, owners, network.NETNS / network.desktop_namespace(name), logs.writer("ports")
    )
    reader, launcher = _launch(order, name, token, user, endpoints)
    endpoints.close()
    try:
        return _follow(record, reader, ends, internet, logs, [launcher, forwarder])
    finally:
        internet.close()
        # The launcher waits for process 1, whose end is complete only when all inside have ended.
        os.kill(record["init"][0] if "init" in record else launcher, signal.SIGKILL)
        os.waitpid(launcher, 0)
        os.kill(forwarder, signal.SIGKILL)
        os.waitpid(forwarder, 0)


def _ports(
    order: DesktopConfig, slot: int, guest_socket: str, listener: socket.socket
) -> tuple[list[forward.Port], dict[str, Any]]:
    """Return the machine's ports of the desktop, and what its record says of them.

    OSWorld's clients expect certain ports: so a desktop of theirs has an address of its own.
    """
    ports: dict[str, int] = {}
    ports_opened: list[forward.Port] = []
    host = forward.LOOPBACK
    if order.osworld:
        listener.close()
        host = network.address(slot)
        listener = forward.listen(host, OSWORLD_PORT)
        for name, target in forward.OSWORLD_PORTS.items():
            application_port = forward.listen(host, target)
            ports[name] = application_port.getsockname()[1]
            ports_opened.append(forward.Port(application_port, target))
    port = listener.getsockname()[1]
    ports_opened.append(forward.Port(listener, guest_socket))
    fields = {"address": host, "source": host, "guest": f"http://{host}:{port}", "ports": ports}
    return ports_opened, fields


def _follow(
    record: dict[str, Any],
    reader: int,
    ends: Sequence[int],
    internet: Internet,
    logs: BoundedLogs,
    children: Sequence[int],
) -> int:
    """Look after the desktop until it has to end, and pass on its reports; return the exit code.

    Args:
        record: of the desktop.
        reader: where its first process reports.
        ends: descriptors that can be read when somebody wants it to end.
        internet: its local internet.
        logs: of the processes outside.
        children: of this process, to be continued if somebody stops them.

    Raises:
        SetupError: A part of it has failed.
    """
    health = GuestHealth(record["door"])
    buffer = b""
    is_up = False
    while True:
        starting = () if internet.serves else (internet.reports,)
        ready = logs.wait(LOOK_S, (reader, *ends, *starting))
        if ready.intersection(ends):
            return 0
        internet.look_after(bool(ready.intersection(starting)))
        if reader in ready:
            piece = os.read(reader, 65536)
            if not piece:
                return _fail(record, "the desktop's first process was killed")
            *lines, buffer = (buffer + piece).split(b"\n")
            for kind, value in map(json.loads, lines):
                if kind == "error":
                    return _fail(record, value)
                is_up = is_up or kind == "ready"
                _note(record, kind, value)
        if is_up and internet.serves and record["state"] != "ready":
            record["state"] = "ready"
            registry.save(record)
            _tell("ready", record)
        if record["state"] == "ready" and health.is_stuck():
            return _fail(record, "the guest server accepts no connections any more")
        for pid in (*children, internet.pid, *record.get("init", ())[:1]):
            registry.resume(pid)


def _note(record: dict[str, Any], kind: str, value: Any) -> None:
    """Write down what the desktop's first process or its launcher reports."""
    if kind == "init":
        record["init"] = [value, registry.process_start(value)]
    elif kind == "limited":
        record["limited"] = value
    registry.save(record)


def _fail(record: dict[str, Any], reason: str) -> int:
    return _tell("ended" if record["state"] == "ready" else "error", reason) or 1


def _launch(
    order: DesktopConfig, name: str, token: str, user: Identity, endpoints: DesktopEndpoints
) -> tuple[int, int]:
    """Fork the launcher, which forks process 1.

    Returns:
        The pipe that both write to, and the launcher's pid.
    """
    reader, writer = os.pipe()
    keeper = os.getpid()
    pid = os.fork()
    if pid:
        os.close(writer)
        return reader, pid
    try:
        kernel.die_with_parent(keeper)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        os.close(reader)
        _say(writer, "limited", limits.join_groups(name, order))
        network.enter(name)
        kernel.leave_keyrings()
        kernel.unshare(NAMESPACES)
        child = os.fork()
        if child == 0:
            _first_process(order, name, token, user, endpoints, writer)
        _say(writer, "init", child)
        os.waitpid(child, 0)
    except OSError as error:
        _say(
            writer,
            "error",
            f"cannot make the desktop's namespaces: {error}; see `hijack desktop doctor`",
        )
    finally:
        os._exit(0)


def _first_process(
    order: DesktopConfig,
    name: str,
    token: str,
    user: Identity,
    endpoints: DesktopEndpoints,
    writer: int,
) -> NoReturn:
    try:
        kernel.die_with_parent()
        init.quit_on_signals()
        os.dup2(os.open("/dev/null", os.O_WRONLY), 1)  # the reports are the keeper's
        first = init.Init(order, registry.folder(name), token, user, endpoints)
        first.run(lambda: _say(writer, "ready", True))
    except (SetupError, OSError) as error:
        _say(writer, "error", str(error))
    finally:
        os._exit(0)


def _say(writer: int, kind: str, value: object) -> None:
    os.write(writer, json.dumps([kind, value]).encode() + b"\n")


def _tell(kind: str, value: object) -> None:
    with contextlib.suppress(OSError):  # the controller is gone: nobody to tell
        os.write(1, json.dumps({kind: value}).encode() + b"\n")
