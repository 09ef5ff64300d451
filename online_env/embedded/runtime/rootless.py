"""Desktops without root: the keeper enters a user namespace in which it is root.

Inside, the kernel lets it make namespaces, mounts and cables, but it has one user number only, its
caller's. So the desktop's user is the caller, too (in a second user namespace, without rights over
the first: identity.py), and what asks for another user fails: sudo, and the password of a locked
screen.
"""

import os
from pathlib import Path

from ...privilege import as_root
from . import identity, kernel
from .plain import SetupError

LACKING = (
    "no sudo, lock screen, firewall, OSWorld mode, or limits for a desktop as a whole "
    f"({as_root('desktop', '...')} has them)"
)
_SWITCHES = {
    "/proc/sys/kernel/unprivileged_userns_clone": (
        "0",
        "sysctl kernel.unprivileged_userns_clone=1",
    ),
    "/proc/sys/kernel/apparmor_restrict_unprivileged_userns": (
        "1",
        "sysctl kernel.apparmor_restrict_unprivileged_userns=0",
    ),
    "/proc/sys/user/max_user_namespaces": ("0", "sysctl user.max_user_namespaces=10000"),
}


def switched_off() -> str:
    """The command (for root) that allows user namespaces here; empty where nothing forbids them."""
    for path, (value, command) in _SWITCHES.items():
        try:
            if Path(path).read_text(encoding="ascii").strip() == value:
                return command
        except OSError:
            continue
    return ""


def way_out(reason: str) -> str:
    """What lets namespaces be made where the kernel refused them, in one line.

    Args:
        reason: the kernel's refusal, as `kernel` words it.
    """
    is_root = os.geteuid() == 0
    switch = "" if is_root else switched_off()
    if switch:
        return f"sudo {switch}"
    if "mount overlay" in reason and not is_root:
        return f"use Linux 5.11 or newer, or run it as root: {as_root('desktop', '...')}"
    if "No space left" in reason:
        return "sudo sysctl user.max_user_namespaces=10000 user.max_net_namespaces=10000"
    if in_container():
        return (
            "start the container with: docker run --privileged ..., or as a user inside with"
            " --security-opt seccomp=unconfined --security-opt apparmor=unconfined"
            " --security-opt systempaths=unconfined"
        )
    return "give this process CAP_SYS_ADMIN" if is_root else as_root("desktop", "...")


def in_container() -> bool:
    """Whether this process runs in a container of Docker, Podman or Kubernetes."""
    if any(Path(path).exists() for path in ("/.dockerenv", "/run/.containerenv")):
        return True
    return "KUBERNETES_SERVICE_HOST" in os.environ


def enter() -> None:
    """Make this process root of a new user namespace with its own network and mounts.

    Raises:
        SetupError: The kernel refuses it.
    """
    uid = os.geteuid()
    gid = os.getegid()
    try:
        kernel.unshare(kernel.CLONE_NEWUSER | kernel.CLONE_NEWNS | kernel.CLONE_NEWNET)
        identity.write_map(os.getpid(), f"0 {uid} 1", f"0 {gid} 1")
        kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)
        # Where `ip netns` keeps its names.
        kernel.mount("tmpfs", "/run", "tmpfs", 0, "size=64k,mode=755")
    except OSError as error:
        hint = switched_off()
        fix = f"as root: {hint}" if hint else "run it as root, or see `hijack desktop doctor`"
        raise SetupError(f"no user namespace for a desktop without root: {error}; {fix}") from None
