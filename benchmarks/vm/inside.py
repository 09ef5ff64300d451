"""Process 1 of the measured guest: the embedded desktop's own, on a machine of its own.

`image.FIRST` starts it, with our packages and their requirements first in `sys.path`.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from online_env.embedded.runtime import account, kernel, root_file_system, session
from online_env.embedded.runtime.desktop_config import DesktopConfig
from online_env.embedded.runtime.framebuffer import DesktopEndpoints, Framebuffer
from online_env.embedded.runtime.init import Init, quit_on_signals

SCREEN = (1920, 1080)
ADDRESS = "10.0.2.15"  # what QEMU's user network gives its first guest
READY = "agenthijack: ready"
MEMORY_FOLDERS = (("/run", "755"), ("/tmp", "1777"), ("/dev/shm", "1777"))


class Guest(Init):
    """The session of the embedded desktop; the file system is the machine's own."""

    def run(self, ready: Callable[[], None]) -> NoReturn:
        """Start the session, call `ready`, then watch for ever."""
        kernel.set_host_name(account.HOST_NAME)
        self._write_secrets()
        self._start_servers()
        self._start_session()
        ready()
        for name, program in session.LATE.items():
            self.start(name, program.argv)
        self._watch()


def main() -> NoReturn:
    """Make the rest of the system, then run the session; when this ends, so does the machine."""
    os.environ["PATH"] = session.PATH
    for target, mode in MEMORY_FOLDERS:
        Path(target).mkdir(exist_ok=True)
        kernel.mount("none", target, "tmpfs", options=f"mode={mode}")
    Path("/dev/pts").mkdir(exist_ok=True)
    kernel.mount("devpts", "/dev/pts", "devpts", options="ptmxmode=0666,mode=0620,gid=5")
    order = DesktopConfig(
        name="vm",
        screen=SCREEN,
        layer="",
        search_path=tuple(sys.path[:2]),
        python="/usr/bin/python3",
        time_out=240,
    )
    root = Path("/")
    folder = Path("/run/guest")
    for path in (folder / "logs", Path(session.TOKEN_FILE).parent):
        path.mkdir(parents=True)
    root_file_system.write_settings(root, order)
    root_file_system.install_guest_files(root)
    root_file_system.install_browser(root)
    quit_on_signals()
    doors = DesktopEndpoints(Framebuffer(SCREEN, folder, rootless=False), None)
    Guest(order, folder, os.environ["AH_TOKEN"], ADDRESS, doors).run(
        lambda: print(READY, flush=True)
    )
