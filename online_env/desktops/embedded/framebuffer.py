"""The memory that a desktop's X server draws in, and the door to the guest that holds it still.

The keeper makes both before the desktop exists, so nothing inside has a say in what the machine opens; and the memory
is sealed: no one can make it shorter, which would kill a process that reads it.
Light on purpose: the keeper and the first process of a desktop import it.
"""

import fcntl
import os
import socket
from dataclasses import dataclass
from pathlib import Path

from . import account

DOOR = "screen"
# What the file holds before the pixels (X11/XWDFile.h): a header and 256 colours, about 3 KB.
_ROOM = 1 << 16


class Framebuffer:
    """Made by the keeper for a screen of `(width, height)` pixels; `folder` is the desktop's run folder."""

    def __init__(self, screen: tuple[int, int], folder: Path, rootless: bool) -> None:
        width, height = screen
        self.memory = os.memfd_create("screen", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        os.ftruncate(self.memory, width * height * 4 + _ROOM)
        fcntl.fcntl(self.memory, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL)
        if not rootless:
            os.fchown(self.memory, account.UID, account.UID)
        self.door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.door.bind(str(folder / DOOR))
        self.door.listen(8)

    def show(self, folder: Path) -> None:
        """Let an X server that inherits the memory find it in `folder`, where it looks for a file of that name."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "Xvfb_screen0").symlink_to(f"/proc/self/fd/{self.memory}")


@dataclass(frozen=True)
class Doors:
    """What the keeper made for the desktop to keep open: the memory, and where there is one, the guest's socket."""

    framebuffer: Framebuffer
    guest: socket.socket | None

    def close(self) -> None:
        """Close the keeper's ends of the sockets."""
        self.framebuffer.door.close()
        if self.guest is not None:
            self.guest.close()
