"""The network of one desktop: two namespaces and a cable (veth).

    ah-<id>  eth0 10.77.0.2/24 --- web0 10.77.0.1/24  ah-<id>.web

There is no way to the machine or the real network. Over `eth0` the desktop reaches its local
internet. Neither namespace has an address or an interface of the machine's: requests for the guest
server come over a socket in the file system (forward.py). Both belong to the machine's user
namespace, or without root to the keeper's: root inside has no rights over them, so it can neither
change them nor send frames of its own making.
"""

import contextlib
import subprocess
from pathlib import Path

from . import kernel, program_paths
from .desktop_config import SetupError

NETNS = Path("/run/netns")
WEB_ADDRESS = "10.77.0.1"
DESKTOP_ADDRESS = "10.77.0.2"
_WEB = ".web"
# For who enters the desktop's network: servers on low ports need no rights, nor does `ping`.
_SETTINGS = {"ip_unprivileged_port_start": "0", "ping_group_range": "0 4294967294"}


def desktop_namespace(name: str) -> str:
    """Return the network namespace that the desktop's processes live in."""
    return f"ah-{name}"


def web_namespace(name: str) -> str:
    """Return the network namespace that its local internet lives in.

    No desktop's name has a dot, so it is never that of another desktop.
    """
    return f"ah-{name}{_WEB}"


def address(slot: int) -> str:
    """Return an address of the machine's loopback interface for the desktop in `slot`."""
    return f"127.199.{slot // 256}.{slot % 256}"


def create(name: str, system: str = "/") -> None:
    """Make the namespaces and the cable; raises `SetupError` with what `ip` said.

    Args:
        name: of the desktop.
        system: the root of the system whose `ip` is taken where the machine has none.
    """
    desktop = desktop_namespace(name)
    web = web_namespace(name)
    ip = program_paths.command("ip", system)
    _batch(ip, [f"netns add {desktop}", f"netns add {web}"])
    _batch(
        ip,
        [
            "link set lo up",
            f"link add eth0 type veth peer name web0 netns {web}",
            f"addr add {DESKTOP_ADDRESS}/24 dev eth0",
            "link set eth0 up",
            f"route add default via {WEB_ADDRESS}",
        ],
        desktop,
    )
    _batch(
        ip,
        [
            "link set lo up",
            f"addr add {WEB_ADDRESS}/24 dev web0",
            "link set web0 up",
            "route add unreachable default",
        ],
        web,
    )


def enter(name: str) -> None:
    """Enter the desktop's network for good, and set there what programs inside expect."""
    _enter(desktop_namespace(name))
    for setting, value in _SETTINGS.items():
        with contextlib.suppress(OSError):  # without root there is but one group
            Path("/proc/sys/net/ipv4", setting).write_text(value, encoding="ascii")


def remove(name: str) -> None:
    """Remove what `create` made, as far as it is there."""
    for namespace in (desktop_namespace(name), web_namespace(name)):
        path = NETNS / namespace
        # A name that a killed `ip` left is no mount; another user's is not ours to remove.
        with contextlib.suppress(OSError):
            kernel.unmount(str(path))
        with contextlib.suppress(OSError):
            path.unlink()


def leftovers(ids: set[str]) -> list[str]:
    """Desktops (by name) that have a network namespace but are not in `ids`."""
    with contextlib.suppress(FileNotFoundError):
        names = {
            p.name.removeprefix("ah-").removesuffix(_WEB)
            for p in NETNS.iterdir()
            if p.name.startswith("ah-")
        }
        return sorted(names - ids)
    return []


def _batch(ip: list[str], lines: list[str], namespace: str | None = None) -> None:
    argv = [*ip, *(["-n", namespace] if namespace else []), "-batch", "-"]
    text = "".join(f"{line}\n" for line in lines)
    try:
        process = subprocess.run(
            argv, input=text, capture_output=True, text=True, timeout=20, check=False
        )
    except subprocess.TimeoutExpired:
        raise SetupError(f"`{' '.join(argv)}` did not end within 20 s") from None
    if process.returncode != 0:
        raise SetupError(
            f"`{' '.join(argv)}` failed ({process.returncode}): {process.stderr.strip() or text}"
        )


def _enter(namespace: str) -> None:
    kernel.join_namespace(str(NETNS / namespace), kernel.CLONE_NEWNET)
