"""Commands that run as root, through sudo; they work as printed."""

import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path


def as_root(*words: str) -> str:
    """Return the command line of `hijack WORDS` as root.

    It gives the program's path: sudo looks for programs in its own folders, not in those of a
    virtual environment.
    """
    script = Path(sys.executable).with_name("hijack")
    program = [str(script)]
    if not script.exists():
        program = [sys.executable, "-m", "hijack_data"]
    return shlex.join(["sudo", *program, *words])


def through_sudo(argv: Sequence[str], **environment: str) -> list[str] | None:
    """Return `argv` through sudo, which asks for a password itself; `None` without sudo."""
    sudo = shutil.which("sudo")
    if sudo is None:
        return None
    variables = [f"{name}={value}" for name, value in environment.items()]
    return [sudo, "env", *variables, *argv]
