"""System calls that Python 3.11 lacks: namespaces, mounts, parent-death signal, capabilities.

Light on purpose (ctypes and os only): the first process of a desktop imports it.
"""

import ctypes
import os
import signal
from pathlib import Path

CLONE_NEWNS = 0x00020000
CLONE_NEWCGROUP = 0x02000000
CLONE_NEWUTS = 0x04000000
CLONE_NEWIPC = 0x08000000
CLONE_NEWUSER = 0x10000000
CLONE_NEWPID = 0x20000000
CLONE_NEWNET = 0x40000000
MS_RDONLY = 1
MS_NOSUID = 2
MS_NODEV = 4
MS_NOEXEC = 8
MS_REMOUNT = 32
MS_BIND = 4096
MS_REC = 16384
MS_PRIVATE = 1 << 18
MNT_DETACH = 2
# statvfs(3) has other numbers than mount(2) for: nosuid, nodev, noexec, noatime, nodiratime,
# relatime.
_KEPT_FLAGS = {2: 2, 4: 4, 8: 8, 1024: 1024, 2048: 2048, 4096: 1 << 21}
_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4
_PR_SET_NAME = 15
_PR_CAPBSET_DROP = 24
# What root inside a desktop keeps, less than container engines leave: enough for sudo, chown and
# apt, not enough for mounts, devices, raw frames, the firewall, kernel modules or the clock.
_KEPT_CAPABILITIES = frozenset({0, 1, 3, 4, 5, 6, 7, 8, 10, 18, 29, 31})
_LAST_CAPABILITY = 40
# System calls that are younger than the C library: their numbers are the same everywhere.
_OPEN_TREE = 428
_MOVE_MOUNT = 429
_MOUNT_SETATTR = 442
# And two that are not.
_NUMBERS = {
    "x86_64": {"pivot_root": 155, "keyctl": 250},
    "aarch64": {"pivot_root": 41, "keyctl": 219},
}
_OPEN_TREE_CLONE = 1
_MOVE_MOUNT_F_EMPTY_PATH = 4
_AT_FDCWD = -100
_AT_EMPTY_PATH = 0x1000
_MOUNT_ATTR_IDMAP = 0x00100000
_KEYCTL_JOIN_SESSION_KEYRING = 1
_ARGUMENTS = slice(45, 47)  # of /proc/PID/stat after the name: where its command line is in memory

_libc = ctypes.CDLL(None, use_errno=True)


def _check(result: int, operation: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{operation}: {os.strerror(number)}")


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


def mount(
    source: str, target: str, kind: str | None = None, flags: int = 0, options: str | None = None
) -> None:
    """Mount a file system by the system call of that name."""
    fstype = None if kind is None else kind.encode()
    data = None if options is None else options.encode()
    result = _libc.mount(source.encode(), target.encode(), fstype, ctypes.c_ulong(flags), data)
    _check(result, f"mount {source} on {target}")


def bind(source: str, target: str, read_only: bool = False) -> None:
    """Show `source` at `target`, too."""
    mount(source, target, flags=MS_BIND)
    if read_only:
        # What the mount below forbids must stay forbidden: in a user namespace, the kernel insists.
        present = os.statvfs(target).f_flag
        flags = MS_BIND | MS_REMOUNT | MS_RDONLY
        for statvfs_flag, mount_flag in _KEPT_FLAGS.items():
            if present & statvfs_flag:
                flags |= mount_flag
        mount("none", target, flags=flags)


def unmount(target: str) -> None:
    """Detach a mount, even where it is in use."""
    _check(_libc.umount2(target.encode(), MNT_DETACH), f"umount {target}")


def set_host_name(name: str) -> None:
    """Call sethostname(2), in the present UTS namespace."""
    raw = name.encode()
    _check(_libc.sethostname(raw, len(raw)), "sethostname")


def die_with_parent(parent: int = 0) -> None:
    """Have this process killed when its parent ends.

    Args:
        parent: its number; if it has ended by now, so does this process. 0 where it cannot be seen
            from this process' namespace.
    """
    _check(_libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0), "prctl(PR_SET_PDEATHSIG)")
    if parent and os.getppid() != parent:
        os._exit(1)


def drop_capabilities() -> None:
    """Take from all later children what root inside a desktop must not have.

    This process keeps its own.
    """
    for number in range(_LAST_CAPABILITY + 1):
        if number not in _KEPT_CAPABILITIES:
            result = _libc.prctl(_PR_CAPBSET_DROP, number, 0, 0, 0)
            _check(result, f"prctl(PR_CAPBSET_DROP, {number})")


def open_tree(path: str) -> int:
    """Return a descriptor of a copy of the mount at `path`, attached nowhere.

    What is opened below it has its path from there on, so that /proc tells nothing of what is
    above.
    """
    flags = _OPEN_TREE_CLONE | os.O_CLOEXEC
    descriptor = _libc.syscall(_OPEN_TREE, _AT_FDCWD, path.encode(), flags)
    _check(min(descriptor, 0), f"open_tree({path})")
    return descriptor


class _MountAttributes(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in ("set", "clear", "propagation", "namespace")]


def open_mapped_tree(path: str, namespace: int) -> int:
    """As `open_tree`; the user namespace `namespace` decides to whom the files in it belong.

    Raises:
        OSError: The file system of `path`, or the kernel, cannot.
    """
    descriptor = open_tree(path)
    attributes = _MountAttributes(set=_MOUNT_ATTR_IDMAP, namespace=namespace)
    size = ctypes.sizeof(attributes)
    try:
        result = _libc.syscall(
            _MOUNT_SETATTR, descriptor, b"", _AT_EMPTY_PATH, ctypes.byref(attributes), size
        )
        _check(result, f"mount_setattr({path})")
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def attach_tree(descriptor: int, target: str) -> None:
    """Mount what `open_tree` gave at `target`; closes the descriptor."""
    flags = _MOVE_MOUNT_F_EMPTY_PATH
    try:
        result = _libc.syscall(_MOVE_MOUNT, descriptor, b"", _AT_FDCWD, target.encode(), flags)
        _check(result, f"move_mount to {target}")
    finally:
        os.close(descriptor)


def pivot_root() -> None:
    """Make the present folder, a mount, the root.

    The old root lies over it until it is detached.
    """
    _check(_libc.syscall(_number("pivot_root"), b".", b"."), "pivot_root")


def leave_keyrings() -> None:
    """Give this process and its later children an empty session keyring of their own."""
    _libc.syscall(_number("keyctl"), _KEYCTL_JOIN_SESSION_KEYRING, None)  # no keyrings: fine, too


def _number(name: str) -> int:
    machine = os.uname().machine
    if machine not in _NUMBERS:
        raise OSError(f"no embedded desktops on {machine}: only on {' and '.join(_NUMBERS)}")
    return _NUMBERS[machine][name]


def forbid_reading() -> None:
    """Let no process without rights over ours read or change this one's memory and descriptors."""
    _check(_libc.prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0), "prctl(PR_SET_DUMPABLE)")


def set_process_name(title: str) -> None:
    """Call this process `title` in lists of processes.

    The paths of its owner are nobody's business inside.
    """
    name = title.encode()
    _libc.prctl(_PR_SET_NAME, name[:15], 0, 0, 0)
    text = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace")
    fields = text.rpartition(")")[2].split()
    start, end = map(int, fields[_ARGUMENTS])
    room = end - start
    if room > 0:
        visible = name[: room - 1]
        ctypes.memset(start, 0, room)
        ctypes.memmove(start, visible, len(visible))
