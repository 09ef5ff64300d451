"""Detect the capabilities of a guest, for desktops that do not list them."""

import shlex
import time
from collections.abc import Callable, Iterable, Sequence

from ..errors import DesktopTimeoutError
from .lockers import LOCKERS, REMEDY, SESSION_BUS
from .protocol import Capability, Desktop, RunResult

TIMEOUT = 20.0
HANGS = 124  # what `timeout` returns for a command that it ended
# Root's rights do not suffice: root inside a container or an embedded desktop may not be able to
# set firewall rules.
_FIREWALL = """
try='PATH=$PATH:/usr/sbin:/sbin; nft list tables || iptables -w -S'
if [ "$(id -u)" = 0 ]; then sh -c "$try"
elif [ -n "$1" ]; then printf '%s\\n' "$1" | sudo -S -k -p '' sh -c "$try"
else sudo -n sh -c "$try"; fi >/dev/null 2>&1 && echo firewall
"""
# In the same way as effects: apart from the user's Python, with the packages of the home after the
# system's.
_XLIB = "import site, sys; sys.path.append(site.getusersitepackages()); import Xlib"
_WINDOWS = (
    f"wmctrl -m >/dev/null 2>&1 && (cd / && /usr/bin/python3 -I -c {shlex.quote(_XLIB)}) "
    '2>/dev/null && ! pgrep -x -u "$(id -u)" Xwayland >/dev/null && echo windows\n'
)
# A locker that is installed but not running reports neither state; in a new session it does so
# after a moment.
_LOCK = "\n".join(
    f"command -v {locker.name} >/dev/null 2>&1 && {locker.able} && "
    f"for i in {'1 2 3 4 5 6' if locker.window else '1'}; do "
    f"said=$(timeout 3 {locker.query} 2>/dev/null); [ $? = {HANGS} ] && break; case $said in "
    f"*{shlex.quote(locker.on)}*|*{shlex.quote(locker.off)}*) echo lock; break;; "
    "esac; sleep 0.3; done"
    for locker in LOCKERS
)
_SCRIPT = f"export LC_ALL=C\n{SESSION_BUS}\n{_LOCK}\n{_WINDOWS}{_FIREWALL}true\n"


# The options with which to start a container for capabilities that Docker and Podman omit by
# default.
FLAGS: dict[Capability, str] = {"firewall": "--cap-add NET_ADMIN"}
REMEDIES: dict[Capability, str] = {
    "firewall": "sudo must take the password that the desktop was given, and nft or iptables must"
    " be installed there (apt-get install iptables)",
    "lock": REMEDY,
    "windows": "a window manager must run on X11, not Wayland, with wmctrl and python3-xlib"
    " (apt-get install wmctrl python3-xlib)",
    "accessibility": "its environment must offer get_accessibility_tree",
}
_MARKS = ("/.dockerenv", "/run/.containerenv")


def survey(
    execute: Callable[[Sequence[str] | str, float], RunResult], password: str | None
) -> frozenset[Capability]:
    """Return those of `lock`, `windows` and `firewall` that the guest behind `execute` has.

    `password` is that of its user, for sudo; without it only a sudo without password is tried.
    Nothing in the guest is changed.

    Raises:
        DesktopTimeoutError: The guest is too busy to tell; that is no proof that it lacks them.
    """
    start = time.monotonic()
    result = execute(["sh", "-c", _SCRIPT, "sh", password or ""], TIMEOUT)
    if not result.ok and time.monotonic() - start >= TIMEOUT:
        raise DesktopTimeoutError(
            f"the guest did not tell within {TIMEOUT:g} s which of lock, windows and firewall it"
            " has; it is too busy, try again"
        )
    flags = set(result.output.split())
    names: tuple[Capability, ...] = ("lock", "windows", "firewall")
    return frozenset(name for name in names if name in flags)


def is_container(execute: Callable[[Sequence[str] | str, float], RunResult]) -> bool:
    """Return whether the guest behind `execute` is a Docker or Podman container."""
    first, second = _MARKS
    return execute(["test", "-e", first, "-o", "-e", second], TIMEOUT).ok


def lacks(desktop: Desktop, missing: Iterable[Capability]) -> str:
    """Return the text of an error for a desktop that lacks `missing`, with the remedy if known.

    For example, a container can be started with more rights.
    """
    capabilities = ", ".join(sorted(desktop.capabilities)) or "nothing"
    text = f"which this desktop lacks (available: {capabilities})"
    names = list(missing)
    remedies = [f"for {name}, {REMEDIES[name]}" for name in names if name in REMEDIES]
    flags = [FLAGS[name] for name in names if name in FLAGS]
    if flags and getattr(desktop, "is_container", False):
        remedies.append(f"start its container with {' '.join(flags)}")
    return "; ".join([text, *remedies])
