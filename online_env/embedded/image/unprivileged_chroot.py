"""Running Debian's own programs in the tree of an image, without a right that a user lacks.

Process 1 of new namespaces has the tree as its root, and no network. A seccomp filter lets `chown`
and its like succeed without doing anything, so that one user number is enough: no range in
/etc/subuid is needed, and the files of an image are the same whoever builds it.
"""

import ctypes
import os
import signal
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from ...errors import DesktopImageError
from ..runtime import identity, kernel, rootless

ENVIRONMENT = {
    "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
    "HOME": "/root",
    "LC_ALL": "C.UTF-8",
    "DEBIAN_FRONTEND": "noninteractive",
    "DEBCONF_NONINTERACTIVE_SEEN": "true",
}
DEVICES = ("null", "zero", "full", "random", "urandom", "tty")
LINKS = {"fd": "/proc/self/fd", "stdin": "fd/0", "stdout": "fd/1", "stderr": "fd/2"}
# chown and its like, mknod, and what changes users, groups or capabilities; by asm/unistd.h.
_FAKED = {
    "x86_64": (
        0xC000003E,
        (92, 93, 94, 260, 133, 259, 105, 106, 113, 114, 116, 117, 119, 122, 123, 126),
    ),
    "aarch64": (0xC00000B7, (55, 54, 33, 146, 144, 145, 143, 159, 147, 149, 151, 152, 91)),
}
# Classic BPF (linux/filter.h, linux/seccomp.h).
_LOAD, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x15, 0x06
_ALLOW, _SUCCEED = 0x7FFF0000, 0x00050000
_NUMBER, _ARCHITECTURE = 0, 4  # offsets in the data that a filter sees
_PR_SET_SECCOMP, _PR_SET_NO_NEW_PRIVS = 22, 38
_FILTER_MODE = 2
_TAIL = 2000


@dataclass(frozen=True)
class _Job:
    root: Path
    commands: Sequence[Sequence[str]]
    log: Path
    mounts: Mapping[str, Path]
    writable: Mapping[str, Path]
    environment: Mapping[str, str]


def run(
    root: Path,
    commands: Sequence[Sequence[str]],
    log: Path,
    mounts: Mapping[str, Path] | None = None,
    writable: Mapping[str, Path] | None = None,
    environment: Mapping[str, str] | None = None,
) -> None:
    """Run commands in a tree, one after the other.

    Args:
        root: of the tree.
        commands: their arguments.
        log: gets their output.
        mounts: folders of the machine to show below `/run`, read-only, by name.
        writable: the same, for folders that the commands may write to.
        environment: more variables.

    Raises:
        DesktopImageError: Namespaces are refused, or a command fails; with the end of its output.
    """
    sys.stdout.flush()
    parent = os.getpid()
    between = os.fork()
    if between == 0:
        job = _Job(
            root,
            commands,
            log,
            mounts or {},
            writable or {},
            {**ENVIRONMENT, **(environment or {})},
        )
        _enter_and_run(parent, job)
    _, status = os.waitpid(between, 0)
    if status:
        text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
        raise DesktopImageError(
            f"building the image failed; the end of {log}:\n{text[-_TAIL:].strip()}"
        )


def _enter_and_run(parent: int, job: _Job) -> NoReturn:
    try:
        kernel.die_with_parent()
        if os.getppid() != parent:
            os._exit(1)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        out = os.open(job.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        for target, source in ((0, os.open("/dev/null", os.O_RDONLY)), (1, out), (2, out)):
            os.dup2(source, target)
        os.umask(0o022)
        _unshare()
        first = os.fork()
        if first:
            os._exit(os.waitstatus_to_exitcode(os.waitpid(first, 0)[1]) & 0xFF)
        kernel.die_with_parent()
        _mount_root(job)
        fake_ownership()
        for command in job.commands:
            _run(command, job.environment)
        os._exit(0)
    except OSError as error:
        print(f"{error}{_hint()}", file=sys.stderr, flush=True)
    finally:  # whatever happened, it must not go on as a second builder
        os._exit(1)


def _hint() -> str:
    command = rootless.switched_off()
    return f"; as root: {command}" if command and os.geteuid() != 0 else ""


def _unshare() -> None:
    uid = os.geteuid()
    gid = os.getegid()
    flags = kernel.CLONE_NEWNS | kernel.CLONE_NEWPID | kernel.CLONE_NEWNET
    flags |= kernel.CLONE_NEWUTS | kernel.CLONE_NEWIPC
    if uid == 0:
        kernel.unshare(flags)
    else:
        kernel.unshare(flags | kernel.CLONE_NEWUSER)
        identity.write_map(os.getpid(), f"0 {uid} 1", f"0 {gid} 1")
    kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)


