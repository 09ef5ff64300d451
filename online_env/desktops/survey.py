"""What a guest can do, found by asking it: for desktops that do not know it by themselves."""

from collections.abc import Callable, Sequence

from .protocol import Capability, RunResult

LOCKERS = ("mate-screensaver-command", "gnome-screensaver-command", "xflock4")
TIMEOUT = 15.0
# Root's rights are not enough: what root may do inside a container or an embedded desktop does not hold the firewall.
_SCRIPT = """
for p in {lockers}; do command -v $p >/dev/null 2>&1 && echo lock; done
command -v wmctrl >/dev/null 2>&1 && python3 -c 'import Xlib' 2>/dev/null && echo windows
try='PATH=$PATH:/usr/sbin:/sbin; nft list tables || iptables -w -S'
if [ "$(id -u)" = 0 ]; then sh -c "$try"
elif [ -n "$1" ]; then printf '%s\\n' "$1" | sudo -S -k -p '' sh -c "$try"
else sudo -n sh -c "$try"; fi >/dev/null 2>&1 && echo firewall
true
""".format(lockers=" ".join(LOCKERS))


def survey(execute: Callable[[Sequence[str] | str, float], RunResult], password: str | None) -> frozenset[Capability]:
    """Those of `lock`, `windows` and `firewall` that the guest behind `execute` has.

    `password` is that of its user, for sudo; without one only a sudo that does not ask is tried. Changes nothing.
    """
    found = set(execute(["sh", "-c", _SCRIPT, "sh", password or ""], TIMEOUT).output.split())
    names: tuple[Capability, ...] = ("lock", "windows", "firewall")
    return frozenset(name for name in names if name in found)
