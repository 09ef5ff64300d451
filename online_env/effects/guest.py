"""The inside of a desktop, for effects.

Only `Desktop.execute` is needed, so any OSWorld-like guest will do.

Probes must not run in a Python that the agent can change. Our own guest server runs them in its own
process (`Desktop.tool`); on other guests the system's Python does, isolated from the user's home,
packages and variables.
"""

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any, cast

from hijack_data.rng import Stream

from ..desktops.protocol import Desktop, RunResult
from ..embedded.guest import inside
from ..errors import DesktopError, MissingCapabilityError

TOOL_TIMEOUT_S = 60.0
# Not the session's PATH, in which a folder of the user may come first.
SYSTEM_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
# Only the variables for the display are kept, and the working directory is /. Old releases of
# python-xlib fail where the file that XAUTHORITY names does not exist, though none may be needed.
_ISOLATED = (
    'auth=${XAUTHORITY:-$HOME/.Xauthority}; [ -r "$auth" ] || auth=/dev/null; '
    'cd / && exec /usr/bin/env -i PATH="$1" LC_ALL=C.UTF-8 HOME="$HOME" DISPLAY="$DISPLAY" '
    'XAUTHORITY="$auth" /usr/bin/python3 -I -c "$2" "$3" "$4"'
)
# On some guests python-xlib is in the user's home; it comes last, so that nothing there shadows the
# system's modules.
_PRELUDE = "import site, sys\nsys.path.append(site.getusersitepackages())\n"
ROOT_TIMEOUT_S = 60.0
EXIT_NOT_FOUND = 127  # the exit code of a shell for a missing program


