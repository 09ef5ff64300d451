"""The memory that a desktop's X server draws in, and the sockets of its guest server.

The keeper makes both before the desktop exists, so nothing inside has a say in what the machine
opens; and the memory is sealed: no one can make it shorter, which would kill a process that reads
it. Light on purpose: the keeper and the first process of a desktop import it.
"""

import fcntl
import os
import socket
from dataclasses import dataclass
from pathlib import Path

from . import account
from .identity import Identity

FREEZE_SOCKET = "screen"
GUEST_SOCKET = "guest"
# What the file holds before the pixels (X11/XWDFile.h): a header and 256 colours, about 3 KB.
_ROOM = 1 << 16


class Framebuffer:
    """The screen's memory and the socket by which the guest freezes it, made by the keeper.

    Args:
        screen: its size `(width, height)` in pixels.
        folder: the desktop's run folder.
        identity: who the processes inside are.
    """

    def __init__(self, screen: tuple[int, int], folder: Path, identity: Identity) -> None:
        width, height = screen
        self.memory = os.memfd_create("screen", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        os.ftruncate(self.memory, width * height * 4 + _ROOM)
        fcntl.fcntl(
            self.memory,
            fcntl.F_ADD_SEALS,
            fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL,
        )
        identity.fchown(self.memory, account.UID)
        self.freeze_socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.freeze_socket.bind(str(folder / FREEZE_SOCKET))
        self.freeze_socket.listen(8)

    def close(self) -> None:
        """Close the memory and the socket; processes that have them open keep them."""
        os.close(self.memory)
        self.freeze_socket.close()

    def show(self, folder: Path) -> None:
        """Let an X server that inherits the memory find it in `folder`.

        It looks for a file of that name there.
        """
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "Xvfb_screen0").symlink_to(f"/proc/self/fd/{self.memory}")


@dataclass(frozen=True)
class DesktopEndpoints:
    """The memory and the guest server's socket, which the keeper made for the desktop to keep open.

    The socket is a file in the run folder, which nobody else may enter. A TCP socket of the
    machine's would be a way out: whoever holds one may connect it to whatever the machine can
    reach.
    """

    framebuffer: Framebuffer
    guest: socket.socket

    @classmethod
    def make(cls, screen: tuple[int, int], folder: Path, identity: Identity) -> "DesktopEndpoints":
        """Make them for a screen of `(width, height)` pixels in the run folder `folder`."""
        guest = socket.socket(socket.AF_UNIX)
        guest.bind(str(folder / GUEST_SOCKET))
        guest.listen(128)
        return cls(Framebuffer(screen, folder, identity), guest)

    def close(self) -> None:
        """Close the keeper's ends of the sockets."""
        self.framebuffer.freeze_socket.close()
        self.guest.close()
