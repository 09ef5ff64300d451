"""Locks between processes, on a file or on a folder.

They use `flock`: the kernel releases a lock when its holder ends, however that happens. A fork of
the holder does not hold it: `os.fork` closes the descriptor there, which would keep the lock for as
long as the fork lives. The package `filelock` does not lock folders, waits by polling, and falls
back to marker files, which outlive a process that is killed.
"""

import json
import os
import platform
import socket
import weakref
from pathlib import Path
from types import TracebackType
from typing import Any

from .errors import HijackError

try:
    import fcntl
except ModuleNotFoundError:  # Windows: pictures and transforms work, and lock nothing
    fcntl = None

_LONGEST_NOTE = 1000  # bytes


class LockedError(HijackError):
    """A file or folder that another process, or another part of this process, has locked.

    `holder` describes it in words: "process 12 on host", or "another process".
    """

    def __init__(self, path: Path, holder: str) -> None:
        self.holder = holder
        super().__init__(f"{path}: is locked by {holder}; wait for it")


class Lock:
    """A lock that is held until `release`, or until its process ends; use it in a `with` block."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor: int | None = descriptor
        _held_locks.add(self)

    def release(self) -> None:
        """Release the lock; calling it again does nothing."""
        descriptor = self._descriptor
        self._descriptor = None
        if descriptor is not None:
            os.close(descriptor)

    def sign(self) -> None:
        """Write this process into the locked file, so that others can name the holder.

        Raises:
            OSError: The file cannot be written.
        """
        if self._descriptor is None:
            return
        note = json.dumps({"pid": os.getpid(), "host": socket.gethostname()})
        os.ftruncate(self._descriptor, 0)
        os.pwrite(self._descriptor, note.encode(), 0)

    def __enter__(self) -> "Lock":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def __del__(self) -> None:
        self.release()


_held_locks: "weakref.WeakSet[Lock]" = weakref.WeakSet()


def _forget_held() -> None:
    for descriptor in list(_held_locks):
        descriptor.release()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_held)


def lock(path: Path, *, wait: bool = False, mode: int = 0o644) -> Lock:
    """Lock a file, which is created if it is missing, or an existing folder.

    Two calls exclude each other within one process as well.

    Args:
        path: The file or folder. Its content stays as it is.
        wait: Wait for the holder instead of raising `LockedError`.
        mode: Permissions of a file that is created, before the process's umask is applied.

    Returns:
        The lock; keep a reference, since it is released with its last one.

    Raises:
        LockedError: The lock is held elsewhere, and `wait` is false.
        OSError: The file or folder cannot be opened.
        HijackError: This system has no such locks.
    """
    if fcntl is None:
        raise HijackError(
            f"{path}: {platform.system()} has no locks that end with their process, without which"
            " nothing is written to a folder that others may use; use Linux, macOS or WSL"
        )
    flags = os.O_CLOEXEC | os.O_NOFOLLOW
    if path.is_dir():
        flags |= os.O_RDONLY | os.O_DIRECTORY
    else:
        flags |= os.O_RDWR | os.O_CREAT
    descriptor = os.open(path, flags, mode)
    file_lock = Lock(descriptor)
    operation = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
    try:
        fcntl.flock(descriptor, operation)
    except BlockingIOError:
        holder = _holder(descriptor)
        file_lock.release()
        raise LockedError(path, holder) from None
    except BaseException:
        file_lock.release()
        raise
    return file_lock


def _holder(descriptor: int) -> str:
    """Return the holder named in the file; a new holder may not have written its name yet."""
    try:
        note: Any = json.loads(os.pread(descriptor, _LONGEST_NOTE, 0))
        return f"process {note['pid']} on {note['host']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
