"""System calls that Python 3.11 does not have: namespaces, mounts, parent-death signal, capabilities.

Light on purpose (ctypes and os only): the first process of a desktop imports it.
"""

import ctypes
import os
import signal

CLONE_NEWNS, CLONE_NEWUTS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET = (
    0x00020000, 0x04000000, 0x08000000, 0x10000000, 0x20000000, 0x40000000,
)  # fmt: skip
MS_RDONLY, MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_REMOUNT = 1, 2, 4, 8, 32
MS_BIND, MS_REC, MS_PRIVATE = 4096, 16384, 1 << 18
MNT_DETACH = 2
# statvfs(3) has other numbers than mount(2) for: nosuid, nodev, noexec, noatime, nodiratime, relatime.
_KEPT_FLAGS = {2: 2, 4: 4, 8: 8, 1024: 1024, 2048: 2048, 4096: 1 << 21}
_PR_SET_PDEATHSIG, _PR_CAPBSET_DROP = 1, 24
# What root inside a desktop keeps, about what container engines leave: enough for sudo, chown and apt, not enough for
# mounts, devices, the firewall, kernel modules or the clock.
_KEPT_CAPABILITIES = frozenset({0, 1, 3, 4, 5, 6, 7, 8, 10, 13, 18, 29, 31})
_LAST_CAPABILITY = 40

_libc = ctypes.CDLL(None, use_errno=True)


def _check(result: int, what: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")


def unshare(flags: int) -> None:
    """Give this process (for CLONE_NEWPID: its children) new namespaces."""
    _check(_libc.unshare(flags), f"unshare({flags:#x})")


def join_namespace(path: str, kind: int) -> None:
    """Enter the namespace at `path`, such as `/run/netns/x`; `kind` is its CLONE_NEW flag."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        join(descriptor, kind)
    finally:
        os.close(descriptor)


def join(descriptor: int, kind: int) -> None:
    """Enter the namespace behind an open file."""
    _check(_libc.setns(descriptor, kind), f"setns({kind:#x})")


def mount(source: str, target: str, kind: str | None = None, flags: int = 0, options: str | None = None) -> None:
    """mount(2)."""
    encoded = [None if text is None else text.encode() for text in (source, target, kind)]
    data = None if options is None else options.encode()
    _check(_libc.mount(*encoded, ctypes.c_ulong(flags), data), f"mount {source} on {target}")


def bind(source: str, target: str, read_only: bool = False) -> None:
    """Show `source` at `target`, too."""
    mount(source, target, flags=MS_BIND)
    if read_only:
        # What the mount below forbids must stay forbidden: in a user namespace, the kernel insists.
        kept = sum(to for of, to in _KEPT_FLAGS.items() if os.statvfs(target).f_flag & of)
        mount("none", target, flags=MS_BIND | MS_REMOUNT | MS_RDONLY | kept)


def unmount(target: str) -> None:
    """Detach a mount, even where it is in use."""
    _check(_libc.umount2(target.encode(), MNT_DETACH), f"umount {target}")


def set_host_name(name: str) -> None:
    """sethostname(2), in the present UTS namespace."""
    raw = name.encode()
    _check(_libc.sethostname(raw, len(raw)), "sethostname")


def die_with_parent() -> None:
    """Have this process killed when its parent ends."""
    _check(_libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0), "prctl(PR_SET_PDEATHSIG)")


def drop_capabilities() -> None:
    """Take from all later children what root inside a desktop must not have; this process keeps its own."""
    for number in range(_LAST_CAPABILITY + 1):
        if number not in _KEPT_CAPABILITIES:
            _check(_libc.prctl(_PR_CAPBSET_DROP, number, 0, 0, 0), f"prctl(PR_CAPBSET_DROP, {number})")
