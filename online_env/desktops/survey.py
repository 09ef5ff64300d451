"""The capabilities of a guest, found by asking it: for desktops that have no list of their own."""

import shlex
import time
from collections.abc import Callable, Iterable, Sequence

from ..errors import DesktopTimeoutError
from .lockers import LOCKERS
from .protocol import Capability, Desktop, RunResult

TIMEOUT = 20.0
HANGS = 124  # what `timeout` returns for a command that it ended
# Root's rights are not enough: what root may do inside a container or an embedded desktop does not
# hold the firewall.
_FIREWALL = """
try='PATH=$PATH:/usr/sbin:/sbin; nft list tables || iptables -w -S'
if [ "$(id -u)" = 0 ]; then sh -c "$try"
elif [ -n "$1" ]; then printf '%s\\n' "$1" | sudo -S -k -p '' sh -c "$try"
else sudo -n sh -c "$try"; fi >/dev/null 2>&1 && echo firewall
"""
# As effects run it: apart from the user's Python, with the packages of the home behind the
# system's.
_XLIB = "import site, sys; sys.path.append(site.getusersitepackages()); import Xlib"
_WINDOWS = (
    f"command -v wmctrl >/dev/null 2>&1 && (cd / && /usr/bin/python3 -I -c {shlex.quote(_XLIB)}) "
    "2>/dev/null && echo windows\n"
)
# A locker that is installed and does not run says neither; one of a session that has just begun
# says it soon.
_LOCK = "\n".join(
    f"command -v {one.name} >/dev/null 2>&1 && for i in {'1 2 3 4 5 6' if one.window else '1'}; do "
    f"said=$(timeout 3 {one.query} 2>/dev/null); [ $? = {HANGS} ] && break; case $said in "
    f"*{shlex.quote(one.on)}*|*{shlex.quote(one.off)}*) echo lock; break;; esac; sleep 0.3; done"
    for one in LOCKERS
)
_SCRIPT = f"export LC_ALL=C\n{_LOCK}\n{_WINDOWS}{_FIREWALL}true\n"


# What a container has to be started with for a capability that Docker and Podman leave out.
FLAGS: dict[Capability, str] = {"firewall": "--cap-add NET_ADMIN"}
_MARKS = ("/.dockerenv", "/run/.containerenv")


def survey(
    execute: Callable[[Sequence[str] | str, float], RunResult], password: str | None
) -> frozenset[Capability]:
    """Those of `lock`, `windows` and `firewall` that the guest behind `execute` has.

    `password` is that of its user, for sudo; without one only a sudo that does not ask is tried.
    Changes nothing.

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
    found = set(result.output.split())
    names: tuple[Capability, ...] = ("lock", "windows", "firewall")
    return frozenset(name for name in names if name in found)


def is_container(execute: Callable[[Sequence[str] | str, float], RunResult]) -> bool:
    """Whether the guest behind `execute` is a container of Docker's or Podman's."""
    first, second = _MARKS
    return execute(["test", "-e", first, "-o", "-e", second], TIMEOUT).ok


def lacks(desktop: Desktop, missing: Iterable[Capability]) -> str:
    """Return how an error says that a desktop lacks `missing`, with the way out if it is known.

    A container can be started with more rights.
    """
    there = ", ".join(sorted(desktop.capabilities)) or "nothing"
    text = f"which this desktop lacks (available: {there})"
    flags = [FLAGS[name] for name in missing if name in FLAGS]
    if flags and getattr(desktop, "is_container", False):
        text += f"; start its container with {' '.join(flags)}"
    return text
