"""A desktop that is a folder of this machine: files and commands, and no screen.

Preparing a task and judging its result need no more, so tasks are checked without a desktop.
"""

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from hijack_data.types import Size, UInt8Array

from ..desktops.protocol import Capability, RunResult, TaskConfig
from ..errors import DesktopError, GuestError

_NOT_HERE = ("pkill", "kill", "killall")  # they would reach the programs of this machine


class FolderDesktop:
    """Files and commands in a folder.

    Args:
        home: The folder that is the user's home; it must exist. Only tests and checks of tasks
            use this: commands run as the user of this process, and nothing keeps them in it.
    """

    capabilities: frozenset[Capability] = frozenset({"files"})
    size: Size = (1080, 1920)

    def __init__(self, home: Path) -> None:
        self._home = home

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command in the folder; a string goes to the shell."""
        if any(word in argv for word in _NOT_HERE):
            return RunResult("success", returncode=1)
        done = subprocess.run(
            argv,
            shell=isinstance(argv, str),
            cwd=self._home,
            env={**os.environ, "HOME": str(self._home)},
            capture_output=True,
            timeout=timeout,
        )
        output = done.stdout.decode("utf-8", "replace")
        error = done.stderr.decode("utf-8", "replace")
        return RunResult("success", output, error, done.returncode)

    def read_file(self, path: str) -> bytes:
        """Return the content of a file.

        Raises:
            GuestError: There is none.
        """
        try:
            return Path(path).read_bytes()
        except FileNotFoundError:
            raise GuestError(f"{path}: no such file", 404) from None

    def write_file(self, path: str, data: bytes) -> None:
        """Write a file.

        Raises:
            GuestError: Its folder does not exist.
        """
        try:
            Path(path).write_bytes(data)
        except FileNotFoundError:
            raise GuestError(f"{path}: its folder does not exist", 404) from None

    def reset(self, task: TaskConfig | None = None) -> None:
        """Refuse.

        Raises:
            DesktopError: Always.
        """
        raise _no_screen("reset")

    def screenshot(self) -> UInt8Array:
        """Refuse.

        Raises:
            DesktopError: Always.
        """
        raise _no_screen("screenshot")

    def accessibility(self) -> str:
        """Refuse.

        Raises:
            DesktopError: Always.
        """
        raise _no_screen("accessibility")

    def run(self, code: str) -> RunResult:
        """Refuse.

        Raises:
            DesktopError: Always.
        """
        raise _no_screen("run")

    def close(self) -> None:
        """Nothing: the folder stays."""


def _no_screen(what: str) -> DesktopError:
    return DesktopError(f"a folder has no screen, so it has no {what}; use a real desktop")
