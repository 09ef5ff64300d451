"""Desktops without root: the keeper enters a user namespace in which it is root.

Inside, the kernel lets it make namespaces, mounts and cables, but it has one user number only, its
caller's. So the desktop's user is the caller, too (in a second user namespace, without rights over
the first: identity.py), and what asks for another user fails: sudo.
"""

import os
from pathlib import Path

from ...privilege import as_root
from . import identity, kernel
from .desktop_config import SetupError

LACKING = (
    "no sudo, OSWorld mode, or limits for a desktop as a whole "
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
    """Return what lets namespaces be made where the kernel refused them, in one line.

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
            " --security-opt systempaths=unconfined; or make the container the desktop: hijack"
            " desktop image container"
        )
    return "give this process CAP_SYS_ADMIN" if is_root else as_root("desktop", "...")


def in_container() -> bool:
    """Return whether this process runs in a container of Docker, Podman or Kubernetes."""
    if any(Path(path).exists() for path in ("/.dockerenv", "/run/.containerenv")):
        return True
    return "KUBERNETES_SERVICE_HOST" in os.environ


def check_rights() -> None:
    """Check that root has the rights that a desktop needs, as it has not in most containers.

    Raises:
        SetupError: It has not; with the way out.
    """
    child = os.fork()
    if child == 0:
        try:
            kernel.unshare(kernel.CLONE_NEWNS)
            kernel.mount("none", "/", flags=kernel.MS_REC | kernel.MS_PRIVATE)
            os._exit(0)
        except OSError as error:
            os._exit(error.errno or 1)
        finally:
            os._exit(1)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code:
        reason = f"root may make no namespaces and mounts here: {os.strerror(code)}"
        raise SetupError(f"{reason}; {way_out(reason)}")


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
        raise SetupError(
            f"no user namespace for a desktop without root: {error}; {way_out(str(error))}"
        ) from None
