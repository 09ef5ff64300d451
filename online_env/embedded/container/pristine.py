"""Resets the files of a container: the home and all folders of temporary files are made anew.

What root inside has changed elsewhere cannot be undone from within the container: `check` finds
such changes and refuses the reset.
"""

import os
import re
import shutil
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from ..runtime import account, session
from ..runtime.desktop_config import DesktopConfig, SetupError

FOLDER = Path("/run/desktop-server")
# Emptied at each reset.
EMPTIED = ("/tmp", "/var/tmp", "/dev/shm", "/run/lock", "/run/user", "/run/sudo", "/var/lib/sudo")
SUDO_RULE = Path("/etc/sudoers.d", account.NAME)
# Not looked at: made anew, the kernel's, or written by whoever logs in.
_PASSED = frozenset((*EMPTIED, "/proc", "/sys", "/dev", "/run", "/home", "/var/log"))
_MAX_NAMED = 3
_ESCAPED = re.compile(r"\\([0-7]{3})")  # as mountinfo writes spaces (proc(5))


def begin(order: DesktopConfig) -> int:
    """Make the folders of the first session.

    Returns:
        When the system's files were last known to be as they are in the image, in ns since 1970.
    """
    if order.osworld:
        SUDO_RULE.chmod(0o600)
        SUDO_RULE.write_text(f"{account.NAME} ALL=(ALL:ALL) NOPASSWD: ALL\n", encoding="ascii")
        SUDO_RULE.chmod(0o440)
    fill(order)
    # An overlay copies a folder, and those above it, when something in it is first written: that
    # must not look like a change later.
    for name in (*EMPTIED, "/var/log"):
        if os.path.isdir(name):
            os.utime(name)
    time.sleep(0.01)  # times of files are a little behind the clock
    return time.time_ns()


def fill(order: DesktopConfig) -> None:
    """Make the home, the folders of a session and those for temporary files as new."""
    for name in (*EMPTIED, account.HOME, str(FOLDER), session.SCREEN_FOLDER):
        _empty(Path(name))
    home = Path(account.HOME)
    shutil.copytree(f"{order.layer}/home", home, symlinks=True, dirs_exist_ok=True)
    for path in (home, *home.rglob("*")):
        os.chown(path, account.UID, account.UID, follow_symlinks=False)
    for name in ("/tmp/.X11-unix", "/tmp/.ICE-unix"):
        _folder(name, 0o1777)
    _folder(session.RUNTIME, 0o700, account.UID)
    _folder(session.SCREEN_FOLDER)
    _folder(str(FOLDER), 0o700)
    _folder(f"{FOLDER}/logs", 0o700)


def _folder(name: str, mode: int = 0o755, uid: int = 0) -> None:
    path = Path(name)
    path.mkdir(parents=True, exist_ok=True)
    path.chmod(mode)
    os.chown(path, uid, uid)


def _empty(folder: Path) -> None:
    """Remove what is in a folder; a link in its place is removed itself."""
    if folder.is_symlink():
        folder.unlink()
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def check(since: int) -> None:
    """Check that no file of the system was changed.

    Args:
        since: what `begin` returned.

    Raises:
        SetupError: Some files were changed; the message names them.
    """
    changed_paths = list(_changed_paths("/", _PASSED | mount_points(), since))
    if changed_paths:
        names = ", ".join(changed_paths[:_MAX_NAMED])
        unnamed = len(changed_paths) - _MAX_NAMED
        suffix = f" and {unnamed} more" if unnamed > 0 else ""
        raise SetupError(
            f"root inside has changed the container's system ({names}{suffix}), which no reset"
            " takes back; start a fresh container"
        )


def mount_points(mounts: Path = Path("/proc/self/mountinfo")) -> frozenset[str]:
    """Return what is mounted over the system: by the engine (`/etc/hosts`), or by the user (`-v`).

    The root itself is not among them. Numbers of devices would not do: in an overlay, files of
    one folder may have different ones.
    """
    lines = mounts.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    names = (line.split()[4] for line in lines)
    return frozenset(_ESCAPED.sub(lambda match: chr(int(match[1], 8)), name) for name in names)


def _changed_paths(folder: str, skipped: frozenset[str], since: int) -> Iterator[str]:
    with os.scandir(folder) as scan:
        entries = list(scan)
    for entry in entries:
        if entry.path in skipped:
            continue
        status = entry.stat(follow_symlinks=False)
        if status.st_ctime_ns > since:
            yield entry.path
        if stat.S_ISDIR(status.st_mode):
            yield from _changed_paths(entry.path, skipped, since)
