"""User and group numbers of the processes in a desktop: none that the machine uses.

The processes run in a user namespace of the desktop's own. Its root user owns nothing outside and
has no rights over the desktop's mounts and network, which belong to the namespace above.

With root, the desktop's user numbers 0 to 65535 are others on the machine, one range for each
desktop, and the files of the machine are shown to it as if shifted (ID-mapped mounts). Where the
kernel or a file system cannot do that, the numbers stay the same: root inside still has no rights
outside, but is called 0 there, too. Without root there is one number only, the caller's.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from . import account, kernel
from .desktop_config import SetupError

RANGE = 1 << 16
# Above what distributions give to users and below 2**31 + 2**28; one range for each slot of the
# registry.
_FIRST = 28992
# Since then an overlay may have ID-mapped layers.
_OLDEST_KERNEL = (5, 19)


@dataclass(frozen=True)
class Identity:
    """A user namespace.

    Attributes:
        namespace: its descriptor; -1 in a container, which has one for us or none.
        base: added to a number inside, it gives the one outside.
        rootless: whether there is only the desktop's user.
    """

    namespace: int
    base: int
    rootless: bool

    def chown(self, path: "str | Path", uid: int, gid: int | None = None) -> None:
        """Make a file, or a link, the property of a user inside."""
        if not self.rootless:
            group = uid if gid is None else gid
            os.chown(path, self.base + uid, self.base + group, follow_symlinks=False)

    def fchown(self, descriptor: int, uid: int) -> None:
        """Make an open file the property of a user inside."""
        if not self.rootless:
            os.fchown(descriptor, self.base + uid, self.base + uid)

    def owner(self, uid: int = 0) -> str:
        """Options of a tmpfs that belongs to a user inside."""
        return "" if self.rootless else f",uid={self.base + uid},gid={self.base + uid}"

    def enter(self) -> None:
        """With root: become root inside, who may still make of itself whom it likes in there."""
        if self.rootless:
            return
        kernel.join(self.namespace, kernel.CLONE_NEWUSER)
        kernel.drop_capabilities()
        os.setgroups([])
        os.setresgid(0, 0, 0)
        os.setresuid(0, 0, 0)

    def become_user(self, guarded: bool = False) -> None:
        """Become the desktop's user, for good; after `enter`.

        Args:
            guarded: keep the user's other programs from changing this process' limits: prlimit(2)
                asks that all three groups are the same. There is no other group without root.
        """
        saved_group = account.UID
        if self.rootless:
            kernel.join(self.namespace, kernel.CLONE_NEWUSER)
        else:
            os.setgroups([])
            saved_group += int(guarded)
        os.setresgid(account.UID, account.UID, saved_group)
        os.setresuid(account.UID, account.UID, account.UID)


def make(slot: int, rootless: bool, folders: Iterable[str]) -> Identity:
    """Return the identity of the desktop in `slot`, which is to see the folders `folders`.

    If none can be made, it is a `SetupError`.
    """
    if rootless:
        return Identity(_namespace(f"{account.UID} 0 1"), 0, True)
    base = (_FIRST + slot) * RANGE
    mapped = _namespace(f"0 {base} {RANGE}")
    if can_shift(mapped, folders):
        return Identity(mapped, base, False)
    os.close(mapped)
    return Identity(_namespace(f"0 0 {RANGE}"), 0, False)


def can_shift(namespace: int, folders: Iterable[str]) -> bool:
    """Return whether all folders of `folders` can be shown with the numbers of `namespace`."""
    release = os.uname().release.split(".")
    if (int(release[0]), int(release[1].split("-")[0])) < _OLDEST_KERNEL:
        return False
    try:
        for path in folders:
            os.close(kernel.open_mapped_tree(path, namespace))
    except OSError:
        return False
    return True


def _namespace(numbers: str) -> int:
    """Return a descriptor of a new user namespace.

    Args:
        numbers: the map of users, and of groups.

    Raises:
        SetupError: The kernel refuses it.
    """
    ready, tell = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            kernel.unshare(kernel.CLONE_NEWUSER)
            os.write(tell, b"x")
            os.read(os.pipe()[0], 1)  # until it is killed
        finally:
            os._exit(1)
    os.close(tell)
    try:
        if not os.read(ready, 1):
            raise SetupError(
                "no user namespace for the desktop's users; is user.max_user_namespaces too low?"
            )
        write_map(child, numbers, numbers)
        return os.open(f"/proc/{child}/ns/user", os.O_RDONLY | os.O_CLOEXEC)
    finally:
        os.close(ready)
        os.kill(child, 9)
        os.waitpid(child, 0)


def write_map(pid: int, users: str, groups: str) -> None:
    """Say what the numbers in the user namespace of process `pid` are outside of it."""
    single = users.endswith(" 1")
    for name, text in (
        *((("setgroups", "deny"),) if single else ()),
        ("uid_map", users),
        ("gid_map", groups),
    ):
        Path(f"/proc/{pid}/{name}").write_text(text, encoding="ascii")
