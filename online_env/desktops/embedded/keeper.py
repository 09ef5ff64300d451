"""The process on the machine that looks after one desktop: makes its network, forks it off, clears up when it ends.

    controller --(pipe: when it closes, the desktop ends)--> keeper --> launcher --> process 1 inside (init.py)

Every arrow ends the next process when the one before dies, `kill -9` included. The keeper prints one JSON line when the
desktop is ready (`{"ready": record}`) or cannot be built (`{"error": text}`), and one more (`{"ended": text}`) when it
ends by itself.
"""

import contextlib
import json
import os
import secrets
import select
import signal
import socket
from typing import Any, NoReturn

from . import account, init, kernel, limits, network, registry, rootless, session
from .framebuffer import Doors, Framebuffer
from .internet import Internet
from .plain import Order, SetupError

NAMESPACES = kernel.CLONE_NEWNS | kernel.CLONE_NEWUTS | kernel.CLONE_NEWIPC


def main(text: str) -> int:
    """Keep one desktop until it, its controller or this process is told to end; returns the exit code."""
    order = Order.from_json(text)
    wake, woken = os.pipe()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: os.write(woken, b"x"))
    os.umask(0o022)
    door = None
    me = (os.getpid(), registry.process_start(os.getpid()))
    try:
        door = rootless.enter() if order.rootless else None
        record = registry.claim(order.name, me, order.controller, _facts(order))
    except (SetupError, OSError) as error:
        return _tell("error", str(error)) or 1
    log = os.open(registry.folder(record["id"]) / "logs/keeper.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 2)  # until here what goes wrong is the controller's to see; and it must not wait for our end of it
    try:
        return _keep(order, record, wake, door)
    except (SetupError, OSError) as error:
        return _tell("error", str(error)) or 1
    finally:
        registry.clear(record)


def _facts(order: Order) -> dict[str, Any]:
    return {"screen": list(order.screen), "display": session.DISPLAY, "user": account.NAME, "apps": list(order.apps),
            "osworld": order.osworld, "rootless": order.rootless}  # fmt: skip


def _keep(order: Order, record: dict[str, Any], wake: int, door: socket.socket | None) -> int:
    name, slot = record["id"], record["slot"]
    network.create(name, slot)
    token = secrets.token_urlsafe(24)
    token_file = registry.folder(name) / "token"
    token_file.touch(mode=0o600)
    token_file.write_text(token, encoding="ascii")
    internet = Internet(order, name)
    framebuffer = Framebuffer(order.screen, registry.folder(name), order.rootless)
    source, address = network.addresses(slot)
    record |= {
        "address": address,
        "source": source,
        "netns": network.desktop_namespace(name),
        "web_netns": network.web_namespace(name),
        "token_file": str(token_file),
        "guest": f"http://{address}:{session.GUEST_PORT}",
        **_reached_by(door),
        "memory": framebuffer.memory,
        "sites": str(internet.state),
    }
    doors = Doors(framebuffer, door)
    reader, launcher = _launch(order, name, token, address, doors)
    doors.close()
    try:
        return _follow(order, record, reader, wake, internet)
    finally:
        internet.close()
        # The launcher waits for process 1, whose end is complete only when all inside have ended.
        os.kill(record["init"][0] if "init" in record else launcher, signal.SIGKILL)
        os.waitpid(launcher, 0)


def _reached_by(door: socket.socket | None) -> dict[str, Any]:
    """Where the guest server is, if the machine reaches it by a socket of ours instead of over the cable."""
    if door is None:
        return {}
    host, port = door.getsockname()
    return {"guest": f"http://{host}:{port}", "address": host, "source": host}


def _follow(order: Order, record: dict[str, Any], reader: int, wake: int, internet: Internet) -> int:
    """Pass on what the desktop reports until something says that it is over; returns the exit code."""
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
    """Write down one message of the desktop and tell the controller; returns whether the desktop goes on."""
    if kind == "init":
        record["init"] = [value, registry.process_start(value)]
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


def _launch(order: Order, name: str, token: str, address: str, doors: Doors) -> tuple[int, int]:
    """Fork the launcher, which forks process 1; returns the pipe that both write to, and the launcher's pid."""
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
        limits.join_group(name, order)
        kernel.join_namespace(str(network.NETNS / network.desktop_namespace(name)), kernel.CLONE_NEWNET)
        kernel.unshare(kernel.CLONE_NEWPID | NAMESPACES)
        child = os.fork()
        if child == 0:
            _first_process(order, name, token, address, doors, writer)
        _say(writer, "init", child)
        os.waitpid(child, 0)
    except OSError as error:
        _say(writer, "error", f"cannot make the desktop's namespaces: {error}; see `hijack desktop doctor`")
    finally:
        os._exit(0)


def _first_process(order: Order, name: str, token: str, address: str, doors: Doors, writer: int) -> NoReturn:
    try:
        kernel.die_with_parent()
        init.quit_on_signals()
        for descriptor in (0, 1):  # the lifeline and the reports are the keeper's
            os.dup2(os.open("/dev/null", os.O_RDWR), descriptor)
        first = init.Init(order, registry.folder(name), token, address, doors)
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
