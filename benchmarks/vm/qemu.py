"""One QEMU machine with the guest of `image`; it ends with this process, however that ends."""

import json
import secrets
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from online_env.desktops.http import HttpDesktop
from online_env.desktops.protocol import TaskConfig
from online_env.embedded.runtime.session import APPS
from online_env.errors import DesktopError, GuestError

from .image import Image
from .inside import ADDRESS, READY

CPUS, MEMORY = 2, 4096  # MiB
GUEST_PORT = 5000  # where the guest server listens by default
PATIENCE = 300.0  # s; a machine without KVM needs more than a minute


class Machine:
    """A machine whose disk is a copy-on-write layer over the image; use it in a `with` statement.

    Args:
        image: what it starts.
        folder: where its files may lie; they go with it.
        kvm: whether the processor is the real one; else QEMU translates each instruction.
    """

    def __init__(self, image: Image, folder: Path, kvm: bool) -> None:
        self._started = time.perf_counter()
        self._folder = tempfile.TemporaryDirectory(dir=folder)
        self._console = Path(self._folder.name, "console.log")
        layer = Path(self._folder.name, "disk.qcow2")
        create = [
            "qemu-img",
            "create",
            "-q",
            "-f",
            "qcow2",
            "-F",
            "raw",
            "-b",
            str(image.disk),
            str(layer),
        ]
        subprocess.run(create, check=True)
        token = secrets.token_hex(16)
        port = _free_port()
        # setpriv: the machine is killed when this process ends, however it does.
        command = [
            "setpriv",
            "--pdeathsig",
            "KILL",
            "qemu-system-x86_64",
            *_arguments(image, layer, port, kvm),
        ]
        command += [
            "-append",
            f"console=ttyS0 quiet panic=-1 AH_TOKEN={token}",
            "-serial",
            f"file:{self._console}",
        ]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.pid = self._process.pid
        self.token = token
        self.desktop = HttpDesktop(f"http://127.0.0.1:{port}", token, resetter=self._load)
        self._order("qmp_capabilities")

    def __enter__(self) -> "Machine":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self) -> float:
        """Wait until the desktop is up with a screenshot; return the seconds since the start.

        Raises `DesktopError` with the end of the guest's console where that does not happen.
        """
        deadline = time.monotonic() + PATIENCE
        while READY not in (text := self._read_console()):
            if self._process.poll() is not None or time.monotonic() > deadline:
                raise DesktopError(
                    "the guest did not come up; the end of its console:"
                    f" {text[-1500:] or '(empty)'}"
                )
            time.sleep(0.005)
        self.desktop.screenshot()
        return time.perf_counter() - self._started

    def open(self, app: str) -> None:
        """Start an application that `session.APPS` names, and wait for its window."""
        program = APPS[app]
        deadline = time.monotonic() + PATIENCE
        self.desktop.launch(program.argv)
        while not any(
            program.window in str(window["class"]).lower() for window in self.desktop.windows()
        ):
            if time.monotonic() > deadline:
                raise DesktopError(f"no window of {app} within {PATIENCE:.0f} s")
            time.sleep(0.05)

    def save(self) -> None:
        """Keep a snapshot of the running machine: memory, devices and disk."""
        self.desktop.close()
        self._order("human-monitor-command", {"command-line": "savevm base"})

    def load(self) -> float:
        """Go back to the snapshot, wait for a screenshot, and return the seconds of the former."""
        start = time.perf_counter()
        self.desktop.reset()
        took = time.perf_counter() - start
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                self.desktop.screenshot()
                return took
            except GuestError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.005)

    def close(self) -> None:
        """End the machine at once; its disk is thrown away anyway."""
        self.desktop.close()
        self._process.kill()
        self._process.communicate()
        self._folder.cleanup()

    def _load(self, _: TaskConfig | None) -> None:
        self.desktop.close()
        self._order("human-monitor-command", {"command-line": "loadvm base"})

    def _order(self, name: str, arguments: dict[str, str] | None = None) -> None:
        """Give an order over QMP and wait until it is done; an answer is a complaint."""
        if self._process.stdin is None or self._process.stdout is None:
            raise DesktopError("QEMU has no monitor")
        self._process.stdin.write(
            json.dumps({"execute": name, "arguments": arguments or {}}) + "\n"
        )
        self._process.stdin.flush()
        answer: dict[str, Any] = {}
        while not {"return", "error"} & answer.keys():  # else the greeting, or an event
            answer = json.loads(self._process.stdout.readline() or '{"error": "it has ended"}')
        if answer.get("return") not in ("", {}):
            raise DesktopError(f"QEMU refused {name} {arguments or ''}: {answer}")

    def _read_console(self) -> str:
        return self._console.read_text(errors="replace") if self._console.exists() else ""


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _arguments(image: Image, layer: Path, port: int, kvm: bool) -> list[str]:
    processor = (
        ("-accel", "kvm", "-cpu", "host") if kvm else ("-accel", "tcg,thread=multi", "-cpu", "max")
    )
    forward = f"hostfwd=tcp:127.0.0.1:{port}-{ADDRESS}:{GUEST_PORT}"
    return [
        "-nodefaults",
        "-no-user-config",
        "-no-reboot",
        "-display",
        "none",
        "-qmp",
        "stdio",
        *processor,
        "-machine",
        "q35",
        "-smp",
        str(CPUS),
        "-m",
        str(MEMORY),
        "-kernel",
        str(image.kernel),
        "-initrd",
        str(image.initramfs),
        "-drive",
        f"file={layer},format=qcow2,if=virtio",
        "-drive",
        f"file={image.code},format=raw,if=virtio,readonly=on",
        "-netdev",
        f"user,id=net,restrict=on,{forward}",
        "-device",
        "virtio-net-pci,netdev=net,romfile=",
    ]