class Guest:
    """A desktop, with everything that effects need.

    Args:
        desktop: the desktop.
        password: the password of its user.
        stream: the source of an effect's random draws.
    """

    def __init__(self, desktop: Desktop, password: str, stream: Stream | None) -> None:
        self.desktop = desktop
        self.password = password
        self.stream = stream

    def x(self, operation: str, timeout: float = 0.0, **fields: Any) -> dict[str, Any]:
        """Run an operation on windows or pointer (`inside/xtool.py`).

        It waits for the result for at most `timeout` seconds.
        """
        fields |= {"timeout": timeout} if timeout else {}
        return self._tool("xtool", operation, fields, TOOL_TIMEOUT_S + timeout)

    def keys(self, operation: str, **fields: Any) -> dict[str, Any]:
        """Type, or ask who holds the keyboard and the top of the screen (`inside/locktool.py`)."""
        return self._tool("locktool", operation, fields, TOOL_TIMEOUT_S)

    def net(self, operation: str, timeout: float = 0.0, **fields: Any) -> dict[str, Any]:
        """Examine the network (`inside/nettool.py`)."""
        fields |= {"timeout": timeout} if timeout else {}
        return self._tool("nettool", operation, fields, TOOL_TIMEOUT_S + timeout)

    def shell(self, script: str, *words: str, timeout: float = TOOL_TIMEOUT_S) -> RunResult:
        """Run a shell script as the desktop's user; `words` are its `$1`, `$2` ...

        Raises:
            DesktopError: It did not start or did not end: what it would have said is not known.
        """
        result = self.desktop.execute(["sh", "-c", script, "sh", *words], timeout)
        if result.status != "success":
            raise DesktopError(
                f"a shell script did not run in the guest: {result.error.strip()[-300:]}"
            )
        return result

    def pyautogui(self, code: str) -> None:
        """Run pyautogui code that must succeed.

        It runs in the user's Python, so probes must not depend on it.

        Raises:
            DesktopError: the code fails.
        """
        result = self.desktop.run(code)
        if not result.ok:
            raise DesktopError(
                f"pyautogui failed in the guest: {(result.error or result.output).strip()[-300:]}"
            )

    def installed(self, *commands: str) -> set[str]:
        """Return those of `commands` that the guest has."""
        script = 'for c; do command -v "$c" >/dev/null 2>&1 && echo "$c"; done; true'
        return set(self.shell(script, *commands).output.split())

    @property
    def network_is_ours(self) -> bool:
        """Whether this machine controls the guest's network, out of reach even for root inside."""
        if getattr(self.desktop, "network_root", None) is not None:
            return True
        return isinstance(getattr(self.desktop, "namespace", None), Path)

    def root(self, script: str) -> RunResult:
        """Run a shell script with root's rights over the guest's network.

        Usually it runs through sudo inside the guest. Root inside an embedded desktop has no such
        rights, so that an agent that knows the password has none either: for these, the script runs
        on this machine, in the desktop's network namespace.
        """
        ask = getattr(self.desktop, "network_root", None)
        if ask is not None:
            return cast("RunResult", ask(script))
        namespace = getattr(self.desktop, "namespace", None)
        if isinstance(namespace, Path):
            return _in_namespace(namespace, script)
        wrapped = 'printf "%s\\n" "$1" | sudo -S -p "" -- sh -c "$2"'
        return self.shell(
            wrapped, self.password, f"PATH=$PATH:/usr/sbin:/sbin; {script}", timeout=ROOT_TIMEOUT_S
        )

    def _tool(
        self, name: str, operation: str, fields: dict[str, Any], timeout: float
    ) -> dict[str, Any]:
        ask = getattr(self.desktop, "tool", None)
        if ask is not None and getattr(self.desktop, "is_ours", True):
            return cast("dict[str, Any]", ask(name, operation, fields, timeout))
        result = self.desktop.execute(
            isolated(_source(name), operation, json.dumps(fields)), timeout
        )
        if result.ok:
            try:
                # python-xlib may print warnings before it
                return cast("dict[str, Any]", json.loads(result.output.splitlines()[-1]))
            except (ValueError, IndexError):
                raise DesktopError(
                    f"{name} {operation} printed {result.output!r:.200} in the guest, not JSON"
                ) from None
        if "No module named 'Xlib'" in result.error:
            raise MissingCapabilityError(
                "the guest's python3 lacks python-xlib, which windows and pointer need; "
                "install it there: apt-get install python3-xlib"
            )
        if "python3" in result.error and result.returncode in (None, EXIT_NOT_FOUND):
            raise MissingCapabilityError(f"the guest has no python3: {result.error.strip()[-200:]}")
        raise DesktopError(f"{name} {operation} failed in the guest: {result.error.strip()[-400:]}")


def isolated(source: str, operation: str, data: str) -> list[str]:
    """Return the command that runs a tool in the system's Python, apart from the user's files."""
    return ["/bin/sh", "-c", _ISOLATED, "sh", SYSTEM_PATH, f"{_PRELUDE}{source}", operation, data]


def _source(name: str) -> str:
    return inside.source(name)


def _in_namespace(namespace: Path, script: str) -> RunResult:
    if not namespace.exists():
        raise DesktopError(
            f"the desktop's network namespace {namespace} is gone, and the desktop with it"
        )
    path = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"
    program = shutil.which("nsenter", path=path)
    if program is None or os.geteuid() != 0:
        lacking = (
            "root's rights on this machine" if program else "nsenter (apt-get install util-linux)"
        )
        raise MissingCapabilityError(f"changing the network of an embedded desktop needs {lacking}")
    argv = [program, f"--net={namespace}", "sh", "-c", script]
    try:
        result = subprocess.run(
            argv,
            capture_output=True,
            text=True,
            timeout=ROOT_TIMEOUT_S,
            check=False,
            env={**os.environ, "PATH": path, "LC_ALL": "C"},
        )
    except subprocess.TimeoutExpired:
        raise DesktopError(
            f"`{shlex.join(argv)[:200]}` did not end within {ROOT_TIMEOUT_S:g} s"
        ) from None
    return RunResult("success", result.stdout, result.stderr, result.returncode)