def _mount_root(job: _Job) -> None:
    root = job.root
    quiet = kernel.MS_NOSUID | kernel.MS_NODEV
    kernel.mount(str(root), str(root), flags=kernel.MS_BIND | kernel.MS_REC)
    try:
        kernel.mount("proc", str(root / "proc"), "proc", quiet | kernel.MS_NOEXEC)
    except OSError:  # in a container that covers parts of /proc
        kernel.mount("/proc", str(root / "proc"), flags=kernel.MS_BIND | kernel.MS_REC)
    for name, mode in (("dev", "755"), ("tmp", "1777"), ("run", "755")):
        kernel.mount("tmpfs", str(root / name), "tmpfs", kernel.MS_NOSUID, f"mode={mode}")
    for name in DEVICES:
        (root / "dev" / name).touch()
        kernel.mount(f"/dev/{name}", str(root / "dev" / name), flags=kernel.MS_BIND)
    for name, target in LINKS.items():
        (root / "dev" / name).symlink_to(target)
    (root / "dev/shm").mkdir()
    for name, path in {**job.mounts, **job.writable}.items():
        target = root / "run" / name
        target.mkdir()
        kernel.bind(str(path), str(target), read_only=name in job.mounts)
    os.chdir(root)
    kernel.pivot_root()
    kernel.unmount(".")
    os.chdir("/")


def fake_ownership() -> None:
    """Let system calls that change owners succeed without effect, here and in all children.

    Raises:
        OSError: The kernel has no seccomp filters, or the architecture is unknown.
    """
    machine = os.uname().machine
    if machine not in _FAKED:
        raise OSError(f"no images on {machine}: only on {' and '.join(_FAKED)}")
    architecture, numbers = _FAKED[machine]
    lines = [
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_JUMP_IF_EQUAL, 1, 0, architecture),
        (_RETURN, 0, 0, _ALLOW),
        (_LOAD, 0, 0, _NUMBER),
    ]
    for position, number in enumerate(numbers):
        lines.append((_JUMP_IF_EQUAL, len(numbers) - position, 0, number))
    lines += [(_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _SUCCEED)]
    code = b"".join(struct.pack("HBBI", *line) for line in lines)
    buffer = ctypes.create_string_buffer(code)
    program = struct.pack("HxxxxxxP", len(lines), ctypes.addressof(buffer))
    libc = ctypes.CDLL(None, use_errno=True)
    for arguments in (
        (_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0),
        (_PR_SET_SECCOMP, _FILTER_MODE, ctypes.create_string_buffer(program), 0, 0),
    ):
        if libc.prctl(*arguments):
            raise OSError(ctypes.get_errno(), "the kernel refuses a seccomp filter")


def _run(command: Sequence[str], environment: Mapping[str, str]) -> None:
    """Run one command as a child of process 1, which also reaps what it leaves.

    Raises:
        OSError: It fails.
    """
    child = os.fork()
    if child == 0:
        try:
            os.execvpe(command[0], list(command), dict(environment))
        except OSError as error:
            os.write(2, f"{command[0]} does not start: {error}\n".encode())
        finally:
            os._exit(127)
    while True:
        pid, status = os.wait()
        if pid == child:
            break
    if status:
        text = " ".join(command[:4])
        raise OSError(f"`{text}` failed with exit code {os.waitstatus_to_exitcode(status)}")
