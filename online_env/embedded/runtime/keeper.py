"""The process on the machine that looks after one desktop.

It makes the desktop's network, forks it off, and clears up when it ends.

    controller --(pipe: when it closes, the desktop ends)--> keeper --> launcher --> process 1
                                                                inside (init.py) `--> the machine's
                                                                ports (forward.py)

Every arrow ends the next process when the one before dies, `kill -9` included. The keeper prints
one JSON line when the desktop is ready (`{"ready": record}`) or cannot be built (`{"error":
text}`), and one more (`{"ended": text}`) when it ends by itself.
"""

import contextlib
import json
import os
import secrets
import select
import signal
import socket
from typing import Any, NoReturn

from .. import registry
from . import account, files, forward, identity, init, kernel, limits, network, rootless, session
from .framebuffer import GUEST_DOOR, Doors
from .identity import Identity
from .internet import Internet
from .plain import DesktopConfig, SetupError

# Mounts follow later: the guest server is loaded before (nest.py).
NAMESPACES = (
    kernel.CLONE_NEWPID | kernel.CLONE_NEWUTS | kernel.CLONE_NEWIPC | kernel.CLONE_NEWCGROUP
)
OSWORLD_PORT = 5000


def main(text: str) -> int:
    """Keep one desktop until it, its controller or this process has to end.

    Returns:
        The exit code.
    """
    order = DesktopConfig.from_json(text)
    wake, woken = os.pipe()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: os.write(woken, b"x"))
    os.umask(0o022)
    me = (os.getpid(), registry.process_start(os.getpid()))
    try:
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
        return _keep(order, record, wake, owners, listener)
    except (SetupError, OSError) as error:
        return _tell("error", str(error)) or 1
    finally:
        registry.clear(record)


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
    wake: int,
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
    internet = Internet(order, name)
    shown = [*map(str, files.shown_folders(order.system)), f"{order.layer}/home"]
    who = identity.make(record["slot"], order.rootless, shown)
    who.give(folder / "logs", 0)  # process 1 writes there
    doors = Doors.make(order.screen, folder, who)
    ports, reached = _ports(order, record["slot"], str(folder / GUEST_DOOR), listener)
    record |= {
        **reached,
        "netns": network.desktop_namespace(name),
        "web_netns": network.web_namespace(name),
        "token_file": str(token_file),
        "door": str(folder / GUEST_DOOR),
        "memory": doors.framebuffer.memory,
        "sites": str(internet.state),
        "shifted": bool(who.base),
    }
    forwarder = forward.start(ports, owners, network.NETNS / network.desktop_namespace(name))
    reader, launcher = _launch(order, name, token, who, doors)
    doors.close()
    try:
        return _follow(order, record, reader, wake, internet)
    finally:
        internet.close()
        # The launcher waits for process 1, whose end is complete only when all inside have ended.
        os.kill(record["init"][0] if "init" in record else launcher, signal.SIGKILL)
        os.waitpid(launcher, 0)
        os.kill(forwarder, signal.SIGKILL)
        os.waitpid(forwarder, 0)


def _ports(
    order: DesktopConfig, slot: int, door: str, listener: socket.socket
) -> tuple[list[forward.Port], dict[str, Any]]:
    """The machine's ports of the desktop, and what its record says of them.

    OSWorld's clients expect certain ports: so a desktop of theirs has an address of its own.
    """
    ports: dict[str, int] = {}
    found: list[forward.Port] = []
    host = forward.LOOPBACK
    if order.osworld:
        listener.close()
        host = network.address(slot)
        listener = forward.listen(host, OSWORLD_PORT)
        for name, target in forward.OSWORLD_PORTS.items():
            more = forward.listen(host, target)
            ports[name] = more.getsockname()[1]
            found.append(forward.Port(more, target))
    port = listener.getsockname()[1]
    found.append(forward.Port(listener, door))
    told = {"address": host, "source": host, "guest": f"http://{host}:{port}", "ports": ports}
    return found, told


def _follow(
    order: DesktopConfig, record: dict[str, Any], reader: int, wake: int, internet: Internet
) -> int:
    """Pass on the desktop's reports until one of them ends it; return the exit code."""
    lifeline = [0] if order.lifeline else []
    buffer = b""
    while not order.controller or registry.alive(order.controller):
        events, _, _ = select.select([reader, wake, *lifeline], [], [], 1.0)
        internet.look_after()
        if wake in events or (0 in events and not os.read(0, 4096)):
            return 0
        if reader not in events:
            continue
        piece = os.read(reader, 65536)
        *lines, buffer = (buffer + piece).split(b"\n")
        for line in lines if piece else [b'["error", "the desktop\'s first process was killed"]']:
            kind, value = json.loads(line)
            if not _report(record, kind, value, internet):
                return 1
    return 0


def _report(record: dict[str, Any], kind: str, value: Any, internet: Internet) -> bool:
    """Write down one message of the desktop and pass it on; return whether the desktop goes on."""
    if kind == "init":
        record["init"] = [value, registry.process_start(value)]
    elif kind == "limited":
        record["limited"] = value
    elif kind == "ready":
        internet.wait()
        record["state"] = "ready"
    else:
        _tell("ended" if record["state"] == "ready" else "error", value)
        return False
    registry.save(record)
    if kind == "ready":
        _tell("ready", record)
    return True


def _launch(
    order: DesktopConfig, name: str, token: str, who: Identity, doors: Doors
) -> tuple[int, int]:
    """Fork the launcher, which forks process 1.

    Returns:
        The pipe that both write to, and the launcher's pid.
    """
    reader, writer = os.pipe()
    parent = os.getpid()
    pid = os.fork()
    if pid:
        os.close(writer)
        return reader, pid
    try:
        kernel.die_with_parent()
        if os.getppid() != parent:
            os._exit(1)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        os.close(reader)
        _say(writer, "limited", limits.join_groups(name, order))
        network.enter(name)
        kernel.leave_keyrings()
        kernel.unshare(NAMESPACES)
        child = os.fork()
        if child == 0:
            _first_process(order, name, token, who, doors, writer)
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
    order: DesktopConfig, name: str, token: str, who: Identity, doors: Doors, writer: int
) -> NoReturn:
    try:
        kernel.die_with_parent()
        init.quit_on_signals()
        for descriptor in (0, 1):  # the lifeline and the reports are the keeper's
            os.dup2(os.open("/dev/null", os.O_RDWR), descriptor)
        first = init.Init(order, registry.folder(name), token, who, doors)
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
